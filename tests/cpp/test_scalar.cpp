// Every function of the dual numbers against central differences, for double, long double and nested duals; and of traced
// ones.
#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "dualdrive/scalar.hpp"
#include "dualdrive/trace.hpp"

using namespace dualdrive;

namespace {

// One function of one variable, callable for every scalar; `at` lists points of its domain.
struct Tested {
    std::string name;
    std::function<long double(long double)> plain;
    std::function<Dual<double, 2>(Dual<double, 2>)> dual;
    std::function<Dual<long double, 2>(Dual<long double, 2>)> wide;
    std::function<Dual<Dual<double, 2>, 1>(Dual<Dual<double, 2>, 1>)> nested;
    std::function<Traced(Traced)> traced;
    std::function<Dual<Traced, 1>(Dual<Traced, 1>)> traced_dual;
    std::vector<double> at;
};

template <class F>
Tested tested(std::string name, F f, std::vector<double> at) {
    return {std::move(name), f, f, f, f, f, f, std::move(at)};
}

const std::vector<double> anywhere{-2.3, -0.4, 0.1, 0.9, 1.7};
const std::vector<double> above_zero{0.05, 0.4, 1.0, 2.6};

using std::abs, std::atan, std::cos, std::exp, std::log, std::pow, std::sin, std::sqrt, std::tan, std::tanh;

const std::vector<Tested> functions{
    tested(
        "sin", [](auto x) { return sin(x); }, anywhere),
    tested(
        "cos", [](auto x) { return cos(x); }, anywhere),
    tested("tan", [](auto x) { return tan(x); }, {-1.2, -0.3, 0.0, 1.1}),
    tested(
        "exp", [](auto x) { return exp(x); }, anywhere),
    tested(
        "log", [](auto x) { return log(x); }, above_zero),
    tested(
        "sqrt", [](auto x) { return sqrt(x); }, above_zero),
    tested(
        "tanh", [](auto x) { return tanh(x); }, anywhere),
    tested(
        "atan", [](auto x) { return atan(x); }, anywhere),
    tested(
        "abs", [](auto x) { return abs(x); }, anywhere),
    tested(
        "cube", [](auto x) { return pow(x, 3.0); }, anywhere),
    tested(
        "pow 2.5", [](auto x) { return pow(x, 2.5); }, above_zero),
    tested(
        "pow -0.5", [](auto x) { return pow(x, -0.5); }, above_zero),
    tested(
        "x^x", [](auto x) { return pow(x, x); }, above_zero),
    tested(
        "polynomial", [](auto x) { return 3.0 - x * x * 0.5 + x * 2.0 - 1.0; }, anywhere),
    tested(
        "quotient", [](auto x) { return (1.0 + x) / (x * x + 2.0) - 4.0 / (x - 5.0); }, anywhere),
    tested(
        "signs", [](auto x) { return -x + +(x * x) - (-x) * 3.0; }, anywhere),
    tested(
        "in place",
        [](auto x) {
            auto y = x;
            y += x * x;
            y -= 0.5 * x;
            y *= y;
            y /= x + 7.0;
            return y;
        },
        anywhere),
    tested(
        "composed", [](auto x) { return exp(sin(x) * 0.3) / sqrt(1.0 + x * x) + tanh(x * cos(x)); }, anywhere),
};

// Fourth-order central differences: truncation about 1e-14 at this step, rounding about 1e-16 in 80-bit numbers.
long double slope(const std::function<long double(long double)>& f, long double x) {
    const long double h = 1e-4L;
    return (8.0L * (f(x + h) - f(x - h)) - (f(x + 2 * h) - f(x - 2 * h))) / (12.0L * h);
}
long double curvature(const std::function<long double(long double)>& f, long double x) {
    const long double h = 1e-3L;
    return (16.0L * (f(x + h) + f(x - h)) - (f(x + 2 * h) + f(x - 2 * h)) - 30.0L * f(x)) / (12.0L * h * h);
}

double seen(long double x) { return static_cast<double>(x); }

}  // namespace

TEST_CASE("values and slopes of every function agree with central differences") {
    for (const auto& f : functions)
        for (const double x : f.at) {
            CAPTURE(f.name);
            CAPTURE(x);
            const auto y = f.dual(Dual<double, 2>::variable(x, 1));
            CHECK(y.value == doctest::Approx(seen(f.plain(x))).epsilon(1e-14));
            CHECK(y.slope[1] == doctest::Approx(seen(slope(f.plain, x))).epsilon(1e-9));
            CHECK(y.slope[0] == 0.0);  // the other direction is not touched
        }
}

TEST_CASE("long double duals keep long double accuracy") {
    for (const auto& f : functions)
        for (const double x : f.at) {
            CAPTURE(f.name);
            CAPTURE(x);
            const auto y = f.wide(Dual<long double, 2>::variable(x, 0));
            CHECK(seen(std::abs(y.value - f.plain(x))) <= 1e-18 * (1.0 + std::abs(seen(y.value))));
            CHECK(y.slope[0] == doctest::Approx(seen(slope(f.plain, x))).epsilon(1e-9));
        }
    const auto third = Dual<long double, 1>(1.0) / Dual<long double, 1>(3.0);
    CHECK(third.value == 1.0L / 3.0L);
}

TEST_CASE("nested duals give second derivatives") {
    using Inner = Dual<double, 2>;
    for (const auto& f : functions)
        for (const double x : f.at) {
            CAPTURE(f.name);
            CAPTURE(x);
            const auto y = f.nested(Dual<Inner, 1>::variable(Inner::variable(x, 0), 0));
            CHECK(y.value.slope[0] == doctest::Approx(seen(slope(f.plain, x))).epsilon(1e-9));
            CHECK(y.slope[0].value == doctest::Approx(seen(slope(f.plain, x))).epsilon(1e-9));
            CHECK(y.slope[0].slope[0] == doctest::Approx(seen(curvature(f.plain, x))).epsilon(1e-6));
        }
}

namespace {

// ∂(result)/∂(the variable that came first on the trace).
double back_to_first(const Traced& result, const Trace& trace) {
    std::vector<double> bars(trace.size(), 0.0);
    bars[static_cast<std::size_t>(result.node)] += result.weight;
    trace.walk_back(0, trace.size(), bars);
    return bars[0];
}

}  // namespace

TEST_CASE("slopes come back over a trace, and second derivatives through duals on it") {
    for (const auto& f : functions)
        for (const double x : f.at) {
            CAPTURE(f.name);
            CAPTURE(x);
            Trace trace;
            const Traced y = f.traced(Traced::variable(x, trace));
            CHECK(y.value == doctest::Approx(seen(f.plain(x))).epsilon(1e-14));
            CHECK(back_to_first(y, trace) == doctest::Approx(seen(slope(f.plain, x))).epsilon(1e-9));
            Trace second;
            const auto z = f.traced_dual(Dual<Traced, 1>::variable(Traced::variable(x, second), 0));
            CHECK(z.slope[0].value == doctest::Approx(seen(slope(f.plain, x))).epsilon(1e-9));
            CHECK(back_to_first(z.slope[0], second) == doctest::Approx(seen(curvature(f.plain, x))).epsilon(1e-6));
        }
}

TEST_CASE("one walk back reaches every variable, walks forward say the same, and constants leave no trace") {
    Trace trace;
    const Traced x = Traced::variable(0.7, trace), y = Traced::variable(1.3, trace);
    const Traced f = x * sin(y) + pow(y, x) * (Traced(2.0) * 0.5);
    std::vector<double> bars(trace.size(), 0.0);
    bars[static_cast<std::size_t>(f.node)] = f.weight;
    trace.walk_back(0, trace.size(), bars);
    CHECK(bars[0] == doctest::Approx(std::sin(1.3) + std::pow(1.3, 0.7) * std::log(1.3)));
    CHECK(bars[1] == doctest::Approx(0.7 * std::cos(1.3) + 0.7 * std::pow(1.3, -0.3)));
    for (const std::size_t seeded : {0, 1}) {  // the same forward, one variable at a time
        std::vector<double> dots(trace.size(), 0.0);
        dots[seeded] = 1.0;
        trace.walk_forward(0, trace.size(), dots);
        CHECK(f.weight * dots[static_cast<std::size_t>(f.node)] == doctest::Approx(bars[seeded]).epsilon(1e-14));
    }
    const std::size_t written = trace.size();
    const Traced g = exp(-3.0 * (x + 1.0)) / 2.0 + x * 0.0 * y;
    CHECK(trace.size() == written);
    CHECK(g.weight == doctest::Approx(-1.5 * std::exp(-5.1)));
}

TEST_CASE("partial derivatives of a function of several variables") {
    const auto x = Gradient::variable(0.7, 0), y = Gradient::variable(1.3, directions - 1);
    const auto f = x * sin(y) + pow(y, x);
    CHECK(f.value == doctest::Approx(0.7 * std::sin(1.3) + std::pow(1.3, 0.7)));
    CHECK(f.slope[0] == doctest::Approx(std::sin(1.3) + std::pow(1.3, 0.7) * std::log(1.3)));
    CHECK(f.slope[directions - 1] == doctest::Approx(0.7 * std::cos(1.3) + 0.7 * std::pow(1.3, -0.3)));
    for (std::size_t k = 1; k + 1 < directions; ++k) CHECK(f.slope[k] == 0.0);
}

TEST_CASE("comparisons and value_of look at the value only") {
    const auto a = Gradient::variable(1.0, 0), b = Gradient::variable(2.0, 1);
    CHECK(a < b);
    CHECK(b > a);
    CHECK_FALSE(a > b);
    CHECK_FALSE(a < Gradient(1.0));
    CHECK(value_of(Dual<Gradient, 2>(b)) == 2.0);
    CHECK(value_of(2.5L) == 2.5);
    CHECK(abs(-a).slope[0] == 1.0);
}
