#include "dualdrive/layout.hpp"

#include <algorithm>
#include <stdexcept>

#include "dualdrive/effects.hpp"
#include "dualdrive/expression.hpp"

namespace dualdrive {

std::string channel_suffix(const std::string& body) {
    if (body == "table") return "m";
    if (body.starts_with("motor_")) return body.substr(6);
    if (body.starts_with("pinion_")) return "c" + body.substr(7);
    return body;
}

namespace {

// Fills a Layout part by part; each method is one kind of thing.
class Builder {
  public:
    Builder(Layout& layout, const Machine& machine, const Inputs& inputs) : l(layout), m(machine), in(inputs) {}

    void build() {
        group_bodies();
        walk_angles();
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

    // Walk outward from the table so that every group's reference body is the one nearest to it: a drive with a rigid
    // reducer is then described in its pinion's frame, as in Eq. 11.
    void group_bodies() {
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

    void grow(std::size_t root, std::vector<bool>& seen) {
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

    bool extend(std::vector<std::size_t>& reached, std::vector<bool>& seen, bool through_rigid) {
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

    void walk_angles() {
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

    void mechanical_states() {
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
            l.root_angle.push_back(
                state("theta_" + channel_suffix(m.bodies()[static_cast<std::size_t>(r)].name), "rad"));
    }

    void electrical_states() {
        for (std::size_t k = 0; k < m.motors().size(); ++k)
            l.current.push_back(
                m.motors()[k].kind == MotorKind::armature ? state("I_" + channel_suffix(m.motors()[k].name), "A") : -1);
    }

    int add_block(Loop loop, int drive, const std::string& name, bool integrates, double sample, double latency,
                  const std::string& unit) {
        BlockPlace b{loop, drive, name};
        if (integrates) b.integrator = state(name + ".integral", "");
        if (sample > 0) b.held = state(name + ".held", unit);
        if (sample > 0 && latency > 0) b.pending = state(name + ".pending", unit);
        l.blocks.push_back(b);
        return static_cast<int>(l.blocks.size()) - 1;
    }

    void controller_states() {
        const auto c = controller();
        const auto& options = m.controller();
        l.position_block = add_block(Loop::position, 0, "controller.position", c.K_i > 0, c.position_sample,
                                     c.position_latency, "rad/s");
        if (c.K_d > 0) l.derivative_filter = state("controller.derivative", "rad");
        if (m.motors().size() > 1 && c.tau_t > 0) l.tension_filter = state("controller.tension", "N*m");
        for (std::size_t k = 0; k < m.motors().size(); ++k) {
            const int drive = static_cast<int>(k);
            const std::string n = channel_suffix(m.motors()[k].name);
            if (k > 0)
                l.tension_block.push_back(add_block(Loop::tension, drive, "controller.equaliser_" + n,
                                                    c.T_E > 0 && c.g_E > 0, c.tension_sample, c.tension_latency,
                                                    "rad/s"));
            l.speed_block.push_back(add_block(Loop::speed, drive, "controller.speed_" + n, c.T_N > 0, c.speed_sample,
                                              c.speed_latency, "N*m"));
            l.current_block.push_back(m.motors()[k].kind == MotorKind::direct
                                          ? -1
                                          : add_block(Loop::current, drive, "controller.current_" + n,
                                                      options.current == ControllerOptions::CurrentLoop::cascade,
                                                      c.current_sample, c.current_latency, "V"));
            l.encoder_history.push_back(-1);
            for (int h = 0; h < options.speed_samples; ++h) {
                const int s = state("controller.encoder_" + n + "[" + std::to_string(h) + "]", "rad");
                if (h == 0) l.encoder_history.back() = s;
            }
        }
        const auto clock = [&](Loop loop, double period, double latency) {
            if (period > 0) l.clocks.push_back({loop, period, latency});
        };
        clock(Loop::position, c.position_sample, c.position_latency);
        clock(Loop::tension, c.tension_sample, c.tension_latency);
        clock(Loop::speed, c.speed_sample, c.speed_latency);
        clock(Loop::current, c.current_sample, c.current_latency);
    }

    void place_effects() {
        const std::size_t bodies = m.bodies().size();
        l.effects_on_body.resize(bodies);
        l.friction_on_body.resize(bodies);
        l.effects_on_mesh.resize(m.connections().size());
        l.effects_in_motor.resize(m.motors().size());
        l.sensor_effects.resize(m.motors().size() + 1);
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
                if (hooks & hook::estimate)
                    l.torque_estimates[static_cast<std::size_t>(m.motor(place))].push_back(index);
                if (hooks & hook::mesh)
                    for (std::size_t c = 0; c < m.connections().size(); ++c)
                        if (shapes(place, c)) l.effects_on_mesh[c].push_back(mesh_effect(place, c, index));
                if (hooks & (hook::reading | hook::delay)) {
                    if (place == "table") l.sensor_effects[m.motors().size()].push_back(index);
                    if (const int k = m.motor(place); k >= 0)
                        l.sensor_effects[static_cast<std::size_t>(k)].push_back(index);
                }
            }
        }
    }

    // A loss belongs to the wheel that drives, so that each mesh is counted once; the table drives none.
    void carry_loads() {
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

    void remember(const EffectEntry& entry, int effect, int body) {
        const int count = effect_type(entry.name).memory;
        for (int k = 0; k < count; ++k) {
            const int s = state(entry.label + "[" + std::to_string(k) + "]", "");
            if (k == 0) l.memories.push_back({effect, body, s});
        }
    }

    Layout::MeshEffect mesh_effect(const std::string& place, std::size_t c, int effect) const {
        const bool at_ring = place == "ring" || place == "table";
        const std::string& name = m.connections()[c].name;
        const auto digits = name.find_last_not_of("0123456789") + 1;
        return {effect, at_ring, at_ring && digits < name.size() ? std::stoi(name.substr(digits)) : 1};
    }

    // A mesh effect may be told a connection, the pinion that drives it, or the ring that every mesh shares.
    bool shapes(const std::string& place, std::size_t c) const {
        const auto& k = m.connections()[c];
        if (k.kind == ConnectionKind::rigid) return false;
        if (k.name == place) return true;
        const bool mesh = k.frame == TwistFrame::driver;
        if (place == "ring" || place == "table")
            return mesh && m.bodies()[static_cast<std::size_t>(k.driven)].name == "table";
        return mesh && m.bodies()[static_cast<std::size_t>(k.driver)].name == place;
    }

    int signal(const std::string& name, const std::string& unit, const std::string& long_name) {
        l.signals.push_back({name, unit, long_name});
        return static_cast<int>(l.signals.size()) - 1;
    }

    void name_signals() {
        auto& at = l.at;
        at.theta_ref = signal("theta_ref", "rad", "commanded angle, table frame");
        at.omega_ref = signal("omega_ref", "rad/s", "commanded speed, table frame");
        at.T_load = signal("T_load", "N*m", "load torque on the table, opposing positive motion");
        at.e = signal("e", "rad", "following error, theta_ref minus theta_m");
        for (const auto& b : m.bodies()) {
            const std::string s = channel_suffix(b.name);
            at.angle.push_back(signal("theta_" + s, "rad", b.name + " angle"));
            at.speed.push_back(signal("omega_" + s, "rad/s", b.name + " speed"));
            at.acceleration.push_back(signal("alpha_" + s, "rad/s^2", b.name + " acceleration"));
        }
        for (const auto& c : m.connections()) {
            at.twist.push_back(signal(c.name + ".twist", "rad", c.name + " twist, pinion frame"));
            at.deflection.push_back(signal(c.name + ".deflection", "rad", c.name + " twist with geometric errors"));
            at.torque.push_back(signal(c.name + ".torque", "N*m", c.name + " torque, pinion frame"));
            at.flank.push_back(signal(c.name + ".flank", "", c.name + " flank: -1 back, 0 in the gap, 1 front"));
        }
        for (const auto& k : m.motors()) {
            const std::string s = channel_suffix(k.name);
            at.I.push_back(signal("I_" + s, "A", k.name + " current"));
            at.U.push_back(signal("U_" + s, "V", k.name + " voltage"));
            at.T.push_back(signal("T_" + s, "N*m", k.name + " torque, motor side"));
            at.Omega.push_back(
                signal("Omega_" + s + "*", "rad/s", k.name + " speed set-point after tension, pinion frame"));
            at.T_ref.push_back(signal("T_" + s + "*", "N*m", k.name + " torque set-point"));
        }
        at.Omega_1 = signal("Omega_1", "rad/s", "speed command of the position loop, pinion frame");
        if (m.controlled() && controller().delta_c > 0)
            at.Omega_0 = signal("Omega_0", "rad/s", "speed command before the command lag, pinion frame");
        at.tension = signal("tension", "N*m", "filtered tension set-point");
        for (const auto& k : m.motors())
            at.sensor.push_back(signal("sensed." + k.name, "rad/s", k.name + " speed as the drive reads it"));
        at.sensor.push_back(signal("sensed.table", "rad", "table angle as the control reads it"));
        for (const auto& e : m.effects()) {  // those that act through a torque of their own
            const unsigned hooks = effect_type(e.name).hooks;
            const bool torque = hooks & (hook::body | hook::friction | hook::motor | hook::inertia);
            at.effect.push_back(torque ? signal(e.label, "N*m", "torque of " + e.label) : -1);
        }
        for (const auto& [name, waveform] : in)
            at.input.push_back(l.signal(name) >= 0 && name != "theta_ref" && name != "T_load"
                                   ? -1
                                   : signal("in." + name, "", "input " + name));
        at.stored_energy = signal("energy.stored", "J", "kinetic, magnetic and mesh energy");
    }

    void delay_lines() {
        l.sensor_delay.assign(m.motors().size() + 1, -1);
        if (!m.controlled()) return;
        const auto lag = [&](const char* path, int source) {
            l.delays.push_back({path, source, m.resolve(path).front()});
            return static_cast<int>(l.delays.size()) - 1;
        };
        if (controller().delta_c > 0) l.command_delay = lag("controller.delta_c", l.at.Omega_0);
        if (m.motors().size() > 1 && controller().delta_t > 0) l.slave_delay = lag("controller.delta_t", l.at.Omega_1);
        for (std::size_t s = 0; s < l.sensor_effects.size(); ++s)
            for (const int e : l.sensor_effects[s]) {
                const auto& entry = m.effects()[static_cast<std::size_t>(e)];
                if (!(effect_type(entry.name).hooks & hook::delay) || value(entry.first, 0) == 0.0) continue;
                if (l.sensor_delay[s] >= 0)
                    throw std::invalid_argument("effect " + entry.label +
                                                ": this sensor has a delay already; change that one");
                l.sensor_delay[s] = static_cast<int>(l.delays.size());
                const bool table = s == m.motors().size();
                const int body = table ? l.table : m.motors()[s].body;
                const auto b = static_cast<std::size_t>(body);
                l.delays.push_back({entry.label + ".delay", table ? l.at.angle[b] : l.at.speed[b], entry.first});
            }
    }

    int element(SwitchKind kind, int index, const std::string& name) {
        l.switches.push_back({kind, index, name});
        return static_cast<int>(l.switches.size()) - 1;
    }

    bool gains_play(std::size_t c) const {
        return std::any_of(l.effects_on_mesh[c].begin(), l.effects_on_mesh[c].end(), [&](const Layout::MeshEffect& at) {
            return effect_type(m.effects()[static_cast<std::size_t>(at.effect)].name).text.makes_play;
        });
    }

    void switching_elements() {
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
};

}  // namespace

Layout::Layout(const Machine& machine, const Inputs& inputs) {
    machine.validate();
    Builder(*this, machine, inputs).build();
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

}  // namespace dualdrive
