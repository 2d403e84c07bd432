// The method of order 5 with an error estimate of order 4 by Dormand and Prince, and its continuous extension of order 4:
// coefficients, by stage. For steps that must be short whatever a law does: less than half the work of dop853.hpp, whose
// terms these are: the rate at the step's end stands at the same place.
//
// Source: Hairer, Nørsett, Wanner, "Solving Ordinary Differential Equations I", 2nd ed., Springer 1993, § II.5 and II.6;
// Dormand, Prince, "A family of embedded Runge-Kutta formulae", J. Comp. Appl. Math. 6 (1980). tests/cpp/test_explicit_coefficients.cpp
// holds every coefficient to the conditions of order.
#pragma once

#include "dop853.hpp"

namespace dualdrive::dopri5 {

using dop853::last;
using dop853::Row;

inline constexpr std::size_t stages = 6;  // before the rate at the end
inline constexpr int order = 5, dense_order = 4;

inline constexpr std::array<double, stages> c{0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0};

inline constexpr Row<1> a1{{{0, 1.0 / 5.0}}};
inline constexpr Row<2> a2{{{0, 3.0 / 40.0}, {1, 9.0 / 40.0}}};
inline constexpr Row<3> a3{{{0, 44.0 / 45.0}, {1, -56.0 / 15.0}, {2, 32.0 / 9.0}}};
inline constexpr Row<4> a4{{{0, 19372.0 / 6561.0}, {1, -25360.0 / 2187.0}, {2, 64448.0 / 6561.0}, {3, -212.0 / 729.0}}};
inline constexpr Row<5> a5{
    {{0, 9017.0 / 3168.0}, {1, -355.0 / 33.0}, {2, 46732.0 / 5247.0}, {3, 49.0 / 176.0}, {4, -5103.0 / 18656.0}}};
inline constexpr Row<5> b{
    {{0, 35.0 / 384.0}, {2, 500.0 / 1113.0}, {3, 125.0 / 192.0}, {4, -2187.0 / 6784.0}, {5, 11.0 / 84.0}}};

// Weights of the estimate of order 4.
inline constexpr Row<6> error_4{{{0, 71.0 / 57600.0},
                                 {2, -71.0 / 16695.0},
                                 {3, 71.0 / 1920.0},
                                 {4, -17253.0 / 339200.0},
                                 {5, 22.0 / 525.0},
                                 {last, -1.0 / 40.0}}};

// The highest coefficient of the extension.
inline constexpr Row<6> d0{{{0, -12715105075.0 / 11282082432.0},
                            {2, 87487479700.0 / 32700410799.0},
                            {3, -10690763975.0 / 1880347072.0},
                            {4, 701980252875.0 / 199316789632.0},
                            {5, -1453857185.0 / 822651844.0},
                            {last, 69997945.0 / 29380423.0}}};

}  // namespace dualdrive::dopri5
