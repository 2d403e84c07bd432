// Units of formulas, and those that contradict each other.
#include <doctest/doctest.h>

#include <map>
#include <string>

#include "dualdrive/expression.hpp"
#include "refusal.hpp"

using namespace dualdrive;

TEST_CASE("units") {
    const std::map<std::string, const char*, std::less<>> units{
        {"T", "N*m"}, {"J", "kg*m^2"},  {"alpha", "rad/s^2"}, {"w", "rad/s"},   {"b", "N*m*s/rad"}, {"phi", "rad"},
        {"I", "A"},   {"K", "N*m/A"},   {"R", "ohm"},         {"v_s", "rad/s"}, {"x", "m"},         {"v", "m/s"},
        {"t", "s"},   {"k", "N*m/rad"}, {"U", "V"},           {"L", "H"}};
    const auto unit_of = [&](std::string_view name) { return Unit::parse(units.find(name)->second); };
    const auto unit = [&](const std::string& text) { return Expression::parse(text).unit(unit_of); };
    const auto is = [&](const std::string& text, const char* expected) { return unit(text) == Unit::parse(expected); };
    const auto wrong = [&](const std::string& text) { return refusal([&] { unit(text); }); };

    CHECK(is("J*alpha + b*w + k*phi - T", "N*m"));
    CHECK(is("T*tanh(w/v_s)", "N*m"));
    CHECK(is("U - R*I", "V"));
    CHECK(is("L*I/t", "V"));
    CHECK(is("sqrt(x^2 + (v*t)^2)", "m"));
    CHECK(is("x^0.5", "m^0.5"));
    CHECK(is("abs(T)*sign(w)*sin(3*phi + 0.2)", "N*m"));
    CHECK(is("if(w > 0, T, b*w)", "N*m"));
    CHECK(is("max(T, 0) + if(w >= v_s, 0, T)", "N*m"));  // 0 fits every unit
    CHECK(is("0*x + T", "N*m"));
    CHECK(is("(1 - 1) + T", "N*m"));
    CHECK(is("0", "1"));
    CHECK(is("2^phi*exp(-t/(3*t))", "1"));
    CHECK(is("w/v_s*pi", "1"));

    CHECK(wrong("J*alpha + v*t") ==
          "formula 'J*alpha + v*t': in 'J*alpha + v*t' one can't add 'J*alpha' [N*m] and 'v*t' [m]");
    CHECK(contains(wrong("2*(T - 1)"), "in 'T - 1' one can't subtract 'T' [N*m] and '1' [1]"));
    CHECK(contains(wrong("sin(x/t)"), "the argument of a function must be a pure number: 'x/t' [m/s]"));
    CHECK(contains(wrong("min(T, x)"), "in 'min(T, x)' one can't compare 'T' [N*m] and 'x' [m]"));
    CHECK(contains(wrong("if(x < T, 1, 2)"), "in 'x < T' one can't compare 'x' [m] and 'T' [N*m]"));
    CHECK(contains(wrong("if(w > 0, T, x)"), "in 'if(w > 0, T, x)' one can't choose between 'T' [N*m] and 'x' [m]"));
    CHECK(contains(wrong("2^x"), "an exponent must be a pure number: 'x' [m]"));
    CHECK(contains(wrong("x^phi"), "the base of a power whose exponent varies must be a pure number: 'x' [m]"));
    CHECK(refusal([&] { Expression::parse("q").unit([](std::string_view) -> Unit { return Unit::parse("?"); }); }) ==
          "unit '?': column 1: expected a unit");
}
