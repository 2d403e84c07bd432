// Scalars the physics is written on: double, and forward-mode dual numbers over double or long double.
//
// Every law of the machine is a template on its scalar, so that the Jacobian and the parameter
// sensitivities come from the very lines that compute the forces. A dual number carries a value and
// N directional derivatives; duals nest, which is how a mesh's forces come out as derivatives of
// its energy.
#pragma once

#include <array>
#include <cmath>
#include <type_traits>

namespace dualdrive {

template <class S, int N>
struct Dual {
    S value{};
    std::array<S, N> slope{};

    constexpr Dual() = default;
    constexpr Dual(double v) : value(v) {}  // NOLINT: a constant is a dual without slope
    template <class T>
        requires(std::is_same_v<T, S> && !std::is_same_v<T, double>)
    constexpr Dual(const T& v) : value(v) {}  // NOLINT

    // The independent variable number `direction`.
    static constexpr Dual variable(const S& v, int direction) {
        Dual r;
        r.value = v;
        r.slope[static_cast<std::size_t>(direction)] = S(1.0);
        return r;
    }

    Dual& operator+=(const Dual& o) {
        value += o.value;
        for (int k = 0; k < N; ++k) slope[k] += o.slope[k];
        return *this;
    }
    Dual& operator-=(const Dual& o) {
        value -= o.value;
        for (int k = 0; k < N; ++k) slope[k] -= o.slope[k];
        return *this;
    }
    Dual& operator*=(const Dual& o) { return *this = *this * o; }
    Dual& operator/=(const Dual& o) { return *this = *this / o; }

    friend Dual operator+(Dual a, const Dual& b) { return a += b; }
    friend Dual operator-(Dual a, const Dual& b) { return a -= b; }
    friend Dual operator-(Dual a) {
        a.value = -a.value;
        for (int k = 0; k < N; ++k) a.slope[k] = -a.slope[k];
        return a;
    }
    friend Dual operator+(const Dual& a) { return a; }
    friend Dual operator*(const Dual& a, const Dual& b) {
        Dual r;
        r.value = a.value * b.value;
        for (int k = 0; k < N; ++k) r.slope[k] = a.slope[k] * b.value + a.value * b.slope[k];
        return r;
    }
    friend Dual operator/(const Dual& a, const Dual& b) {
        const S inverse = S(1.0) / b.value;
        Dual r;
        r.value = a.value * inverse;
        for (int k = 0; k < N; ++k) r.slope[k] = (a.slope[k] - r.value * b.slope[k]) * inverse;
        return r;
    }
};

// The plain number behind a scalar: for tests, branches and messages, never for physics.
inline double value_of(double x) { return x; }
inline double value_of(long double x) { return static_cast<double>(x); }
template <class S, int N>
double value_of(const Dual<S, N>& x) {
    return value_of(x.value);
}

namespace detail {
// f(x) with f'(x) known: the chain rule for one-argument functions.
template <class S, int N>
Dual<S, N> chain(const Dual<S, N>& x, const S& value, const S& derivative) {
    Dual<S, N> r;
    r.value = value;
    for (int k = 0; k < N; ++k) r.slope[k] = derivative * x.slope[k];
    return r;
}
}  // namespace detail

#define DUALDRIVE_CHAIN(name, derivative)                \
    template <class S, int N>                            \
    Dual<S, N> name(const Dual<S, N>& x) {               \
        using std::sin, std::cos, std::tan, std::exp;    \
        using std::log, std::sqrt, std::tanh, std::atan; \
        const S f = name(x.value);                       \
        const S& v = x.value;                            \
        static_cast<void>(v);                            \
        return detail::chain(x, f, S(derivative));       \
    }
DUALDRIVE_CHAIN(sin, cos(v))
DUALDRIVE_CHAIN(cos, -sin(v))
DUALDRIVE_CHAIN(tan, S(1.0) + f * f)
DUALDRIVE_CHAIN(exp, f)
DUALDRIVE_CHAIN(log, S(1.0) / v)
DUALDRIVE_CHAIN(sqrt, S(0.5) / f)
DUALDRIVE_CHAIN(tanh, S(1.0) - f * f)
DUALDRIVE_CHAIN(atan, S(1.0) / (S(1.0) + v * v))
#undef DUALDRIVE_CHAIN

// |x| with the branch of its value; a switching element owns the kink where it matters.
template <class S, int N>
Dual<S, N> abs(const Dual<S, N>& x) {
    return value_of(x) < 0 ? -x : x;
}

template <class S, int N>
Dual<S, N> pow(const Dual<S, N>& x, double p) {
    using std::pow;
    return detail::chain(x, S(pow(x.value, p)), S(S(p) * pow(x.value, p - 1.0)));
}

// x^p with a variable exponent; x > 0.
template <class S, int N>
Dual<S, N> pow(const Dual<S, N>& x, const Dual<S, N>& p) {
    return exp(p * log(x));
}

// Comparisons are by value.
template <class S, int N>
bool operator<(const Dual<S, N>& a, const Dual<S, N>& b) {
    return value_of(a) < value_of(b);
}
template <class S, int N>
bool operator>(const Dual<S, N>& a, const Dual<S, N>& b) {
    return value_of(a) > value_of(b);
}

// Directions carried at once by the Jacobian and the sensitivities.
inline constexpr int directions = 8;
using Gradient = Dual<double, directions>;
using FineGradient = Dual<long double, directions>;  // of the exact engine's reference arithmetic

}  // namespace dualdrive
