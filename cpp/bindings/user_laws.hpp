// Coordinates of a learned curve and recorded columns of a user's law, as plain Python tuples.
#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "dualdrive/machine.hpp"

namespace dualdrive::python {

using Axes = std::vector<std::tuple<std::string, double, double, int, bool>>;  // coordinate, low, high, knots, periodic
using Columns = std::vector<std::tuple<std::string, std::string>>;             // name, unit

inline std::vector<CurveAxis> axes_of(const Axes& list) {
    std::vector<CurveAxis> axes;
    for (const auto& [coordinate, low, high, knots, periodic] : list)
        axes.push_back({coordinate, low, high, knots, periodic});
    return axes;
}

inline Axes axes_from(const std::vector<CurveAxis>& axes) {
    Axes list;
    for (const auto& a : axes) list.emplace_back(a.coordinate, a.low, a.high, a.knots, a.periodic);
    return list;
}

inline std::vector<Column> columns_of(const Columns& list) {
    std::vector<Column> columns;
    for (const auto& [name, unit] : list) columns.push_back({name, unit});
    return columns;
}

inline Columns columns_from(const std::vector<Column>& columns) {
    Columns list;
    for (const auto& c : columns) list.emplace_back(c.name, c.unit);
    return list;
}

}  // namespace dualdrive::python
