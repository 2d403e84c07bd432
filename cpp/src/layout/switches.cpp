// What switches, and the names that events give it.
#include <algorithm>

#include "builder.hpp"
#include "dualdrive/effects.hpp"
#include "dualdrive/expression.hpp"

namespace dualdrive {

int LayoutBuilder::element(SwitchKind kind, int index, const std::string& name) {
    l.switches.push_back({kind, index, name});
    return static_cast<int>(l.switches.size()) - 1;
}

bool LayoutBuilder::gains_play(std::size_t c) const {
    return std::any_of(l.effects_on_mesh[c].begin(), l.effects_on_mesh[c].end(), [&](const Layout::MeshEffect& at) {
        return effect_type(m.effects()[static_cast<std::size_t>(at.effect)].name).text.makes_play;
    });
}

void LayoutBuilder::switching_elements() {
    l.flank_of.assign(m.connections().size(), -1);
    for (std::size_t c = 0; c < m.connections().size(); ++c) {
        const auto& k = m.connections()[c];
        // Zero gap is a named special case: the connection is compliant, and no flank opens unless an effect makes play.
        const bool tight = read_component<Connection<double>>(m.values().data() + k.first).gap == 0.0;
        if (k.kind != ConnectionKind::gap || (tight && !gains_play(c))) continue;
        l.flank_of[c] = element(SwitchKind::flank, static_cast<int>(c), k.name);
    }
    l.stick_of.assign(static_cast<std::size_t>(l.groups), -1);
    for (std::size_t b = 0; b < m.bodies().size(); ++b) {
        const auto g = static_cast<std::size_t>(l.group_of[b]);
        if (l.friction_on_body[b].empty() || l.stick_of[g] >= 0 || l.locked[g]) continue;
        l.stick_of[g] = element(SwitchKind::stick, l.group_of[b], "friction of " + l.state_names[g].substr(6));
    }
    for (std::size_t b = 0; b < l.blocks.size(); ++b)
        if (l.blocks[b].held < 0)
            l.blocks[b].limiter = element(SwitchKind::limiter, static_cast<int>(b), l.blocks[b].name);
    if (m.controlled() && m.motors().size() > 1 && m.controller().tension == ControllerOptions::Schedule::falling) {
        l.tension_sum_branch = element(SwitchKind::branch, 0, "controller.tension sum");
        l.tension_zero_branch = element(SwitchKind::branch, 1, "controller.tension zero");
    }
    l.branch_of.assign(m.effects().size(), std::vector<int>(m.bodies().size(), -1));
    for (std::size_t e = 0; e < m.effects().size(); ++e) {
        const auto& entry = m.effects()[e];
        if (entry.formula.empty()) continue;
        const int count = Expression::parse(entry.formula).switches();
        int number = 2;
        for (const auto& member : entry.members)
            for (int k = 0; k < count; ++k) {
                const int s = element(SwitchKind::branch, number++, entry.label);
                if (k == 0) l.branch_of[e][static_cast<std::size_t>(m.body(member))] = s;
            }
    }
}

}  // namespace dualdrive
