// Limiters that slide along their limit (limiter::riding): of conditional integration the sliding mode, as the engines have it
// (cpp/src/simulation/modes.cpp). The output stays on the limit, and the integrator follows from it: nothing feels it until the
// ride ends. What ends it are rates, ṡ of the surface s = raw − limit with the integrator held, and with it running (Filippov;
// Leine, Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, ch. 4).
#include <algorithm>

#include "../simulation/mode_rules.hpp"
#include "flow.hpp"

namespace dualdrive::innovations {

namespace {

// Of the rate with which the integrator alone would drive a block outward: its input turns outward, or inward for all that, once
// it does so faster. Where both drives are saturated an equaliser's input stands, and rounding would have it turn without end.
constexpr double standing = 1e-9;

// What that makes of both guards of a ride, which add up to this rate.
const Eigen::Matrix2d let_stand{{1.0 + standing, standing}, {standing, 1.0 + standing}};

}  // namespace

bool Flow::rides(int element) const {
    const auto e = static_cast<std::size_t>(element);
    return layout_.switches[e].kind == SwitchKind::limiter && limiter::riding(modes_[e]);
}

// From s = 0; and the shares of disturbances in the guards that are rates of s, which the reader of laws knows nothing of.
void Flow::find_slaved(Frozen& frozen, const exact::Laws<double>& laws) const {
    for (const int element : limiters_) {
        const auto e = static_cast<std::size_t>(element);
        if (!limiter::riding(frozen.modes[e])) continue;
        const auto b = static_cast<std::size_t>(layout_.switches[e].index);
        const Eigen::Index state = layout_.blocks[b].integrator;
        if (state < 0) continue;
        const Eigen::MatrixXd s = widened(laws.beyond.row(static_cast<Eigen::Index>(b)), 1);
        Slaved own{state, -s.row(0) / s(0, state)};
        own.row(state) = 0.0;
        frozen.slaved.push_back(std::move(own));
        const Eigen::RowVectorXd pushed = s.row(0) * frozen.A.middleCols(first_disturbance(), disturbance_count());
        const double side = limiter::side(frozen.modes[e]);
        auto both = frozen.guards.middleRows<guards_per_switch>(element * guards_per_switch);
        both.middleCols(first_disturbance(), disturbance_count()) += Eigen::Vector2d(-side, side) * pushed;
        both = let_stand * both;
    }
}

// d(raw)/dt of every block along the flow at (t, y), where the model was evaluated last; with integrators as the modes hold
// them, and that of one block held besides.
const double* Flow::block_rates(double t, const double* y, int held) {
    if (!along_the_way_) along_the_way_ = std::make_unique<Model<Gradient>>(machine_, record_.inputs(), layout_);
    rates_ = model_.rate();
    if (held >= 0)
        if (const int state = layout_.blocks[static_cast<std::size_t>(held)].integrator; state >= 0)
            rates_[static_cast<std::size_t>(state)] = 0.0;
    if (now_ && !creeping_.empty()) {
        const Eigen::Map<const Eigen::VectorXd> disturbances(y + first_disturbance(), disturbance_count());
        Eigen::Map<Eigen::VectorXd>(rates_.data(), states()) += now_->creep.topRows(states()) * disturbances;
    }
    rates_of_blocks(*along_the_way_, t, y, rates_.data(), {modes_.data(), cell_, memory_.get(), nullptr}, z_along_,
                    block_rates_);
    return block_rates_.data();
}

// Likewise a guard.
double Flow::model_guard(double t, const double* y, int guard) {
    const int element = guard / guards_per_switch, which = guard % guards_per_switch;
    return rides(element) ? riding_guards(element, block_rates(t, y))[which] : model_.guard(element, which, nullptr);
}

Eigen::Vector2d Flow::riding_guards(int element, const double* rates) const {
    return let_stand * Eigen::Vector2d(model_.guard(element, 0, rates), model_.guard(element, 1, rates));
}

// Of those that ride, where the others are known: by the rates of the whole machine.
void Flow::write_riding_guards(double t, const double* y, double* g) {
    evaluate(t, y);
    const double* const rates = block_rates(t, y);
    for (const int element : limiters_)
        if (rides(element))
            Eigen::Map<Eigen::Vector2d>(g + element * guards_per_switch) = riding_guards(element, rates);
}

void Flow::slave(double t) {
    evaluate(t, y_.data());
    model_.slave_integrators(y_.data());
}

void Flow::slave(const Frozen& frozen, Eigen::MatrixXd& flow) {
    for (const auto& [state, row] : frozen.slaved) flow.row(state) = row * flow;
}

// What follows when a guard of a limiter has fallen at the present state.
Mode Flow::limiter_mode_after(double t, int element, int which) {
    const auto e = static_cast<std::size_t>(element);
    const auto block = static_cast<std::size_t>(layout_.switches[e].index);
    evaluate(t, y_.data());
    const double held = block_rates(t, y_.data(), static_cast<int>(block))[block];
    return dualdrive::limiter_mode_after(model_.block(static_cast<int>(block)), layout_.blocks[block].integrator >= 0,
                                         modes_[e], which, held);
}

}  // namespace dualdrive::innovations
