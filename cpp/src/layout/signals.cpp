// The names of what a run can record.
#include "builder.hpp"
#include "dualdrive/effects.hpp"

namespace dualdrive {

int LayoutBuilder::signal(const std::string& name, const std::string& unit, const std::string& long_name) {
    l.signals.push_back({name, unit, long_name});
    return static_cast<int>(l.signals.size()) - 1;
}

void LayoutBuilder::name_signals() {
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
    for (std::size_t k = 0; k < m.motors().size(); ++k) {
        const bool filters = k < l.set_point_filter.size() && l.set_point_filter[k] >= 0;
        const std::string& n = m.motors()[k].name;
        at.filtered.push_back(filters ? signal("filtered." + n, "N*m", n + " torque set-point behind its filter") : -1);
    }
    at.Omega_1 = signal("Omega_1", "rad/s", "speed command of the position loop, pinion frame");
    if (m.controlled() && controller().delta_c > 0)
        at.Omega_0 = signal("Omega_0", "rad/s", "speed command before the command lag, pinion frame");
    at.tension = signal("tension", "N*m", "filtered tension set-point");
    for (const auto& k : m.motors())
        at.sensor.push_back(signal("sensed." + k.name, "rad/s", k.name + " speed as the drive reads it"));
    at.sensor.push_back(signal("sensed.table", "rad",
                               m.controller().position_sensor == ControllerOptions::PositionSensor::table
                                   ? "table angle as the control reads it"
                                   : "table angle as the control has it from its position sensors"));
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

}  // namespace dualdrive
