// What formulas come to: values, names, switches and their branches, slopes.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include "dualdrive/expression.hpp"
#include "expression_value.hpp"
#include "refusal.hpp"

using namespace dualdrive;

TEST_CASE("arithmetic follows the usual precedence") {
    CHECK(value("1 + 2 * 3") == 7.0);
    CHECK(value("(1 + 2) * 3") == 9.0);
    CHECK(value("8 - 3 - 2") == 3.0);
    CHECK(value("16 / 4 / 2") == 2.0);
    CHECK(value("-2^2") == -4.0);
    CHECK(value("2^3^2") == 512.0);
    CHECK(value("2^-1") == 0.5);
    CHECK(value("2*-3") == -6.0);
    CHECK(value("--3") == 3.0);
    CHECK(value("1.5e3 + .5 + 2.") == 1502.5);
    CHECK(value(" \t1\n+\r2 ") == 3.0);
    const Values v{{"a", 3.0}, {"b", -2.0}};
    CHECK(value("a - b - a*b/a^2", v) == doctest::Approx(5.0 + 2.0 / 3.0).epsilon(1e-15));
    CHECK(value("-a^2", v) == -9.0);
    CHECK(value("b^3", v) == -8.0);
    CHECK(value("b^-2", v) == 0.25);
    CHECK(value("b^0", v) == 1.0);
    CHECK(value("a^b", v) == doctest::Approx(1.0 / 9.0).epsilon(1e-15));
    CHECK(value("a^0.5^2", v) == doctest::Approx(std::pow(3.0, 0.25)).epsilon(1e-15));
}

TEST_CASE("functions and names") {
    const Values v{{"x", 0.7}, {"mesh_1.torque", 4.0}, {"_k2", 0.1}, {"pi.x", 5.0}, {"e", 2.0}};
    CHECK(value("sin(x)", v) == doctest::Approx(std::sin(0.7)).epsilon(1e-15));
    CHECK(value("cos(x)", v) == doctest::Approx(std::cos(0.7)).epsilon(1e-15));
    CHECK(value("tan(x)", v) == doctest::Approx(std::tan(0.7)).epsilon(1e-15));
    CHECK(value("tanh(x)", v) == doctest::Approx(std::tanh(0.7)).epsilon(1e-15));
    CHECK(value("exp(x)", v) == doctest::Approx(std::exp(0.7)).epsilon(1e-15));
    CHECK(value("log(x)", v) == doctest::Approx(std::log(0.7)).epsilon(1e-15));
    CHECK(value("sqrt (x)", v) == std::sqrt(0.7));
    CHECK(value("pi") == std::numbers::pi);
    CHECK(value("mesh_1.torque*_k2 + pi.x + e", v) == doctest::Approx(7.4));
    CHECK(value("abs(-x) + sign(-x) + min(x, 2) + max(x, 2)", v) == doctest::Approx(0.7 - 1.0 + 0.7 + 2.0));
    const Expression e = Expression::parse("b + a*b + mesh_1.torque + a");
    CHECK(e.names() == std::vector<std::string>{"b", "a", "mesh_1.torque"});
    CHECK(e.text() == "b + a*b + mesh_1.torque + a");
    CHECK(Expression::parse("3").names().empty());
}

TEST_CASE("names are bound to slots") {
    Expression e = Expression::parse("a - b");
    const double slots[] = {0.0, 10.0, 20.0, 30.0};
    CHECK(e.evaluate(slots, nullptr) == -10.0);
    e.bind([](std::string_view name) { return name == "a" ? 3 : 1; });
    CHECK(e.evaluate(slots, nullptr) == 20.0);
    CHECK(refusal([&] { e.bind([](std::string_view name) { return name == "b" ? -1 : 0; }); }) ==
          "formula 'a - b': the name 'b' is not known here");
    CHECK(e.evaluate(slots, nullptr) == 20.0);  // as bound before
}

TEST_CASE("a switch keeps its branch, and tells the argument that decides") {
    struct Case {
        const char* text;
        double plus, minus, argument;  // with a = 3, b = 5
    };
    const Case cases[] = {
        {"abs(a)", 3.0, -3.0, 3.0},          {"sign(a)", 1.0, -1.0, 3.0},          {"min(a, b)", 5.0, 3.0, -2.0},
        {"max(a, b)", 3.0, 5.0, -2.0},       {"if(a < b, 1, 2)", 1.0, 2.0, 2.0},   {"if(a <= b, 1, 2)", 1.0, 2.0, 2.0},
        {"if(a > b, 1, 2)", 1.0, 2.0, -2.0}, {"if(a >= b, 1, 2)", 1.0, 2.0, -2.0},
    };
    for (const Case& c : cases) {
        CAPTURE(c.text);
        const Expression e = Expression::parse(c.text);
        const std::vector<double> slots = slots_of(e, {{"a", 3.0}, {"b", 5.0}});
        REQUIRE(e.switches() == 1);
        const std::int8_t plus = 1, minus = -1;
        CHECK(e.evaluate(slots.data(), &plus) == c.plus);
        CHECK(e.evaluate(slots.data(), &minus) == c.minus);
        double argument = 0.0;
        e.switch_values(slots.data(), &plus, &argument);
        CHECK(argument == c.argument);
        std::int8_t right = 0;
        e.decide(slots.data(), &right);
        CHECK(right == (c.argument > 0.0 ? 1 : -1));
    }
}

TEST_CASE("at zero a strict comparison is false, everything else is on +1") {
    const Values v{{"a", 2.0}, {"z", 0.0}};
    CHECK(value("if(a < 2, 10, 20)", v) == 20.0);
    CHECK(value("if(a <= 2, 10, 20)", v) == 10.0);
    CHECK(value("if(a > 2, 10, 20)", v) == 20.0);
    CHECK(value("if(a >= 2, 10, 20)", v) == 10.0);
    CHECK(value("sign(z)", v) == 1.0);
}

TEST_CASE("switches nest; in a branch that is not taken they decide nothing") {
    const Expression e = Expression::parse("if(x > 0, abs(y) + min(y, 1), sqrt(abs(-1 - abs(x)))) + max(x, y)");
    // In order of evaluation: x > 0; abs(y), min; abs(x), abs(-1 - abs(x)); max.
    REQUIRE(e.switches() == 6);
    REQUIRE(e.names() == std::vector<std::string>{"x", "y"});
    Branches b(6);
    std::vector<double> out(6);
    const double right[] = {2.0, -3.0}, left[] = {-2.0, -3.0};

    e.decide(right, b.data());
    CHECK(b == Branches{1, -1, -1, 1, 1, 1});
    CHECK(e.evaluate(right, b.data()) == 3.0 - 3.0 + 2.0);
    b = {1, -1, -1, -1, 1, 1};
    e.switch_values(right, b.data(), out.data());
    CHECK(out == std::vector<double>{2.0, -3.0, -4.0, -1.0, 1.0, 5.0});

    e.decide(left, b.data());
    CHECK(b == Branches{-1, 1, 1, -1, -1, 1});
    CHECK(e.evaluate(left, b.data()) == doctest::Approx(std::sqrt(3.0) - 2.0));
    b = {-1, -1, 1, -1, -1, 1};
    e.switch_values(left, b.data(), out.data());
    CHECK(out == std::vector<double>{-2.0, -1.0, 1.0, -2.0, -3.0, 1.0});

    SUBCASE("a solver at a zero keeps the side it goes on to, the rest follows") {
        const double edge[] = {0.0, -3.0};
        e.decide(edge, b.data());
        CHECK(b[0] == -1);
        b[0] = 1;
        e.decide(edge, b.data(), 0);
        CHECK(b == Branches{1, -1, -1, 1, 1, 1});
    }
}

TEST_CASE("a domain error in the branch not taken does no harm") {
    const double x[] = {-4.0};
    const Expression e = Expression::parse("if(x > 0, sqrt(x), x^2)");
    const std::int8_t branch = -1;
    CHECK(e.evaluate(x, &branch) == 16.0);
    using D = Dual<double, 1>;
    const D dual[] = {D::variable(-4.0, 0)};
    CHECK(e.evaluate(dual, &branch).slope[0] == -8.0);
}

TEST_CASE("slopes agree with central differences") {
    using D = Dual<double, 2>;
    for (const char* text : {"x*y - y/x + 3", "sin(x)*cos(y) + tan(x*y/5)", "exp(-x^2)*log(y) + sqrt(x + y)",
                             "x^y + x^2.5 + x^-3", "tanh(3*x)*abs(x - y)",
                             "if(x < y, x^3, y^3) + max(x, 2*y)*min(x, y)", "-(x - 2*y)^2*sign(y - x)", "x^0 + y^1"}) {
        CAPTURE(text);
        const Expression e = Expression::parse(text);
        const double at[] = {0.8, 1.3};
        Branches b(static_cast<std::size_t>(e.switches()));
        e.decide(at, b.data());
        const D dual[] = {D::variable(at[0], 0), D::variable(at[1], 1)};
        const D f = e.evaluate(dual, b.data());
        CHECK(f.value == doctest::Approx(e.evaluate(at, b.data())).epsilon(1e-15));
        for (std::size_t k = 0; k < 2; ++k) {
            const double h = 1e-6;
            double ahead[] = {at[0], at[1]}, behind[] = {at[0], at[1]};
            ahead[k] += h;
            behind[k] -= h;
            const double slope = (e.evaluate(ahead, b.data()) - e.evaluate(behind, b.data())) / (2.0 * h);
            CHECK(f.slope[k] == doctest::Approx(slope).epsilon(1e-8));
        }
    }
    // Where exp(p log x) would fail: at zero and below.
    const D zero[] = {D::variable(0.0, 0)}, below[] = {D::variable(-2.0, 0)};
    CHECK(Expression::parse("x^2").evaluate(zero, nullptr).slope[0] == 0.0);
    CHECK(Expression::parse("x^0").evaluate(zero, nullptr).slope[0] == 0.0);
    CHECK(Expression::parse("x^1.5").evaluate(zero, nullptr).slope[0] == 0.0);
    CHECK(Expression::parse("x^3").evaluate(below, nullptr).slope[0] == 12.0);
}

TEST_CASE("long double and nested duals") {
    const long double x[] = {1.0L / 3.0L};
    const auto cube = Expression::parse("x^3 - x*x*x").evaluate(x, nullptr);
    CHECK(std::abs(static_cast<double>(cube)) < 1e-19);
    using D = Dual<Dual<double, 1>, 1>;
    D t;
    t.value = Dual<double, 1>::variable(0.6, 0);
    t.slope[0] = Dual<double, 1>(1.0);
    const D f = Expression::parse("sin(t)*t^3").evaluate(&t, nullptr);
    const double second = -std::sin(0.6) * 0.216 + 6.0 * 0.36 * std::cos(0.6) + 6.0 * 0.6 * std::sin(0.6);
    CHECK(f.slope[0].slope[0] == doctest::Approx(second).epsilon(1e-14));
}
