#include <algorithm>
#include <stdexcept>

#include "dualdrive/effects.hpp"
#include "dualdrive/model.hpp"
#include "model/curve.hpp"
#include "model/formula.hpp"

// The laws again, on scalars that leave a trace; beside model.cpp, so that both are compiled at once.
#include "model/assembly.ipp"
#include "model/control.ipp"
#include "model/guards.ipp"
#include "model/mechanics.ipp"

namespace dualdrive {

template class Model<Traced>;
template class Model<TracedGradient>;

}  // namespace dualdrive
