// Which mode an element has, read off the model as it was last evaluated: at a state that nothing led to, and after a guard
// fell. Whoever integrates, a simulation or a predictor, asks here.
#pragma once

#include "dualdrive/model.hpp"

namespace dualdrive {

// A saturated block's mode on the side ±1: frozen while it is driven outward, unwinding else.
inline Mode saturated_mode(const Block<double>& block, int side) {
    return static_cast<Mode>(side * (side * block.integrand >= 0 ? 1 : 2));
}

// The mode of an element at state z that nothing led to: the start of a run, or what a break left. `model` was evaluated
// there in the mode `m`.
Mode standing_mode(const Layout& layout, const Model<double>& model, const double* z, int element, Mode m);

// What follows when a guard of mode `m` has fallen through zero; not for limiters, which may slide along their limit. Taken
// from the guard, not from the state alone: a solver may stand on the far side of its bracket.
Mode mode_after(const Layout& layout, const Model<double>& model, int element, int which, Mode m);

// The same of a limiter. held: d(raw)/dt with its own integrator held.
Mode limiter_mode_after(const Block<double>& block, bool integrates, Mode m, int which, double held);

// Where a break has carried the block of a riding limiter off its limit the ride is over: its integrator, which does not jump,
// does not make up for that. The guard that this is as good as; −1 where it still stands there, since guards of a ride are
// rates, and tell nothing of it.
int guard_off_limit(const Block<double>& block, Mode m);

// d(raw)/dt of every block where ż = rate, at (t, z): what riding guards ask for, and the rule above. `along` is evaluated there;
// z_along: room for the states.
void rates_of_blocks(Model<Gradient>& along, double t, const double* z, const double* rate,
                     const Model<Gradient>::Now& now, std::vector<Gradient>& z_along, std::vector<double>& found);

}  // namespace dualdrive
