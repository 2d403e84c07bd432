// What no single number of a machine shows: clocks, filters, and sensors that nothing reads or that come too late.
#include <cmath>

#include "dualdrive/effects.hpp"
#include "dualdrive/machine.hpp"
#include "refuse.hpp"

namespace dualdrive {

namespace {

using Law = Controller<double>;
using Sensor = ControllerOptions::PositionSensor;

void check_ratings(const Machine& machine) {
    for (const auto& e : machine.effects())
        for (const auto& m : e.members)
            if (effect_type(e.name).text.of_rating && !std::isfinite(machine.get(m + ".T_rated")))
                refuse("effect " + e.label + ": it is measured against the rated torque; set " + m + ".T_rated");
}

void check_latencies(const Law& law) {
    const auto check = [](double latency, double sample, const char* loop) {
        if (latency > 0 && sample == 0)
            refuse(std::string("controller.") + loop + "_latency: needs a sample time; set controller." + loop +
                   "_sample");
        if (latency > sample)
            refuse(std::string("controller.") + loop + "_latency: " + rounded(latency) + " s exceeds the sample time " +
                   rounded(sample) + " s");
    };
    check(law.position_latency, law.position_sample, "position");
    check(law.tension_latency, law.tension_sample, "tension");
    check(law.speed_latency, law.speed_sample, "speed");
    check(law.current_latency, law.current_sample, "current");
}

void check_speed_samples(int samples, const Law& law) {
    constexpr int most = 100;  // each is a state of its own
    if (samples < 0 || samples > most)
        refuse("controller.speed_samples: " + std::to_string(samples) + " must be 0 .. " + std::to_string(most));
    if (samples > 0 && law.speed_sample == 0)
        refuse(
            "controller.speed_samples: a differenced encoder needs a sampled speed loop; set controller.speed_sample");
}

// A filter stepped by forward Euler swings ever wider from two filter times per sample on.
void check_filter(double time, double sample, const char* filter, const char* sampled) {
    if (time > 0 && sample >= 2.0 * time)
        refuse(std::string("controller.") + sampled + ": " + rounded(sample) +
               " s is no sample time for the filter controller." + filter + " = " + rounded(time) +
               " s; sample faster than twice per filter time, or filter longer");
}

// Sensors that nothing reads, and a late or rounding one that the angle of a motor can't have.
void check_position_sensor(const Machine& machine, const Law& law) {
    const Sensor sensor = machine.controller().position_sensor;
    if (sensor == Sensor::table) return;
    const std::string& master = machine.motors().front().name;
    for (const auto& e : machine.effects()) {
        const EffectType& type = effect_type(e.name);
        const bool angle = type.text.of_angle || type.text.rounds || type.text.by_force;
        for (const auto& m : e.members) {
            const bool late = (type.hooks & hook::delay) && machine.values()[e.first] > 0.0;
            if (sensor == Sensor::motor && m == "table" && (late || (angle && (type.hooks & hook::reading))))
                refuse("effect " + e.label +
                       ": with controller.position_sensor = motor nothing in the loop reads the "
                       "table's encoder; take the effect out, or choose table or both");
            if (m == master && late)
                refuse("effect " + e.label + ": with controller.position_sensor = " +
                       (sensor == Sensor::motor ? "motor" : "both") + " the angle of " + m +
                       " is read as well as its speed, and has no delay of its own; use controller.delta_c, or "
                       "choose table");
            if (m == master && type.text.rounds && law.position_sample == 0)
                refuse("effect " + e.label +
                       ": a continuous position loop would switch at every count; set controller.position_sample");
        }
    }
}

// Rounding in the loop, where that is not sampled or reads no counts.
void check_rounding(const Machine& machine, const Law& law) {
    for (const auto& e : machine.effects()) {
        if (!effect_type(e.name).text.rounds) continue;
        for (const auto& m : e.members) {
            if (m == "table" && law.position_sample == 0)
                refuse("effect " + e.label +
                       ": a continuous position loop would switch at every count; set controller.position_sample, or "
                       "place it at the recorded channel theta_m");
            if (machine.motor(m) >= 0 && machine.controller().speed_samples == 0)
                refuse("effect " + e.label + ": the drive of " + m +
                       " reads a speed without counts; set controller.speed_samples and speed_sample, or place it at a "
                       "recorded channel");
        }
    }
}

void check_speed_sensors(const Machine& machine) {
    const int samples = machine.controller().speed_samples;
    if (samples == 0) return;
    for (const auto& e : machine.effects()) {
        const EffectType& type = effect_type(e.name);
        if (!(type.hooks & (hook::reading | hook::delay)) || type.text.of_angle || type.text.rounds) continue;
        for (const auto& m : e.members)
            if (machine.motor(m) >= 0)
                refuse("effect " + e.label + ": with controller.speed_samples = " + std::to_string(samples) +
                       " the drive differences the encoder of " + m +
                       " and reads no speed sensor; set speed_samples = 0 or move the effect to table");
    }
}

// A direct torque source has its torque at once: what would be fed back from it must wait for a clock.
void check_direct_motors(const Machine& machine, const Law& law) {
    if (machine.motors().size() < 2 || law.speed_sample != 0) return;
    for (const auto& m : machine.motors()) {
        if (m.kind != MotorKind::direct) continue;
        if (machine.controller().tension == ControllerOptions::Schedule::falling)
            refuse("motor " + m.name +
                   ": a direct torque source under continuous speed loops has no torque of its own that a falling "
                   "tension could follow; use kind = armature, a sampled speed loop, or another tension");
        if (law.g_E > 0 && law.tension_sample == 0)
            refuse("motor " + m.name +
                   ": a direct torque source under a continuous torque equaliser is an algebraic loop; "
                   "use kind = armature, a sampled loop, or controller.g_E = 0");
    }
}

}  // namespace

void Machine::validate() const {
    if (bodies_.empty()) refuse("machine: no bodies");
    check_ratings(*this);
    if (!controlled()) return;
    if (motors_.empty()) refuse("controller: the machine has no motor to command");
    if (body("table") < 0)
        refuse("controller: the machine has no body named table, whose angle the position loop reads");
    const auto law = read_component<Law>(values_.data() + controller_first_);
    check_latencies(law);
    check_speed_samples(controller_.speed_samples, law);
    if (law.K_d > 0) check_filter(law.tau_d, law.position_sample, "tau_d", "position_sample");
    if (motors_.size() > 1) check_filter(law.tau_t, law.tension_sample, "tau_t", "tension_sample");
    check_position_sensor(*this, law);
    if (controller_.position_sensor == Sensor::both)
        check_filter(law.tau_s, law.position_sample, "tau_s", "position_sample");
    check_rounding(*this, law);
    check_speed_sensors(*this);
    check_direct_motors(*this, law);
}

}  // namespace dualdrive
