// What is done with polynomials of the rest: taken through the nodes, counted in another unit of time, looked at later.
//
// c: derivatives c_k = δ^k n⁽ᵏ⁾ for k < terms, those of all quantities for one k before those for the next.
#pragma once

#include <array>
#include <vector>

#include "../exact/kernels.hpp"
#include "nodes.hpp"

namespace dualdrive::exponential {

inline constexpr std::size_t terms = nodes;

inline constexpr std::array<double, terms + 1> inverse_factorial = [] {
    std::array<double, terms + 1> f{1.0};
    for (std::size_t k = 1; k < f.size(); ++k) f[k] = f[k - 1] / static_cast<double>(k);
    return f;
}();

// Over the interval from node j on, of the polynomial through the nodes.
inline constexpr auto integrals = [] {
    std::array<std::array<double, terms>, terms> w{};
    for (std::size_t j = 0; j < terms; ++j)
        for (std::size_t k = 0; k < terms; ++k)
            for (std::size_t i = 0; i < terms; ++i) w[j][i] += through_nodes[j][k][i] * inverse_factorial[k + 1];
    return w;
}();

// Derivatives at node j of the polynomial `last_gram`.
inline constexpr auto gram_derivatives = [] {
    std::array<std::array<double, terms>, terms> d{};
    for (std::size_t j = 0; j < terms; ++j)
        for (std::size_t k = 0; k < terms; ++k)
            for (std::size_t i = 0; i < terms; ++i) d[j][k] += through_nodes[j][k][i] * last_gram[i];
    return d;
}();

// c, derivatives in one unit of time, in another `ratio` times as long.
inline void rescale(double* c, std::size_t m, double ratio) {
    double power = 1.0;
    for (std::size_t k = 0; k < terms; ++k, power *= ratio)
        for (std::size_t r = 0; r < m; ++r) c[k * m + r] *= power;
}

// Derivatives at every node of the polynomials through `values`, [node][width] with a padded width: [node][order][width].
inline void expand(const std::vector<double>& values, int width, std::vector<double>& out) {
    out.resize(terms * terms * static_cast<std::size_t>(width));
    exact::kernels().product(width, static_cast<int>(terms), values.data(), static_cast<int>(terms),
                             through_nodes[0][0].data(), static_cast<int>(terms * terms), out.data());
}

// c so many units of time later.
inline void shift(double* c, std::size_t m, double units = 1.0) {
    for (std::size_t k = 0; k < terms; ++k) {
        double power = 1.0;
        for (std::size_t j = k + 1; j < terms; ++j) {
            power *= units;
            for (std::size_t r = 0; r < m; ++r) c[k * m + r] += power * inverse_factorial[j - k] * c[j * m + r];
        }
    }
}

}  // namespace dualdrive::exponential
