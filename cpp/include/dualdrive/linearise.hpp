// The machine as a linear system while its modes are frozen: ż = A z + a, signals = C z + c.
//
// Exact where the machine is affine (plant, controller, contacts, limits, Coulomb friction); elsewhere the tangent at
// the given state. A'(s) and C(s) v of Eq. 23 are one instance: the rows of C named ω_c1, ω_c2, θ_c1, θ_c2, I_1, I_2,
// θ_m, ω_m turn the core's states (twists) into the paper's (angles).
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dualdrive/machine.hpp"
#include "dualdrive/signal.hpp"

namespace dualdrive {

struct LinearSystem {
    std::vector<std::string> states, signals;
    std::vector<double> A, a;  // states × states row-major, states
    std::vector<double> C, c;  // signals × states row-major, signals
};

// modes: element -> mode by name, as events report them; those not named are gap, stuck, linear, positive.
// state: values of states, others 0. Delayed signals are taken as not delayed.
// Errors: std::invalid_argument naming an element, mode or state that the machine does not have.
LinearSystem linearise(const Machine& machine, const Inputs& inputs, const std::map<std::string, std::string>& modes,
                       const std::map<std::string, double>& state, double t = 0.0);

// The laws of frozen modes at one instant. guards: two per switching element, positive while its mode lasts.
struct FrozenLaws {
    std::vector<double> rates, guards, guard_slopes;
};

// What they are taken from: the model itself, or the matrices that stand in for it where a machine is affine. The model
// gives no slopes.
enum class LawsOf { model, matrices };

// t lies in the cell, between two knots of the inputs or at one of them. Arguments and errors else as for
// linearise; std::invalid_argument besides for the matrices of a machine that is not affine.
FrozenLaws frozen_laws(const Machine& machine, const Inputs& inputs, const std::map<std::string, std::string>& modes,
                       const std::map<std::string, double>& state, double t, const Cell& cell, LawsOf of);

// Every switching element of a machine, and the modes it may have.
std::map<std::string, std::vector<std::string>> possible_modes(const Machine& machine, const Inputs& inputs);

}  // namespace dualdrive
