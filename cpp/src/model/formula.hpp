// A user's formula as an effect on a body: it reads named signals and its own parameters.
#pragma once

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "dualdrive/effect.hpp"
#include "dualdrive/expression.hpp"
#include "dualdrive/layout.hpp"

namespace dualdrive {

template <class S>
class FormulaEffect final : public Effect<S> {
  public:
    FormulaEffect(const EffectEntry& entry, const Machine& machine, const Layout& layout, const S* values)
        : expression_(Expression::parse(entry.formula)) {
        // Local names of the place come first, then the machine's signals, then the formula's parameters.
        for (const auto& name : expression_.names()) sources_.push_back(find(name, entry, machine, layout));
        slots_.resize(sources_.size());
        int k = 0;
        expression_.bind([&](std::string_view) { return k++; });
        for (std::size_t s = 0; s < sources_.size(); ++s)
            if (sources_[s].kind == Source::parameter) slots_[s] = values[sources_[s].index];
    }

    S torque_on_body(const BodyPort<S>& at) const override {
        fill(at);
        return expression_.evaluate(slots_.data(), at.branches);
    }
    void switch_values(const BodyPort<S>& at, S* out) const override {
        fill(at);
        expression_.switch_values(slots_.data(), at.branches, out);
    }

  private:
    struct Source {
        enum Kind { time, angle, speed, signal, parameter } kind;
        std::size_t index = 0;
    };

    static Source find(const std::string& name, const EffectEntry& entry, const Machine& machine,
                       const Layout& layout) {
        if (name == "t") return {Source::time};
        if (name == "angle") return {Source::angle};
        if (name == "speed") return {Source::speed};
        for (std::size_t k = 0; k < entry.count; ++k)
            if (machine.slots()[entry.first + k].path == entry.label + "." + name) return {Source::parameter, k};
        int signal = layout.signal(name);
        if (signal < 0) signal = layout.signal("in." + name);
        const bool early = signal >= 0 && !name.starts_with("alpha_") && !name.starts_with("energy.");
        if (!early)
            throw std::invalid_argument(
                "effect " + entry.label + ": the formula reads '" + name +
                "', which is neither a signal known before body torques, t, angle, speed, nor a parameter of it");
        return {Source::signal, static_cast<std::size_t>(signal)};
    }

    void fill(const BodyPort<S>& at) const {
        for (std::size_t s = 0; s < sources_.size(); ++s) switch (sources_[s].kind) {
                case Source::time:
                    slots_[s] = at.t;
                    break;
                case Source::angle:
                    slots_[s] = at.angle;
                    break;
                case Source::speed:
                    slots_[s] = at.speed;
                    break;
                case Source::signal:
                    slots_[s] = at.signals[sources_[s].index];
                    break;
                case Source::parameter:
                    break;
            }
    }

    Expression expression_;
    std::vector<Source> sources_;
    mutable std::vector<S> slots_;  // scratch; a model belongs to one thread
};

}  // namespace dualdrive
