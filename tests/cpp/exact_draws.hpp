// What tests of the exact engine's parts draw and compare with: numbers of any size, values in long double.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <random>

namespace dualdrive::exact {

using Fine = long double;

inline constexpr double epsilon = std::numeric_limits<double>::epsilon();

class Draw {
  public:
    explicit Draw(unsigned seed) : random_(seed) {}
    double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
    double normal() { return std::normal_distribution<double>()(random_); }
    double size(double decades) { return std::pow(10.0, uniform(-decades, decades)); }
    int whole(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }
    bool chance(double p) { return uniform(0, 1) < p; }

  private:
    std::mt19937 random_;
};

// A quintic of these Bernstein coefficients at x, by de Casteljau.
inline Fine quintic_at(const std::array<Fine, 6>& b, Fine x) {
    std::array<Fine, 6> c = b;
    for (std::size_t level = 5; level > 0; --level)
        for (std::size_t i = 0; i < level; ++i) c[i] += x * (c[i + 1] - c[i]);
    return c[0];
}

}  // namespace dualdrive::exact
