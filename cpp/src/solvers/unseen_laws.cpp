#include "unseen_laws.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dualdrive/effects.hpp"
#include "dualdrive/growth.hpp"
#include "dualdrive/model.hpp"

// The laws once more, on a scalar that knows how it grows.
#include "../model/curve.hpp"
#include "../model/formula.hpp"
// clang-format off: in this order
#include "../model/assembly.ipp"
#include "../model/control.ipp"
#include "../model/guards.ipp"
#include "../model/mechanics.ipp"
// clang-format on

namespace dualdrive {

template class Model<Growth>;

struct BentRows::Hidden {
    Inputs still, growing;  // growing: affine in time, so that an input is affine where time is
    Model<Growth> model;
    std::vector<Growth> z;
    std::vector<int> groups;  // with laws on a body that may show another piece elsewhere: a spline, a cut
};

namespace {

constexpr double far_below = 1e-6;  // of its typical size

bool bends(const EffectEntry& effect) { return effect.of_user() || !effect_type(effect.name).text.affine; }

std::vector<int> groups_with_laws(const Machine& machine, const Layout& layout) {
    std::vector<int> groups;
    const auto bends_it = [&](int e) { return bends(machine.effects()[static_cast<std::size_t>(e)]); };
    for (std::size_t b = 0; b < layout.effects_on_body.size(); ++b)
        if (std::any_of(layout.effects_on_body[b].begin(), layout.effects_on_body[b].end(), bends_it))
            groups.push_back(layout.group_of[b]);
    return groups;
}

}  // namespace

// Of a spline in turn up and down: equal values would be a constant.
std::vector<double> values_at_size(const Machine& machine, const std::vector<std::vector<std::size_t>>& parameters) {
    std::vector<double> values = machine.values();
    for (const EffectEntry& effect : machine.effects()) {
        if (!bends(effect)) continue;
        const auto is_own = [&](std::size_t slot) {
            return slot >= effect.first && slot < effect.first + effect.count;
        };
        for (const auto& slots : parameters)
            for (const std::size_t slot : slots) {
                const double size = machine.slots()[slot].typical;
                if (!is_own(slot) || !(std::abs(machine.values()[slot]) < far_below * size)) continue;
                values[slot] = !effect.axes.empty() && (slot - effect.first) % 2 == 1 ? -size : size;
            }
    }
    return values;
}

BentRows::BentRows(const Machine& machine, const Inputs& inputs, const Layout& layout,
                   const std::vector<double>& values)
    : h_(std::make_unique<Hidden>(
          Hidden{inputs, inputs, {machine, inputs, layout}, {}, groups_with_laws(machine, layout)})) {
    for (auto& [name, waveform] : h_->still) waveform = Waveform();
    for (auto& [name, waveform] : h_->growing) waveform = Waveform({0.0}, {Polynomial{1.0, 1.0}, Polynomial{1.0, 1.0}});
    h_->z.resize(static_cast<std::size_t>(layout.size()));
    const std::vector<Growth> grown(values.begin(), values.end());
    h_->model.set_parameters(grown.data());
}

BentRows::BentRows(BentRows&&) noexcept = default;
BentRows::~BentRows() = default;

// Time itself is no state: a law that has it bends a rate, an input that has it does not.
template <class See>
void BentRows::evaluate(const Modes& modes, double t, const double* z, const See& see) {
    for (std::size_t i = 0; i < h_->z.size(); ++i) h_->z[i] = Growth::variable(z[i]);
    for (const bool inputs_grow : {true, false}) {
        h_->model.set_inputs(inputs_grow ? h_->growing : h_->still);
        const Growth time = Growth::variable(t, inputs_grow ? Growth::affine : Growth::other);
        h_->model.evaluate(time, h_->z.data(), {modes.data(), Cell{}, nullptr});
        see();
    }
}

std::vector<int> BentRows::in(const Modes& modes, double t, const double* z) {
    std::vector<bool> bent(h_->z.size(), false);
    evaluate(modes, t, z, [&] {
        for (std::size_t i = 0; i < bent.size(); ++i) bent[i] = bent[i] || h_->model.rate()[i].kind == Growth::other;
    });
    for (const int g : h_->groups) {
        const auto k = static_cast<std::size_t>(g);
        const int stick = h_->model.layout().stick_of[k];
        bent[k] = bent[k] || stick < 0 || modes[static_cast<std::size_t>(stick)] != stick::stuck;
    }
    std::vector<int> rows;
    for (std::size_t i = 0; i < bent.size(); ++i)
        if (bent[i]) rows.push_back(static_cast<int>(i));
    return rows;
}

bool BentRows::spare(const std::vector<int>& signals, const Modes& modes, double t, const double* z) {
    const auto& at = h_->model.layout().at;
    const auto contains = [](const std::vector<int>& list, int s) {
        return std::find(list.begin(), list.end(), s) != list.end();
    };
    bool all = true;
    for (const int s : signals)  // a law that may show another piece elsewhere shows it here
        all = all && !contains(at.effect, s) && (h_->groups.empty() || !contains(at.acceleration, s));
    if (!all) return false;
    evaluate(modes, t, z, [&] {
        for (const int s : signals) all = all && h_->model.signals()[static_cast<std::size_t>(s)].kind != Growth::other;
    });
    return all;
}

UnseenLaws::UnseenLaws(const Machine& machine, const Inputs& inputs, const Layout& layout,
                       const std::vector<double>& values)
    : any_(values != machine.values()), model_(machine, inputs, layout) {
    model_.set_parameters(values.data());
}

const std::vector<double>& UnseenLaws::rates(double t, const double* z, const Modes& modes, const Cell& cell) {
    model_.evaluate(t, z, {.modes = modes.data(), .cell = cell, .past = nullptr, .scope = Scope::dynamics});
    return model_.rate();
}

}  // namespace dualdrive
