#include "dualdrive/recorder.hpp"

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "dualdrive/effects.hpp"

namespace dualdrive {

namespace {

constexpr unsigned sensing = hook::reading | hook::delay;

bool is_sensor_effect(const EffectEntry& effect) {
    return std::any_of(effect_types().begin(), effect_types().end(),
                       [&](const EffectType& type) { return effect.name == type.text.name && (type.hooks & sensing); });
}

// Whether an effect changes the angle that the sensor of a place reads: at a motor an offset is one of the speed.
bool changes_angle(const EffectEntry& effect, bool at_motor) {
    const EffectType& type = effect_type(effect.name);
    return !at_motor || type.text.of_angle || type.text.rounds || (type.hooks & hook::delay);
}

// The effects at a channel or sensor, their numbers out of `values`, which are the machine's.
template <class S>
std::vector<std::unique_ptr<Effect<S>>> effects_with(const Machine& machine, const std::string& channel,
                                                     const S* values) {
    std::vector<std::unique_ptr<Effect<S>>> found;
    const bool at_motor = machine.motor(channel) >= 0;
    for (const auto& e : machine.effects())
        if (effect_type(e.name).text.by_force && channel == "table")
            throw std::invalid_argument("effect " + e.label +
                                        ": what this sensor reads follows from the forces of the teeth, not from a "
                                        "recorded angle; a run has it as the signal sensed.table");
    for (const auto& e : machine.effects())
        if (is_sensor_effect(e) && changes_angle(e, at_motor) &&
            std::find(e.members.begin(), e.members.end(), channel) != e.members.end())
            found.push_back(make_effect<S>(e.name, values + e.first));
    return found;
}

// The same with slopes along up to `directions` parameters.
std::vector<std::unique_ptr<Effect<Gradient>>> effects_at(const Machine& machine, const std::string& channel,
                                                          const std::vector<std::vector<std::size_t>>& slots,
                                                          std::size_t first) {
    std::vector<Gradient> values(machine.values().begin(), machine.values().end());
    for (std::size_t d = 1; d < directions && first + d - 1 < slots.size(); ++d)
        for (const auto slot : slots[first + d - 1]) values[slot].slope[d] = 1.0;
    return effects_with<Gradient>(machine, channel, values.data());
}

std::vector<std::vector<std::size_t>> slots_of(const Machine& machine, const std::vector<std::string>& parameters) {
    std::vector<std::vector<std::size_t>> slots;
    for (const auto& path : parameters) slots.push_back(machine.resolve(path));
    return slots;
}

Measures measures(const Machine& machine, const std::string& channel) {
    const bool angle = channel.starts_with("theta_") || channel == "table" || machine.motor(channel) >= 0;
    return angle ? Measures::angle : Measures::other;
}

constexpr std::size_t at_once = directions - 1;  // the first direction is the signal's own

}  // namespace

std::vector<std::unique_ptr<Effect<double>>> reading_effects(const Machine& machine,
                                                             const std::vector<std::string>& places) {
    std::vector<std::unique_ptr<Effect<double>>> found;
    for (const std::string& place : places)
        for (auto& effect : effects_with<double>(machine, place, machine.values().data()))
            found.push_back(std::move(effect));
    return found;
}

bool on_record(const Machine& machine, const EffectEntry& effect) {
    return is_sensor_effect(effect) &&
           std::none_of(effect.members.begin(), effect.members.end(),
                        [&](const std::string& m) { return m == "table" || machine.motor(m) >= 0; });
}

std::vector<std::string> recorded_channels(const Machine& machine) {
    std::vector<std::string> channels;
    for (const auto& e : machine.effects()) {
        if (!on_record(machine, e)) continue;
        for (const auto& m : e.members)
            if (std::find(channels.begin(), channels.end(), m) == channels.end()) channels.push_back(m);
    }
    return channels;
}

RecorderDelay recorder_delay(const Machine& machine, const std::string& channel,
                             const std::vector<std::string>& parameters) {
    const auto slots = slots_of(machine, parameters);
    RecorderDelay late{0.0, std::vector<double>(parameters.size(), 0.0)};
    for (std::size_t first = 0; first == 0 || first < slots.size(); first += at_once) {
        Gradient time(0.0);
        for (const auto& effect : effects_at(machine, channel, slots, first)) time += effect->delay();
        late.time = time.value;
        for (std::size_t d = 0; d < at_once && first + d < slots.size(); ++d)
            late.slopes[first + d] = time.slope[d + 1];
    }
    return late;
}

Recording record(const Machine& machine, const std::string& channel, const std::vector<double>& t,
                 const std::vector<double>& signal, const std::vector<std::string>& parameters) {
    if (t.size() != signal.size())
        throw std::invalid_argument("channel " + channel + ": " + std::to_string(signal.size()) + " values at " +
                                    std::to_string(t.size()) + " times; give one each");
    const auto slots = slots_of(machine, parameters);
    const std::size_t rows = t.size(), np = parameters.size();
    Recording out{std::vector<double>(rows), std::vector<double>(rows), std::vector<double>(rows * np)};
    for (std::size_t first = 0; first == 0 || first < np; first += at_once) {
        const auto effects = effects_at(machine, channel, slots, first);
        for (std::size_t row = 0; row < rows; ++row) {
            Gradient y = Gradient::variable(signal[row], 0);
            for (const auto& effect : effects) y = effect->reading(y, {Gradient(t[row]), measures(machine, channel)});
            out.values[row] = y.value;
            out.by_signal[row] = y.slope[0];
            for (std::size_t d = 0; d < at_once && first + d < np; ++d)
                out.slopes[row * np + first + d] = y.slope[d + 1];
        }
    }
    return out;
}

}  // namespace dualdrive
