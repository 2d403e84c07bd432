#include "dualdrive/linearise.hpp"

#include <algorithm>
#include <stdexcept>

#include "dualdrive/layout.hpp"
#include "dualdrive/model.hpp"
#include "dualdrive/switching.hpp"
#include "simulation/affine.hpp"
#include "simulation/affine_field.hpp"
#include "simulation/mode_rules.hpp"

namespace dualdrive {

namespace {

constexpr Mode modes_from = -3, modes_to = 3;

Mode mode_of(const Switch& element, const std::string& name) {
    std::string known;
    for (Mode m = modes_from; m <= modes_to; ++m) {
        const std::string candidate = mode_name(element.kind, m);
        if (candidate == name) return m;
        if (candidate != "?") known += (known.empty() ? "" : ", ") + candidate;
    }
    throw std::invalid_argument("linearise: " + element.name + " has no mode '" + name + "'; choose one of " + known);
}

Modes modes_of(const Layout& layout, const std::map<std::string, std::string>& given) {
    Modes modes(layout.switches.size(), 0);
    std::vector<std::string> known;
    for (std::size_t e = 0; e < modes.size(); ++e) {
        const Switch& element = layout.switches[e];
        known.push_back(element.name);
        if (element.kind == SwitchKind::branch) modes[e] = branch::positive;
        if (const auto it = given.find(element.name); it != given.end()) modes[e] = mode_of(element, it->second);
    }
    for (const auto& [name, mode] : given)
        if (std::find(known.begin(), known.end(), name) == known.end())
            throw std::invalid_argument("linearise: no switching element named " + name + near_names(name, known));
    return modes;
}

std::vector<double> state_of(const Layout& layout, const std::map<std::string, double>& given) {
    std::vector<double> z(static_cast<std::size_t>(layout.size()), 0.0);
    for (const auto& [name, value] : given) {
        const int k = layout.state(name);
        if (k < 0) throw std::invalid_argument("linearise: no state " + name + near_names(name, layout.state_names));
        z[static_cast<std::size_t>(k)] = value;
    }
    return z;
}

}  // namespace

LinearSystem linearise(const Machine& machine, const Inputs& inputs, const std::map<std::string, std::string>& modes,
                       const std::map<std::string, double>& state, double t) {
    const Layout layout(machine, inputs);
    const Modes frozen = modes_of(layout, modes);
    const std::vector<double> z = state_of(layout, state);
    const std::size_t n = z.size(), outputs = layout.signals.size();
    LinearSystem s{layout.state_names, {}, std::vector<double>(n * n), {}, std::vector<double>(outputs * n), {}};
    for (const auto& signal : layout.signals) s.signals.push_back(signal.name);

    Model<Gradient> model(machine, inputs, layout);
    std::vector<Gradient> seeded(n);
    for (std::size_t first = 0; first < n; first += directions) {
        const std::size_t count = std::min<std::size_t>(directions, n - first);
        for (std::size_t k = 0; k < n; ++k) seeded[k] = Gradient(z[k]);
        for (std::size_t d = 0; d < count; ++d) seeded[first + d].slope[d] = 1.0;
        model.evaluate(Gradient(t), seeded.data(), {frozen.data(), Cell{}, nullptr, nullptr});
        for (std::size_t d = 0; d < count; ++d) {
            for (std::size_t row = 0; row < n; ++row) s.A[row * n + first + d] = model.rate()[row].slope[d];
            for (std::size_t row = 0; row < outputs; ++row) s.C[row * n + first + d] = model.signals()[row].slope[d];
        }
    }
    const auto offset = [&](const std::vector<Gradient>& value, const std::vector<double>& matrix) {
        std::vector<double> rest;
        for (std::size_t row = 0; row < value.size(); ++row) {
            double r = value[row].value;
            for (std::size_t k = 0; k < n; ++k) r -= matrix[row * n + k] * z[k];
            rest.push_back(r);
        }
        return rest;
    };
    s.a = offset(model.rate(), s.A);
    s.c = offset(model.signals(), s.C);
    return s;
}

FrozenLaws frozen_laws(const Machine& machine, const Inputs& inputs, const std::map<std::string, std::string>& modes,
                       const std::map<std::string, double>& state, double t, const Cell& cell, LawsOf of) {
    const Layout layout(machine, inputs);
    const Modes frozen = modes_of(layout, modes);
    const std::vector<double> z = state_of(layout, state);
    FrozenLaws laws;
    laws.guards.resize(frozen.size() * guards_per_switch);
    if (of == LawsOf::matrices) {
        if (const auto effect = effect_that_is_not_affine(machine))
            throw std::invalid_argument("frozen_laws: effect " + *effect + " is not affine: no matrices say its law");
        AffineField field(machine, inputs, layout, frozen, cell);
        laws.rates.resize(z.size());
        laws.guard_slopes.resize(laws.guards.size());
        field.rates(t, z.data(), laws.rates.data());
        field.guards(t, z.data(), laws.guards.data());
        field.guard_slopes(laws.guard_slopes.data());
        return laws;
    }
    Model<double> model(machine, inputs, layout);
    model.evaluate(t, z.data(), {frozen.data(), cell, nullptr, nullptr});
    laws.rates = model.rate();
    Model<Gradient> along(machine, inputs, layout);
    std::vector<Gradient> z_along;
    std::vector<double> block_rates;
    rates_of_blocks(along, t, z.data(), laws.rates.data(), {frozen.data(), cell, nullptr, nullptr}, z_along,
                    block_rates);
    model.guards(laws.guards.data(), block_rates.data());
    return laws;
}

std::map<std::string, std::vector<std::string>> possible_modes(const Machine& machine, const Inputs& inputs) {
    std::map<std::string, std::vector<std::string>> possible;
    for (const Switch& element : Layout(machine, inputs).switches)
        for (Mode m = modes_from; m <= modes_to; ++m)
            if (const std::string name = mode_name(element.kind, m); name != "?")
                possible[element.name].push_back(name);
    return possible;
}

}  // namespace dualdrive
