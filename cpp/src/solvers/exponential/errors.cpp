// What a step errs by: what its polynomial does not hold of the laws, by its last component and between its nodes.
#include <algorithm>
#include <cmath>
#include <limits>

#include "exponential.hpp"
#include "terms.hpp"

namespace dualdrive {

using exponential::gram_derivatives, exponential::last_gram, exponential::rescale, exponential::shift,
    exponential::terms;

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr std::size_t most_defects = 16;  // suspects whose defect is looked at
constexpr double slope_accuracy = 1e-7;   // of the derivative by a law that the run does not show
constexpr double gram_area = 40.0;        // between the nodes, under |last_gram|'s polynomial, about

}  // namespace

// What the last of the polynomials that are orthogonal over the nodes, as far as the rest holds it, does to the states.
double Exponential::interpolation_error() const {
    const std::size_t m = driven_.size();
    const double* const M = propagators().step(level_);
    Vector share(m, 0.0), e(width(), 0.0), next(rows());
    for (std::size_t r = 0; r < m; ++r) {
        for (std::size_t i = 0; i < nodes; ++i) share[r] += last_gram[i] * rest_[i * padded_ + r];
        share[r] /= exponential::last_gram_square;
    }
    double most = 0.0;
    for (std::size_t j = 0; j < intervals; ++j) {
        for (std::size_t k = 0; k < terms; ++k)
            for (std::size_t r = 0; r < m; ++r) e[rows() + k * m + r] = gram_derivatives[j][k] * share[r];
        exact::kernels().multiply(propagators().rows(), propagators().width(), M, propagators().width(), e.data(), 1,
                                  next.data());
        std::copy(next.begin(), next.end(), e.begin());
        most = std::max(most, norm(e.data()));
    }
    return most;
}

// How large that component is of what laws would add that the run does not show, over the most they have added so far: it
// is their derivative that has to be told, whatever their size.
double Exponential::unseen_error() const {
    double most = 0.0;
    for (std::size_t r = 0; !unseen_.empty() && r < driven_.size(); ++r) {
        double share = 0.0;
        for (std::size_t i = 0; i < nodes; ++i) share += last_gram[i] * unseen_[i * padded_ + r];
        share *= last_gram[intervals / 2] / exponential::last_gram_square;
        if (const double size = unseen_size_[static_cast<std::size_t>(driven_[r])]; size > 0.0)
            most = std::max(most, std::abs(share) / (slope_accuracy * size));
    }
    return most;
}

// How far the polynomial is from the rest between the first two nodes, over the time between them: there it fits worst,
// and something fast that dies away is seen.
double Exponential::defect() { return defect(column(0), origin_, level_ - 1); }

// The same in the middle of the stretches where a guard may come to zero: a law may be at its steepest where it ends, as
// friction is that falls with speed.
double Exponential::defect_of_suspects() {
    double most = 0.0;
    for (std::size_t k = 0; k < std::min(suspects_.size(), most_defects) && most < infinite; ++k) {
        const std::size_t from = suspects_[suspects_.size() - 1 - k];
        most = std::max(most, defect(point(from), origin_ + static_cast<double>(from) * stride(), walk_level_ - 1));
    }
    return most;
}

// At half the unit of c after (y, c), which is a step of `level`.
double Exponential::defect(const double* yc, double t, int level) {
    const std::size_t m = driven_.size();
    if (m == 0) return 0.0;
    Vector half(yc, yc + width()), rest(m), apart(states_, 0.0);
    rescale(half.data() + rows(), m, 0.5);
    pass(half.data(), level, t, between_.data());
    shift(half.data() + rows(), m);
    if (!rest_at(t + std::ldexp(setup_.grid, level), between_.data(), rest.data())) return infinite;
    for (std::size_t r = 0; r < m; ++r)
        apart[static_cast<std::size_t>(driven_[r])] = delta_ * (rest[r] - half[rows() + r]);
    return norm(apart.data());
}

// The same of the powers, over the area of that polynomial.
double Exponential::work_error() const {
    const std::size_t m = work_.size();
    double sum = 0.0;
    for (std::size_t r = 0; r < m; ++r) {
        double share = 0.0;
        for (std::size_t i = 0; i < nodes; ++i) share += last_gram[i] * powers_[i * paths_ + r];
        const double e = delta_ * gram_area * share / exponential::last_gram_square /
                         (quadrature_atol_ + rtol_ * std::abs(work_[r]));
        sum += e * e;
    }
    return m > 0 ? std::sqrt(sum / static_cast<double>(m)) : 0.0;
}

}  // namespace dualdrive
