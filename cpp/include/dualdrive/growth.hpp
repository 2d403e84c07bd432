// How a result grows with what it depends on: a scalar that knows of itself whether it is constant, affine or neither.
#pragma once

#include <algorithm>
#include <cmath>

namespace dualdrive {

struct Growth {
    enum Kind { constant, affine, other };
    double value = 0.0;
    Kind kind = constant;

    Growth() = default;
    Growth(double v) : value(v) {}  // NOLINT: a constant
    static Growth variable(double v, Kind kind = affine) {
        Growth g(v);
        g.kind = kind;
        return g;
    }

    Growth& operator+=(const Growth& o) { return *this = *this + o; }
    Growth& operator-=(const Growth& o) { return *this = *this - o; }
    Growth& operator*=(const Growth& o) { return *this = *this * o; }
    Growth& operator/=(const Growth& o) { return *this = *this / o; }

    friend Growth operator+(const Growth& a) { return a; }
    friend Growth operator-(const Growth& a) { return variable(-a.value, a.kind); }
    friend Growth operator+(const Growth& a, const Growth& b) { return variable(a.value + b.value, larger(a, b)); }
    friend Growth operator-(const Growth& a, const Growth& b) { return variable(a.value - b.value, larger(a, b)); }
    friend Growth operator*(const Growth& a, const Growth& b) {
        if (a.is_nothing() || b.is_nothing()) return {};
        return variable(a.value * b.value, a.kind == constant || b.kind == constant ? larger(a, b) : other);
    }
    friend Growth operator/(const Growth& a, const Growth& b) {
        return a * variable(1.0 / b.value, b.kind == constant ? constant : other);
    }

    Growth curved(double f) const { return variable(f, kind == constant ? constant : other); }

  private:
    bool is_nothing() const { return kind == constant && value == 0.0; }
    static Kind larger(const Growth& a, const Growth& b) { return std::max(a.kind, b.kind); }
};

inline double value_of(const Growth& x) { return x.value; }

inline Growth sin(const Growth& x) { return x.curved(std::sin(x.value)); }
inline Growth cos(const Growth& x) { return x.curved(std::cos(x.value)); }
inline Growth tan(const Growth& x) { return x.curved(std::tan(x.value)); }
inline Growth exp(const Growth& x) { return x.curved(std::exp(x.value)); }
inline Growth log(const Growth& x) { return x.curved(std::log(x.value)); }
inline Growth sqrt(const Growth& x) { return x.curved(std::sqrt(x.value)); }
inline Growth tanh(const Growth& x) { return x.curved(std::tanh(x.value)); }
inline Growth atan(const Growth& x) { return x.curved(std::atan(x.value)); }
inline Growth abs(const Growth& x) { return x.curved(std::abs(x.value)); }
inline Growth pow(const Growth& x, double p) { return x.curved(std::pow(x.value, p)); }
inline Growth pow(const Growth& x, const Growth& p) { return exp(p * log(x)); }  // x > 0

// Comparisons are by value.
inline bool operator<(const Growth& a, const Growth& b) { return a.value < b.value; }
inline bool operator>(const Growth& a, const Growth& b) { return a.value > b.value; }

}  // namespace dualdrive
