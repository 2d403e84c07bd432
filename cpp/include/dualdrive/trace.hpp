// Reverse mode: a scalar that leaves a trace of how it came about, over which derivatives go back.
//
// One walk back gives the derivatives of a result by all states and all parameters at once, where a dual number carries
// a few of them forward (A. Griewank, A. Walther, Evaluating Derivatives, 2nd ed., SIAM 2008, section 3.2). To first order
// a number is a constant plus a multiple of one earlier number; only where two different ones meet is anything written.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "dualdrive/scalar.hpp"

namespace dualdrive {

class Trace {
  public:
    int variable() { return add({}); }
    // ∂(the new number) = weight_a ∂a + weight_b ∂b.
    int combine(int a, double weight_a, int b, double weight_b) { return add({a, b, weight_a, weight_b}); }
    std::size_t size() const { return links_.size(); }
    void forget_from(std::size_t first) { links_.resize(first); }

    // bars: ∂(result)/∂(number), per number; those of [first, last) go to what they were made of.
    template <class Bar>
    void walk_back(std::size_t first, std::size_t last, std::vector<Bar>& bars) const;
    // dots: ∂(number)/∂(something), per number; those of [first, last) come from what they were made of.
    template <class Dot>
    void walk_forward(std::size_t first, std::size_t last, std::vector<Dot>& dots) const;

  private:
    struct Link {
        int a = 0, b = 0;
        double weight_a = 0.0, weight_b = 0.0;
    };
    int add(const Link& link) {
        links_.push_back(link);
        return static_cast<int>(links_.size()) - 1;
    }
    std::vector<Link> links_;
};

// Several results at once.
inline constexpr std::size_t lanes = 4;
struct Lanes {
    std::array<double, lanes> each{};
    Lanes& operator+=(const Lanes& o) {
        for (std::size_t k = 0; k < lanes; ++k) each[k] += o.each[k];
        return *this;
    }
    friend Lanes operator*(double w, Lanes l) {
        for (double& x : l.each) x *= w;
        return l;
    }
};

template <class Bar>
void Trace::walk_back(std::size_t first, std::size_t last, std::vector<Bar>& bars) const {
    for (std::size_t k = last; k-- > first;) {
        const Link& link = links_[k];
        const Bar bar = bars[k];
        bars[static_cast<std::size_t>(link.a)] += link.weight_a * bar;
        bars[static_cast<std::size_t>(link.b)] += link.weight_b * bar;
    }
}

template <class Dot>
void Trace::walk_forward(std::size_t first, std::size_t last, std::vector<Dot>& dots) const {
    for (std::size_t k = first; k < last; ++k) {
        const Link& link = links_[k];
        dots[k] += link.weight_a * dots[static_cast<std::size_t>(link.a)];
        dots[k] += link.weight_b * dots[static_cast<std::size_t>(link.b)];
    }
}

struct Traced {
    double value = 0.0, weight = 0.0;  // weight: ∂(this)/∂(number `node`); 0: a constant
    Trace* trace = nullptr;
    int node = 0;

    Traced() = default;
    Traced(double v) : value(v) {}  // NOLINT: a constant
    static Traced variable(double v, Trace& trace) { return {v, 1.0, &trace, trace.variable()}; }

    Traced& operator+=(const Traced& o) { return *this = *this + o; }
    Traced& operator-=(const Traced& o) { return *this = *this - o; }
    Traced& operator*=(const Traced& o) { return *this = *this * o; }
    Traced& operator/=(const Traced& o) { return *this = *this / o; }

    friend Traced operator+(const Traced& a) { return a; }
    friend Traced operator-(const Traced& a) { return a.follow(-a.value, -1.0); }
    friend Traced operator+(const Traced& a, const Traced& b) { return meet(a.value + b.value, a, 1.0, b, 1.0); }
    friend Traced operator-(const Traced& a, const Traced& b) { return meet(a.value - b.value, a, 1.0, b, -1.0); }
    friend Traced operator*(const Traced& a, const Traced& b) {
        return meet(a.value * b.value, a, b.value, b, a.value);
    }
    friend Traced operator/(const Traced& a, const Traced& b) {
        const double inverse = 1.0 / b.value, quotient = a.value * inverse;
        return meet(quotient, a, inverse, b, -quotient * inverse);
    }

    // With plain numbers, of which there are many, nothing meets.
    friend Traced operator+(const Traced& a, double b) { return a.follow(a.value + b, 1.0); }
    friend Traced operator+(double a, const Traced& b) { return b + a; }
    friend Traced operator-(const Traced& a, double b) { return a + -b; }
    friend Traced operator-(double a, const Traced& b) { return b.follow(a - b.value, -1.0); }
    friend Traced operator*(const Traced& a, double b) { return a.follow(a.value * b, b); }
    friend Traced operator*(double a, const Traced& b) { return b * a; }
    friend Traced operator/(const Traced& a, double b) { return a.follow(a.value / b, 1.0 / b); }
    friend Traced operator/(double a, const Traced& b) {
        const double quotient = a / b.value;
        return b.follow(quotient, -quotient / b.value);
    }

    // f(this), with the derivative known.
    Traced follow(double f, double derivative) const { return {f, derivative * weight, trace, node}; }

  private:
    Traced(double v, double w, Trace* t, int n) : value(v), weight(w), trace(t), node(n) {}
    static Traced meet(double value, const Traced& a, double by_a, const Traced& b, double by_b) {
        const double weight_a = by_a * a.weight, weight_b = by_b * b.weight;
        if (weight_b == 0.0) return {value, weight_a, a.trace, a.node};
        if (weight_a == 0.0) return {value, weight_b, b.trace, b.node};
        if (a.node == b.node) return {value, weight_a + weight_b, a.trace, a.node};
        return {value, 1.0, a.trace, a.trace->combine(a.node, weight_a, b.node, weight_b)};
    }
};

inline double value_of(const Traced& x) { return x.value; }

inline Traced sin(const Traced& x) { return x.follow(std::sin(x.value), std::cos(x.value)); }
inline Traced cos(const Traced& x) { return x.follow(std::cos(x.value), -std::sin(x.value)); }
inline Traced tan(const Traced& x) {
    const double f = std::tan(x.value);
    return x.follow(f, 1.0 + f * f);
}
inline Traced exp(const Traced& x) {
    const double f = std::exp(x.value);
    return x.follow(f, f);
}
inline Traced log(const Traced& x) { return x.follow(std::log(x.value), 1.0 / x.value); }
inline Traced sqrt(const Traced& x) {
    const double f = std::sqrt(x.value);
    return x.follow(f, 0.5 / f);
}
inline Traced tanh(const Traced& x) {
    const double f = std::tanh(x.value);
    return x.follow(f, 1.0 - f * f);
}
inline Traced atan(const Traced& x) { return x.follow(std::atan(x.value), 1.0 / (1.0 + x.value * x.value)); }
inline Traced abs(const Traced& x) { return x.value < 0 ? -x : x; }
inline Traced pow(const Traced& x, double p) { return x.follow(std::pow(x.value, p), p * std::pow(x.value, p - 1.0)); }
inline Traced pow(const Traced& x, const Traced& p) { return exp(p * log(x)); }  // x > 0

using TracedGradient = Dual<Traced, directions>;  // tangents, traced

// Comparisons are by value.
inline bool operator<(const Traced& a, const Traced& b) { return a.value < b.value; }
inline bool operator>(const Traced& a, const Traced& b) { return a.value > b.value; }
inline bool operator<=(const Traced& a, const Traced& b) { return a.value <= b.value; }
inline bool operator==(const Traced& a, const Traced& b) { return a.value == b.value; }

}  // namespace dualdrive
