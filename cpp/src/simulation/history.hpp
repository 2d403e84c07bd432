// The past of delayed signals: one polynomial per accepted step, kept as long as the longest delay needs it.
//
// A delay inside feedback makes a delay equation; this is its dense output. Each step is sampled at six Chebyshev-Lobatto
// points of the solver's own interpolant, so the history is as smooth and as accurate as the step itself.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <deque>
#include <vector>

#include "dualdrive/signal.hpp"

namespace dualdrive {

class History {
  public:
    static constexpr int points = 6;

    History(double begin, std::size_t lines, std::size_t parameters)
        : begin_(begin),
          lines_(lines),
          parameters_(parameters),
          before_(lines, 0.0),
          slope_before_(lines * parameters, 0.0) {
        for (int j = 0; j < points; ++j) node_[j] = 0.5 * (1.0 - std::cos(M_PI * j / (points - 1)));
        Eigen::Matrix<double, points, points> vandermonde;
        for (int j = 0; j < points; ++j)
            for (int k = 0; k < points; ++k) vandermonde(j, k) = std::pow(node_[j], k);
        to_monomial_ = vandermonde.inverse();
    }

    double node(int j, double from, double to) const { return j == points - 1 ? to : from + node_[j] * (to - from); }
    // What the line was before the start, and its slopes.
    void set_before(std::size_t line, double value) { before_[line] = value; }
    void set_slope_before(std::size_t line, std::size_t parameter, double slope) {
        slope_before_[line * parameters_ + parameter] = slope;
    }

    // samples: [node][line], slopes: [node][line][parameter]
    void append(double from, double to, const std::vector<double>& samples, const std::vector<double>& slopes) {
        Piece p{from, to, coefficients(samples, lines_), coefficients(slopes, lines_ * parameters_)};
        pieces_.push_back(std::move(p));
    }
    void forget_before(double t) {
        while (pieces_.size() > 1 && pieces_.front().to < t) pieces_.pop_front();
    }

    // The value of a line; `parameter` = first of the chunk whose slopes a Gradient carries, -1 for none.
    template <class S>
    S at(int line, const S& t, const Cell& cell, int parameter) const {
        const Piece* p = find(value_of(t), cell);
        const auto k = static_cast<std::size_t>(line);
        if (!p) {
            S v(before_[k]);
            if constexpr (std::is_same_v<S, Gradient>)
                for (std::size_t d = 0; parameter >= 0 && d < directions; ++d)
                    if (static_cast<std::size_t>(parameter) + d < parameters_)
                        v.slope[d] = slope_before_[k * parameters_ + static_cast<std::size_t>(parameter) + d];
            return v;
        }
        const S x = (t - p->from) / (p->to - p->from);
        S v = horner<S>(p->values, lines_, k, x);
        if constexpr (std::is_same_v<S, Gradient>) {
            const double plain = value_of(x);
            for (int d = 0; parameter >= 0 && d < directions; ++d) {
                const auto which = static_cast<std::size_t>(parameter + d);
                if (which < parameters_)
                    v.slope[static_cast<std::size_t>(d)] +=
                        horner<double>(p->slopes, lines_ * parameters_, k * parameters_ + which, plain);
            }
        }
        return v;
    }

  private:
    struct Piece {
        double from, to;
        std::vector<double> values, slopes;  // monomial coefficients, [power][quantity]
    };

    std::vector<double> coefficients(const std::vector<double>& samples, std::size_t quantities) const {
        std::vector<double> c(quantities * points, 0.0);
        for (std::size_t q = 0; q < quantities; ++q)
            for (int k = 0; k < points; ++k)
                for (int j = 0; j < points; ++j)
                    c[static_cast<std::size_t>(k) * quantities + q] +=
                        to_monomial_(k, j) * samples[static_cast<std::size_t>(j) * quantities + q];
        return c;
    }
    template <class S>
    static S horner(const std::vector<double>& c, std::size_t quantities, std::size_t q, const S& x) {
        S v(0.0);
        for (int k = points; k-- > 0;) v = v * x + S(c[static_cast<std::size_t>(k) * quantities + q]);
        return v;
    }
    // The piece that holds t; where two meet, the one on the side of the cell in which the solver stands. A time less a
    // delay misses the meeting point by rounding, so that side is taken a little further on.
    // Steps too short to be kept leave holes of 1e-12 s, which the piece after them covers.
    const Piece* find(double t, const Cell& cell) const {
        const double little = 1e-14 * std::max(1.0, std::abs(t));
        const double beside = t >= cell.high ? t - little : t + little;
        if (pieces_.empty() || beside < begin_) return nullptr;
        const auto holds =
            std::partition_point(pieces_.begin(), pieces_.end(), [&](const Piece& p) { return p.to <= beside; });
        return holds == pieces_.end() ? &pieces_.back() : &*holds;
    }

    double begin_;
    std::size_t lines_, parameters_;
    std::array<double, points> node_{};
    Eigen::Matrix<double, points, points> to_monomial_;
    std::vector<double> before_, slope_before_;
    std::deque<Piece> pieces_;
};

template <class S>
class HistoryView final : public Past<S> {
  public:
    HistoryView(const History& history, int first_parameter) : history_(history), first_(first_parameter) {}
    S at(int line, const S& t, const Cell& cell) const override { return history_.at<S>(line, t, cell, first_); }

  private:
    const History& history_;
    int first_;
};

}  // namespace dualdrive
