#include "adjoint.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "arithmetic.hpp"

namespace dualdrive::exact {

LawGradient::LawGradient(const Propagator<double>& law, int states)
    : law_(law),
      n_(law.size()),
      rows_(law.rows()),
      states_(states),
      lambda_rows_(padded(states)),
      signals_(static_cast<int>(law.laws().outputs.rows())),
      transposed_(levels + 1),
      exponential_(levels + 1),
      A_transposed_(states_transposed(rows_, states_, law.A())),
      outputs_transposed_(static_cast<std::size_t>(lambda_rows_ * signals_), 0.0),
      A_(static_cast<std::size_t>(lambda_rows_ * n_), 0.0),
      outputs_(static_cast<std::size_t>(rows_ * signals_), 0.0),
      terms_(static_cast<std::size_t>(rows_ * (law.order() + 1))),
      bars_(static_cast<std::size_t>(lambda_rows_ * (law.order() + 1))),
      guards_(Matrix<double>::Zero(law.laws().guards.rows(), n_)) {
    for (int s = 0; s < signals_; ++s)
        for (int c = 0; c < states_; ++c)
            outputs_transposed_[static_cast<std::size_t>(s * lambda_rows_ + c)] = law.laws().outputs(s, c);
}

LawGradient::Packed LawGradient::product(const Packed& a, const Packed& b) const {
    Packed p(a.size());
    kernels().multiply(rows_, n_, a.data(), rows_, b.data(), n_, p.data());
    return p;
}

// λ_{k−1} += Eᵀ λ_k, and E takes λ_k y_{k−1}ᵀ.
void LawGradient::power_back(int level, int count, const double* y, double* lambda) {
    Packed &T = transposed_[static_cast<std::size_t>(level)], &sum = exponential_[static_cast<std::size_t>(level)];
    if (T.empty()) {
        T = states_transposed(rows_, states_, law_.power(level));
        sum.assign(A_.size(), 0.0);
    }
    kernels().chain_back(lambda_rows_, states_, T.data(), count, lambda);
    kernels().add_outer(lambda_rows_, n_, count, lambda + lambda_rows_, rows_, y, sum.data());
}

void LawGradient::steps_back(int count, const double* y, double* lambda) { power_back(0, count, y, lambda); }

// As Propagator::advance went: the halves it took, then the rest as a series, now the other way round.
void LawGradient::part_back(double length, const double* y, double* lambda) {
    std::vector<int> halves;
    Packed begins(y, y + rows_);
    const auto begin = [&](std::size_t k) { return begins.data() + k * static_cast<std::size_t>(rows_); };
    double part = law_.step();
    for (int b = 0; b <= levels && length > 0; ++b, part /= 2) {
        if (length < part) continue;
        begins.resize(begins.size() + static_cast<std::size_t>(rows_));
        kernels().multiply(rows_, n_, law_.power(b).data(), rows_, begin(halves.size()), 1, begin(halves.size() + 1));
        halves.push_back(b);
        length -= part;
    }
    if (length > 0) series_back(length, begin(halves.size()), lambda);
    for (std::size_t k = halves.size(); k-- > 0;) {
        Packed two(static_cast<std::size_t>(2 * lambda_rows_), 0.0);
        std::copy_n(lambda, lambda_rows_, two.begin() + lambda_rows_);
        power_back(halves[k], 1, begin(k), two.data());
        std::copy_n(two.begin(), lambda_rows_, lambda);
    }
}

// y⁺ = Σ t_k, t_k = A t_{k−1} r/k. Backwards t̄_{k−1} = λ + Aᵀ t̄_k r/k, and A takes t̄_k t_{k−1}ᵀ r/k.
void LawGradient::series_back(double length, const double* y, double* lambda) {
    const int order = law_.order();
    std::copy_n(y, rows_, terms_.data());
    kernels().series(rows_, n_, law_.A().data(), length, order - 1, terms_.data());
    std::copy_n(lambda, lambda_rows_, bars_.data() + order * lambda_rows_);
    kernels().series_back(lambda_rows_, states_, A_transposed_.data(), length, order, lambda, bars_.data());
    kernels().add_outer(lambda_rows_, n_, order, bars_.data() + lambda_rows_, rows_, terms_.data(), A_.data());
    std::copy_n(bars_.data(), lambda_rows_, lambda);
}

void LawGradient::outputs_back(int count, const double* y, const double* seeds, double* push) {
    kernels().multiply(lambda_rows_, signals_, outputs_transposed_.data(), signals_, seeds, count, push);
    kernels().add_outer(rows_, signals_, count, y, signals_, seeds, outputs_.data());
}

void LawGradient::guard_back(int guard, double weight, const double* y) {
    for (int j = 0; j < n_; ++j) guards_(guard, j) += weight * y[j];
}

// What the squarings and the series that led to the exponentials owe to A, backwards.
LawGradient::Packed LawGradient::of_exponentials() const {
    const auto add = [](Packed& to, const Packed& what, double factor) {
        for (std::size_t i = 0; i < to.size(); ++i) to[i] += factor * what[i];
    };
    const Packed& A = law_.A();
    Packed bar(A.size(), 0.0);  // ∂(cost)/∂E of the present level
    for (int b = 0; b <= levels; ++b) {
        if (b > 0) {  // E_{b−1} = E_b E_b
            const Packed root = transposed(rows_, n_, law_.power(b));
            Packed both = product(bar, root);
            add(both, product(root, bar), 1.0);
            bar.swap(both);
        }
        if (const Packed& own = exponential_[static_cast<std::size_t>(b)]; !own.empty())
            for (int c = 0; c < n_; ++c)
                for (int r = 0; r < states_; ++r)
                    bar[static_cast<std::size_t>(c * rows_ + r)] += own[static_cast<std::size_t>(c * lambda_rows_ + r)];
    }
    // E = 1 + F_1, F_k = (X + X F_{k+1})/k from F_{order+1} = 0 on.
    const double finest = law_.step() / (1 << levels);
    Packed X(A);
    for (double& each : X) each *= finest;
    const Packed X_transposed = transposed(rows_, n_, X);
    std::vector<Packed> F(static_cast<std::size_t>(law_.order()) + 2, Packed(A.size(), 0.0));
    for (int k = law_.order(); k > 0; --k) {
        add(F[static_cast<std::size_t>(k)], X, 1.0 / k);
        add(F[static_cast<std::size_t>(k)], product(X, F[static_cast<std::size_t>(k) + 1]), 1.0 / k);
    }
    Packed owed(A.size(), 0.0);
    for (int k = 1; k <= law_.order(); ++k) {
        for (double& each : bar) each /= k;
        add(owed, bar, finest);
        add(owed, product(bar, transposed(rows_, n_, F[static_cast<std::size_t>(k) + 1])), finest);
        bar = product(X_transposed, bar);
    }
    return owed;
}

void LawGradient::close() {
    closed_ = true;
    const Packed rest = of_exponentials();
    for (int c = 0; c < n_; ++c)
        for (int r = 0; r < states_; ++r)
            A_[static_cast<std::size_t>(c * lambda_rows_ + r)] += rest[static_cast<std::size_t>(c * rows_ + r)];
}

double LawGradient::along(const Laws<double>& derivative) {
    if (!closed_) close();
    using View = Eigen::Map<const Matrix<double>, 0, Eigen::OuterStride<>>;
    const View A(A_.data(), states_, n_, Eigen::OuterStride<>(lambda_rows_));
    const View outputs(outputs_.data(), n_, signals_, Eigen::OuterStride<>(rows_));
    return A.cwiseProduct(derivative.A.topRows(states_)).sum() + guards_.cwiseProduct(derivative.guards).sum() +
           outputs.transpose().cwiseProduct(derivative.outputs).sum();
}

Adjoint::Adjoint(const Tape& tape, int states, std::function<void(int, double*)> jump_back)
    : dualdrive::Adjoint(tape, states, std::move(jump_back)), side_(static_cast<std::size_t>(lambda_rows_), 0.0) {}

LawGradient& Adjoint::gradient(const Propagator<double>* law) {
    if (law != recent_) {
        recent_ = law;
        LawGradient*& known = known_[law];
        if (!known) {
            laws_.push_back(std::make_unique<Owed>(Owed{law, LawGradient(*law, states_)}));
            known = &laws_.back()->gradient;
        }
        recent_gradient_ = known;
    }
    return *recent_gradient_;
}

void Adjoint::present_output_back(const Entry& e) {
    gradient(e.law).outputs_back(1, values(e), seeds(e), side_.data());
    for (std::size_t i = 0; i < lambda_.size(); ++i) lambda_[i] += side_[i];
}

// What the outputs along the steps add to λ at each column; those read between two columns go their own way back.
void Adjoint::outputs_back(Outputs outputs, const Entry& steps) {
    const int columns = steps.count + steps.column + 1;
    columns_.assign(static_cast<std::size_t>(lambda_rows_ * columns), 0.0);
    for (const Entry& e : outputs) {
        if (e.column < 0) continue;
        LawGradient& g = gradient(e.law);
        const bool between = e.length > 0.0;
        side_.resize(std::max(side_.size(), static_cast<std::size_t>(lambda_rows_ * e.count)));
        const double* from = values(steps) + e.column * steps.law->rows();
        g.outputs_back(e.count, between ? values(e) : from, seeds(e), side_.data());
        if (between) g.part_back(e.length, from, side_.data());
        double* column = columns_.data() + e.column * lambda_rows_;
        for (int i = 0; i < lambda_rows_ * e.count; ++i) column[i] += side_[static_cast<std::size_t>(i)];
    }
}

void Adjoint::steps_back(const Entry& entry, Outputs outputs) {
    outputs_back(outputs, entry);
    LawGradient& g = gradient(entry.law);
    const double* y = values(entry);
    double* const last = columns_.data() + entry.count * lambda_rows_;  // λ after the whole steps
    if (entry.column == 1) {
        for (int i = 0; i < lambda_rows_; ++i) lambda_[static_cast<std::size_t>(i)] += last[lambda_rows_ + i];
        g.part_back(entry.length, y + entry.count * entry.law->rows(), lambda_.data());
    }
    for (int i = 0; i < lambda_rows_; ++i) last[i] += lambda_[static_cast<std::size_t>(i)];
    if (entry.count > 0) g.steps_back(entry.count, y, columns_.data());
    std::copy_n(columns_.data(), lambda_rows_, lambda_.data());
}

void Adjoint::guard_back(const Entry& e, double weight) {
    for (int i = 0; i < states_; ++i) lambda_[static_cast<std::size_t>(i)] += weight * e.law->laws().guards(e.count, i);
    gradient(e.law).guard_back(e.count, weight, values(e));
}

}  // namespace dualdrive::exact
