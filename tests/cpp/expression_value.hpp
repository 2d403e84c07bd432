// The value of a formula at named numbers.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "dualdrive/expression.hpp"

namespace dualdrive {

using Values = std::map<std::string, double, std::less<>>;
using Branches = std::vector<std::int8_t>;

inline std::vector<double> slots_of(const Expression& e, const Values& values) {
    std::vector<double> slots;
    for (const std::string& name : e.names()) slots.push_back(values.at(name));
    return slots;
}

// With every switch on the branch that is right at these values.
inline double value(const std::string& text, const Values& values = {}) {
    const Expression e = Expression::parse(text);
    const std::vector<double> slots = slots_of(e, values);
    Branches branches(static_cast<std::size_t>(e.switches()));
    e.decide(slots.data(), branches.data());
    return e.evaluate(slots.data(), branches.data());
}

}  // namespace dualdrive
