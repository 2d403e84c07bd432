// What a run was asked for: options and sensitivities, checked before anything moves.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "instant.hpp"
#include "simulation.hpp"

namespace dualdrive {

namespace {

// Numbers whose 0 takes a state, a delay or a flank out of the equations, so that no derivative is left of them there.
bool is_switch(std::string_view path) {
    for (const std::string_view name :
         {"controller.K_i", "controller.K_d", "controller.T_N", "controller.T_E", "controller.g_E", "controller.tau_t",
          "controller.delta_c", "controller.delta_t"})
        if (path == name) return true;
    return path.ends_with(".gap") || (path.starts_with("sensor_delay@") && path.ends_with(".time"));
}

}  // namespace

void Simulation::read_options() {
    const auto refuse = [](const std::string& what) { throw std::invalid_argument(what); };
    if (!std::isfinite(options_.start) || !std::isfinite(options_.end) || !(options_.end > options_.start))
        refuse("simulate: end = " + text(options_.end) +
               " s must be a finite time after start = " + text(options_.start) + " s");
    if (!(options_.rtol >= 1e-14 && options_.rtol <= 1e-2))
        refuse("simulate: rtol = " + text(options_.rtol) + " must lie between 1e-14 and 1e-2");
    if (options_.method != Method::automatic && options_.engine != Engine::automatic &&
        options_.engine != Engine::cvode)
        refuse("simulate: method is of the cvode engine alone; leave it out, or ask for engine = cvode");
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
    for (std::size_t k = 0; k < recorded_.size(); ++k) {
        // energies are quadratic, and at rest laws of friction share what is needed
        const auto& effects = layout_.at.effect;
        const int s = recorded_[k];
        all_.push_back(k);
        placed_ = placed_ && layout_.is_placed(s);
        if (s == layout_.at.stored_energy || std::find(effects.begin(), effects.end(), s) != effects.end())
            curved_.push_back(k);
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
                   "controller, other columns belong to a user's law" +
                   near_names(name, {"theta_ref", "T_load"}));
}

// A misspelt input would otherwise be a run without it.
bool Simulation::is_read(const std::string& input) const {
    if (input == "theta_ref" || (input == "T_load" && layout_.table >= 0)) return true;
    for (const auto& m : machine_.motors())
        if (!machine_.controlled() && input == (m.kind == MotorKind::armature ? "U_" : "T_") + channel_suffix(m.name))
            return true;
    return std::any_of(machine_.effects().begin(), machine_.effects().end(), [&](const EffectEntry& e) {
        const auto names = names_read(e);
        return std::any_of(names.begin(), names.end(),
                           [&](const std::string& name) { return name == input || name == "in." + input; });
    });
}

Simulation::Parameter Simulation::read_parameter(const std::string& path) const {
    Parameter p{{}, -1, 1.0};
    if (path.starts_with("initial.")) {
        p.initial_state = layout_.state(path.substr(8));
        if (p.initial_state < 0)
            throw std::invalid_argument("sensitivity " + path + ": no such state" +
                                        near_names(path.substr(8), layout_.state_names));
        return p;
    }
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
    return p;
}

void Simulation::read_parameters() {
    if (!options_.sensitivities.empty() && !options_.gradient.empty())
        throw std::invalid_argument("gradient and sensitivities: a run goes back or forward; ask for one of them");
    if (options_.rows && !options_.gradient.empty())
        throw std::invalid_argument("gradient: its run must keep all rows; take it one run at a time");
    for (const auto& path : options_.sensitivities) parameters_.push_back(read_parameter(path));
    for (const auto& path : options_.gradient) back_parameters_.push_back(read_parameter(path));
    out_.parameters = options_.sensitivities;
    out_.gradient = options_.gradient;
    chunk_ = seeded_models(parameters_);
}

// One model per `directions` parameters, each with its slopes along them.
std::vector<std::unique_ptr<Model<Gradient>>> Simulation::seeded_models(
    const std::vector<Parameter>& parameters) const {
    std::vector<std::unique_ptr<Model<Gradient>>> models;
    for (std::size_t first = 0; first < parameters.size(); first += directions) {
        models.push_back(std::make_unique<Model<Gradient>>(machine_, inputs_, layout_));
        std::vector<Gradient> values(machine_.values().begin(), machine_.values().end());
        for (std::size_t d = 0; d < directions && first + d < parameters.size(); ++d)
            for (const auto slot : parameters[first + d].slots) values[slot].slope[d] = 1.0;
        models.back()->set_parameters(values.data());
    }
    return models;
}

}  // namespace dualdrive
