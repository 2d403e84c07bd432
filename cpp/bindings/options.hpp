// Options of a run by the names that Python gives them.
#pragma once

#include <stdexcept>
#include <string>

#include "dualdrive/solver.hpp"

namespace dualdrive::python {

inline Method method_of(const std::string& name) {
    if (name == "auto") return Method::automatic;
    if (name == "adams") return Method::adams;
    if (name == "bdf") return Method::bdf;
    throw std::invalid_argument("method = '" + name + "' is unknown; choose one of auto, adams, bdf");
}

inline Engine engine_of(const std::string& name) {
    if (name == "auto") return Engine::automatic;
    if (name == "exact") return Engine::exact;
    if (name == "exponential") return Engine::exponential;
    if (name == "explicit") return Engine::explicit_rk;
    if (name == "cvode") return Engine::cvode;
    throw std::invalid_argument("engine = '" + name +
                                "' is unknown; "
                                "choose one of auto, exact, exponential, explicit, cvode");
}

}  // namespace dualdrive::python
