// A declared number as Python sees it, with the value it has in a machine or by default.
#pragma once

#include <string>

namespace dualdrive::python {

struct Parameter {
    std::string path, unit, doc;
    double low, high;
    bool low_excluded;
    double standard, typical, value;
    bool counted;
};

}  // namespace dualdrive::python
