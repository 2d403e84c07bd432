// Polynomials through equidistant values, as derivatives at one of the places: what φ-functions are multiplied by.
//
// Places are counted in steps of one; a derivative of order k belongs to that unit. Exact integers up to the last
// division, so that the compiler finds these numbers to rounding.
#pragma once

#include <array>
#include <cstddef>

namespace dualdrive::exponential {

inline constexpr std::size_t intervals = 8, nodes = intervals + 1;
inline constexpr std::size_t most_back = 6;  // values that a prediction goes by

template <std::size_t n>
using Derivatives = std::array<std::array<double, n>, nodes>;  // [order][value]

// Of the polynomial through values at places[0] … places[n − 1], at the place `at` (Lagrange).
template <std::size_t n>
constexpr Derivatives<n> derivatives(const std::array<int, n>& places, int at) {
    Derivatives<n> result{};
    for (std::size_t i = 0; i < n; ++i) {
        std::array<double, n + 1> product{1.0};  // Π (x − x_m), m ≠ i, in powers of x − at
        double divisor = 1.0;
        std::size_t degree = 0;
        for (std::size_t m = 0; m < n; ++m) {
            if (m == i) continue;
            divisor *= places[i] - places[m];
            ++degree;
            for (std::size_t k = degree; k > 0; --k) product[k] = product[k - 1] + (at - places[m]) * product[k];
            product[0] *= at - places[m];
        }
        double factorial = 1.0;
        for (std::size_t k = 0; k <= degree; factorial *= static_cast<double>(++k))
            result[k][i] = factorial * product[k] / divisor;
    }
    return result;
}

// At node j, from values at all nodes.
inline constexpr std::array<Derivatives<nodes>, nodes> through_nodes = [] {
    std::array<int, nodes> places{};
    for (std::size_t i = 0; i < nodes; ++i) places[i] = static_cast<int>(i);
    std::array<Derivatives<nodes>, nodes> all{};
    for (std::size_t j = 0; j < nodes; ++j) all[j] = derivatives(places, static_cast<int>(j));
    return all;
}();

// At the last of p + 1 values, the first of which is the latest: what an Adams–Bashforth method extrapolates by.
inline constexpr std::array<Derivatives<most_back>, most_back> backward = [] {
    std::array<Derivatives<most_back>, most_back> all{};
    const auto add = [&]<std::size_t p>(std::integral_constant<std::size_t, p>) {
        std::array<int, p + 1> places{};
        for (std::size_t i = 0; i <= p; ++i) places[i] = -static_cast<int>(i);
        const Derivatives<p + 1> found = derivatives(places, 0);
        for (std::size_t k = 0; k < nodes; ++k)
            for (std::size_t i = 0; i <= p; ++i) all[p][k][i] = found[k][i];
    };
    [&]<std::size_t... p>(std::index_sequence<p...>) {
        (add(std::integral_constant<std::size_t, p>{}), ...);
    }(std::make_index_sequence<most_back>{});
    return all;
}();

// The last of the polynomials that are orthogonal over the nodes, of degree `intervals`: (−1)^j C(8, j) (J. P. Gram, 1883);
// the sum of its squares is C(16, 8).
inline constexpr std::array<double, nodes> last_gram{1, -8, 28, -56, 70, -56, 28, -8, 1};
inline constexpr double last_gram_square = 12870.0;
static_assert(intervals == 8, "last_gram is that of nine nodes");

}  // namespace dualdrive::exponential
