// Which engine integrates a run, and why another would not do.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "../solvers/cvode.hpp"
#include "../solvers/exact/exact.hpp"
#include "../solvers/explicit/runge_kutta.hpp"
#include "../solvers/exponential/exponential.hpp"
#include "../solvers/handover.hpp"
#include "affine.hpp"
#include "instant.hpp"
#include "simulation.hpp"

namespace dualdrive {

namespace {

constexpr int most_exact_states = 256;  // of machine, controller and inputs: dense matrices beyond that do not pay
constexpr double near_multiple = 1e-9;
constexpr double slowest_ring = 1000.0;  // 1/s: a drive's own loops; below that nothing is stiff
// Something well damped and so much faster than what rings makes a machine stiff: the explicit engine and Adams methods
// then take steps for stability alone, and BDF is the cheaper from about here on (measured, benchmarks/effects.py).
constexpr double stiff_beyond = 14.0;
// A multistep method errs by a multiple of what the others err by at the same tolerance (benchmarks/laws.py); it is given
// this share of it, lest the accuracy of a run hang on who happened to take it.
constexpr double share_of_bdf = 0.1;
// Measured on the machines of benchmarks/laws.py and benchmarks/turns.py. Of a multistep method: its algebra and the looks
// at guards, and the Jacobian by columns of duals. Of the exponential one: products and walk, the propagators of a new mode
// as far as it comes back, and looks between the points of its walk.
constexpr Handover::Price price_of_explicit{1.0, 0.0, 0.0}, price_of_bdf{0.0, 4.4, 14.0},
    price_of_exponential{1.7, 4.2, 100.0, 3.5};
// Where it begins two thirds of that: a trial sees the other solver on another stretch of the motion, and this one errs
// least.
constexpr Handover::Price favoured(const Handover::Price& p) {
    constexpr double share = 2.0 / 3.0;
    return {share * p.rate, share * p.step, share * p.jacobian, share * p.look};
}
// What sensitivities cost besides (benchmarks/effects.py): eight directions of the model's derivatives for one evaluation
// of the rates; the exponential engine's products per step and parameter, more where propagators depend on it, and those of
// a tangent; and the algebra of a multistep method.
constexpr double directions_of_explicit = 5.5, directions_of_exponential = 4.5, directions_of_bdf = 8.0;
constexpr double products_of_a_step = 8.0, more_products_of_a_step = 24.0, products_of_a_tangent = 50.0,
                 algebra_of_bdf = 1.4;
constexpr double long_step = 0.064;  // s, of the exponential engine
// Of the fastest pole times the time an explicit method makes of an evaluation: it takes twelve for a step that is stable
// up to 6.
constexpr double explicit_reach = 6.0 / 12.0;
constexpr double finest_bdf = 1e-13;  // relative tolerance that arithmetic leaves a multistep method
constexpr double exact_reach = 3.0;   // of |λ| times a step of the exact engine, whose series is that long

struct Prices {
    Handover::Price exponential, bdf;
};

// In evaluations by the explicit method with so many sensitivities along, some of them to first states.
Prices prices(int states, int sensitivities, int first_states) {
    Prices found{price_of_exponential, price_of_bdf};
    if (sensitivities == 0) return found;
    const auto evaluations = [](int n) { return static_cast<double>((n + directions - 1) / directions); };
    const double chunks = evaluations(sensitivities), parameters = sensitivities, others = sensitivities - first_states;
    found.exponential.step +=
        directions_of_exponential * static_cast<double>(exponential::nodes) * (evaluations(states) + chunks) +
        products_of_a_step * parameters + more_products_of_a_step * others;
    found.exponential.jacobian += products_of_a_tangent * others;
    found.bdf.step += directions_of_bdf * chunks + algebra_of_bdf * parameters;
    for (Handover::Price* p : {&found.exponential, &found.bdf})
        for (double* each : {&p->rate, &p->step, &p->jacobian, &p->look})
            *each /= 1.0 + directions_of_explicit * chunks;
    return found;
}

// Whether b is a whole multiple of a.
bool divides(double a, double b) { return std::abs(b / a - std::round(b / a)) < near_multiple && b > 0.5 * a; }

}  // namespace

bool Simulation::exact_is_possible(std::string& reason) const {
    if (!affine_) reason = "effect " + *effect_that_is_not_affine(machine_) + " is not affine between switches";
    if (!layout_.delays.empty()) reason = layout_.delays.front().name + " delays a signal inside the loop";
    if (exact::Generator(inputs_).size() + layout_.size() > most_exact_states)
        reason = "the inputs have too many harmonics";
    return reason.empty();
}

// The step between the times to which exact propagation is prepared: the finest of the output step, the clocks and the
// spacing of sampled inputs that has all the others for multiples; else the output step.
double Simulation::exact_grid() const {
    const double span = options_.end - options_.start;
    const auto count = static_cast<double>(std::max<std::size_t>(1, times_.size() - 1));
    const double output = times_.size() > 1 ? (times_.back() - times_.front()) / count : span;
    std::vector<double> steps{output};
    for (const Clock& c : layout_.clocks) {
        steps.push_back(c.period);
        if (c.latency > 0) steps.push_back(c.latency);
    }
    for (const auto& [name, w] : inputs_)
        if (const auto knots = w.knots(); knots.size() > 2)
            steps.push_back((knots.back() - knots.front()) / static_cast<double>(knots.size() - 1));
    const double finest = *std::min_element(steps.begin(), steps.end());
    const bool common = std::all_of(steps.begin(), steps.end(), [&](double s) { return divides(finest, s); });
    return common ? finest : output;
}

// How many steps of the grid a run takes, as far as memory for them is worth setting aside.
std::size_t Simulation::grid_steps() const {
    return static_cast<std::size_t>(std::min(1e6, (options_.end - options_.start) / exact_grid()));
}

// How fast the machine rings, and how fast its fastest motion dies away, with flanks closed and drives sliding.
Simulation::Pace Simulation::pace() {
    const Modes standing = modes_;
    for (std::size_t e = 0; e < layout_.switches.size(); ++e) {
        if (layout_.switches[e].kind == SwitchKind::flank) modes_[e] = flank::front;
        if (layout_.switches[e].kind == SwitchKind::stick) modes_[e] = stick::forward;
    }
    Eigen::MatrixXd A(layout_.size(), layout_.size());
    jacobian(options_.start, z_scratch_.data(), A.data());
    modes_ = standing;
    Pace pace{slowest_ring, 0.0};
    if (!A.allFinite()) return {slowest_ring, std::numeric_limits<double>::infinity()};
    const Eigen::VectorXcd poles = Eigen::EigenSolver<Eigen::MatrixXd>(A, false).eigenvalues();
    for (const auto& p : poles) {
        if (std::abs(p.real()) < 0.3 * std::abs(p)) pace.rings = std::max(pace.rings, std::abs(p));
        pace.decays = std::max(pace.decays, -p.real());
    }
    return pace;
}

// Whether a motion that dies away at once would cost the exact engine more steps than a run may take. What does not reach
// the end so does with BDF, which damps such a motion out.
bool Simulation::too_stiff_to_be_exact() {
    const auto [rings, decays] = pace();
    const double steps = decays / exact_reach * (options_.end - options_.start);
    return decays > stiff_beyond * rings && steps > static_cast<double>(options_.max_steps);
}

namespace {

void refuse(const std::string& what) { throw std::invalid_argument(what); }

}  // namespace

void Simulation::refuse_gradient(const std::string& impossible) const {
    const std::string instead = "ask for sensitivities instead";
    if (!wants_exact() && !chooses_engine() && options_.engine != Engine::exponential)
        refuse(std::string("gradient: engine = ") + (options_.engine == Engine::explicit_rk ? "explicit" : "cvode") +
               " has no way back; take engine = auto, or " + instead);
    if (!goes_back_by_collocation()) {
        if (!impossible.empty())
            refuse("gradient: " + impossible + "; " + (affine_ ? "" : "take engine = auto, or ") + instead);
        if (!curved_.empty())
            refuse(
                "gradient: energies and torques of effects are not linear in the state; record others, or take "
                "engine = exponential");
        return;
    }
    if (!layout_.delays.empty() || !suits_exponential()) refuse("gradient: " + impossible + "; " + instead);
    // A bristle's rate has a kink where its body turns, which costs the way back its order.
    if (!layout_.memories.empty())
        refuse("gradient: " + machine_.effects()[static_cast<std::size_t>(layout_.memories.front().effect)].label +
               " keeps a state that is stiff while its body slides and has a kink where it turns; " + instead);
}

// What was asked for and can't be had together, said before anything moves. `impossible`: why the exact engine would not
// do, or empty.
void Simulation::refuse_what_is_not_exact(const std::string& impossible) const {
    if (!options_.gradient.empty()) refuse_gradient(impossible);
    if (options_.long_double && !(options_.sensitivities.empty() && options_.gradient.empty()))
        refuse("long_double = true: a reference run has no derivatives; leave one of them out");
    if (wants_exact() && !impossible.empty())
        refuse("engine = exact: " + impossible + "; take engine = auto, exponential, explicit or cvode");
}

// Where nothing ticks, nothing comes back late and no recorded input changes its form often, the exponential engine is seldom
// beaten, and says where it is. Sensitivities do not see such an input: with them it may do so often.
bool Simulation::steps_may_be_long() const {
    const exact::Generator generator(inputs_);
    const auto passed = std::count_if(generator.knots().begin(), generator.knots().end(),
                                      [this](double t) { return t > options_.start && t < options_.end; });
    const double apart = (options_.end - options_.start) / (1.0 + static_cast<double>(passed));
    return layout_.clocks.empty() && layout_.delays.empty() && (apart > long_step || !parameters_.empty());
}

// No step passes a tick, or is longer than a delay, s; infinite where there are none.
double Simulation::longest_stretch() const {
    double apart = std::numeric_limits<double>::infinity();
    for (const Clock& c : layout_.clocks) apart = std::min(apart, c.period);
    for (const auto& d : layout_.delays) apart = std::min(apart, machine_.values()[d.slot]);
    return apart;
}

// How long an input takes to come and go, s: a multistep method sees it at the ends of its steps only.
double Simulation::turning_time() const {
    double turning = std::numeric_limits<double>::infinity();
    for (const auto& [name, wave] : inputs_) turning = std::min(turning, wave.turning_time());
    return turning;
}

bool Simulation::suits_exponential() const {
    return exact::Generator(inputs_).size() + layout_.size() <= most_exact_states;
}

// Laws that are not affine, or whoever asks for it.
bool Simulation::goes_back_by_collocation() const {
    return !options_.gradient.empty() &&
           (options_.engine == Engine::exponential || (!affine_ && options_.engine != Engine::exact));
}

bool Simulation::wants_exact() const { return options_.engine == Engine::exact || options_.long_double; }

bool Simulation::chooses_engine() const {
    return options_.engine == Engine::automatic && options_.method == Method::automatic;
}

void Simulation::take_exact_solver(Solver::Size size) {
    std::vector<std::vector<std::size_t>> slots;
    for (const Parameter& p : parameters_) slots.push_back(p.slots);
    if (!options_.gradient.empty()) tape_ = std::make_unique<Tape>();
    const auto build = [&]<class R>() {
        typename exact::Exact<R>::Setup setup{machine_, inputs_,        layout_,      modes_,
                                              cell_,    options_.start, exact_grid(), recorded_,
                                              slots,    tape_.get(),    grid_steps()};
        return std::make_unique<exact::Exact<R>>(size, std::move(setup));
    };
    if (options_.long_double) {
        solver_ = build.operator()<long double>();
        return;
    }
    auto solver = build.operator()<double>();
    exact_ = solver.get();
    solver_ = std::move(solver);
}

std::unique_ptr<Exponential> Simulation::exponential_solver(Solver::Size size) {
    TracedParameters::Slots slots;
    std::vector<double> scale;
    for (const Parameter& p : parameters_) {
        slots.push_back(p.slots);
        scale.push_back(p.scale);
    }
    return std::make_unique<Exponential>(
        *this, size, options_.rtol,
        Exponential::Setup{machine_, inputs_, layout_, modes_, cell_, options_.start, exact_grid(), recorded_,
                           std::move(slots), std::move(scale), steps_.get()});
}

void Simulation::take_exponential_solver(Solver::Size size) {
    if (!options_.gradient.empty()) {
        tape_ = std::make_unique<Tape>();
        const std::vector<double> values = values_at_size(machine_, back_slots());
        steps_ = std::make_unique<exponential::Steps>(
            exponential::Steps{*tape_, {machine_, inputs_, layout_, values}, {machine_, inputs_, layout_, values}, {}});
    }
    auto solver = exponential_solver(size);
    if (tape_) exponential_ = solver.get();
    solver_ = std::move(solver);
}

void Simulation::choose_solver(int guards, std::span<const double> parameter_scale) {
    const Solver::Size size{layout_.size(), guards, static_cast<int>(parameters_.size()),
                            options_.energy ? static_cast<int>(powers) : 0};
    std::string impossible;
    const bool possible = exact_is_possible(impossible), left_open = chooses_engine();
    refuse_what_is_not_exact(impossible);
    const bool by_collocation =
        !wants_exact() && (options_.engine == Engine::exponential || goes_back_by_collocation());
    const bool must = wants_exact() || (!options_.gradient.empty() && !by_collocation);
    if (must || (left_open && possible && !by_collocation && !too_stiff_to_be_exact())) return take_exact_solver(size);
    if (possible) field_ = std::make_unique<AffineField>(machine_, inputs_, layout_, modes_, cell_);
    if (by_collocation) return take_exponential_solver(size);
    const auto cvode = [this, size, scale = std::vector<double>(parameter_scale.begin(), parameter_scale.end())](
                           Method m, double rtol) {
        const std::vector<int> falling(static_cast<std::size_t>(size.guards), -1);
        return std::unique_ptr<Solver>(std::make_unique<Cvode>(*this, size, m, rtol, falling, scale));
    };
    const auto explicit_solver =
        [this, size, scale = std::vector<double>(parameter_scale.begin(), parameter_scale.end())](double limit) {
            return std::unique_ptr<Solver>(std::make_unique<RungeKutta>(*this, size, options_.rtol, scale, limit));
        };
    const auto exponential = [this, size] { return std::unique_ptr<Solver>(exponential_solver(size)); };
    if (options_.engine == Engine::explicit_rk) {
        solver_ = explicit_solver(std::numeric_limits<double>::infinity());
        return;
    }
    const auto [rings, decays] = pace();
    const bool stiff = decays > stiff_beyond * rings;
    if (left_open && !stiff) {
        const double rtol = std::min(options_.rtol, std::max(finest_bdf, share_of_bdf * options_.rtol));
        const bool possible_at_all = suits_exponential(), first_choice = possible_at_all && steps_may_be_long();
        const double first = first_choice ? Handover::late : Handover::soon;
        const auto first_states =
            std::count_if(parameters_.begin(), parameters_.end(), [](const Parameter& p) { return p.slots.empty(); });
        const Prices others = prices(size.states, size.sensitivities, static_cast<int>(first_states));
        const Handover::Price price = first_choice ? favoured(others.exponential) : others.exponential;
        const double apart = longest_stretch();
        Handover::Candidate smooth{.make = exponential,
                                   .price = price,
                                   .lone = false,
                                   .best = apart / (exponential::intervals * price.rate + price.step)};
        std::vector<Handover::Candidate> candidates;
        if (first_choice) candidates.push_back(smooth);
        candidates.push_back(
            {.make = [explicit_solver, limit = stiff_beyond * rings] { return explicit_solver(limit); },
             .price = price_of_explicit,
             .first = first,
             .best = explicit_reach / decays});
        if (possible_at_all && !first_choice) candidates.push_back(smooth);
        candidates.push_back({.make = [cvode, rtol] { return cvode(Method::bdf, rtol); },
                              .price = others.bdf,
                              .share = share_of_bdf,
                              .first = first,
                              .best = std::min(apart, turning_time()) / others.bdf.step});
        solver_ = std::make_unique<Handover>(std::move(candidates), size.sensitivities, options_.end);
    } else if (options_.method != Method::automatic)
        solver_ = cvode(options_.method, options_.rtol);
    else
        solver_ = cvode(stiff ? Method::bdf : Method::adams, options_.rtol);
}

}  // namespace dualdrive
