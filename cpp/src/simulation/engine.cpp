// Which engine integrates a run, and why another would not do.
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "../solvers/cvode.hpp"
#include "../solvers/exact/exact.hpp"
#include "../solvers/explicit/runge_kutta.hpp"
#include "instant.hpp"
#include "simulation.hpp"

namespace dualdrive {

namespace {

constexpr int most_exact_states = 256;  // of machine, controller and inputs: dense matrices beyond that do not pay
constexpr double near_multiple = 1e-9;

// Whether b is a whole multiple of a.
bool divides(double a, double b) { return std::abs(b / a - std::round(b / a)) < near_multiple && b > 0.5 * a; }

}  // namespace

bool Simulation::exact_is_possible(std::string& reason) const {
    if (!affine_) reason = "an effect of this machine is not affine in its modes";
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

void Simulation::choose_solver(int guards, std::span<const double> parameter_scale) {
    const Solver::Size size{layout_.size(), guards, static_cast<int>(parameters_.size()),
                            options_.energy ? static_cast<int>(powers) : 0};
    std::string reason;
    const bool asked = options_.engine == Engine::exact || options_.long_double;
    const bool possible = exact_is_possible(reason) && parameters_.empty();
    if (asked && !possible)
        throw std::invalid_argument("engine = exact: " + reason + "; take engine = auto, explicit or cvode");
    const bool left_open = options_.engine == Engine::automatic && options_.method == Method::automatic;
    if (asked || (left_open && possible)) {
        const auto build = [&]<class R>() {
            typename exact::Exact<R>::Setup setup{machine_,       inputs_,      layout_,   modes_, cell_,
                                                  options_.start, exact_grid(), recorded_, {}};
            return std::make_unique<exact::Exact<R>>(*this, size, std::move(setup));
        };
        if (options_.long_double)
            solver_ = build.operator()<long double>();
        else
            solver_ = build.operator()<double>();
        return;
    }
    if (options_.engine == Engine::explicit_rk) {
        solver_ = std::make_unique<RungeKutta>(*this, size, options_.rtol, parameter_scale);
        return;
    }
    const std::vector<int> direction(static_cast<std::size_t>(guards), -1);
    solver_ = std::make_unique<Cvode>(*this, size, choose_method(), options_.rtol, direction, parameter_scale);
}

}  // namespace dualdrive
