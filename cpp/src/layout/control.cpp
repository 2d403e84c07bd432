// What the controller remembers, its clocks, and what reaches it late.
#include <stdexcept>

#include "builder.hpp"
#include "dualdrive/delay_approximant.hpp"
#include "dualdrive/effects.hpp"

namespace dualdrive {

int LayoutBuilder::add_block(Loop loop, int drive, const std::string& name, bool integrates, double sample,
                             double latency, const std::string& unit) {
    BlockPlace b{loop, drive, name};
    if (integrates) b.integrator = state(name + ".integral", "");
    if (sample > 0) b.held = state(name + ".held", unit);
    if (sample > 0 && latency > 0) b.pending = state(name + ".pending", unit);
    l.blocks.push_back(b);
    return static_cast<int>(l.blocks.size()) - 1;
}

void LayoutBuilder::controller_states() {
    const auto c = controller();
    const auto& options = m.controller();
    l.position_block =
        add_block(Loop::position, 0, "controller.position", c.K_i > 0, c.position_sample, c.position_latency, "rad/s");
    if (c.K_d > 0) l.derivative_filter = state("controller.derivative", "rad");
    if (options.position_sensor == ControllerOptions::PositionSensor::both)
        l.sensor_filter = state("controller.sensor", "rad");
    if (m.motors().size() > 1 && c.tau_t > 0) l.tension_filter = state("controller.tension", "N*m");
    for (std::size_t k = 0; k < m.motors().size(); ++k) {
        const int drive = static_cast<int>(k);
        const std::string n = channel_suffix(m.motors()[k].name);
        if (k > 0)
            l.tension_block.push_back(add_block(Loop::tension, drive, "controller.equaliser_" + n,
                                                c.T_E > 0 && c.g_E > 0, c.tension_sample, c.tension_latency, "rad/s"));
        l.speed_block.push_back(
            add_block(Loop::speed, drive, "controller.speed_" + n, c.T_N > 0, c.speed_sample, c.speed_latency, "N*m"));
        l.current_block.push_back(m.motors()[k].kind == MotorKind::direct
                                      ? -1
                                      : add_block(Loop::current, drive, "controller.current_" + n,
                                                  options.current == ControllerOptions::CurrentLoop::cascade,
                                                  c.current_sample, c.current_latency, "V"));
        const bool filters = read_component<Motor<double>>(m.values().data() + m.motors()[k].first).filter_pole > 0;
        l.set_point_filter.push_back(filters ? state("controller.filter_" + n + "[0]", "N*m") : -1);
        if (filters) state("controller.filter_" + n + "[1]", "N*m");
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

void LayoutBuilder::delay_lines() {
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
    if (delays_are == Delays::exact) return;
    for (std::size_t k = 0; k < l.delays.size(); ++k) {
        DelayLine& line = l.delays[k];
        const bool command = static_cast<int>(k) == l.command_delay || static_cast<int>(k) == l.slave_delay;
        if (command && controller().position_sample > 0)
            continue;  // it comes in steps, which no rational filter passes on
        line.state = l.size();
        for (int i = 0; i < DelayApproximant::order; ++i)
            state(line.name + "_" + std::to_string(k) + "[" + std::to_string(i) + "]",
                  l.signals[static_cast<std::size_t>(line.source)].unit);
    }
}

}  // namespace dualdrive
