// Laws of single parts, each a textbook line.
#pragma once

#include <algorithm>
#include <cmath>

namespace blind {

inline double sign(double v) { return (v > 0) - (v < 0); }
inline double clamp(double v, double limit) { return std::clamp(v, -limit, limit); }

// From 0 to 1, smooth at both ends.
inline double ease(double u) {
    u = std::clamp(u, 0.0, 1.0);
    return u * u * (3 - 2 * u);
}

// Harmonics, not computed where they are not there.
inline double wave(double amplitude, double angle) { return amplitude == 0 ? 0 : amplitude * std::sin(angle); }
inline double cowave(double amplitude, double angle) { return amplitude == 0 ? 0 : amplitude * std::cos(angle); }

// Deflection beyond the flank of a play of half width `gap`.
inline double dead_zone(double x, double gap) { return x > gap ? x - gap : (x < -gap ? x + gap : 0); }

// Spring and damper behind a play; a flank pushes and never pulls.
inline double contact(double force, double damping, double beyond) {
    if (beyond > 0) return std::max(0.0, force + damping);
    if (beyond < 0) return std::min(0.0, force + damping);
    return 0;
}

// Level of dry friction while moving in direction `d` at speed w (Armstrong-Helouvry 1994).
inline double dry_level(double torque, double asymmetry, double ratio, double speed, double d, double w) {
    if (torque == 0) return 0;
    double rise = ratio > 1 ? (ratio - 1) * std::exp(-(w / speed) * (w / speed)) : 0;
    return torque * (1 + asymmetry * d) * (1 + rise);
}

// LuGre (Canudas de Wit 1995): rate of the bristle z, and friction torque.
struct Lugre {
    double torque, ratio, speed, stiffness, damping;
    double rate(double z, double w) const {
        double g = torque * (1 + (ratio - 1) * std::exp(-(w / speed) * (w / speed)));
        return w - stiffness * std::abs(w) * z / g;
    }
    double friction(double z, double w) const { return stiffness * z + damping * rate(z, w); }
};

}  // namespace blind
