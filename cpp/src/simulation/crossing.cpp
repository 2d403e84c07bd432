// Which guards fell in the last step, and when first.
//
// CVODE compares guards at the two ends of a step: it misses a guard crossed twice within it, and one that starts at
// zero and falls at once. Both are looked for here, on the solver's own interpolant, with the guards at the middle of
// the step besides; a step that holds a missed crossing is taken back to it.
#include <algorithm>
#include <cmath>
#include <limits>

#include "simulation.hpp"

namespace dualdrive {

namespace {

constexpr double rounding = 1e-10;  // of a guard's scale: what lies less below zero is none
constexpr double near_zero = 0.05;  // of a guard's larger end value: a parabola that dips below is followed exactly
constexpr int dip_passes = 12, bisections = 100;

// Positive at both ends and in the middle, and the parabola through them has no lowest point in between.
bool stays_positive(double a, double m, double b) {
    return a > 0 && m > 0 && b > 0 && std::abs(b - a) >= 2.0 * (a - 2.0 * m + b);
}

}  // namespace

std::vector<int> Simulation::fallen_guards(Solver::Outcome outcome) {
    std::vector<int> fallen;
    if (outcome == Solver::Outcome::root) {
        const auto roots = solver_->roots();
        for (std::size_t k = 0; k < roots.size(); ++k)
            if (roots[k] != 0) fallen.push_back(static_cast<int>(k));
    }
    const double from = solver_->previous_time(), to = solver_->time();
    if (guard_end_.empty() || !(to > from) || solver_->finds_every_root()) return fallen;
    const double middle = from + 0.5 * (to - from);
    guards(to, solver_->state().data(), guard_end_.data());
    solver_->state_at(middle, z_scratch_.data());
    guards(middle, z_scratch_.data(), guard_middle_.data());
    Crossing first{std::numeric_limits<double>::infinity(), -1};
    for (std::size_t k = 0; k < guard_end_.size(); ++k) {
        if (stays_positive(guard_begin_[k], guard_middle_[k], guard_end_[k])) continue;
        const bool flagged = std::find(fallen.begin(), fallen.end(), static_cast<int>(k)) != fallen.end();
        if (!flagged) find_missed(k, first);
    }
    if (first.guard >= 0) {
        fallen = {first.guard};
        solver_->go_back(first.t);
    } else {
        std::swap(guard_begin_, guard_end_);
    }
    return fallen;
}

// A guard's crossing within the last step that CVODE did not report, if it comes before `first`.
void Simulation::find_missed(std::size_t guard, Crossing& first) {
    const double a = guard_begin_[guard], m = guard_middle_[guard], b = guard_end_[guard];
    const double from = solver_->previous_time(), to = solver_->time();
    double above = from, under = 0.0;
    bool found = false;
    const auto below = [&](double t, double g) {
        if (found || g >= 0) {
            if (!found) above = t;
            return;
        }
        const int element = static_cast<int>(guard) / guards_per_switch,
                  which = static_cast<int>(guard) % guards_per_switch;
        if (g > -rounding * guard_scale(element, which)) return;
        under = t;
        found = true;
    };
    below(from + 0.5 * (to - from), m);
    // Between the three points: follow a parabola's lowest point down.
    double x[3] = {from, from + 0.5 * (to - from), to}, g[3] = {a, m, b};
    for (int pass = 0; pass < dip_passes && !found && a > 0 && m > 0 && b > 0; ++pass) {
        const double left = (g[1] - g[0]) / (x[1] - x[0]), right = (g[2] - g[1]) / (x[2] - x[1]);
        const double curvature = (right - left) / (x[2] - x[0]);
        if (!(curvature > 0)) break;
        const double lowest = 0.5 * (x[0] + x[1]) - 0.5 * left / curvature;
        const double depth = g[0] + (lowest - x[0]) * (left + curvature * (lowest - x[1]));
        if (!(lowest > x[0] && lowest < x[2]) || depth > near_zero * std::max(a, b)) break;
        const double value = guard_at(guard, lowest);
        if (value < 0) below(lowest, value);
        if (found || std::abs(lowest - x[1]) < 1e-3 * (x[2] - x[0])) break;
        const bool left_half = lowest < x[1];
        if (value < g[1]) {
            x[left_half ? 2 : 0] = x[1], g[left_half ? 2 : 0] = g[1];
            x[1] = lowest, g[1] = value;
        } else {
            x[left_half ? 0 : 2] = lowest, g[left_half ? 0 : 2] = value;
        }
    }
    below(to, b);
    if (!found || above >= first.t) return;
    const double t = locate(guard, std::min(above, under), under);
    if (t < first.t) first = {t, static_cast<int>(guard)};
}

double Simulation::guard_at(std::size_t guard, double t) {
    solver_->state_at(t, z_scratch_.data());
    guards(t, z_scratch_.data(), guard_probe_.data());
    return guard_probe_[guard];
}

// The first time at which the guard is below zero, to rounding of the time.
double Simulation::locate(std::size_t guard, double above, double under) {
    const double enough = 4.0 * std::numeric_limits<double>::epsilon() * std::max(std::abs(above), std::abs(under));
    for (int k = 0; k < bisections && under - above > enough; ++k) {
        const double middle = above + 0.5 * (under - above);
        (guard_at(guard, middle) < 0 ? under : above) = middle;
    }
    return under;
}

}  // namespace dualdrive
