// Named quantities of a machine, and what drives it from outside.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dualdrive/waveform.hpp"

namespace dualdrive {

struct SignalInfo {
    std::string name, unit, long_name;
};

// Known functions of time: theta_ref (commanded motion), T_load (opposes positive motion), U_n or T_n of a machine
// without controller, and any recorded column that a user's formula reads.
using Inputs = std::map<std::string, Waveform>;

// Where delayed signals come from: the solver's history of a signal.
template <class S>
class Past {
  public:
    virtual ~Past() = default;
    // Value of delay line `line` at time t, which lies behind the solver.
    virtual S at(int line, const S& t, const Cell& cell) const = 0;
};

}  // namespace dualdrive
