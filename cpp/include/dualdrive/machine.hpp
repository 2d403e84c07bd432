// A machine as an assembly: bodies, connections, motors, a controller and effects, with every number in one flat
// parameter vector. The source paper's model is one instance of it: motor and pinion joined rigidly by the reducer, two
// meshes, one table; Eq. 14 without play, Eq. 17 with it, Eq. 22 with selectors in place of the dead zone.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "dualdrive/body.hpp"
#include "dualdrive/connection.hpp"
#include "dualdrive/controller.hpp"
#include "dualdrive/motor.hpp"
#include "dualdrive/parameter.hpp"

namespace dualdrive {

struct EffectType;

// One number of the machine: where it is found and what was declared about it.
struct ParameterSlot {
    std::string path;  // mesh_1.gap, table.J, controller.K_v, coulomb@table.torque
    std::string unit, doc;
    Bounds bounds;
    double standard, typical;
    bool clock = false;    // a sample time or latency: no derivative with respect to it
    bool counted = false;  // not fitted unless named
};

struct BodyEntry {
    std::string name;
    std::size_t first;  // of its parameters in the flat vector
    bool locked = false;
};

struct ConnectionEntry {
    std::string name;
    ConnectionKind kind;
    TwistFrame frame;
    int driver, driven;
    std::size_t first;
    ConnectionKind built;  // as it was connected; `kind` is that, or what an effect makes of it
};

// A drive: motor, the reducer behind it (-1: none), and the mesh that joins it to the table (-1: none).
struct MotorEntry {
    std::string name;
    MotorKind kind;
    int body, gearbox, mesh;
    std::size_t first;
};

// One coordinate of a learned curve and its knots, evenly spaced from low to high, in the coordinate's SI unit.
struct CurveAxis {
    std::string coordinate;  // t, angle or speed of the body, a signal, or in.NAME for a recorded column
    double low, high;
    int knots;
    bool periodic = false;  // high is low again: the last knot stands one step before it
};

// A recorded column that a user's law reads, and its unit.
struct Column {
    std::string name, unit;
};

struct EffectEntry {
    std::string name, place, label;    // label: name@place, the prefix of its parameters
    std::vector<std::string> members;  // the places it sits at, groups resolved
    std::string formula;               // of an expression effect
    std::size_t first, count;
    std::vector<CurveAxis> axes = {};  // of a spline effect
    std::vector<Column> columns = {};  // of a user's law
    bool of_user() const { return !formula.empty() || !axes.empty(); }
};

// The names that a user's law reads: signals, recorded columns, own parameters; none for an effect of the registry.
std::vector<std::string> names_read(const EffectEntry& effect);

// A parameter of a user's formula.
struct FormulaParameter {
    std::string name, unit;
    double value;
};

class Machine {
  public:
    std::string name = "machine";

    // Assembly. Names are unique; bodies come before the connections and motors that use them.
    // Errors: std::invalid_argument naming the part, its value and the rule.
    void add_body(const std::string& name, bool locked = false);
    void connect(const std::string& name, const std::string& driver, const std::string& driven, ConnectionKind kind,
                 TwistFrame frame);
    void add_motor(const std::string& name, const std::string& body, MotorKind kind);
    void set_controller(const ControllerOptions& options);
    const std::string& add_effect(const std::string& name, const std::string& place);
    const std::string& add_expression(const std::string& place, const std::string& formula,
                                      const std::vector<FormulaParameter>& parameters,
                                      const std::vector<Column>& columns = {});
    // A torque on a body as a curve over one coordinate or two; values, N·m at the knots, run along the last axis first.
    const std::string& add_spline(const std::string& place, const std::vector<CurveAxis>& axes,
                                  const std::vector<double>& values, double usual_size,
                                  const std::vector<Column>& columns = {});
    void remove_effect(const std::string& label);

    // Parameters by path or tie group: `meshes.gap` is mesh_1.gap, mesh_2.gap, ...; `current_limit@motors.T_max`, of an
    // effect that is a part of the machine, is motor_1.T_max, motor_2.T_max, ...
    std::vector<std::size_t> resolve(std::string_view path) const;  // std::invalid_argument with near names
    // Why no law reads the number at a path, the gap of a rigid mesh say; empty where one does. A group is read where any
    // of its members is.
    std::string unread(std::string_view path) const;
    double get(std::string_view path) const;        // members of a group must agree
    void set(std::string_view path, double value);  // checks finiteness and bounds

    // Everything that one parameter alone can't show: masses where there is motion, clocks, delays, places.
    void validate() const;

    const std::vector<ParameterSlot>& slots() const { return slots_; }
    const std::vector<double>& values() const { return values_; }
    const std::vector<BodyEntry>& bodies() const { return bodies_; }
    const std::vector<ConnectionEntry>& connections() const { return connections_; }
    const std::vector<MotorEntry>& motors() const { return motors_; }
    const std::vector<EffectEntry>& effects() const { return effects_; }
    const EffectEntry& effect(const std::string& label) const;  // throws std::invalid_argument with the nearest labels
    const ControllerOptions& controller() const { return controller_; }
    bool controlled() const { return controller_.kind != ControllerOptions::Kind::none; }
    std::size_t controller_first() const { return controller_first_; }
    int body(std::string_view name) const;        // -1 when there is none
    int connection(std::string_view name) const;  // -1 when there is none
    int motor(std::string_view name) const;       // -1 when there is none

  private:
    std::size_t declare(const std::string& prefix, const Declaration* declarations, std::size_t count);
    template <class Component>
    std::size_t declare(const std::string& prefix);
    std::vector<std::string> members_of(std::string_view group) const;
    const std::string& append_effect(EffectEntry entry);
    EffectEntry user_law(const char* effect_name, const std::string& place, std::size_t count,
                         const std::vector<Column>& columns) const;
    std::string unread(std::size_t slot) const;
    bool shapes_a_mesh(const std::string& place, bool with_play = false) const;
    void check_place(const EffectType& type, const std::string& member) const;

    // Effects that are parts of the machine (structural.hpp).
    void check_part(const EffectType& type, const std::string& member) const;
    void check_joint(const EffectType& type, const std::string& member) const;
    void settle_joints();
    void switch_off(const EffectEntry& removed);
    std::vector<std::size_t> lent(std::string_view path) const;
    double nearly_rigid(const ConnectionEntry& joint) const;

    std::vector<BodyEntry> bodies_;
    std::vector<ConnectionEntry> connections_;
    std::vector<MotorEntry> motors_;
    std::vector<EffectEntry> effects_;
    ControllerOptions controller_;
    std::size_t controller_first_ = 0;
    std::vector<ParameterSlot> slots_;
    std::vector<double> values_;
};

// Names nearest to a misspelt one, for error messages: ", did you mean a or b?" or "".
std::string near_names(std::string_view wrong, const std::vector<std::string>& known);

}  // namespace dualdrive
