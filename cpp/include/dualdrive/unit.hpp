// Units of quantities, as far as they decide whether a formula makes sense.
#pragma once

#include <array>
#include <string>
#include <string_view>

namespace dualdrive {

// A coherent SI unit as exponents of its base units. The radian is the number 1, as in the SI: kept as a dimension of its
// own it would refuse J·α = T (kg·m²·rad/s² against N·m) and r·φ = s, laws that every formula here is made of. A torque
// and an energy are therefore of one unit, and so are a speed in rad/s and a rate in 1/s.
class Unit {
  public:
    Unit() = default;  // of a pure number

    // Reads kg m s A K, rad, N J W Pa Hz V ohm F H C Wb T and 1, joined by * and /, raised by ^ or **, in parentheses:
    // "N*m*s/rad", "kg*m^2", "1/s"; an empty text is a pure number. Throws std::invalid_argument naming text, column and
    // rule; rpm, mm and the like are refused, as a formula computes in coherent units alone.
    static Unit parse(std::string_view text);

    bool is_number() const;
    Unit power(double exponent) const;
    // The shortest usual name where there is one ("N*m", "V"), else base units ("kg*m^2/s"); "1" for a pure number.
    std::string text() const;

    friend Unit operator*(const Unit& a, const Unit& b) { return a.times(b, 1.0); }
    friend Unit operator/(const Unit& a, const Unit& b) { return a.times(b, -1.0); }
    friend bool operator==(const Unit& a, const Unit& b);

  private:
    friend struct UnitSymbol;
    using Exponents = std::array<double, 5>;  // of kg, m, s, A, K; halves come from square roots
    constexpr explicit Unit(const Exponents& exponents) : exponents_(exponents) {}
    Unit times(const Unit& other, double exponent) const;
    std::string base_text() const;

    Exponents exponents_{};
};

}  // namespace dualdrive
