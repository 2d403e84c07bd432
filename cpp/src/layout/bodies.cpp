// Groups of bodies that are joined rigidly, and the states of mechanics and motors.
#include <algorithm>
#include <stdexcept>

#include "builder.hpp"

namespace dualdrive {

// Walk outward from the table so that every group's reference body is the one nearest to it: a drive with a rigid
// reducer is then described in its pinion's frame, as in Eq. 11.
void LayoutBuilder::group_bodies() {
    const std::size_t n = m.bodies().size();
    l.group_of.assign(n, -1);
    std::vector<bool> seen(n, false);
    l.table = m.body("table");
    for (std::size_t start = 0; start < n; ++start) {
        const std::size_t root = start == 0 && l.table >= 0 ? static_cast<std::size_t>(l.table) : start;
        if (!seen[root]) grow(root, seen);
        if (!seen[start]) grow(start, seen);
    }
}

void LayoutBuilder::grow(std::size_t root, std::vector<bool>& seen) {
    l.roots.push_back(static_cast<int>(root));
    seen[root] = true;
    l.group_of[root] = l.groups++;
    l.locked.push_back(m.bodies()[root].locked);
    // Rigid neighbours first, so that a group is complete before play or compliance is crossed.
    std::vector<std::size_t> reached{root};
    for (bool grown = true; grown;) {
        grown = extend(reached, seen, true);
        if (!grown) grown = extend(reached, seen, false);
    }
}

bool LayoutBuilder::extend(std::vector<std::size_t>& reached, std::vector<bool>& seen, bool through_rigid) {
    for (std::size_t r = 0; r < reached.size(); ++r)
        for (std::size_t c = 0; c < m.connections().size(); ++c) {
            const auto& k = m.connections()[c];
            if (rigid(c) != through_rigid) continue;
            const int from = static_cast<int>(reached[r]);
            const bool outward_is_driver = k.driven == from;
            if (!outward_is_driver && k.driver != from) continue;
            const int next = outward_is_driver ? k.driver : k.driven;
            const auto body = static_cast<std::size_t>(next);
            if (seen[body]) continue;
            seen[body] = true;
            l.steps.push_back({next, from, static_cast<int>(c), outward_is_driver});
            if (through_rigid) {
                l.group_of[body] = l.group_of[reached[r]];
                if (m.bodies()[body].locked) l.locked[static_cast<std::size_t>(l.group_of[body])] = true;
            } else {
                l.group_of[body] = l.groups++;
                l.locked.push_back(m.bodies()[body].locked);
            }
            reached.push_back(body);
            return true;
        }
    return false;
}

// Every twist is a state of its own: no connection may join what is joined rigidly already.
void LayoutBuilder::check_joints() const {
    for (std::size_t c = 0; c < m.connections().size(); ++c) {
        const auto& k = m.connections()[c];
        const bool same =
            l.group_of[static_cast<std::size_t>(k.driver)] == l.group_of[static_cast<std::size_t>(k.driven)];
        if (same && !rigid(c))
            throw std::invalid_argument("connection " + k.name + ": both its ends are joined rigidly already");
        if (rigid(c) && std::none_of(l.steps.begin(), l.steps.end(),
                                     [&](const Layout::Step& s) { return s.connection == static_cast<int>(c); }))
            throw std::invalid_argument("connection " + k.name +
                                        ": a rigid connection closes a loop; the machine is overdetermined");
    }
}

void LayoutBuilder::mechanical_states() {
    std::vector<std::string> group_name(static_cast<std::size_t>(l.groups));
    for (std::size_t b = m.bodies().size(); b-- > 0;)
        if (auto& g = group_name[static_cast<std::size_t>(l.group_of[b])]; g.empty()) g = m.bodies()[b].name;
    // the reference body names the group: the first reached, which is a root or the far end of a soft connection
    for (const auto& s : l.steps)
        if (!rigid(static_cast<std::size_t>(s.connection)))
            group_name[static_cast<std::size_t>(l.group_of[static_cast<std::size_t>(s.body)])] =
                m.bodies()[static_cast<std::size_t>(s.body)].name;
    for (const int r : l.roots)
        group_name[static_cast<std::size_t>(l.group_of[static_cast<std::size_t>(r)])] =
            m.bodies()[static_cast<std::size_t>(r)].name;
    for (const auto& g : group_name) state("omega_" + channel_suffix(g), "rad/s");
    l.twist.assign(m.connections().size(), -1);
    for (std::size_t c = 0; c < m.connections().size(); ++c)
        if (!rigid(c)) l.twist[c] = state(m.connections()[c].name + ".twist", "rad");
    for (const int r : l.roots)
        l.root_angle.push_back(state("theta_" + channel_suffix(m.bodies()[static_cast<std::size_t>(r)].name), "rad"));
}

void LayoutBuilder::electrical_states() {
    for (std::size_t k = 0; k < m.motors().size(); ++k)
        l.current.push_back(
            m.motors()[k].kind == MotorKind::armature ? state("I_" + channel_suffix(m.motors()[k].name), "A") : -1);
}

}  // namespace dualdrive
