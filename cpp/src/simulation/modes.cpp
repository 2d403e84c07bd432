// Which mode an element has in a state, and which follows when a guard of it has fallen.
#include <algorithm>
#include <cmath>

#include "mode_rules.hpp"
#include "simulation.hpp"

namespace dualdrive {

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

Mode Simulation::standing_mode(int element) {
    return dualdrive::standing_mode(layout_, model_, z_scratch_.data(), element,
                                    modes_[static_cast<std::size_t>(element)]);
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
    const double held = block_rates(solver_->time(), solver_->state().data(), static_cast<int>(b))[b];
    evaluate(solver_->time(), solver_->state().data());
    return limiter_mode_after(model_.block(static_cast<int>(b)), layout_.blocks[b].integrator >= 0, from, which, held);
}

Mode Simulation::next_mode(int element, int which) {
    const Switch& s = layout_.switches[static_cast<std::size_t>(element)];
    if (s.kind == SwitchKind::limiter)
        return next_limiter_mode(static_cast<std::size_t>(s.index), modes_[static_cast<std::size_t>(element)], which);
    evaluate(solver_->time(), solver_->state().data());
    return mode_after(layout_, model_, element, which, modes_[static_cast<std::size_t>(element)]);
}

}  // namespace dualdrive
