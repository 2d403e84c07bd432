#include "watch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace dualdrive::exponential {

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double rounding = 1e-9;  // of a guard's constant: what is less apart is a pair, or constant
constexpr double of_slope =
    0.125;  // a cubic that is wrong by s in its slope at the middle is wrong by about s/8 beside it

}  // namespace

Watch::Watch(const exact::Laws<double>& laws, const std::vector<int>& driven, double unit)
    : G_(laws.guards), GA_(G_ * laws.A), GAA_(GA_ * laws.A), driven_(driven), unit_(unit) {
    find_quantities();
}

void Watch::find_quantities() {
    quantities_.clear();
    unwatched_.assign(static_cast<std::size_t>(G_.rows()), true);
    const auto add = [&](int low, int high, double upper) {
        quantities_.push_back({low, high, upper});
        unwatched_[static_cast<std::size_t>(low)] = false;
        if (high >= 0) unwatched_[static_cast<std::size_t>(high)] = false;
    };
    for (const auto& q : exact::watched_quantities<double>(G_))
        if (!alone_.contains(q.low)) add(q.low, q.high, q.upper);
    for (const int guard : alone_) add(guard, -1, infinite);
    upper_.assign(static_cast<std::size_t>(rows()), infinite);
    for (std::size_t k = 0; k < quantities_.size(); ++k) upper_[k] = quantities_[k].upper;
    known_.clear();
    values_.assign(static_cast<std::size_t>(rows() * exact::padded(static_cast<int>(G_.cols()))), 0.0);
    for (std::size_t k = 0; k < quantities_.size(); ++k)
        for (Eigen::Index j = 0; j < G_.cols(); ++j)
            values_[static_cast<std::size_t>(j * rows()) + k] = G_(quantities_[k].low, j);
}

bool Watch::set_apart(const double* guards) {
    const std::size_t before = alone_.size();
    for (const auto& q : quantities_)
        if (q.high >= 0 && !(std::abs(guards[q.low] + guards[q.high] - q.upper) <= rounding * std::abs(q.upper)))
            alone_.insert({q.low, q.high});
    const Eigen::Index one = G_.cols() - 1;
    for (int g = 0; g < static_cast<int>(unwatched_.size()); ++g)
        if (unwatched_[static_cast<std::size_t>(g)] && !(std::abs(guards[g] - G_(g, one)) <= rounding * G_(g, one)))
            alone_.insert(g);
    if (alone_.size() == before) return false;
    find_quantities();
    return true;
}

// q' = G (A y + B n), q'' = G (A² y + A B n + B n').
const std::vector<double>& Watch::matrix(int level) {
    std::vector<double>& M = known_[level];
    if (!M.empty()) return M;
    const double w = std::ldexp(unit_, level);
    const auto n = static_cast<std::size_t>(exact::padded(static_cast<int>(G_.cols()))), m = driven_.size();
    const auto tall = static_cast<std::size_t>(rows());
    M.assign(3 * tall * (n + 2 * m), 0.0);
    const auto at = [&](std::size_t part, std::size_t row, std::size_t column) -> double& {
        return M[column * 3 * tall + part * tall + row];
    };
    for (std::size_t k = 0; k < tall; ++k) {
        if (k >= quantities_.size()) {  // what fills the lane is always valid
            at(0, k, static_cast<std::size_t>(G_.cols() - 1)) = 1.0;
            continue;
        }
        const Eigen::Index row = quantities_[k].low;
        for (Eigen::Index j = 0; j < G_.cols(); ++j) {
            at(0, k, static_cast<std::size_t>(j)) = G_(row, j);
            at(1, k, static_cast<std::size_t>(j)) = GA_(row, j) * w / 5.0;
            at(2, k, static_cast<std::size_t>(j)) = GAA_(row, j) * w * w / 20.0;
        }
        for (std::size_t r = 0; r < m; ++r) {
            at(1, k, n + r) = G_(row, driven_[r]) * w / 5.0;
            at(2, k, n + r) = GA_(row, driven_[r]) * w * w / 20.0;
            at(2, k, n + m + r) = G_(row, driven_[r]) * w / 20.0;
        }
    }
    return M;
}

void largest_doubt(int rows, int count, const double* values, double* doubt) {
    std::fill_n(doubt, rows, 0.0);
    for (int k = 0; k + 2 <= count; k += 2) {
        const double *a = values + static_cast<std::ptrdiff_t>(k) * 3 * rows, *m = a + 3 * rows, *b = m + 3 * rows;
        for (int i = 0; i < rows; ++i) {
            const double s0 = 2.0 * a[rows + i], s5 = 2.0 * b[rows + i], b0 = a[i], b5 = b[i];
            const double b1 = b0 + s0, b2 = b1 + s0 + 4.0 * a[2 * rows + i];
            const double b4 = b5 - s5, b3 = b4 - s5 + 4.0 * b[2 * rows + i];
            const double value = (b0 + b5 + 5.0 * (b1 + b4) + 10.0 * (b2 + b3)) / 32.0;
            const double slope = 5.0 / 16.0 * (b5 - b0 + 3.0 * (b4 - b1) + 2.0 * (b3 - b2));
            const double off = std::abs(m[i] - value) + of_slope * std::abs(10.0 * m[rows + i] - slope);
            doubt[i] = std::max(doubt[i], off);
        }
    }
}

}  // namespace dualdrive::exponential
