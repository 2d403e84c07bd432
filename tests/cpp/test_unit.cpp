#include <doctest/doctest.h>

#include "dualdrive/unit.hpp"
#include "refusal.hpp"

using dualdrive::Unit;

namespace {

bool same(const char* a, const char* b) { return Unit::parse(a) == Unit::parse(b); }

}  // namespace

TEST_CASE("derived units are what the SI brochure says of base units") {
    CHECK(same("N", "kg*m/s^2"));
    CHECK(same("J", "N*m"));
    CHECK(same("W", "J/s"));
    CHECK(same("Pa", "N/m^2"));
    CHECK(same("Hz", "1/s"));
    CHECK(same("V", "W/A"));
    CHECK(same("ohm", "V/A"));
    CHECK(same("F", "C/V"));
    CHECK(same("C", "A*s"));
    CHECK(same("Wb", "V*s"));
    CHECK(same("H", "Wb/A"));
    CHECK(same("T", "Wb/m^2"));
    CHECK_FALSE(same("V", "A"));
    CHECK_FALSE(same("K", "1"));
}

TEST_CASE("the radian is the number one, so that the laws of rotation hold") {
    CHECK(same("kg*m^2*rad/s^2", "N*m"));   // J α = T
    CHECK(same("N*m*s/rad*rad/s", "N*m"));  // b ω = T
    CHECK(same("N*m/A", "V*s/rad"));        // K_d = C_e
    CHECK(same("N*m*rad/s", "W"));          // T ω = P
    CHECK(Unit::parse("rad").is_number());
}

TEST_CASE("products, quotients, powers and parentheses are read from left to right") {
    CHECK(same("N/m/s", "N/(m*s)"));
    CHECK(same("N/m*s", "N*s/m"));
    CHECK(same("m^-2", "1/m^2"));
    CHECK(same("(m/s)^2", "m^2/s^2"));
    CHECK(same("kg*m**2", "kg * m ^ 2"));
    CHECK(same("s^0.5", "s/s^0.5"));
    CHECK(same("", "1"));
    CHECK(same(" ", "rad/rad"));
    CHECK(Unit::parse("m").power(1.0 / 3.0).power(3.0) == Unit::parse("m"));
}

TEST_CASE("a unit is told by its usual name, else by base units") {
    CHECK(Unit::parse("J").text() == "N*m");
    CHECK(Unit::parse("kg*m^2").text() == "kg*m^2");
    CHECK(Unit::parse("rad/s").text() == "1/s");
    CHECK(Unit::parse("rad").text() == "1");
    CHECK(Unit::parse("V*s/rad").text() == "N*m/A");
    CHECK(Unit::parse("s^0.5*A/m^3").text() == "s^0.5*A/m^3");
}

TEST_CASE("malformed units are refused with column and rule") {
    CHECK(refusal([] { Unit::parse("N*m/rpm"); }) ==
          "unit 'N*m/rpm': column 5: 'rpm' is no coherent SI unit known here "
          "(kg m s A K rad N J W Pa Hz V ohm F H C Wb T)");
    CHECK(contains(refusal([] { Unit::parse("N*"); }), "column 3: expected a unit"));
    CHECK(contains(refusal([] { Unit::parse("N m"); }), "column 3: expected '*', '/' or '^'"));
    CHECK(contains(refusal([] { Unit::parse("(N*m"); }), "column 5: expected ')'"));
    CHECK(contains(refusal([] { Unit::parse("m^"); }), "column 3: expected an exponent"));
    CHECK(contains(refusal([] { Unit::parse("m^nan"); }), "expected an exponent"));
    CHECK(contains(refusal([] { Unit::parse("m^1000"); }), "expected an exponent, at most 100"));
    CHECK(contains(refusal([] { Unit::parse("2*m"); }), "column 1: expected a unit"));
    CHECK(contains(refusal([] { Unit::parse(std::string(500, '(')); }), "nested too deeply"));
    CHECK(contains(refusal([] { Unit::parse("µm"); }), "column 1: expected a unit"));
}
