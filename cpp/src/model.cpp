#include "dualdrive/model.hpp"

#include <algorithm>
#include <stdexcept>

#include "dualdrive/effects.hpp"
#include "model/curve.hpp"
#include "model/formula.hpp"

// The laws, by the part of the machine they belong to.
#include "model/assembly.ipp"
#include "model/control.ipp"
#include "model/guards.ipp"
#include "model/mechanics.ipp"

namespace dualdrive {

const char* const power_names[powers] = {"delivered", "conversion", "copper", "viscous", "effects", "mesh", "load"};

template class Model<double>;
template class Model<Gradient>;
template class Model<FineGradient>;

}  // namespace dualdrive
