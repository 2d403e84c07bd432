// Which mode an element has in a state, and which follows when a guard of it has fallen.
#include <algorithm>
#include <cmath>

#include "simulation.hpp"

namespace dualdrive {

namespace {

constexpr double at_limit = 1e-6;  // of a limit: nearer than this a limited quantity stands on it

}  // namespace

// The size of a guard where it matters, so that rounding can be told from a violated mode.
double Simulation::guard_scale(int element, int which) const {
    const Switch& s = layout_.switches[static_cast<std::size_t>(element)];
    const auto k = static_cast<std::size_t>(s.index);
    const Mode m = modes_[static_cast<std::size_t>(element)];
    switch (s.kind) {
        case SwitchKind::flank: {
            const bool in_torque = flank::carries(m) || (m != flank::gap && which == 1);
            return in_torque ? model_.stiffness(k) * model_.gap(k) : model_.gap(k);
        }
        case SwitchKind::stick:
            return m == stick::stuck ? model_.friction_limit(s.index, 1) + model_.friction_limit(s.index, -1)
                   : scale_.empty()  ? 1e-6
                                     : scale_[k];
        case SwitchKind::limiter: {
            const Block<double>& b = model_.block(s.index);
            if (limiter::riding(m)) return std::abs(b.gain * b.integrand);
            const bool on_integrand = limiter::saturated(m) && which == 1;
            return on_integrand ? b.limit / std::max(b.gain, 1e-300) : b.limit;
        }
        case SwitchKind::branch:
            return 1e-3;
    }
    return 1.0;
}

// The mode an element has in a state that nothing led to: the start of a run, or what a break left.
Mode Simulation::standing_mode(int element) {
    const Switch& s = layout_.switches[static_cast<std::size_t>(element)];
    const auto k = static_cast<std::size_t>(s.index);
    const Mode m = modes_[static_cast<std::size_t>(element)];
    switch (s.kind) {
        case SwitchKind::flank: {
            const double x = model_.signals()[static_cast<std::size_t>(layout_.at.deflection[k])];
            if (x > model_.gap(k)) return m == flank::front_parting ? m : flank::front;
            if (x < -model_.gap(k)) return m == flank::back_parting ? m : flank::back;
            return flank::gap;
        }
        case SwitchKind::stick: {
            const double speed = z_scratch_[k], torque = model_.group_torque(s.index);
            if (speed != 0.0) return speed > 0 ? stick::forward : stick::backward;
            if (torque > model_.friction_limit(s.index, 1)) return stick::forward;
            return torque < -model_.friction_limit(s.index, -1) ? stick::backward : stick::stuck;
        }
        case SwitchKind::limiter: {
            const Block<double>& b = model_.block(s.index);
            if (std::abs(b.raw) <= b.limit) return limiter::linear;
            const int side = b.raw > 0 ? 1 : -1;
            return static_cast<Mode>(side * (side * b.integrand >= 0 ? 1 : 2));
        }
        case SwitchKind::branch: {
            std::vector<double> g(modes_.size() * guards_per_switch);
            return model_.guard(element, 0, nullptr) >= 0 ? m : static_cast<Mode>(-m);
        }
    }
    return m;
}

void Simulation::classify() {
    for (int pass = 0; pass < settle_passes; ++pass) {
        bool changed = false;
        for (std::size_t e = 0; e < modes_.size(); ++e) {
            evaluate(options_.start, z_scratch_.data());
            const Mode m = standing_mode(static_cast<int>(e));
            changed = changed || m != modes_[e];
            modes_[e] = m;
        }
        if (!changed) return;
    }
}

Mode Simulation::next_limiter_mode(std::size_t b, Mode from, int which) {
    // d(raw)/dt with the integrator held, and with it running: conditional integration slides along its limit where the
    // first points inward and the second outward.
    const double held = block_rates(solver_->time(), solver_->state().data(), static_cast<int>(b))[b];
    evaluate(solver_->time(), solver_->state().data());
    const Block<double>& block = model_.block(static_cast<int>(b));
    const bool integrates = layout_.blocks[b].integrator >= 0;
    // A jump of the command carries raw away from the limit: nothing to slide along there.
    const auto rides = [&](int side, bool inward) {
        return integrates && std::abs(side * block.raw - block.limit) < at_limit * block.limit && inward &&
               side * (held + block.gain * block.integrand) > 0;
    };
    const auto saturated = [&](int side) {
        return static_cast<Mode>(side * (side * block.integrand >= 0 || !integrates ? 1 : 2));
    };
    const int side = from == limiter::linear ? (which == 0 ? 1 : -1) : limiter::side(from);
    if (from == limiter::linear) return rides(side, side * held < 0) ? static_cast<Mode>(3 * side) : saturated(side);
    if (limiter::riding(from)) return which == 0 ? static_cast<Mode>(side) : limiter::linear;
    if (which == 1) return static_cast<Mode>(limiter::integrates(from) ? side : 2 * side);
    // It falls away from its limit with the integrator held, even where that begins with no rate at all.
    const bool inward = !limiter::integrates(from) || side * held < 0;
    return rides(side, inward) ? static_cast<Mode>(3 * side) : limiter::linear;
}

// What follows when a guard of the present mode has fallen through zero. Taken from the guard, not from re-evaluating
// the state: the solver returns the far side of its bracket.
Mode Simulation::next_mode(int element, int which) {
    const Switch& s = layout_.switches[static_cast<std::size_t>(element)];
    const auto k = static_cast<std::size_t>(s.index);
    const Mode m = modes_[static_cast<std::size_t>(element)];
    switch (s.kind) {
        case SwitchKind::flank: {
            if (m == flank::gap) return which == 0 ? flank::front : flank::back;
            const auto side = static_cast<Mode>(flank::side(m));
            if (!flank::carries(m)) return which == 0 ? flank::gap : side;
            if (layout_.effects_on_mesh[k].empty()) return flank::gap;
            evaluate(solver_->time(), solver_->state().data());
            const double x = model_.signals()[static_cast<std::size_t>(layout_.at.deflection[k])];
            return side * x > model_.gap(k) * (1.0 + 1e-9) ? static_cast<Mode>(2 * side) : flank::gap;
        }
        case SwitchKind::stick: {
            if (m == stick::stuck) return which == 0 ? stick::forward : stick::backward;
            // Its speed has come to zero: the torque, less the friction it slid under, points away from where it slid.
            // Where the two are equal, as after a long creep, rounding would deny this; were it heard, the body would
            // slide on the way its guard has just ended, and the guard fall again at the same instant. Without any friction
            // it turns.
            evaluate(solver_->time(), solver_->state().data());
            const Mode other = static_cast<Mode>(-m);
            const double away = std::max(other * model_.group_torque(s.index), -model_.friction_limit(s.index, m));
            return away >= model_.friction_limit(s.index, other) ? other : stick::stuck;
        }
        case SwitchKind::limiter:
            return next_limiter_mode(k, m, which);
        case SwitchKind::branch:
            return static_cast<Mode>(-m);
    }
    return m;
}

}  // namespace dualdrive
