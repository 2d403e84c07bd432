// Small things the files of a run share.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>

namespace dualdrive {

// Times nearer than this are one time.
inline double instant(double t) { return 1e-12 * std::max(1.0, std::abs(t)); }
// What rounding leaves of a difference of times: in an instant a fast motion moves by more.
inline double rounding_of(double t) {
    return 16.0 * std::numeric_limits<double>::epsilon() * std::max(1.0, std::abs(t));
}

inline std::string text(double v) {
    std::ostringstream s;
    s.precision(9);
    s << v;
    return s.str();
}

}  // namespace dualdrive
