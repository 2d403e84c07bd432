// The way back between two nodes, where something comes in or a knot lies: in pieces, as Exponential::advance went.
#include <algorithm>

#include "../../simulation/instant.hpp"
#include "adjoint.hpp"
#include "terms.hpp"

namespace dualdrive::exponential {

namespace {

// Transposed: c over a piece that begins `units` later and is `ratio` times as long.
void add_moved(const double* moved, std::size_t m, double units, double ratio, double* c) {
    double scale = 1.0;
    for (std::size_t k = 0; k < terms; ++k, scale *= ratio) {
        double power = scale;
        for (std::size_t j = k; j < terms; ++j, power *= units)
            for (std::size_t r = 0; r < m; ++r) c[j * m + r] += power * inverse_factorial[j - k] * moved[k * m + r];
    }
}

}  // namespace

// What comes in between nodes, back to the node before it: interval by interval, all of it in one walk.
void Adjoint::arrivals_back() {
    for (std::size_t last = arrivals_.size(); last > 0;) {
        const std::size_t node = arrivals_[last - 1].node;
        pieces_.clear();
        double from = node_time(node);
        Vector y(column(node), column(node) + propagators_->rows());
        for (; last > 0 && arrivals_[last - 1].node == node; --last) {
            from = find_pieces(node, y, from, arrivals_[last - 1].t);
            pieces_.back().arrivals.push_back(&arrivals_[last - 1]);
        }
        std::fill(part_.begin(), part_.end(), 0.0);
        pieces_back(true, part_.data());
        for (std::size_t i = 0; i < tall_; ++i) within_[node * tall_ + i] += part_[i];
    }
}

void Adjoint::interval_back(std::size_t node, const double* lambda, bool keep, double* owed) {
    if (!knotted_[node]) return gradient_->back(step_->level, lambda, owed);
    pieces_.clear();
    Vector y(column(node), column(node) + propagators_->rows());
    find_pieces(node, y, node_time(node), node_time(node + 1));
    std::fill_n(owed, tall_, 0.0);
    std::copy_n(lambda, lambda_rows_, owed);
    pieces_back(keep, owed);
}

// From the end of the last piece to the begin of the first, as Exponential::advance went, the other way round. `owed`: what
// y is owed there, then at the node, and c with it.
void Adjoint::pieces_back(bool keep, double* owed) {
    const auto c = static_cast<std::size_t>(gradient_->owed_to_rest());
    moved_.resize(tall_);
    for (std::size_t k = pieces_.size(); k-- > 0;) {
        const Piece& p = pieces_[k];
        for (const Arrival* a : p.arrivals)
            for (int i = 0; i < lambda_rows_; ++i) owed[i] += a->lambda[static_cast<std::size_t>(i)];
        if (p.series) {
            gradient_->series_back(p.length, p.yc.data(), owed, keep, moved_.data());
        } else {
            gradient_->back(p.level, owed, moved_.data());
            if (keep) gradient_->keep(p.level, 1, p.yc.data(), owed);
        }
        std::copy_n(moved_.begin(), lambda_rows_, owed);
        add_moved(moved_.data() + c, propagators_->driven().size(), p.begin, p.length / step_->delta, owed + c);
    }
}

bool Adjoint::knotted(std::size_t node) const {
    const auto& knots = setup_.generator.knots();
    const double from = node_time(node), to = node_time(node + 1);
    const auto next = std::upper_bound(knots.begin(), knots.end(), from + instant(from));
    return next != knots.end() && *next <= to + instant(to);
}

// From y on, which is taken along; returns `to`.
double Adjoint::find_pieces(std::size_t node, Vector& y, double from, double to) {
    const auto& knots = setup_.generator.knots();
    for (auto knot = std::upper_bound(knots.begin(), knots.end(), from + instant(from));
         knot != knots.end() && *knot <= to + instant(to); ++knot) {
        find_pieces_between_knots(node, y, from, *knot);
        setup_.generator.set(*knot, step_->cell, y.data() + states_);
        from = *knot;
    }
    find_pieces_between_knots(node, y, from, to);
    return to;
}

void Adjoint::find_pieces_between_knots(std::size_t node, Vector& y, double from, double to) {
    const double little = rounding_of(to);
    const std::size_t m = propagators_->driven().size(), rows = y.size();
    const double* const c = column(node) + rows;
    const auto begin = [&](int level, double length, bool series) -> Piece& {
        const double units = (from - node_time(node)) / step_->delta;
        Piece& p = pieces_.emplace_back(Piece{level, length, units, series, y, {}});
        p.yc.insert(p.yc.end(), c, c + terms * m);
        shift(p.yc.data() + rows, m, units);
        rescale(p.yc.data() + rows, m, length / step_->delta);
        return p;
    };
    const double unit = propagators_->unit();
    for (int level = step_->level; level >= propagators_->finest() && to - from > little; --level) {
        const double part = std::ldexp(unit, level);
        if (to - from < part - little) continue;
        const Piece& p = begin(level, part, false);
        exact::kernels().multiply(propagators_->rows(), propagators_->width(), propagators_->step(level),
                                  propagators_->width(), p.yc.data(), 1, y.data());
        from += part;
    }
    if (to - from <= little) return;
    Piece& p = begin(0, to - from, true);
    Vector after(p.yc), scratch(2 * rows);
    propagators_->taylor(p.length, after.data(), scratch.data());
    std::copy_n(after.begin(), rows, y.begin());
}

}  // namespace dualdrive::exponential
