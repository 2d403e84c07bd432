#include "dualdrive/switching.hpp"

namespace dualdrive {

const char* mode_name(SwitchKind kind, Mode mode) {
    switch (kind) {
        case SwitchKind::flank:
            switch (mode) {
                case flank::back:
                    return "back";
                case flank::gap:
                    return "gap";
                case flank::front:
                    return "front";
                case flank::back_parting:
                    return "back parting";
                case flank::front_parting:
                    return "front parting";
                default:
                    return "?";
            }
        case SwitchKind::stick:
            return mode == stick::stuck ? "stuck" : mode > 0 ? "forward" : "backward";
        case SwitchKind::limiter:
            switch (mode) {
                case limiter::linear:
                    return "linear";
                case limiter::high:
                    return "high";
                case limiter::low:
                    return "low";
                case limiter::unwinding_high:
                    return "high, unwinding";
                case limiter::unwinding_low:
                    return "low, unwinding";
                case limiter::riding_high:
                    return "riding high";
                case limiter::riding_low:
                    return "riding low";
                default:
                    return "?";
            }
        case SwitchKind::branch:
            return mode > 0 ? "positive" : "negative";
    }
    return "?";
}

}  // namespace dualdrive
