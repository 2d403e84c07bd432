// A user's formula as an effect on a body: it reads named signals and its own parameters.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "dualdrive/effect.hpp"
#include "dualdrive/expression.hpp"
#include "dualdrive/layout.hpp"
#include "source.hpp"

namespace dualdrive {

template <class S>
class FormulaEffect final : public Effect<S> {
  public:
    FormulaEffect(const EffectEntry& entry, const Machine& machine, const Layout& layout, const S* values)
        : expression_(Expression::parse(entry.formula)) {
        // Local names of the place come first, then the formula's parameters, then the machine's signals.
        for (const auto& name : expression_.names()) set_up(name, entry, machine, layout, values);
        int k = 0;
        expression_.bind([&](std::string_view) { return k++; });
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
    // A parameter of its own has its value from the start; every other name is read from the port.
    void set_up(const std::string& name, const EffectEntry& entry, const Machine& machine, const Layout& layout,
                const S* values) {
        slots_.emplace_back(0.0);
        for (std::size_t k = 0; k < entry.count; ++k)
            if (machine.slots()[entry.first + k].path == entry.label + "." + name && !is_local(name)) {
                slots_.back() = values[k];
                return;
            }
        const auto source = find_source(name, layout);
        if (!source)
            throw std::invalid_argument(
                "effect " + entry.label + ": the formula reads '" + name +
                "', which is neither a signal known before body torques, t, angle, speed, nor a parameter of it");
        read_.push_back({slots_.size() - 1, *source});
    }

    static bool is_local(const std::string& name) { return name == "t" || name == "angle" || name == "speed"; }

    void fill(const BodyPort<S>& at) const {
        for (const auto& [slot, source] : read_) slots_[slot] = source.read(at);
    }

    struct Reading {
        std::size_t slot;
        Source source;
    };

    Expression expression_;
    std::vector<Reading> read_;
    mutable std::vector<S> slots_;  // scratch; a model belongs to one thread
};

}  // namespace dualdrive
