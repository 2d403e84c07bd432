#include "simulation.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "dualdrive/effects.hpp"
#include "dualdrive/expression.hpp"

namespace dualdrive {

namespace {

constexpr long interrupt_period = 16;  // steps between questions whether to stop
constexpr long stall_period = 20'000;  // so many steps must bring the run on by stall_progress of its length
constexpr double stall_progress = 1e-5;

double instant(double t) { return 1e-12 * std::max(1.0, std::abs(t)); }  // times nearer than this are one time

std::string text(double v) {
    std::ostringstream s;
    s.precision(9);
    s << v;
    return s.str();
}

bool is_affine(const Machine& m) {
    return std::all_of(m.effects().begin(), m.effects().end(),
                       [](const EffectEntry& e) { return e.formula.empty() && effect_type(e.name).text.affine; });
}

// Numbers whose 0 takes a state, a delay or a flank out of the equations, so that no derivative is left of them there.
bool is_switch(std::string_view path) {
    for (const std::string_view name : {"controller.K_i", "controller.K_d", "controller.T_N", "controller.T_E",
                                        "controller.g_E", "controller.tau_t", "controller.delta_t"})
        if (path == name) return true;
    return path.ends_with(".gap") || (path.starts_with("sensor_delay@") && path.ends_with(".time"));
}

}  // namespace

const char* status_name(Status status) {
    switch (status) {
        case Status::success:
            return "success";
        case Status::interrupted:
            return "interrupted";
        case Status::chattering:
            return "chattering";
        case Status::too_many_steps:
            return "too_many_steps";
        case Status::step_too_small:
            return "step_too_small";
        case Status::not_finite:
            return "not_finite";
        case Status::solver_failure:
            return "solver_failure";
    }
    return "unknown";
}

Trajectory simulate(const Machine& machine, const Inputs& inputs, const SimulateOptions& options) {
    return Simulation(machine, inputs, options).run();
}

Simulation::Simulation(const Machine& machine, const Inputs& inputs, const SimulateOptions& options)
    : machine_(machine),
      inputs_(inputs),
      options_(options),
      layout_(machine_, inputs_),
      model_(machine_, inputs_, layout_),
      along_(machine_, inputs_, layout_),
      affine_(is_affine(machine_)) {
    read_options();
    read_parameters();
}

void Simulation::read_options() {
    const auto refuse = [](const std::string& what) { throw std::invalid_argument(what); };
    if (!std::isfinite(options_.start) || !std::isfinite(options_.end) || !(options_.end > options_.start))
        refuse("simulate: end = " + text(options_.end) +
               " s must be a finite time after start = " + text(options_.start) + " s");
    if (!(options_.rtol >= 1e-14 && options_.rtol <= 1e-2))
        refuse("simulate: rtol = " + text(options_.rtol) + " must lie between 1e-14 and 1e-2");
    if (!(options_.longest_step >= 0))
        refuse("simulate: longest_step = " + text(options_.longest_step) + " s must be at least 0; 0 sets no limit");
    if (options_.times.empty()) {
        const double step = options_.output_step;
        if (!(step > 0) || (options_.end - options_.start) / step > 1e8)
            refuse("simulate: output_step = " + text(step) + " s must be positive and give at most 1e8 rows");
        const long n = std::lround(std::floor((options_.end - options_.start) / step * (1 + 1e-12)));
        for (long k = 0; k <= n; ++k) times_.push_back(options_.start + static_cast<double>(k) * step);
    } else {
        times_ = options_.times;
        for (std::size_t k = 0; k < times_.size(); ++k)
            if (!(times_[k] >= options_.start && times_[k] <= options_.end) || (k > 0 && !(times_[k] > times_[k - 1])))
                refuse("simulate: times[" + std::to_string(k) + "] = " + text(times_[k]) +
                       " s must increase within start and end");
    }
    const auto add = [&](int s) { recorded_.push_back(s); };
    if (options_.signals.empty())
        for (std::size_t s = 0; s < layout_.signals.size(); ++s) add(static_cast<int>(s));
    std::vector<std::string> known;
    for (const auto& s : layout_.signals) known.push_back(s.name);
    for (const auto& name : options_.signals) {
        if (layout_.signal(name) < 0) refuse("simulate: no signal named " + name + near_names(name, known));
        add(layout_.signal(name));
    }
    for (const int s : recorded_) out_.signals.push_back(layout_.signals[static_cast<std::size_t>(s)]);
    for (const auto& [name, value] : options_.initial) {
        if (layout_.state(name) < 0)
            refuse("simulate: initial." + name + ": no such state" + near_names(name, layout_.state_names));
        if (!std::isfinite(value)) refuse("simulate: initial." + name + " is not finite");
    }
    if (inputs_.count("theta_ref") == 0 && machine_.controlled())
        refuse("simulate: the controller needs a commanded motion; give input theta_ref");
    for (const auto& [name, waveform] : inputs_)
        if (!is_read(name))
            refuse("simulate: input " + name +
                   " is read by nothing in this machine: a motor takes U_n (armature) or T_n (direct) only without a "
                   "controller, other columns belong to a formula" +
                   near_names(name, {"theta_ref", "T_load"}));
}

// A misspelt input would otherwise be a run without it.
bool Simulation::is_read(const std::string& input) const {
    if (input == "theta_ref" || (input == "T_load" && layout_.table >= 0)) return true;
    for (const auto& m : machine_.motors())
        if (!machine_.controlled() && input == (m.kind == MotorKind::armature ? "U_" : "T_") + channel_suffix(m.name))
            return true;
    return std::any_of(machine_.effects().begin(), machine_.effects().end(), [&](const EffectEntry& e) {
        if (e.formula.empty()) return false;
        const auto names = Expression::parse(e.formula).names();
        return std::any_of(names.begin(), names.end(),
                           [&](const std::string& name) { return name == input || name == "in." + input; });
    });
}

void Simulation::read_parameters() {
    for (const auto& path : options_.sensitivities) {
        Parameter p{{}, -1, 1.0};
        if (path.starts_with("initial.")) {
            p.initial_state = layout_.state(path.substr(8));
            if (p.initial_state < 0)
                throw std::invalid_argument("sensitivity " + path + ": no such state" +
                                            near_names(path.substr(8), layout_.state_names));
        } else {
            p.slots = machine_.resolve(path);
            const auto& slot = machine_.slots()[p.slots.front()];
            if (slot.clock)
                throw std::invalid_argument("sensitivity " + path +
                                            ": a sample time has no derivative; vary it in a sweep instead");
            for (const auto k : p.slots)
                if (machine_.values()[k] == 0.0 && is_switch(machine_.slots()[k].path))
                    throw std::invalid_argument("sensitivity " + path + ": at 0 " + machine_.slots()[k].path +
                                                " is switched off and its derivative would come out as 0; start from "
                                                "another value");
            const double v = std::abs(machine_.values()[p.slots.front()]);
            p.scale = v > 0 && std::isfinite(v) ? v : slot.typical;
        }
        parameters_.push_back(std::move(p));
        out_.parameters.push_back(path);
    }
    for (std::size_t c = 0; c < chunks(); ++c) {
        chunk_.push_back(std::make_unique<Model<Gradient>>(machine_, inputs_, layout_));
        std::vector<Gradient> values(machine_.values().begin(), machine_.values().end());
        for (std::size_t d = 0; d < directions && c * directions + d < parameters_.size(); ++d)
            for (const auto slot : parameters_[c * directions + d].slots) values[slot].slope[d] = 1.0;
        chunk_.back()->set_parameters(values.data());
    }
}

// Times at which something is known to break lie between cells; a cell's ends are evaluated from inside.
double Simulation::next_stop() {
    double stop = options_.end;
    if (next_break_ < breaks_.size()) stop = std::min(stop, breaks_[next_break_]);
    if (!delayed_breaks_.empty()) stop = std::min(stop, delayed_breaks_.top().t);
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c) {
        const Clock& k = layout_.clocks[c];
        stop = std::min(stop, options_.start + static_cast<double>(ticks_[c]) * k.period);
        if (k.latency > 0 && outputs_[c] < ticks_[c])
            stop = std::min(stop, options_.start + static_cast<double>(outputs_[c]) * k.period + k.latency);
    }
    return stop;
}

Method Simulation::choose_method() {
    if (options_.method != Method::automatic) return options_.method;
    // Flanks closed, drives sliding: does the machine ring, or is something far faster than that and well damped?
    Modes standing = modes_;
    for (std::size_t e = 0; e < layout_.switches.size(); ++e) {
        if (layout_.switches[e].kind == SwitchKind::flank) modes_[e] = flank::front;
        if (layout_.switches[e].kind == SwitchKind::stick) modes_[e] = stick::forward;
    }
    const int n = layout_.size();
    Eigen::MatrixXd A(n, n);
    jacobian(options_.start, z_scratch_.data(), A.data());
    modes_ = standing;
    double rings = 0.0, decays = 0.0;
    if (!A.allFinite()) return Method::bdf;
    const Eigen::VectorXcd poles = Eigen::EigenSolver<Eigen::MatrixXd>(A, false).eigenvalues();
    for (const auto& p : poles) {
        if (std::abs(p.real()) < 0.3 * std::abs(p)) rings = std::max(rings, std::abs(p));
        decays = std::max(decays, -p.real());
    }
    const double fastest = std::max(rings, 1000.0);  // a drive's own loops; below that nothing is stiff
    return decays > 30.0 * fastest ? Method::bdf : Method::adams;
}

std::vector<double> Simulation::tolerances() const {
    std::vector<double> a(scale_.size());
    for (std::size_t k = 0; k < a.size(); ++k) a[k] = options_.rtol * scale_[k];
    return a;
}

// Typical sizes from energy: the play's energy, the commanded motion's, the initial state's. They grow with what is seen.
void Simulation::start() {
    const std::size_t n = static_cast<std::size_t>(layout_.size());
    z_scratch_.assign(n, 0.0);
    rate_scratch_.assign(n, 0.0);
    block_rate_.assign(layout_.blocks.size(), 0.0);
    work_scratch_.assign(powers, 0.0);
    z_along_.assign(n, Gradient(0.0));
    ticks_.assign(layout_.clocks.size(), 0);
    outputs_.assign(layout_.clocks.size(), 0);
    for (const auto& [name, value] : options_.initial)
        z_scratch_[static_cast<std::size_t>(layout_.state(name))] = value;
    double rate = 0.0, reach = 0.0;
    for (const auto& [name, w] : inputs_) {
        for (const double b : w.breaks())
            if (b > options_.start + instant(b) && b < options_.end) breaks_.push_back(b);
        if (name != "theta_ref") continue;
        for (int k = 0; k <= 200; ++k) {
            const double t = options_.start + (options_.end - options_.start) * k / 200.0;
            rate = std::max(rate, std::abs(w.rate(t)));
            reach = std::max(reach, std::abs(w.value(t)));
        }
    }
    std::sort(breaks_.begin(), breaks_.end());
    breaks_.erase(std::unique(breaks_.begin(), breaks_.end(), [](double a, double b) { return b - a < instant(a); }),
                  breaks_.end());

    // What happened before the start: inputs as they stood, delayed signals at their value then.
    cell_ = {options_.start - 1.0, options_.start};
    modes_.assign(layout_.switches.size(), 0);
    for (std::size_t e = 0; e < modes_.size(); ++e)
        if (layout_.switches[e].kind == SwitchKind::branch) modes_[e] = branch::positive;
    classify();
    evaluate(options_.start, z_scratch_.data());
    for (std::size_t k = 0; k < layout_.encoder_history.size(); ++k)
        for (int h = 0; h < machine_.controller().speed_samples; ++h)
            z_scratch_[static_cast<std::size_t>(layout_.encoder_history[k] + h)] =
                model_.signals()[static_cast<std::size_t>(
                    layout_.at.angle[static_cast<std::size_t>(machine_.motors()[k].body)])];
    if (layout_.derivative_filter >= 0 && options_.initial.count("controller.derivative") == 0)
        z_scratch_[static_cast<std::size_t>(layout_.derivative_filter)] = 0.0;  // z(0) = 0: a step kicks by K_d/τ_d
    const auto seed = [&](std::size_t k, std::size_t state) {  // initial sensitivities, but for the encoders'
        return parameters_[k].initial_state == static_cast<int>(state) ? 1.0 : 0.0;
    };
    if (!layout_.delays.empty()) {
        history_ = std::make_unique<History>(options_.start, layout_.delays.size(), parameters_.size());
        for (std::size_t d = 0; d < layout_.delays.size(); ++d)
            history_->set_before(d, model_.signals()[static_cast<std::size_t>(layout_.delays[d].source)]);
        past_ = std::make_unique<HistoryView<double>>(*history_, -1);
        past_along_ = std::make_unique<HistoryView<Gradient>>(*history_, -1);
        for (std::size_t c = 0; c < chunks(); ++c) {
            evaluate_chunk(c, options_.start, z_scratch_.data(), seed);
            for (std::size_t d = 0; d < layout_.delays.size(); ++d)
                for (std::size_t k = c * directions; k < std::min((c + 1) * directions, parameters_.size()); ++k)
                    history_->set_slope_before(d, k,
                                               chunk_[c]
                                                   ->signals()[static_cast<std::size_t>(layout_.delays[d].source)]
                                                   .slope[k - c * directions]);
        }
        for (std::size_t c = 0; c < chunks(); ++c)
            past_chunk_.push_back(std::make_unique<HistoryView<Gradient>>(*history_, static_cast<int>(c * directions)));
    }

    double energy = std::abs(model_.signals()[static_cast<std::size_t>(layout_.at.stored_energy)]);
    double inertia = 0.0;
    for (int g = 0; g < layout_.groups; ++g) inertia = std::max(inertia, model_.group_inertia(g));
    energy = std::max(energy, 1e-4 * 0.5 * inertia * rate * rate);
    for (const auto& c : machine_.connections()) {
        const auto p = read_component<Connection<double>>(machine_.values().data() + c.first);
        if (c.kind != ConnectionKind::rigid) energy = std::max(energy, 1e-4 * 0.5 * p.stiffness * p.gap * p.gap);
    }
    energy_scale_ = energy = std::max(energy, 1e-12 * std::max(1.0, inertia));
    scale_.assign(n, 1e-9);
    for (int g = 0; g < layout_.groups; ++g)
        scale_[static_cast<std::size_t>(g)] = std::sqrt(2.0 * energy / std::max(model_.group_inertia(g), 1e-12));
    for (std::size_t c = 0; c < layout_.twist.size(); ++c) {
        if (layout_.twist[c] < 0) continue;
        const auto p = read_component<Connection<double>>(machine_.values().data() + machine_.connections()[c].first);
        scale_[static_cast<std::size_t>(layout_.twist[c])] =
            std::max(p.gap, 1e-3 * std::sqrt(2.0 * energy / p.stiffness));
    }
    for (const int a : layout_.root_angle)
        scale_[static_cast<std::size_t>(a)] = std::max({1e-6, 1e-3 * reach, scale_[0] * 1e-2});
    for (std::size_t k = 0; k < layout_.current.size(); ++k) {
        if (layout_.current[k] < 0) continue;
        const auto m = read_component<Motor<double>>(machine_.values().data() + machine_.motors()[k].first);
        const double torque = std::isfinite(m.T_rated) ? m.T_rated : std::isfinite(m.T_max) ? m.T_max : 1.0;
        scale_[static_cast<std::size_t>(layout_.current[k])] = 0.1 * torque / m.K_d;
    }
    for (std::size_t b = 0; b < layout_.blocks.size(); ++b)
        if (const int s = layout_.blocks[b].integrator; s >= 0) {
            const auto& block = model_.block(static_cast<int>(b));
            const double full = block.limit / block.gain;
            scale_[static_cast<std::size_t>(s)] = std::isfinite(full) ? 0.01 * full : 1e-6;
        }

    const std::size_t guards = layout_.switches.size() * guards_per_switch;
    for (auto* g : {&guard_begin_, &guard_middle_, &guard_end_, &guard_probe_}) g->assign(guards, 1.0);
    const std::vector<int> direction(guards, -1);
    std::vector<double> parameter_scale;
    for (const auto& p : parameters_) parameter_scale.push_back(p.scale);
    const Method method = choose_method();
    out_.statistics.method = method == Method::bdf ? "bdf" : "adams";
    solver_ = std::make_unique<Solver>(
        *this,
        Solver::Size{layout_.size(), static_cast<int>(guards), static_cast<int>(parameters_.size()),
                     options_.energy ? static_cast<int>(powers) : 0},
        method, options_.rtol, direction, parameter_scale);
    std::copy(z_scratch_.begin(), z_scratch_.end(), solver_->state().begin());
    for (std::size_t k = 0; k < parameters_.size(); ++k)
        for (std::size_t state = 0; state < n; ++state)
            solver_->sensitivity(static_cast<int>(k))[state] = seed(k, state);
    start_encoder_sensitivities();
    double longest = options_.longest_step;
    for (const auto& d : layout_.delays) {  // the past must lie behind the step
        const double delay = d.effect >= 0
                                 ? machine_.values()[machine_.effects()[static_cast<std::size_t>(d.effect)].first]
                                 : machine_.get("controller.delta_t");
        if (delay < 1e-7)
            throw std::invalid_argument(d.name + ": " + text(delay) +
                                        " s is too short to integrate as a delay; use 0 or at least 1e-7 s");
        longest = longest > 0 ? std::min(longest, 0.99 * delay) : 0.99 * delay;
    }
    for (const auto& [name, w] : inputs_) {  // a machine at rest would step over a command that comes and goes
        const double turning = w.turning_time();
        if (std::isfinite(turning)) longest = longest > 0 ? std::min(longest, turning) : turning;
    }
    solver_->limit_step(longest);
    restart();
    pass_break();
    evaluate(options_.start, solver_->state().data());
    energy_start_ = model_.signals()[static_cast<std::size_t>(layout_.at.stored_energy)];
}

// Encoders start with the motors' angles, which follow from ratios and initial states.
void Simulation::start_encoder_sensitivities() {
    for (std::size_t c = 0; c < chunks(); ++c) {
        evaluate_chunk(c, options_.start, solver_->state().data(), [&](std::size_t k, std::size_t state) {
            return solver_->sensitivity(static_cast<int>(k))[state];
        });
        for (std::size_t m = 0; m < layout_.encoder_history.size(); ++m) {
            const auto body = static_cast<std::size_t>(machine_.motors()[m].body);
            const Gradient& angle = chunk_[c]->signals()[static_cast<std::size_t>(layout_.at.angle[body])];
            for (std::size_t k = c * directions; k < std::min((c + 1) * directions, parameters_.size()); ++k)
                for (int h = 0; h < machine_.controller().speed_samples; ++h)
                    solver_->sensitivity(static_cast<int>(
                        k))[static_cast<std::size_t>(layout_.encoder_history[m] + h)] = angle.slope[k - c * directions];
        }
    }
}

void Simulation::restart() {
    const auto z = solver_->state();
    for (std::size_t k = 0; k < scale_.size(); ++k) scale_[k] = std::max(scale_[k], std::abs(z[k]));
    solver_->restart(solver_->time() == 0.0 && out_.statistics.restarts == 0 ? options_.start : solver_->time(),
                     tolerances(), options_.rtol * energy_scale_);
    ++out_.statistics.restarts;
    guards(solver_->time(), z.data(), guard_begin_.data());
}

Trajectory Simulation::run() {
    out_.elements = layout_.switches;
    out_.state_names = layout_.state_names;
    out_.t.reserve(times_.size());
    out_.values.reserve(times_.size() * recorded_.size());
    start();
    if (out_.status == Status::success) loop();
    finish();
    return std::move(out_);
}

void Simulation::loop() {
    long steps = 0;
    double stalled_since = options_.start;
    while (solver_->time() < options_.end - instant(options_.end)) {
        record_until(solver_->time() + instant(solver_->time()));  // with the state itself, no interpolant
        if (out_.status != Status::success) return;
        const double stop = next_stop();
        const Solver::Outcome outcome = solver_->step(stop);
        if (outcome == Solver::Outcome::failed)
            return fail(failure(), bad_numbers_ ? Solver::not_finite : Solver::advice(solver_->flag()));
        if (++steps > options_.max_steps)
            return fail(Status::too_many_steps, "more than max_steps = " + std::to_string(options_.max_steps) +
                                                    " steps; raise it, shorten the run, or use a larger rtol");
        if (steps % interrupt_period == 0 && stop_now()) return;
        const std::vector<int> fallen = fallen_guards(outcome);
        const double t = solver_->time();
        if (steps % stall_period == 0) {
            if (t - stalled_since < stall_progress * (options_.end - options_.start))
                return fail(
                    Status::step_too_small,
                    "no headway: " + std::to_string(stall_period) + " steps for " + text(t - stalled_since) +
                        " s; try method = bdf, a larger rtol, or look for a gain or stiffness that is far too large");
            stalled_since = t;
        }
        record_until(t - instant(t));
        if (history_) remember(solver_->previous_time(), t);
        if (!fallen.empty()) switch_at(fallen);
        if (out_.status != Status::success) return;
        if (t >= stop - instant(t)) pass_break();
        if (out_.status != Status::success) return;
    }
    record_until(options_.end + instant(options_.end));
}

bool Simulation::stop_now() {
    if (!options_.interrupted || !options_.interrupted()) return false;
    fail(Status::interrupted, "stopped on request; what was computed before is kept");
    return true;
}

Status Simulation::failure() const {
    if (bad_numbers_) return Status::not_finite;
    return Solver::step_vanished(solver_->flag()) ? Status::step_too_small : Status::solver_failure;
}

void Simulation::fail(Status status, const std::string& message) {
    out_.status = status;
    out_.message = "at t = " + text(solver_ ? solver_->time() : options_.start) + " s: " + message;
}

void Simulation::record_until(double t) {
    while (out_.status == Status::success && next_output_ < times_.size() && times_[next_output_] <= t) {
        solver_->state_at(times_[next_output_], z_scratch_.data());
        record(times_[next_output_], z_scratch_.data());
        ++next_output_;
    }
}

void Simulation::record(double t, const double* z) {
    evaluate(t, z);
    const bool numbers = std::all_of(recorded_.begin(), recorded_.end(), [&](int s) {
        return std::isfinite(model_.signals()[static_cast<std::size_t>(s)]);
    });
    if (!numbers) return fail(Status::not_finite, Solver::not_finite);
    out_.t.push_back(t);
    for (const int s : recorded_) out_.values.push_back(model_.signals()[static_cast<std::size_t>(s)]);
    out_.modes.insert(out_.modes.end(), modes_.begin(), modes_.end());
    if (options_.energy) {
        solver_->quadrature_at(t, work_scratch_.data());
        out_.work.insert(out_.work.end(), work_scratch_.begin(), work_scratch_.end());
        const double stored = model_.signals()[static_cast<std::size_t>(layout_.at.stored_energy)];
        double work = 0.0;
        for (const double w : work_scratch_) {
            work += w;
            energy_moved_ = std::max(energy_moved_, std::abs(w));
        }
        energy_moved_ = std::max(energy_moved_, std::abs(stored));
        energy_scale_ = std::max(energy_scale_, energy_moved_);
        energy_worst_ = std::max(energy_worst_, std::abs(stored - energy_start_ - work));
    }
    if (!parameters_.empty()) record_sensitivities(t, z, out_.t.size() - 1);
}

void Simulation::record_sensitivities(double t, const double* z, std::size_t row) {
    const std::size_t width = recorded_.size() * parameters_.size();
    out_.sensitivities.resize((row + 1) * width);
    std::vector<std::vector<double>> s(parameters_.size(), std::vector<double>(z_along_.size()));
    for (std::size_t k = 0; k < parameters_.size(); ++k) solver_->sensitivity_at(t, static_cast<int>(k), s[k].data());
    for (std::size_t c = 0; c < chunks(); ++c) {
        evaluate_chunk(c, t, z, [&](std::size_t k, std::size_t state) { return s[k][state]; });
        for (std::size_t r = 0; r < recorded_.size(); ++r)
            for (std::size_t d = 0; d < directions && c * directions + d < parameters_.size(); ++d)
                out_.sensitivities[row * width + r * parameters_.size() + c * directions + d] =
                    chunk_[c]->signals()[static_cast<std::size_t>(recorded_[r])].slope[d];
    }
}

// The last step becomes past: delayed signals are sampled from the solver's own interpolant.
void Simulation::remember(double from, double to) {
    if (to - from < instant(to)) return;
    const std::size_t lines = layout_.delays.size(), np = parameters_.size();
    std::vector<double> samples(History::points * lines), slopes(History::points * lines * np);
    for (int j = 0; j < History::points; ++j) {
        const double t = history_->node(j, from, to);
        solver_->state_at(t, z_scratch_.data());
        evaluate(t, z_scratch_.data());
        for (std::size_t l = 0; l < lines; ++l)
            samples[static_cast<std::size_t>(j) * lines + l] =
                model_.signals()[static_cast<std::size_t>(layout_.delays[l].source)];
        if (np == 0) continue;
        std::vector<std::vector<double>> s(np, std::vector<double>(z_along_.size()));
        for (std::size_t k = 0; k < np; ++k) solver_->sensitivity_at(t, static_cast<int>(k), s[k].data());
        for (std::size_t c = 0; c < chunks(); ++c) {
            evaluate_chunk(c, t, z_scratch_.data(), [&](std::size_t k, std::size_t state) { return s[k][state]; });
            for (std::size_t l = 0; l < lines; ++l)
                for (std::size_t d = 0; d < directions && c * directions + d < np; ++d)
                    slopes[(static_cast<std::size_t>(j) * lines + l) * np + c * directions + d] =
                        chunk_[c]->signals()[static_cast<std::size_t>(layout_.delays[l].source)].slope[d];
        }
    }
    history_->append(from, to, samples, slopes);
    double longest = 0.0;
    for (const auto& d : layout_.delays)
        longest = std::max(
            longest, d.effect >= 0 ? machine_.values()[machine_.effects()[static_cast<std::size_t>(d.effect)].first]
                                   : machine_.get("controller.delta_t"));
    history_->forget_before(to - 1.01 * longest - 1e-9);
}

void Simulation::finish() {
    if (!solver_) return;
    const auto c = solver_->counts();
    out_.statistics.steps = c.steps;
    out_.statistics.rhs = c.rhs;
    out_.statistics.jacobians = c.jacobians;
    out_.statistics.guards = c.guards;
    out_.statistics.error_test_failures = c.error_test_failures;
    out_.statistics.energy_error = energy_moved_ > 0 ? energy_worst_ / energy_moved_ : 0.0;
    out_.final_state.assign(solver_->state().begin(), solver_->state().end());
}

}  // namespace dualdrive
