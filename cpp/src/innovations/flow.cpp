#include "flow.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "../simulation/affine.hpp"
#include "../simulation/instant.hpp"
#include "../simulation/mode_rules.hpp"
#include "../solvers/exact/kernels.hpp"
#include "dense.hpp"
#include "dualdrive/effects.hpp"

namespace dualdrive::innovations {

namespace {

constexpr int most_passes = 8;  // over the modes, until they stand
constexpr int at_once = 16;     // rows that the kernels take together

std::vector<int> signals_of(const Layout& layout, const SampledRecord& record) {
    std::vector<int> signals;
    for (const auto& c : record.channels()) {
        const int s = layout.signal(c.name);
        if (s < 0) throw std::invalid_argument("predict: the machine has no signal " + c.name);
        signals.push_back(s);
    }
    return signals;
}

std::vector<int> bodies_of(const Machine& machine, const std::map<std::string, Autoregression>& noise) {
    std::vector<int> bodies;
    for (const auto& [name, own] : noise) {
        bodies.push_back(machine.body(name));
        if (bodies.back() < 0) throw std::invalid_argument("kalman_gains: no body " + name);
    }
    return bodies;
}

// Whether laws that are not affine feel neither inputs nor control, nor these them but through the states.
bool feels_no_control(const Machine& machine, const Layout& layout, const Inputs& inputs) {
    const auto none = [](const auto& lists) {
        return std::all_of(lists.begin(), lists.end(), [](const auto& list) { return list.empty(); });
    };
    // a delay alone is linear, and what is read late are states
    const auto late = [&](const std::vector<int>& effects) {
        return std::all_of(effects.begin(), effects.end(), [&](int e) {
            return effect_type(machine.effects()[static_cast<std::size_t>(e)].name).hooks == hook::delay;
        });
    };
    const auto of_user = [](const EffectEntry& e) { return e.of_user(); };
    const auto driven_directly = [](int current) { return current < 0; };
    return !keeps_past(layout) && std::all_of(layout.sensor_effects.begin(), layout.sensor_effects.end(), late) &&
           none(layout.encoder_effects) && none(layout.torque_estimates) &&
           (layout.effects_on_inertia.empty() || !inputs.contains("T_load")) &&
           std::none_of(machine.effects().begin(), machine.effects().end(), of_user) &&
           std::none_of(layout.current.begin(), layout.current.end(), driven_directly);
}

}  // namespace

Flow::Flow(const Machine& machine, const SampledRecord& record, int substeps, const NoiseModel& noise,
           std::vector<Output> outputs)
    : machine_(machine),
      record_(record),
      layout_(machine, record.inputs(), Delays::approximant),
      model_(machine, record.inputs(), layout_),
      recorded_(signals_of(layout_, record)),
      reader_(machine, record.inputs(), layout_, record.generator(), recorded_),
      affine_(!effect_that_is_not_affine(machine) && !keeps_past(layout_)),
      scope_(feels_no_control(machine, layout_, record.inputs()) ? Scope::plant : Scope::whole),
      driven_(driven_rows()),
      watching_(watching_guards()),
      feeling_(felt_states()),
      bodies_(bodies_of(machine, noise.torque)),
      creeping_(bodies_of(machine, noise.creep)),
      n_(reader_.size() + disturbance_count()),
      outputs_(static_cast<int>(recorded_.size())),
      substeps_(affine_ ? 1 : std::max(1, substeps)),
      h_(record.step() / substeps_) {
    for (std::size_t e = 0; e < layout_.switches.size(); ++e)
        if (layout_.switches[e].kind == SwitchKind::flank) contacts_.push_back(static_cast<int>(e));
    for (std::size_t e = 0; e < layout_.switches.size(); ++e)
        if (layout_.switches[e].kind == SwitchKind::stick) sticks_.push_back(static_cast<int>(e));
    for (std::size_t e = 0; e < layout_.switches.size(); ++e)
        if (layout_.switches[e].kind == SwitchKind::limiter) limiters_.push_back(static_cast<int>(e));
    for (const auto& memory : layout_.memories)
        relaxing_.push_back(layout_.group_of[static_cast<std::size_t>(memory.body)]);
    const auto n = static_cast<std::size_t>(exact::padded(n_));
    for (auto* v : {&n0_, &n1_, &slope_, &earlier_}) v->assign(n, 0.0);
    y_.assign(n + 2 * driven_.size(), 0.0);
    bend_.assign(2 * driven_.size(), 0.0);
    shift_.assign(feeling_.size(), 0.0);
    pushing_.assign(machine.bodies().size(), 0.0);
    felt_.assign(static_cast<std::size_t>(exact::padded(static_cast<int>(driven_.size() + watching_.size()))), 0.0);
    rest_.assign(felt_.size(), 0.0);
    const auto guards = static_cast<std::size_t>(exact::padded(static_cast<int>(guard_count())));
    for (auto* g : {&g0_, &g1_}) g->assign(guards, 1.0);
    shown_.assign(static_cast<std::size_t>(2 * exact::padded(outputs_)), 0.0);
    shows_ = std::move(outputs);
    shows_.resize(recorded_.size());
    for (std::size_t j = 0; j < shows_.size(); ++j) {
        const double late = shows_[j].late;
        if (late == 0.0) continue;
        const auto same = [&](const Delay& d) { return d.time == late; };
        auto own = std::find_if(delays_.begin(), delays_.end(), same);
        if (own == delays_.end()) own = delays_.insert(own, Delay{late, {}});
        own->channels.push_back(static_cast<int>(j));
    }
    const int looked_at = affine_ ? static_cast<int>(guard_count()) : 0;
    step_rows_ = (n_ + outputs_ + looked_at + at_once - 1) / at_once * at_once;
    out_.assign(static_cast<std::size_t>(step_rows_), 0.0);
    trial_.assign(std::max(out_.size(), felt_.size()), 0.0);
    y_[static_cast<std::size_t>(reader_.one())] = 1.0;
    modes_.assign(layout_.switches.size(), 0);
    for (std::size_t e = 0; e < modes_.size(); ++e)
        if (layout_.switches[e].kind == SwitchKind::branch) modes_[e] = branch::positive;
    phases_ = common_period();
    spread_ = phases_ == 0;
    phases_ = std::max(phases_, std::size_t{1});
}

Flow::~Flow() = default;

void Flow::evaluate(double t, const double* y, Scope scope) {
    for (std::size_t b = 0; b < bodies_.size(); ++b)
        pushing_[static_cast<std::size_t>(bodies_[b])] = y[static_cast<std::size_t>(first_disturbance()) + b];
    model_.evaluate(t, y, {modes_.data(), cell_, memory_.get(), nullptr, nullptr, scope, pushing_.data()});
}

void Flow::start(std::size_t sample, const std::map<std::string, double>& initial) {
    std::fill(y_.begin(), y_.end(), 0.0);
    y_[static_cast<std::size_t>(reader_.one())] = 1.0;
    for (const auto& [name, value] : initial) {
        const int k = layout_.state(name);
        if (k < 0) throw std::invalid_argument("predict: no state " + name);
        y_[static_cast<std::size_t>(k)] = value;
    }
    const double t = record_.times()[sample];
    cell_ = {t, record_.times()[sample + 1]};
    at_end_ = false;
    rest_of_ = along_ = slopes_of_ = nullptr;
    finer_ = 0;
    ticked_at_ = -1.0;
    modes_.assign(layout_.switches.size(), 0);
    for (std::size_t e = 0; e < modes_.size(); ++e)
        if (layout_.switches[e].kind == SwitchKind::branch) modes_[e] = branch::positive;
    memory_.reset();
    std::copy_n(record_.generator_states(sample), record_.generator().size(), y_.data() + states());
    for (int pass = 0; pass < most_passes; ++pass) {
        bool changed = false;
        for (std::size_t e = 0; e < modes_.size(); ++e) {
            evaluate(t, y_.data());
            const Mode m = standing_mode(layout_, model_, y_.data(), static_cast<int>(e), modes_[e]);
            changed = changed || m != modes_[e];
            modes_[e] = m;
        }
        if (!changed) break;
    }
    evaluate(t, y_.data());
    for (std::size_t m = 0; m < layout_.encoder_history.size(); ++m)
        for (int k = 0; k < machine_.controller().speed_samples; ++k) {
            const auto slot = static_cast<std::size_t>(layout_.encoder_history[m] + k);
            if (!initial.contains(layout_.state_names[slot]))
                y_[slot] = model_.signals()[static_cast<std::size_t>(
                    layout_.at.angle[static_cast<std::size_t>(machine_.motors()[m].body)])];
        }
    // late signals have been what they are
    for (const DelayLine& line : layout_.delays)
        if (line.state >= 0 && !initial.contains(layout_.state_names[static_cast<std::size_t>(line.state)]))
            y_[static_cast<std::size_t>(line.state)] = model_.signals()[static_cast<std::size_t>(line.source)];
    if (keeps_past(layout_)) memory_ = std::make_unique<DelayMemory>(layout_, machine_, h_);
    wind_clocks(t);
    now_ = &frozen();
    tick(t);
}

const double* Flow::rates(std::size_t sample, const Flow& other, Scope scope) {
    modes_ = other.modes_;
    cell_ = other.cell_;
    evaluate(record_.times()[sample], other.y_.data(), scope);
    return model_.rate().data();
}

double Flow::guard(std::size_t sample, const Modes& modes, const double* y, int guard) {
    modes_ = modes;
    cell_ = {record_.times()[sample], record_.times()[sample + 1]};
    evaluate(record_.times()[sample], y);
    return model_guard(record_.times()[sample], y, guard);
}

std::vector<std::size_t> Flow::held(const Modes& modes) const {
    std::vector<std::size_t> speeds;
    for (const int element : sticks_)
        if (modes[static_cast<std::size_t>(element)] == stick::stuck) speeds.push_back(resting(element));
    return speeds;
}

bool Flow::advance(double t, double length) {
    at_end_ = false;
    if (!relaxing_.empty() && octaves() != octaves_) now_ = &frozen();
    if (const int pieces = pieces_for(length); pieces > 1) {
        const double piece = length / pieces;
        for (int k = 0; k < pieces; ++k)
            if (!advance(t + k * piece, piece)) return false;
        return true;
    }
    const Step* const step = step_of(*now_, length);
    if (!step) {
        if (!memory_)
            if (const Step* const near = near_step(*now_, length)) return nearly(t, length, *near);
        rest_of_ = along_ = nullptr;
        return through_switches(t, length);
    }
    if (!affine_) return integrate(t, *step);
    exact::kernels().multiply(static_cast<int>(step->flow.size()) / n_, n_, step->flow.data(), n_, y_.data(), 1,
                              out_.data());
    if (any_negative(out_.data() + n_ + outputs_, guard_count())) return through_switches(t, length);
    std::copy_n(out_.data(), n_, y_.data());
    at_end_ = true;
    return std::isfinite(y_[0]);
}

// A length with no propagator of its own: what is left of it first, then a step that has one.
bool Flow::nearly(double t, double length, const Step& step) {
    departed_ = y_;
    const double left = length - step.length;
    if (affine_) {
        go_a_little(left);
        exact::kernels().multiply(step_rows_, n_, step.flow.data(), n_, y_.data(), 1, out_.data());
        if (any_negative(out_.data() + n_ + outputs_, guard_count())) {
            y_ = departed_;
            return through_switches(t, length);
        }
        std::copy_n(out_.data(), n_, y_.data());
        at_end_ = true;
        return std::isfinite(y_[0]);
    }
    const std::size_t d = driven_.size();
    double *const n = y_.data() + n_, *const change = n + d;
    if (rest_of_ != now_) {
        feel(t, y_.data());
        std::copy_n(felt_.data(), d, n);
        rest_of_ = now_;
    }
    go_a_little(left);
    for (std::size_t k = 0; along_ == now_ && k < d; ++k) n[k] += change[k] * left / along_length_;
    Flown flown = Flown::done;
    if (step.length > 0.0) {
        flown = fly(t + left, step, {});
    } else {
        guards_near(t + left, y_.data(), g1_.data());
        if (any_negative(g1_.data(), guard_count())) flown = Flown::fallen;
    }
    if (flown == Flown::done) return std::isfinite(y_[0]);
    y_ = departed_;
    along_ = nullptr;
    if (flown == Flown::bent) return halves(t, length);
    rest_of_ = nullptr;
    return through_switches(t, length);
}

void Flow::enter(std::size_t sample) {
    cell_ = {record_.times()[sample], record_.times()[sample + 1]};
    std::copy_n(record_.generator_states(sample), record_.generator().size(), y_.data() + states());
}

bool Flow::flow(std::size_t sample) {
    const double begin = record_.times()[sample], end = record_.times()[sample + 1];
    enter(sample);
    at_end_ = false;
    changes_.clear();
    double t = begin;
    if (leap(sample)) {
        if (!std::isfinite(y_[0])) return false;
        tick_if_due(sample, t = end);
    }
    while (t < end - instant(end)) {
        if (memory_) {
            feel(t, y_.data());
            memory_->go_on(t, model_);
            std::copy_n(felt_.data(), driven_.size(), y_.data() + n_);
            rest_of_ = now_;
        }
        const double stop = std::min(end, next_tick(t));
        if (stop > t + instant(t)) {
            const double step = std::ldexp(h_, -finer_), left = stop - t, length = left > 1.5 * step ? step : left;
            if (!advance(t, length)) return false;
            t = length == left ? stop : t + length;
        }
        tick_if_due(sample, t);
    }
    lengthen();
    return true;
}

const double* Flow::arriving(std::size_t sample) const {
    return std::abs(ticked_at_ - record_.times()[sample]) <= instant(ticked_at_) ? arriving_.data() : y_.data();
}

const double* Flow::outputs(std::size_t sample) {
    if (at_end_ && delays_.empty()) return out_.data() + n_;
    const int rows = exact::padded(outputs_);
    double* const shown = shown_.data();
    double* const differ = shown + rows;
    if (at_end_)
        std::copy_n(out_.data() + n_, outputs_, shown);
    else
        exact::kernels().multiply(rows, n_, now_->shown.data(), n_, y_.data(), 1, shown);
    if (delays_.empty()) return shown;
    exact::kernels().multiply(rows, n_, now_->shifted.data(), n_, arriving(sample), 1, differ);
    for (int j = 0; j < outputs_; ++j) shown[j] += differ[j];
    return shown;
}

// A reading of a moment before tells of the state then: what it corrects there has flowed on since. Corrections of the
// present by what is late by half a sample would swing up under gains that hardly trust the model.
void Flow::carry_on(const KalmanGains::Set& gain, const double* e, double* moved) {
    const auto K = gain.K();
    Eigen::Map<Eigen::VectorXd> there(earlier_.data(), n_);
    for (std::size_t d = 0; d < delays_.size(); ++d) {
        there.setZero();
        for (const int j : delays_[d].channels) {
            there.head(states()) += e[j] * K.col(j).head(states());
            there.segment(first_disturbance(), disturbance_count()) +=
                e[j] * K.col(j).segment(states(), disturbance_count());
        }
        exact::kernels().multiply(exact::padded(n_), n_, now_->onward[d].data(), n_, earlier_.data(), 1, trial_.data());
        for (int i = 0; i < states(); ++i) moved[i] += trial_[static_cast<std::size_t>(i)];
    }
}

void Flow::correct(std::size_t sample, const KalmanGains::Set& gain, const double* e, double* moved, bool holds) {
    if (!delays_.empty()) carry_on(gain, e, moved);
    if (!affine_) std::copy_n(y_.data(), states(), earlier_.data());
    for (int i = 0; i < states(); ++i) y_[static_cast<std::size_t>(i)] += moved[i];
    for (int j = 0; j < disturbance_count(); ++j) disturbances()[j] += moved[states() + j];
    if (holds)
        for (const int element : sticks_)
            if (modes_[static_cast<std::size_t>(element)] == stick::stuck) y_[resting(element)] = 0.0;
    // a corner of the command may lie at the sample: what holds from now on is what counts
    if (!affine_ && sample + 1 < record_.times().size()) enter(sample);
    if (holds && !affine_ && !memory_ && rest_of_ == now_) feel_correction(record_.times()[sample], earlier_.data());
    if (affine_ || rest_of_ == now_)
        guards_near(record_.times()[sample], y_.data(), g0_.data());
    else
        all_guards(record_.times()[sample], y_.data(), g0_.data());
    if (!holds || any_negative(g0_.data(), guard_count())) settle(sample);
    if (!now_->slaved.empty()) slave(record_.times()[sample]);
}

}  // namespace dualdrive::innovations
