// Everything that happens at an instant: switches, ticks, breaks, and what they do to the sensitivities.
#include <algorithm>
#include <cmath>

#include "instant.hpp"
#include "mode_rules.hpp"
#include "simulation.hpp"

namespace dualdrive {

namespace {

constexpr long crowded_limit = 400;     // transitions in a row ...
constexpr double crowded_time = 1e-9;   // ... each within this of the one before, s
constexpr double noise = 1e-9;          // of a guard's scale: below it, which way the guard moves decides
constexpr double standing_rate = 1e-7;  // of a guard's scale, 1/s: one that moves more slowly stands
constexpr double grazing_rate = 1e-2;   // of a guard's scale, 1/s: one that falls more slowly has a kink in its slopes

}  // namespace

std::vector<double> Simulation::rates_now() {
    std::vector<double> rate(model_.rate().size());
    if (solver_->rates_now(rate.data())) return rate;
    evaluate(solver_->time(), solver_->state().data());
    return model_.rate();
}

// How the present instant moves with the parameters when a guard falls there: τ' = −(g_z s⁻ + g_p) / (g_z f⁻ + g_t).
void Simulation::find_instant_slope(int element, int which, const std::vector<double>& rate) {
    const double t = solver_->time();
    const auto z = solver_->state();
    std::fill(instant_slope_.begin(), instant_slope_.end(), 0.0);
    const Mode m = modes_[static_cast<std::size_t>(element)];
    const bool rides =
        layout_.switches[static_cast<std::size_t>(element)].kind == SwitchKind::limiter && limiter::riding(m);
    if (tape_ && rides) tape_->add({.kind = Entry::Kind::still});
    if ((parameters_.empty() && !tape_) || rides) return;  // leaving a riding limit, the field is continuous
    const auto known = solver_->guard_rate_now(element * guards_per_switch + which);
    if (!known) evaluate_along(t, z.data(), 1.0, rate.data());
    const double approach = known ? *known : along_.guard(element, which, nullptr).slope[0];
    if (std::abs(approach) < grazing_rate * guard_scale(element, which)) ++out_.statistics.grazing;
    if (tape_ && approach == 0.0) tape_->add({.kind = Entry::Kind::still});
    if (approach == 0.0) return;
    if (tape_) write_instant(element * guards_per_switch + which, approach);
    if (!solver_->guard_slopes_now(element * guards_per_switch + which, instant_slope_.data()))
        for (std::size_t c = 0; c < chunks(); ++c) {
            evaluate_chunk(c, t, z.data(), [&](std::size_t k, std::size_t state) {
                return solver_->sensitivity(static_cast<int>(k))[state];
            });
            const Gradient g = chunk_[c]->guard(element, which, nullptr);
            for (std::size_t d = 0; d < directions && c * directions + d < parameters_.size(); ++d)
                instant_slope_[c * directions + d] = g.slope[d];
        }
    for (double& slope : instant_slope_) slope /= -approach;
}

// Where the instant moves with the parameters (τ' of a located switch; zero at a tick or a break; that of the cause where
// one switch brings about another), the sensitivities jump as field and state do:  s⁺ = h_z s⁻ + (h_z f⁻ − f⁺) τ'.
// `before`: f⁻; `zeroed`: a state that h sets to zero, or −1.
void Simulation::carry_derivatives(const std::vector<double>& before, int zeroed) {
    std::vector<double> change(before);
    if (zeroed >= 0) change[static_cast<std::size_t>(zeroed)] = 0.0;
    const std::vector<double> after = rates_now();
    for (std::size_t i = 0; i < change.size(); ++i) change[i] -= after[i];
    for (std::size_t k = 0; k < parameters_.size(); ++k) {
        const auto s = solver_->sensitivity(static_cast<int>(k));
        if (zeroed >= 0) s[static_cast<std::size_t>(zeroed)] = 0.0;
        for (std::size_t i = 0; i < s.size(); ++i) s[i] += change[i] * instant_slope_[k];
    }
    if (tape_) tape_->add({.kind = Entry::Kind::shift, .column = zeroed}, change.data(), layout_.size());
}

// One element changes its mode at the present instant.
bool Simulation::transition(int element, int which, Cause cause) {
    const auto e = static_cast<std::size_t>(element);
    const double t = solver_->time();
    const auto z = solver_->state();
    const Mode from = modes_[e];
    const bool derives = !parameters_.empty() || tape_;
    const std::vector<double> before = derives ? rates_now() : std::vector<double>{};
    const Mode to = next_mode(element, which);
    if (to == from) return true;

    if (derives && cause == Cause::guard) find_instant_slope(element, which, before);
    modes_[e] = to;
    const bool sticks = layout_.switches[e].kind == SwitchKind::stick;
    const auto group = static_cast<std::size_t>(layout_.switches[e].index);
    if (sticks) z[group] = 0.0;
    if (sticks && to != stick::stuck) loose_since_[e] = t;
    if (derives) carry_derivatives(before, sticks ? static_cast<int>(group) : -1);
    slave_riding();
    out_.events.push_back({t, element, from, to});
    if (history_) add_delayed_breaks(t, instant_slope_);
    crowded_ = t - last_switch_ < crowded_time ? crowded_ + 1 : 0;
    last_switch_ = t;
    if (crowded_ > crowded_limit) {
        fail(Status::chattering, layout_.switches[e].name +
                                     " switches without end; look at an expression whose sign it decides itself, or "
                                     "add damping or a filter there");
        return false;
    }
    return true;
}

// A body that broke loose and was stopped by its own guard at one instant: what moved it is less than the engine's error of
// its speed. The engine has the last word, lest the torque break it loose again, and so on without end.
bool Simulation::stopped_where_it_broke_loose(int element) const {
    const auto e = static_cast<std::size_t>(element);
    const double t = solver_->time();
    return layout_.switches[e].kind == SwitchKind::stick && modes_[e] == stick::stuck && !out_.events.empty() &&
           out_.events.back().element == element && out_.events.back().t == t && t - loose_since_[e] <= instant(t);
}

// Other guards may be violated at the same instant (simultaneous contacts, a jump of a command): follow them until
// all modes are valid.
bool Simulation::settle(bool located) {
    std::vector<double> g(modes_.size() * guards_per_switch);
    for (int pass = 0; pass < settle_passes * static_cast<int>(1 + modes_.size()); ++pass) {
        const double t = solver_->time();
        const double* z = solver_->state().data();
        if (located && solver_->guards_now(g.data())) {
            if (std::none_of(g.begin(), g.end(), [](double value) { return value < 0; })) return true;
            evaluate(t, z);
        } else if (!model_guards(t, z, g.data())) {
            fail(Status::not_finite, "a switching condition is not finite; check parameters and initial state");
            return false;
        }
        int fallen = -1;
        bool known = false, forced = false;  // forced: violated by a jump, not by a crossing of its own
        for (std::size_t k = 0; k < g.size() && fallen < 0; ++k) {
            const int element = static_cast<int>(k) / guards_per_switch,
                      which = static_cast<int>(k) % guards_per_switch;
            if (!(g[k] < 0) || (located && stopped_where_it_broke_loose(element))) continue;
            const Switch& s = layout_.switches[static_cast<std::size_t>(element)];
            // What a formula decides by has any size: where it has just crossed zero, only its slope can tell.
            const bool stands = located && s.kind == SwitchKind::branch && crossed_[static_cast<std::size_t>(element)];
            bool falls = !stands && g[k] < -noise * guard_scale(element, which);
            forced = falls;
            const bool rides =
                s.kind == SwitchKind::limiter && limiter::riding(modes_[static_cast<std::size_t>(element)]);
            if (!falls && !rides) {
                if (!known) {
                    const std::vector<double> rate(model_.rate());
                    evaluate_along(t, z, 1.0, rate.data());
                    known = true;
                }
                falls = along_.guard(element, which, nullptr).slope[0] < -standing_rate * guard_scale(element, which);
            }
            if (falls) fallen = static_cast<int>(k);
        }
        if (fallen < 0) return true;
        const auto count = out_.events.size();
        const Cause cause = located && !forced ? Cause::guard : Cause::instant;
        if (!transition(fallen / guards_per_switch, fallen % guards_per_switch, cause)) return false;
        if (out_.events.size() == count) return true;  // the element stays: its mode is valid after all
    }
    fail(Status::chattering, "modes do not settle at one instant; two laws contradict each other there");
    return false;
}

void Simulation::switch_at(const std::vector<int>& fallen) {
    const Modes flagged = modes_;
    slave_riding();
    for (const int k : fallen) {
        const int element = k / guards_per_switch;
        if (modes_[static_cast<std::size_t>(element)] != flagged[static_cast<std::size_t>(element)]) continue;
        if (!transition(element, k % guards_per_switch, Cause::guard)) return;
    }
    crossed_.assign(modes_.size(), false);
    for (std::size_t e = 0; e < modes_.size(); ++e) crossed_[e] = modes_[e] != flagged[e];
    if (settle(true)) restart();
}

// A riding limiter's integrator follows from its output, for the state and for its sensitivities.
void Simulation::slave_riding() {
    if (riding()) apply(JumpKind::riding);
}

// A jump of the state at the present instant, carried through to the sensitivities by the same lines.
void Simulation::apply(JumpKind kind, const Clock* clock) {
    const double t = solver_->time();
    const auto z = solver_->state();
    if (tape_) write_jump(kind, clock);
    for (std::size_t c = 0; c < chunks(); ++c) {
        evaluate_chunk(c, t, z.data(), [&](std::size_t k, std::size_t state) {
            return solver_->sensitivity(static_cast<int>(k))[state];
        });
        std::vector<Gradient> next(z_along_);
        do_jump(kind, clock, *chunk_[c], z_along_.data(), next.data());
        for (std::size_t k = c * directions; k < std::min((c + 1) * directions, parameters_.size()); ++k)
            for (std::size_t i = 0; i < next.size(); ++i)
                solver_->sensitivity(static_cast<int>(k))[i] = next[i].slope[k - c * directions];
    }
    evaluate(t, z.data());
    const std::vector<double> before(z.begin(), z.end());
    do_jump(kind, clock, model_, before.data(), z.data());
}

// A discontinuity of a delayed signal comes back one delay later; its time moves as the event's and the delay do.
void Simulation::add_delayed_breaks(double t, const std::vector<double>& time_slope) {
    for (const auto& d : layout_.delays) {
        const std::size_t slot = d.slot;
        DelayedBreak b{t + machine_.values()[slot], time_slope};
        b.slope.resize(parameters_.size(), 0.0);
        for (std::size_t k = 0; k < parameters_.size(); ++k)
            if (std::find(parameters_[k].slots.begin(), parameters_[k].slots.end(), slot) != parameters_[k].slots.end())
                b.slope[k] += 1.0;
        if (b.t >= options_.end) continue;
        cell_.high = std::min(cell_.high, b.t);
        delayed_breaks_.push(std::move(b));
    }
}

// Known instants: breaks of inputs, returning discontinuities, outputs and ticks of sampled loops, in this order.
void Simulation::pass_break() {
    const double t = solver_->time(), now_or_past = t + instant(t);
    const auto z = solver_->state();
    slave_riding();
    instant_slope_.assign(parameters_.size(), 0.0);
    if (tape_) tape_->add({.kind = Entry::Kind::still});
    bool broke = t <= options_.start + instant(t), returned = false;
    const std::vector<double> before = history_ ? rates_now() : std::vector<double>{};
    double begin = t;  // of the cell that follows: a break that rounding puts behind t is over, too
    for (; next_break_ < breaks_.size() && breaks_[next_break_] <= now_or_past; ++next_break_) {
        begin = std::max(begin, breaks_[next_break_]);
        broke = true;
    }
    for (; !delayed_breaks_.empty() && delayed_breaks_.top().t <= now_or_past; delayed_breaks_.pop()) {
        instant_slope_ = delayed_breaks_.top().slope;
        returned = true;
    }
    std::vector<const Clock*> due_outputs, due_ticks;
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c) {
        const Clock& k = layout_.clocks[c];
        if (k.latency > 0 && outputs_[c] < ticks_[c] &&
            options_.start + static_cast<double>(outputs_[c]) * k.period + k.latency <= now_or_past) {
            due_outputs.push_back(&k);
            ++outputs_[c];
        }
        if (options_.start + static_cast<double>(ticks_[c]) * k.period <= now_or_past) {
            due_ticks.push_back(&k);
            ++ticks_[c];
        }
    }
    const bool discontinuous = broke || !due_outputs.empty() || !due_ticks.empty();
    if (discontinuous && history_) add_delayed_breaks(t, {});
    cell_ = {begin, next_stop()};
    if (returned) carry_derivatives(before, -1);
    for (const Clock* k : due_outputs) apply(JumpKind::output, k);
    for (const Clock* k : due_ticks) apply(JumpKind::tick, k);
    if (end_rides() && settle(false)) restart();
}

bool Simulation::end_rides() {
    for (std::size_t e = 0; e < modes_.size(); ++e) {
        if (layout_.switches[e].kind != SwitchKind::limiter || !limiter::riding(modes_[e])) continue;
        evaluate(solver_->time(), solver_->state().data());
        const int fallen = guard_off_limit(model_.block(layout_.switches[e].index), modes_[e]);
        if (fallen >= 0 && !transition(static_cast<int>(e), fallen, Cause::instant)) return false;
    }
    return true;
}

}  // namespace dualdrive
