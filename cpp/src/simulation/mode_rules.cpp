#include "mode_rules.hpp"

#include <algorithm>
#include <cmath>

namespace dualdrive {

namespace {

constexpr double at_limit = 1e-6;  // of a limit: nearer than this a limited quantity stands on it

}  // namespace

Mode standing_mode(const Layout& layout, const Model<double>& model, const double* z, int element, Mode m) {
    const Switch& s = layout.switches[static_cast<std::size_t>(element)];
    const auto k = static_cast<std::size_t>(s.index);
    switch (s.kind) {
        case SwitchKind::flank: {
            const double x = model.signals()[static_cast<std::size_t>(layout.at.deflection[k])];
            if (x > model.gap(k)) return m == flank::front_parting ? m : flank::front;
            if (x < -model.gap(k)) return m == flank::back_parting ? m : flank::back;
            return flank::gap;
        }
        case SwitchKind::stick: {
            const double speed = z[k], torque = model.group_torque(s.index);
            if (speed != 0.0) return speed > 0 ? stick::forward : stick::backward;
            if (torque > model.friction_limit(s.index, 1)) return stick::forward;
            return torque < -model.friction_limit(s.index, -1) ? stick::backward : stick::stuck;
        }
        case SwitchKind::limiter: {
            const Block<double>& b = model.block(s.index);
            return std::abs(b.raw) <= b.limit ? limiter::linear : saturated_mode(b, b.raw > 0 ? 1 : -1);
        }
        case SwitchKind::branch:
            return model.guard(element, 0, nullptr) >= 0 ? m : static_cast<Mode>(-m);
    }
    return m;
}

Mode mode_after(const Layout& layout, const Model<double>& model, int element, int which, Mode m) {
    const Switch& s = layout.switches[static_cast<std::size_t>(element)];
    const auto k = static_cast<std::size_t>(s.index);
    switch (s.kind) {
        case SwitchKind::flank: {
            if (m == flank::gap) return which == 0 ? flank::front : flank::back;
            const auto side = static_cast<Mode>(flank::side(m));
            if (!flank::carries(m)) return which == 0 ? flank::gap : side;
            if (layout.effects_on_mesh[k].empty()) return flank::gap;
            const double x = model.signals()[static_cast<std::size_t>(layout.at.deflection[k])];
            return side * x > model.gap(k) * (1.0 + 1e-9) ? static_cast<Mode>(2 * side) : flank::gap;
        }
        case SwitchKind::stick: {
            if (m == stick::stuck) return which == 0 ? stick::forward : stick::backward;
            // Its speed has come to zero: the torque, less the friction it slid under, points away from where it slid.
            // Where the two are equal, as after a long creep, rounding would deny this; were it heard, the body would
            // slide on the way its guard has just ended, and the guard fall again at the same instant. Without any friction
            // it turns.
            const auto other = static_cast<Mode>(-m);
            const double away = std::max(other * model.group_torque(s.index), -model.friction_limit(s.index, m));
            return away >= model.friction_limit(s.index, other) ? other : stick::stuck;
        }
        case SwitchKind::branch:
            return static_cast<Mode>(-m);
        case SwitchKind::limiter:
            break;
    }
    return m;
}

// With the integrator held, and with it running: conditional integration slides along its limit where the first points inward
// and the second outward.
Mode limiter_mode_after(const Block<double>& block, bool integrates, Mode m, int which, double held) {
    // A jump of the command carries raw away from the limit: nothing to slide along there.
    const auto rides = [&](int side, bool inward) {
        return integrates && std::abs(side * block.raw - block.limit) < at_limit * block.limit && inward &&
               side * (held + block.gain * block.integrand) > 0;
    };
    const auto saturated = [&](int side) { return integrates ? saturated_mode(block, side) : static_cast<Mode>(side); };
    const int side = m == limiter::linear ? (which == 0 ? 1 : -1) : limiter::side(m);
    if (m == limiter::linear) return rides(side, side * held < 0) ? static_cast<Mode>(3 * side) : saturated(side);
    if (limiter::riding(m)) return which == 0 ? static_cast<Mode>(side) : limiter::linear;
    if (which == 1) return static_cast<Mode>(limiter::integrates(m) ? side : 2 * side);
    // It falls away from its limit with the integrator held, even where that begins with no rate at all.
    const bool inward = !limiter::integrates(m) || side * held < 0;
    return rides(side, inward) ? static_cast<Mode>(3 * side) : limiter::linear;
}

int guard_off_limit(const Block<double>& block, Mode m) {
    const double over = limiter::side(m) * block.raw - block.limit;
    if (std::abs(over) < at_limit * block.limit) return -1;
    return over > 0 ? 0 : 1;
}

void rates_of_blocks(Model<Gradient>& along, double t, const double* z, const double* rate,
                     const Model<Gradient>::Now& now, std::vector<Gradient>& z_along, std::vector<double>& found) {
    const Layout& layout = along.layout();
    z_along.resize(static_cast<std::size_t>(layout.size()));
    for (std::size_t k = 0; k < z_along.size(); ++k) {
        z_along[k] = Gradient(z[k]);
        z_along[k].slope[0] = rate[k];
    }
    along.evaluate(Gradient::variable(t, 0), z_along.data(), now);
    found.resize(layout.blocks.size());
    for (std::size_t b = 0; b < found.size(); ++b) found[b] = along.block(static_cast<int>(b)).raw.slope[0];
}

}  // namespace dualdrive
