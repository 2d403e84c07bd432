// Torque balance on a recorded trace: the machine's laws evaluated on measured motion, against measured motor torque.
//
// For traces whose controller is unknown (most CNC and drive logs) the plant must never be free-run from a measured
// current: it drifts. Here recorded angles, speeds and accelerations go into the same hooks that the simulation uses.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dualdrive/machine.hpp"

namespace dualdrive {

struct Balance {
    std::vector<std::string> equations;  // "total", then one per rigid group: its reference body
    std::vector<double> residual;        // equations × rows: J α + losses − motor torque, N·m in the group's frame
    std::vector<double> jacobian;        // equations × rows × parameters
    std::vector<char> standstill;        // equations × rows: dry friction is set-valued here
    std::vector<double> effects;         // effects × rows: torque of every effect
    std::vector<std::string> effect_names;
};

// channels: t, and per body theta_*, omega_*, alpha_* (SI, all of one length), T_n per motor, T_load and any column a
// formula reads. A body without channels moves rigidly with its neighbour. The "total" equation weighs every group by its
// speed per table speed, so that torques inside the machine cancel and need not be known; equations of single groups
// contain the mesh torque K dz(x) at the recorded twist.
// standstill: table speed (rad/s) below which dry friction counts as set-valued.
// Errors: std::invalid_argument naming the channel, row and rule.
Balance torque_balance(const Machine& machine, const std::map<std::string, std::vector<double>>& channels,
                       const std::vector<std::string>& parameters, double standstill);

}  // namespace dualdrive
