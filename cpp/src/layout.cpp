#include <algorithm>

#include "dualdrive/layout.hpp"

#include "layout/builder.hpp"

namespace dualdrive {

std::string channel_suffix(const std::string& body) {
    if (body == "table") return "m";
    if (body.starts_with("motor_")) return body.substr(6);
    if (body.starts_with("pinion_")) return "c" + body.substr(7);
    return body;
}

Layout::Layout(const Machine& machine, const Inputs& inputs, Delays how) {
    machine.validate();
    LayoutBuilder(*this, machine, inputs, how).build();
}

int Layout::signal(std::string_view name) const {
    for (std::size_t k = 0; k < signals.size(); ++k)
        if (signals[k].name == name) return static_cast<int>(k);
    return -1;
}

int Layout::state(std::string_view name) const {
    for (std::size_t k = 0; k < state_names.size(); ++k)
        if (state_names[k] == name) return static_cast<int>(k);
    return -1;
}

bool Layout::is_placed(int signal) const {
    const auto one_of = [signal](const std::vector<int>& those) {
        return std::find(those.begin(), those.end(), signal) != those.end();
    };
    return one_of(at.angle) || one_of(at.speed) || one_of(at.twist) || one_of(at.I);
}

}  // namespace dualdrive
