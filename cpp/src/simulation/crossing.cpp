// Which guards fell in the last step, and when first.
//
// CVODE compares guards at the two ends of a step: it misses a guard crossed twice within it, and one that starts at
// zero and falls at once. Both are looked for here, on the solver's own interpolant, with the guards at the middle of
// the step besides; a step that holds a missed crossing is taken back to it. A solver of longer steps asks for more looks
// inside, and may leave its crossings to be found here altogether.
#include <algorithm>
#include <cmath>
#include <limits>

#include "simulation.hpp"

namespace dualdrive {

namespace {

constexpr double rounding = 1e-10;  // of a guard's scale: what lies less below zero is none
constexpr double near_zero = 0.05;  // of a guard's larger end value: a parabola that dips below is followed exactly
constexpr int dip_passes = 12, narrowings = 100;

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
    watch(to, solver_->state().data(), guard_end_, slope_end_);
    if (nothing_can_dip(to - from) || solver_->keeps_off_guards()) {
        std::swap(guard_begin_, guard_end_);
        std::swap(slope_begin_, slope_end_);
        return fallen;
    }
    const auto looks = static_cast<std::size_t>(solver_->looks());
    if (guard_inside_.size() < looks) guard_inside_.resize(looks, guard_end_);
    const double apart = (to - from) / static_cast<double>(looks + 1);
    for (std::size_t k = 0; k < looks; ++k) {
        const std::size_t j = (looks / 2 + k) % looks;  // the middle first: the solver may have been there last
        const double t = from + static_cast<double>(j + 1) * apart;
        solver_->state_at(t, z_scratch_.data());
        guards(t, z_scratch_.data(), guard_inside_[j].data());
    }
    Crossing first{std::numeric_limits<double>::infinity(), -1};
    for (std::size_t k = 0; k < guard_end_.size(); ++k) {
        if (std::find(fallen.begin(), fallen.end(), static_cast<int>(k)) != fallen.end()) continue;
        bool found = false;
        for (std::size_t j = 0; j < looks && !found; j += 2) {
            const double begin = from + static_cast<double>(j) * apart;
            const Glimpse seen{{begin, begin + apart, j + 2 > looks ? to : begin + 2.0 * apart},
                               {j == 0 ? guard_begin_[k] : guard_inside_[j - 1][k], guard_inside_[j][k],
                                j + 2 > looks ? guard_end_[k] : guard_inside_[j + 1][k]}};
            found = !stays_positive(seen.g[0], seen.g[1], seen.g[2]) && find_missed(k, seen, first);
        }
    }
    if (first.guard >= 0) {
        fallen = {first.guard};
        solver_->go_back(first.t);
    } else {
        std::swap(guard_begin_, guard_end_);
        std::swap(slope_begin_, slope_end_);
    }
    return fallen;
}

void Simulation::watch(double t, const double* z, std::vector<double>& g, std::vector<double>& slope) {
    guards(t, z, g.data());
    if (field_) field_->guard_slopes(slope.data());
}

// Short steps of a machine whose slopes are known: for every guard the cubic through values and slopes at both ends has
// only positive Bernstein coefficients.
bool Simulation::nothing_can_dip(double span) const {
    if (!field_ || guard_inside_.size() > 1) return false;
    double lowest = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < guard_end_.size(); ++k) {
        const double begin = guard_begin_[k], end = guard_end_[k];
        lowest = std::min({lowest, begin, begin + span / 3.0 * slope_begin_[k], end - span / 3.0 * slope_end_[k], end});
    }
    return lowest > 0;
}

// Whether a guard crosses between three looks at it; noted if that comes before `first`.
bool Simulation::find_missed(std::size_t guard, Glimpse seen, Crossing& first) {
    auto& [x, g] = seen;
    const double a = g[0], m = g[1], b = g[2], to = x[2], middle = x[1];
    double above = x[0], under = 0.0;
    bool found = false;
    const auto below = [&](double t, double value) {
        if (found || value >= 0) {
            if (!found) above = t;
            return;
        }
        const int element = static_cast<int>(guard) / guards_per_switch,
                  which = static_cast<int>(guard) % guards_per_switch;
        evaluate(solver_->time(), solver_->state().data());
        if (value > -rounding * guard_scale(element, which)) return;
        under = t;
        found = true;
    };
    below(middle, m);
    // Between the three points: follow a parabola's lowest point down.
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
    if (!found) return false;
    if (above >= first.t) return true;
    const double t = locate(guard, std::min(above, under), under);
    if (t < first.t) first = {t, static_cast<int>(guard)};
    return true;
}

double Simulation::guard_at(std::size_t guard, double t) {
    solver_->state_at(t, z_scratch_.data());
    guards(t, z_scratch_.data(), guard_probe_.data());
    return guard_probe_[guard];
}

// The first time at which the guard is below zero, to rounding of the time: halving, and inverse quadratic interpolation
// where that is safe (Chandrupatla, Advances in Engineering Software 28 (1997) 145–149).
double Simulation::locate(std::size_t guard, double above, double under) {
    struct Point {
        double t, g;
    };
    const double enough = 4.0 * std::numeric_limits<double>::epsilon() * std::max(std::abs(above), std::abs(under));
    Point a{under, guard_at(guard, under)}, b{above, std::max(guard_at(guard, above), 0.0)};
    double share = 0.5;
    for (int k = 0; k < narrowings && std::abs(a.t - b.t) > enough; ++k) {
        const double t = a.t + share * (b.t - a.t);
        const Point p{t, guard_at(guard, t)};
        const bool same_side = (p.g < 0) == (a.g < 0);
        const Point c = same_side ? a : b;
        if (!same_side) b = a;
        a = p;
        const double xi = (a.t - b.t) / (c.t - b.t), phi = (a.g - b.g) / (c.g - b.g);
        const bool smooth = phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi;
        share = smooth ? a.g / (b.g - a.g) * c.g / (b.g - c.g) +
                             (c.t - a.t) / (b.t - a.t) * a.g / (c.g - a.g) * b.g / (c.g - b.g)
                       : 0.5;
        const double edge = 0.5 * enough / std::abs(b.t - a.t);
        share = std::clamp(share, std::min(edge, 0.5), 1.0 - std::min(edge, 0.5));
    }
    return a.g < 0 ? a.t : b.t;
}

}  // namespace dualdrive
