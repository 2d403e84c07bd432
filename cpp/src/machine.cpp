#include "dualdrive/machine.hpp"

#include "refuse.hpp"

namespace dualdrive {

std::size_t Machine::declare(const std::string& prefix, const Declaration* list, std::size_t count) {
    const std::size_t first = slots_.size();
    for (std::size_t k = 0; k < count; ++k) {
        const Declaration& d = list[k];
        const std::string_view declared = d.name;
        const bool clock = declared.ends_with("_sample") || declared.ends_with("_latency");
        slots_.push_back({prefix + "." + d.name, d.unit, d.doc, d.bounds, d.standard, d.typical, clock, d.counted});
        values_.push_back(d.standard);
    }
    return first;
}

template <class Component>
std::size_t Machine::declare(const std::string& prefix) {
    std::vector<Declaration> list;
    for (const auto& f : Component::parameters()) list.push_back(f.declaration);
    return declare(prefix, list.data(), list.size());
}

void Machine::add_body(const std::string& body_name, bool locked) {
    if (body(body_name) >= 0) refuse("body " + body_name + ": a body of this name is there already");
    bodies_.push_back({body_name, declare<Body<double>>(body_name), locked});
}

void Machine::connect(const std::string& connection_name, const std::string& driver, const std::string& driven,
                      ConnectionKind kind, TwistFrame frame) {
    if (connection(connection_name) >= 0) refuse("connection " + connection_name + ": the name is taken");
    for (const auto& end : {driver, driven})
        if (body(end) < 0) refuse("connection " + connection_name + ": no body named " + end);
    if (driver == driven) refuse("connection " + connection_name + ": joins " + driver + " to itself");
    connections_.push_back(
        {connection_name, kind, frame, body(driver), body(driven), declare<Connection<double>>(connection_name), kind});
}

void Machine::add_motor(const std::string& motor_name, const std::string& body_name, MotorKind kind) {
    if (motor(motor_name) >= 0) refuse("motor " + motor_name + ": the name is taken");
    const int b = body(body_name);
    if (b < 0) refuse("motor " + motor_name + ": no body named " + body_name);
    // The chain to the table: a reducer with the motor's body as driver, then the mesh behind it.
    MotorEntry entry{motor_name, kind, b, -1, -1, 0};
    const auto driven_by = [&](int who) {
        for (std::size_t c = 0; c < connections_.size(); ++c)
            if (connections_[c].driver == who) return static_cast<int>(c);
        return -1;
    };
    const auto at = [&](int c) { return connections_[static_cast<std::size_t>(c)]; };
    const int first = driven_by(b);
    if (first >= 0 && at(first).frame == TwistFrame::driver) {
        entry.mesh = first;
    } else if (first >= 0) {
        entry.gearbox = first;
        entry.mesh = driven_by(at(first).driven);
    }
    entry.first = declare<Motor<double>>(motor_name);
    motors_.push_back(entry);
}

void Machine::set_controller(const ControllerOptions& options) {
    if (!controlled() && options.kind != ControllerOptions::Kind::none && controller_first_ == 0)
        controller_first_ = declare<Controller<double>>("controller");
    controller_ = options;
}

int Machine::body(std::string_view wanted) const {
    for (std::size_t k = 0; k < bodies_.size(); ++k)
        if (bodies_[k].name == wanted) return static_cast<int>(k);
    return -1;
}
int Machine::connection(std::string_view wanted) const {
    for (std::size_t k = 0; k < connections_.size(); ++k)
        if (connections_[k].name == wanted) return static_cast<int>(k);
    return -1;
}
int Machine::motor(std::string_view wanted) const {
    for (std::size_t k = 0; k < motors_.size(); ++k)
        if (motors_[k].name == wanted) return static_cast<int>(k);
    return -1;
}

}  // namespace dualdrive
