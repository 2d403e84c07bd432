// What the exponential engine leaves for the way back.
#pragma once

#include <memory>
#include <vector>

#include "../tape.hpp"
#include "../unseen_laws.hpp"
#include "dualdrive/signal.hpp"
#include "dualdrive/switching.hpp"
#include "propagators.hpp"

namespace dualdrive::exponential {

// The linear part of the machine in these modes, and where it touches the laws.
struct Tangent {
    Modes modes;
    double t;
    std::vector<double> z;
    Propagators propagators;
};

// A step over all nodes, used up to `end`. The tape has y at the nodes with it, then the rest there.
struct Step {
    std::shared_ptr<Tangent> tangent;
    Cell cell;
    int level;
    double origin, delta, end;
};

struct Steps {
    Tape& tape;
    BentRows bent;  // driven, whatever the run shows of them
    UnseenLaws unseen;
    std::vector<Step> taken;
};

}  // namespace dualdrive::exponential
