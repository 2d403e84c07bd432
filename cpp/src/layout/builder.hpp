// Fills a Layout part by part; each file of this folder is one kind of thing.
#pragma once

#include <string>
#include <vector>

#include "dualdrive/layout.hpp"

namespace dualdrive {

class LayoutBuilder {
  public:
    LayoutBuilder(Layout& layout, const Machine& machine, const Inputs& inputs, Delays delays)
        : l(layout), m(machine), in(inputs), delays_are(delays) {}

    void build() {
        group_bodies();
        check_joints();
        mechanical_states();
        electrical_states();
        if (m.controlled()) controller_states();
        place_effects();
        carry_loads();
        name_signals();
        delay_lines();
        switching_elements();
    }

  private:
    Layout& l;
    const Machine& m;
    const Inputs& in;
    const Delays delays_are;

    int state(const std::string& name, const std::string& unit) {
        l.state_names.push_back(name);
        l.state_units.push_back(unit);
        return l.size() - 1;
    }
    double value(std::size_t first, std::size_t k) const { return m.values()[first + k]; }
    Controller<double> controller() const {
        return read_component<Controller<double>>(m.values().data() + m.controller_first());
    }
    bool rigid(std::size_t c) const { return m.connections()[c].kind == ConnectionKind::rigid; }

    // bodies.cpp
    void group_bodies();
    void grow(std::size_t root, std::vector<bool>& seen);
    bool extend(std::vector<std::size_t>& reached, std::vector<bool>& seen, bool through_rigid);
    void check_joints() const;
    void mechanical_states();
    void electrical_states();

    // control.cpp
    int add_block(Loop loop, int drive, const std::string& name, bool integrates, double sample, double latency,
                  const std::string& unit);
    void controller_states();
    void delay_lines();

    // places.cpp
    void place_effects();
    void ring_meshes();
    void carry_loads();
    void remember(const EffectEntry& entry, int effect, int body);
    Layout::MeshEffect mesh_effect(const std::string& place, std::size_t c, int effect) const;
    bool shapes(const std::string& place, std::size_t c) const;

    // signals.cpp
    int signal(const std::string& name, const std::string& unit, const std::string& long_name);
    void name_signals();

    // switches.cpp
    int element(SwitchKind kind, int index, const std::string& name);
    bool gains_play(std::size_t c) const;
    void switching_elements();
};

}  // namespace dualdrive
