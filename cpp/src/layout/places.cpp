// Where each effect acts.
#include "builder.hpp"
#include "dualdrive/effects.hpp"

namespace dualdrive {

void LayoutBuilder::place_effects() {
    const std::size_t bodies = m.bodies().size();
    l.effects_on_body.resize(bodies);
    l.friction_on_body.resize(bodies);
    l.effects_on_mesh.resize(m.connections().size());
    l.effects_in_motor.resize(m.motors().size());
    l.sensor_effects.resize(m.motors().size() + 1);
    l.encoder_effects.resize(m.motors().size());
    l.torque_estimates.resize(m.motors().size());
    l.loads.resize(bodies);
    for (std::size_t e = 0; e < m.effects().size(); ++e) {
        const auto& entry = m.effects()[e];
        const unsigned hooks = effect_type(entry.name).hooks;
        const int index = static_cast<int>(e);
        for (const auto& place : entry.members) {
            const int body = m.body(place);
            if (hooks & hook::body) l.effects_on_body[static_cast<std::size_t>(body)].push_back(index);
            remember(entry, index, body);
            if (hooks & hook::friction) l.friction_on_body[static_cast<std::size_t>(body)].push_back(index);
            if (hooks & hook::inertia) l.effects_on_inertia.push_back({e, static_cast<std::size_t>(body)});
            if (hooks & (hook::motor | hook::voltage))
                l.effects_in_motor[static_cast<std::size_t>(m.motor(place))].push_back(index);
            if (hooks & hook::estimate) l.torque_estimates[static_cast<std::size_t>(m.motor(place))].push_back(index);
            if (hooks & hook::mesh)
                for (std::size_t c = 0; c < m.connections().size(); ++c)
                    if (shapes(place, c)) l.effects_on_mesh[c].push_back(mesh_effect(place, c, index));
            if (hooks & (hook::reading | hook::delay)) {
                if (place == "table") l.sensor_effects[m.motors().size()].push_back(index);
                if (const int k = m.motor(place); k >= 0) {
                    l.sensor_effects[static_cast<std::size_t>(k)].push_back(index);
                    const EffectText& text = effect_type(entry.name).text;
                    if (text.of_angle || text.rounds) l.encoder_effects[static_cast<std::size_t>(k)].push_back(index);
                }
            }
            if (effect_type(entry.name).text.by_force && l.ring_meshes.empty()) ring_meshes();
        }
    }
}

void LayoutBuilder::ring_meshes() {
    for (std::size_t c = 0; c < m.connections().size(); ++c)
        if (const auto& k = m.connections()[c];
            !rigid(c) && k.frame == TwistFrame::driver && k.driven == m.body("table"))
            l.ring_meshes.push_back(static_cast<int>(c));
}

// A loss belongs to the wheel that drives, so that each mesh is counted once; the table drives none.
void LayoutBuilder::carry_loads() {
    for (std::size_t b = 0; b < m.bodies().size(); ++b) {
        const auto of = [&](bool as_driver) {
            for (std::size_t c = 0; c < m.connections().size(); ++c) {
                const auto& k = m.connections()[c];
                const bool in_driver_frame = k.frame == TwistFrame::driver;
                if (rigid(c) || (as_driver ? k.driver : k.driven) != static_cast<int>(b)) continue;
                l.loads[b].push_back(
                    {static_cast<int>(c), in_driver_frame && !as_driver, !in_driver_frame && as_driver});
            }
        };
        of(true);
        if (l.loads[b].empty()) of(false);
    }
}

void LayoutBuilder::remember(const EffectEntry& entry, int effect, int body) {
    const int count = effect_type(entry.name).memory;
    for (int k = 0; k < count; ++k) {
        const int s = state(entry.label + "[" + std::to_string(k) + "]", "");
        if (k == 0) l.memories.push_back({effect, body, s});
    }
}

Layout::MeshEffect LayoutBuilder::mesh_effect(const std::string& place, std::size_t c, int effect) const {
    const bool at_ring = place == "ring" || place == "table";
    const std::string& name = m.connections()[c].name;
    const auto digits = name.find_last_not_of("0123456789") + 1;
    return {effect, at_ring, at_ring && digits < name.size() ? std::stoi(name.substr(digits)) : 1};
}

// A mesh effect may be told a connection, the pinion that drives it, or the ring that every mesh shares.
bool LayoutBuilder::shapes(const std::string& place, std::size_t c) const {
    const auto& k = m.connections()[c];
    if (k.kind == ConnectionKind::rigid) return false;
    if (k.name == place) return true;
    const bool mesh = k.frame == TwistFrame::driver;
    if (place == "ring" || place == "table")
        return mesh && m.bodies()[static_cast<std::size_t>(k.driven)].name == "table";
    return mesh && m.bodies()[static_cast<std::size_t>(k.driver)].name == place;
}

}  // namespace dualdrive
