// A machine compiled into indices: rigid groups, states, signals, switching elements, delay lines, clocks.
//
// Bodies joined rigidly form one group with one speed. States, in this order: group speeds, one twist per connection
// that is not rigid, the table angle, currents, then what controller blocks, sampled loops and effects remember, then
// approximants of delays. The twist of a mesh is integrated, not the difference of two absolute angles, or rtol·θ would
// act on the contact torque.
// Eq. 23's order of states is a view: the signals of those names (linearise.hpp).
#pragma once

#include <string>
#include <vector>

#include "dualdrive/machine.hpp"
#include "dualdrive/signal.hpp"
#include "dualdrive/switching.hpp"

namespace dualdrive {

enum class Loop { position, tension, speed, current };

// A limited PI block of the controller and where it keeps what it remembers (-1: nothing).
struct BlockPlace {
    Loop loop;
    int drive;         // 0 = master
    std::string name;  // controller.position, controller.speed_1, ...
    int integrator = -1, held = -1, pending = -1;
    int limiter = -1;  // its switching element, continuous blocks only
};

// A clock ticks the blocks of one loop; with a latency the result is put out that much later.
struct Clock {
    Loop loop;
    double period, latency;
};

// A signal that is used late: a drive's speed command, or a sensor with a delay inside the loop.
struct DelayLine {
    std::string name;
    int source;        // signal
    std::size_t slot;  // the machine's parameter that says how late
    int state = -1;    // first of its approximant's (-1: exact)
};

// What signals that are used late make of a machine: a delay equation, or, by Padé's approximant, one of more states; but for
// what a sampled loop puts out in steps.
enum class Delays { exact, approximant };

struct Layout {
    // Steps that give each body its ratio to its group's reference body, and its angle, walking outward from the table.
    struct Step {
        int body, from, connection;
        bool driver;  // `body` is the connection's driver
    };

    explicit Layout(const Machine& machine, const Inputs& inputs, Delays how = Delays::exact);

    int size() const { return static_cast<int>(state_names.size()); }
    int signal(std::string_view name) const;  // -1 when there is none
    int state(std::string_view name) const;   // -1 when there is none
    bool is_placed(int signal) const;         // an angle, speed, twist or current

    std::vector<std::string> state_names, state_units;
    int groups = 0;
    int table = -1;                             // the body of that name
    std::vector<int> group_of, twist, current;  // per body; per connection (-1 rigid); per motor (-1 direct)
    std::vector<bool> locked;                   // per group
    std::vector<Step> steps;
    std::vector<int> roots;       // bodies whose angle is a state (the table, and one per part not joined to it)
    std::vector<int> root_angle;  // their states

    std::vector<BlockPlace> blocks;
    int position_block = -1;
    std::vector<int> tension_block, speed_block, current_block;  // per slave; per motor; per motor (-1: none)
    int derivative_filter = -1, sensor_filter = -1, tension_filter = -1;
    std::vector<int> set_point_filter;  // per motor: first of its filter's two states (-1: no filter)
    std::vector<int> encoder_history;   // per motor: first of speed_samples states
    std::vector<Clock> clocks;

    std::vector<Switch> switches;
    std::vector<int> flank_of, stick_of;  // per connection, per group (-1: none)
    int tension_sum_branch = -1, tension_zero_branch = -1;
    std::vector<std::vector<int>>
        branch_of;  // per effect and body: first branch element of its formula there (-1: none)
    std::vector<std::vector<int>> effects_on_body, friction_on_body, effects_in_motor, sensor_effects;
    std::vector<std::vector<int>> encoder_effects;   // per motor: those of sensor_effects that change an angle
    std::vector<int> ring_meshes;                    // connections whose teeth push the table, where a sensor feels it
    std::vector<std::vector<int>> torque_estimates;  // per motor: effects on what its drive takes for the torque
    struct MeshEffect {
        int effect;
        bool at_ring;  // its angle is the ring's, else the pinion's
        int number;    // of the mesh, where the ring sees several; 1 at a pinion of its own
    };
    std::vector<std::vector<MeshEffect>> effects_on_mesh;
    // A connection whose torque a body's load-dependent losses go by, and how it comes into the body's frame.
    struct Load {
        int connection;
        bool times_ratio, over_ratio;
    };
    std::vector<std::vector<Load>> loads;  // per body
    struct InertiaEffect {
        std::size_t effect, body;
    };
    std::vector<InertiaEffect> effects_on_inertia;
    struct Memory {
        int effect, body, state;  // first of the effect's own states at this body
    };
    std::vector<Memory> memories;
    std::vector<DelayLine> delays;
    int command_delay = -1, slave_delay = -1;
    std::vector<int> sensor_delay;  // per sensor (motors, then table): delay line

    std::vector<SignalInfo> signals;
    struct Indices {
        int theta_ref, omega_ref, T_load, e, tension, Omega_1, Omega_0 = -1;
        std::vector<int> angle, speed, acceleration;        // per body
        std::vector<int> twist, deflection, torque, flank;  // per connection
        std::vector<int> I, U, T, Omega, T_ref;             // per motor
        std::vector<int> filtered;                          // per motor: set-point behind its filter (-1: no filter)
        std::vector<int> sensor;                            // readings in the loop: motors' speeds, table angle
        std::vector<int> effect;                            // per effect (-1: no torque of its own)
        std::vector<int> input;                             // per input, in map order
        int stored_energy;
    } at;
};

// Names as channels of a measured trace carry them: motor_1 -> theta_1, pinion_1 -> theta_c1, table -> theta_m.
std::string channel_suffix(const std::string& body);

}  // namespace dualdrive
