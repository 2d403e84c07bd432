// The physics, once: signals, forces, rates, guards and ticks of a machine with its modes frozen.
//
// Model<double> drives the solver, Model<Gradient> the Jacobian, the sensitivities and the exact engine's matrices,
// Model<FineGradient> the same matrices in long double, Model<Traced> and Model<TracedGradient> the way back of a gradient,
// all from these lines. A Model is a worker: it owns scratch memory and belongs to one thread.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "dualdrive/delay_approximant.hpp"
#include "dualdrive/effect.hpp"
#include "dualdrive/layout.hpp"
#include "dualdrive/machine.hpp"
#include "dualdrive/signal.hpp"
#include "dualdrive/trace.hpp"

namespace dualdrive {

// Power into the machine, by kind: what the energy balance adds up. Dissipation is negative.
enum class Power { delivered, conversion, copper, viscous, effects, mesh, load };
inline constexpr std::size_t powers = 7;
extern const char* const power_names[powers];

// A term of a power, or of the stored energy: both factors are affine in states and inputs where the machine is.
template <class S>
struct Product {
    std::size_t path;  // of `Power`; `powers`: stored
    S a, b;
};

// What is evaluated: all of it, all but energies, or the plant alone, as if nothing drove it: neither inputs, nor control,
// nor energies.
enum class Scope { whole, dynamics, plant };

template <class S>
class Model {
  public:
    Model(const Machine& machine, const Inputs& inputs, const Layout& layout);

    // New parameter values, in the machine's slot order; S carries derivatives with respect to them.
    void set_parameters(const S* values);

    // Other inputs of the same names, which must outlive the next evaluation.
    void set_inputs(const Inputs& inputs);

    // Appends the times at which the laws of effects take another form.
    void instants(std::vector<double>& times) const;

    // What stays frozen while the solver runs.
    struct Now {
        const Mode* modes;
        Cell cell;                        // interval between known breaks in which t lies
        const Past<S>* past;              // null: delayed signals equal the present ones (start of a run)
        const S* motor_torque = nullptr;  // recorded motor torques in place of K_d I (torque balance)
        const S* load = nullptr;  // torques of the connections that load-dependent losses go by (torque balance)
        Scope scope = Scope::whole;
        const S* pushing = nullptr;  // torques on all bodies beside the machine's own (predictor)
    };

    // Everything at time t and state z; the accessors below refer to the last call.
    void evaluate(const S& t, const S* z, const Now& now);

    // The angles, speeds, twists and currents at state z alone: what neither laws nor inputs have a part in.
    void place(const S* z);

    const std::vector<S>& signals() const { return signal_; }
    const std::vector<S>& rate() const { return rate_; }  // ż
    const std::array<S, powers>& power() const { return power_; }
    // Where every evaluation lists what power() and the stored energy are summed up from; null: nowhere.
    void list_products(std::vector<Product<S>>* into) { products_ = into; }
    const Block<S>& block(int b) const { return block_[static_cast<std::size_t>(b)]; }
    // Net torque on a group without dry friction, and its inertia at the present angles, in the frame of the group's
    // reference body.
    const S& group_torque(int g) const { return torque_[static_cast<std::size_t>(g)]; }
    const S& group_inertia(int g) const { return inertia_[static_cast<std::size_t>(g)]; }
    const S& friction_limit(int g, int direction) const {
        return (direction > 0 ? limit_forward_ : limit_backward_)[static_cast<std::size_t>(g)];
    }
    // Half gap and stiffness of a connection as effects leave them.
    const S& gap(std::size_t connection) const { return gap_[connection]; }
    const S& stiffness(std::size_t connection) const { return stiffness_[connection]; }
    // Speed of a body over the speed of its group.
    const S& ratio(int body) const { return ratio_[static_cast<std::size_t>(body)]; }
    const S& connection_ratio(int c) const { return connection_[static_cast<std::size_t>(c)].ratio; }
    // ω_motor/ω_pinion and ω_pinion/ω_table of a drive.
    const S& gear_ratio(int drive) const { return i_[static_cast<std::size_t>(drive)]; }
    const S& mesh_ratio(int drive) const { return i_m_[static_cast<std::size_t>(drive)]; }

    // Guards of every switching element, guards_per_switch each; positive while the mode is valid, 1 where unused. The
    // riding guards of a limiter need time derivatives: block_rate[b] = d(raw)/dt with the integrator held (or null).
    void guards(S* out, const S* block_rate) const;
    S guard(int element, int which, const S* block_rate) const;

    // What the clock's blocks put into the state at a tick (`next` starts as a copy of z); and the later output. Without
    // limits a tick is affine in z.
    void tick(const Clock& clock, S* next, bool limited = true) const;
    void put_out(const Clock& clock, const S* z, S* next) const;
    // What a riding limiter holds at zero, the surface that it slides on: the block's unlimited value less the limit. In other
    // modes, and where there is no limit, that value.
    S beyond(int block) const;
    // A riding limiter's integrator follows from its output: write it into the state.
    void slave_integrators(S* z) const;

    const Layout& layout() const { return layout_; }
    const Machine& machine() const { return machine_; }

  private:
    void read_inputs(const S& t);
    void drive_nothing();
    void connection_torques();
    void motors(const S* z);
    void sense(const S& t);
    void control(const S& t, const S* z);
    void limit(std::size_t b, const S* z);
    S torque_estimate(std::size_t k) const;
    S encoder_angle(std::size_t k) const;
    void loads_of_teeth();
    S position_reading(const S& t);
    S filtered(std::size_t k, const S& set_point) const;
    S delayed(int line, const S& t) const;
    S tension_set_point() const;
    S measured_speed(std::size_t k, const S* z) const;
    void body_torques(const S& t);
    void vary_inertia();
    void friction(const S& t);
    void rates(const S* z);
    void control_rates(const S* z);
    void energy(const S* z);
    BodyPort<S> port(std::size_t body, const S& t) const;
    S load_through(const Layout::Load& load) const;
    Mode mode(int element) const { return now_.modes[static_cast<std::size_t>(element)]; }
    void add_torque(int body, const S& torque);
    void deliver(Power path, const S& a, const S& b);
    void store(const S& a, const S& b);
    const S* memory_of(int effect, int body) const;

    const Machine& machine_;
    const Layout& layout_;
    std::vector<const Waveform*> input_;  // in map order
    const Waveform *theta_ref_ = nullptr, *T_load_ = nullptr;
    std::vector<const Waveform*> motor_input_;

    std::vector<Body<S>> body_;
    std::vector<Connection<S>> connection_;
    std::vector<Motor<S>> motor_;
    Controller<S> controller_{};
    std::vector<std::unique_ptr<Effect<S>>> effect_;
    std::vector<S> ratio_, inertia_, constant_inertia_, i_, i_m_;
    std::vector<Dual<S, 1>> varied_;  // inertia of each body where effects vary it

    bool rubs_ = false;  // dry friction is among the effects
    Now now_{};
    S time_{};
    const S* state_ = nullptr;
    std::vector<S> signal_, rate_;
    std::vector<S> body_torque_, torque_, limit_forward_, limit_backward_, acceleration_;
    std::vector<S> elongation_, stiffness_, gap_, contact_torque_, contact_energy_;
    std::vector<S> sensed_, motor_torque_, voltage_, added_voltage_, torque_ref_, correction_;
    std::vector<S> delay_;  // per delay line
    std::vector<Block<S>> block_;
    std::vector<ToothLoad<S>> tooth_load_;  // of the ring's meshes, where a sensor feels them
    S derivative_rate_{}, sensor_rate_{}, tension_rate_{}, tension_sum_{}, tension_left_{};
    std::vector<S> branch_argument_;
    std::array<S, powers> power_{};
    S stored_{};
    std::vector<Product<S>>* products_ = nullptr;
};

extern template class Model<double>;
extern template class Model<Gradient>;
extern template class Model<FineGradient>;
extern template class Model<Traced>;
extern template class Model<TracedGradient>;

}  // namespace dualdrive
