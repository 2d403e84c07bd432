// A machine without drives, for tests of what runs it.
#pragma once

#include <string>

#include "dualdrive/machine.hpp"

// A table between two held pinions: thrown, it bounces from flank to flank.
inline dualdrive::Machine bouncing() {
    using namespace dualdrive;
    Machine m;
    for (const char* pinion : {"pinion_1", "pinion_2"}) m.add_body(pinion, true);
    m.add_body("table");
    for (const char* n : {"1", "2"})
        m.connect("mesh_" + std::string(n), "pinion_" + std::string(n), "table", ConnectionKind::gap,
                  TwistFrame::driver);
    m.set("meshes.gap", 1e-3);
    m.set("meshes.stiffness", 1e6);
    m.set("table.J", 100.0);
    m.set("table.b", 5.0);
    return m;
}
