// Guards: positive while a mode is valid.

namespace dualdrive {

template <class S>
void Model<S>::guards(S* out, const S* block_rate) const {
    for (std::size_t e = 0; e < layout_.switches.size(); ++e)
        for (int which = 0; which < guards_per_switch; ++which)
            out[e * guards_per_switch + static_cast<std::size_t>(which)] =
                guard(static_cast<int>(e), which, block_rate);
}

// Zero where a mode ends. Of a mesh: x = ±Δ where a flank is met, the conditions of Eq. 18 and Eq. 19; and where it parts,
// its torque, which damping brings to zero before x comes back to ±Δ.
template <class S>
S Model<S>::guard(int element, int which, const S* block_rate) const {
    const Switch& s = layout_.switches[static_cast<std::size_t>(element)];
    const auto k = static_cast<std::size_t>(s.index);
    const Mode m = mode(element);
    const S unused(1.0);
    switch (s.kind) {
        case SwitchKind::flank: {
            const S& x = signal_[static_cast<std::size_t>(layout_.at.deflection[k])];
            const double side = flank::side(m);
            if (m == flank::gap) return which == 0 ? gap_[k] - x : x + gap_[k];
            if (flank::carries(m)) return which == 0 ? side * contact_torque_[k] : unused;  // a flank never pulls
            return which == 0 ? side * elongation_[k] : -side * contact_torque_[k];
        }
        case SwitchKind::stick: {
            if (m == stick::stuck) return which == 0 ? limit_forward_[k] - torque_[k] : torque_[k] + limit_backward_[k];
            return which == 0 ? double(m) * state_[s.index] : unused;
        }
        case SwitchKind::limiter: {
            const Block<S>& b = block_[k];
            const double side = limiter::side(m);
            if (value_of(b.limit) == infinity) return unused;
            if (m == limiter::linear) return which == 0 ? b.limit - b.raw : b.raw + b.limit;
            if (limiter::riding(m)) {
                if (!block_rate) return unused;
                return which == 0 ? -side * block_rate[k] : side * (block_rate[k] + b.gain * b.integrand);
            }
            if (which == 0) return side * b.raw - b.limit;
            if (layout_.blocks[k].integrator < 0) return unused;
            return (limiter::integrates(m) ? -side : side) * b.integrand;
        }
        case SwitchKind::branch:
            return which == 0 ? double(m) * branch_argument_[static_cast<std::size_t>(element)] : unused;
    }
    return unused;
}

}  // namespace dualdrive
