// What a physical effect may do to the machine: the ports it sees and the hooks it may offer.
//
// An effect reads named quantities of its port, never state indices, and adds: a torque on a body, a dry-friction
// limit, a change of a mesh (deflection, gap, stiffness, damping, stored energy), inertia that varies with the angle, a
// torque or voltage inside the motor, or a changed reading of a sensor. It never overwrites. The hooks are found by concepts;
// `effects/<name>.hpp` holds one effect each.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "dualdrive/connection.hpp"
#include "dualdrive/parameter.hpp"
#include "dualdrive/scalar.hpp"
#include "dualdrive/switching.hpp"

namespace dualdrive {

// What an effect on a body sees. Angle and speed in the body's own frame (motor, pinion or table).
template <class S>
struct BodyPort {
    S t, angle, speed;
    S mesh_torque;  // ≥ 0, through the meshes the body drives, or, if it drives none, through those that drive it
    const S* signals = nullptr;      // all named signals known before body torques; for user expressions
    const S* memory = nullptr;       // the effect's own states at this place
    const Mode* branches = nullptr;  // frozen signs of the effect's own switches
};

// What an effect on a mesh sees; A is a dual number over the two angles, so that forces follow from the energy.
template <class A>
struct MeshPort {
    A twist, pinion_angle, ring_angle;
    A angle;     // the angle of the place: the pinion's, or the ring's
    int number;  // 1 for mesh_1, 2 for mesh_2, ...
};

// The mesh as effects leave it: T = K (d + offset − sΔ) + c ẋ, V = ½ K (d + offset − sΔ)²
template <class A>
struct MeshLaw {
    A offset, gap, stiffness, damping;
};

// What a loaded contact stores besides ½ K ξ², and its derivative by the overlap ξ: torque = dV/dξ, so that energy closes.
template <class A>
struct ContactSpring {
    A energy, torque;
};

template <class S>
struct MotorPort {
    S t, angle, speed, current, torque;             // angle and speed of the motor; torque = K_d I
    S resistance{}, back_emf{}, rated_torque{1.0};  // R, C_e, T_rated of its data sheet
};

// What the teeth of one mesh do to the wheel that a sensor sits at, in its frame: torque, and the size of that.
template <class S>
struct ToothLoad {
    S torque, size;
};

// What an effect on a sensor sees: the sensor reads an angle, or the speed that goes with it, or something else.
enum class Measures : std::uint8_t { other, angle, speed };
template <class S>
struct SensorPort {
    S t;
    Measures measures = Measures::other;
    S angle{}, speed{};                     // of the body that the sensor sits at, in the loop
    std::span<const ToothLoad<S>> teeth{};  // in the loop, at the table: of mesh 1, 2, ... on the ring
};

// One attached effect behind a small virtual face, for one scalar.
template <class S>
class Effect {
  public:
    using A = Dual<S, 2>;
    virtual ~Effect() = default;
    virtual S torque_on_body(const BodyPort<S>&) const { return S(0.0); }
    virtual S friction_limit(const BodyPort<S>&, int /*direction*/) const { return S(0.0); }
    virtual void shape_mesh(MeshLaw<A>&, const MeshPort<A>&) const {}
    // `overlap` is ξ = d + offset − sΔ of a flank that carries; `law` is what all effects made of the mesh.
    virtual void load_contact(ContactSpring<A>&, const A& /*overlap*/, const MeshLaw<A>& /*law*/) const {}
    // The body's inertia at an angle of it; what follows from dJ/dθ is the machine's business.
    virtual void shape_inertia(Dual<S, 1>& /*inertia*/, const Dual<S, 1>& /*angle*/) const {}
    // Times at which the law takes another form, s: no step of the solver reaches across one.
    virtual void instants(std::vector<double>&) const {}
    virtual S torque_of_motor(const MotorPort<S>&) const { return S(0.0); }
    // Voltage added in the motor's circuit: L İ + R I + C_e ω = U + that.
    virtual S voltage_of_motor(const MotorPort<S>&) const { return S(0.0); }
    // What the drive takes for its motor's torque where it compares it with the other's.
    virtual S torque_estimate(const S& torque) const { return torque; }
    virtual S reading(const S& value, const SensorPort<S>&) const { return value; }
    virtual S delay() const { return S(0.0); }
    virtual void flow(const BodyPort<S>&, S* /*rate*/) const {}
    virtual void switch_values(const BodyPort<S>&, S*) const {}
};

namespace hook {
inline constexpr unsigned body = 1, friction = 2, mesh = 4, motor = 8, reading = 16, delay = 32, inertia = 64;
inline constexpr unsigned voltage = 256, estimate = 512;
}  // namespace hook

// What an effect means where it may be what a machine lacks: a search (python/dualdrive/diagnose) knows none by its name.
struct HypothesisText {
    const char* called = "";     // as engineers call it, if not by its name
    const char* untried = "";    // why no search puts it in; empty where one does
    const char* places = "";     // where a search puts it in, if not at all its usual places
    const char* contains = "";   // simpler laws that it is at a limit of its numbers, the nearest first
    const char* carrier = "";    // what multiplies its harmonics: "torque" of the drive, "direction" of motion
    const char* modulates = "";  // number of its body of which its wave is a fraction
    double lowest_order = 1.0;   // below it a harmonic is another law's
    bool friction = false;       // takes power from the motion as dry friction does, beside laws of `friction_limit`
    bool causes = false;         // every number is a cause of its own
    bool clips = false;          // a current or voltage that stands at an extreme may be its doing
    bool scales = false;         // in a torque balance the same as a factor of all inertias and frictions
};

// What a reader and the tools are told of an effect.
struct EffectText {
    const char* name;
    const char* equation;
    const char* source;
    const char* validity;
    const char* confused_with;  // effects that data may not tell apart from this one
    const char* places;         // where it usually sits, best first, comma-separated
    bool affine = false;        // affine in the state once its modes are frozen
    bool makes_play = false;    // of a mesh: a gap of zero opens
    bool by_load = false;       // reads BodyPort::mesh_torque
    bool by_force = false;      // reads SensorPort::teeth, so sits in the loop, at the table
    bool of_angle = false;      // reads angles, and speeds made from them; no other recorded channel
    bool rounds = false;        // jumps with the signal: in the loop only where that is sampled
    bool of_rating = false;     // measured against the motor's T_rated
    const char* brings = "";    // the effect that comes with it where it is put in: no joint gives without loss
    HypothesisText hypothesis{};
};

// A part of the machine that an effect may be.
enum class Part : std::uint8_t { none, motor, joint, controller };

// One row of the registry: an effect type without its scalar.
struct EffectType {
    EffectText text;
    unsigned hooks;
    std::vector<Declaration> parameters;
    int memory = 0;                                // states of its own, at each place
    Part part = Part::none;                        // what it is, where it has no law of its own: see structural.hpp
    ConnectionKind joint = ConnectionKind::rigid;  // what that must at least be, if a joint
    bool structural() const { return part != Part::none; }
    // Whether what stood at the sensor follows from what it said: see taken_back.
    bool invertible() const { return (hooks & hook::delay) || ((hooks & hook::reading) && text.of_angle); }
    // Whether a torque balance on recorded motion contains it.
    bool in_balance() const {
        return part == Part::joint ||
               (hooks & (hook::body | hook::friction | hook::mesh | hook::motor | hook::inertia));
    }
};

namespace detail {
template <class E>
concept ActsOnBody = requires(const E e, const BodyPort<double> p) { e.torque_on_body(p); };
template <class E>
concept RubsOnBody = requires(const E e, const BodyPort<double> p) { e.friction_limit(p, 1); };
template <class E>
concept ShapesMesh =
    requires(const E e, MeshLaw<Dual<double, 2>> law, const MeshPort<Dual<double, 2>> p) { e.shape_mesh(law, p); };
template <class E>
concept LoadsContact = requires(const E e, ContactSpring<Dual<double, 2>> spring, const MeshLaw<Dual<double, 2>> law) {
    e.load_contact(spring, law.offset, law);
};
template <class E>
concept ShapesInertia = requires(const E e, Dual<double, 1> inertia) { e.shape_inertia(inertia, inertia); };
template <class E>
concept ChangesForm = requires(const E e, std::vector<double> times) { e.instants(times); };
template <class E>
concept ActsInMotor = requires(const E e, const MotorPort<double> p) { e.torque_of_motor(p); };
template <class E>
concept ActsInCircuit = requires(const E e, const MotorPort<double> p) { e.voltage_of_motor(p); };
template <class E>
concept Misjudges = requires(const E e) { e.torque_estimate(1.0); };
template <class E>
concept ChangesReading = requires(const E e, const SensorPort<double> p) { e.reading(1.0, p); };
// Own states: a count and their rates, e.g. the bristle of a friction law. They live in the run's state vector.
template <class E>
concept Remembers = requires(const E e, const BodyPort<double> p, double* rate) {
    E::memory;
    e.flow(p, rate);
};
template <class E>
concept DelaysReading = requires(const E e) { e.delay(); };
}  // namespace detail

template <template <class> class E>
unsigned hooks_of() {
    using T = E<double>;
    return (detail::ActsOnBody<T> ? hook::body : 0u) | (detail::RubsOnBody<T> ? hook::friction : 0u) |
           (detail::ShapesMesh<T> || detail::LoadsContact<T> ? hook::mesh : 0u) |
           (detail::ShapesInertia<T> ? hook::inertia : 0u) | (detail::ActsInMotor<T> ? hook::motor : 0u) |
           (detail::ChangesReading<T> ? hook::reading : 0u) | (detail::DelaysReading<T> ? hook::delay : 0u) |
           (detail::ActsInCircuit<T> ? hook::voltage : 0u) | (detail::Misjudges<T> ? hook::estimate : 0u);
}

template <template <class> class E>
constexpr int memory_of() {
    if constexpr (detail::Remembers<E<double>>) return E<double>::memory;
    return 0;
}

// Forwards the virtual face to whichever hooks the plain struct offers.
template <template <class> class E, class S>
class EffectOf final : public Effect<S> {
  public:
    explicit EffectOf(const S* values) : effect_(read_component<E<S>>(values)) {}
    using A = typename Effect<S>::A;

    S torque_on_body(const BodyPort<S>& at) const override {
        if constexpr (detail::ActsOnBody<E<double>>) return effect_.torque_on_body(at);
        return Effect<S>::torque_on_body(at);
    }
    S friction_limit(const BodyPort<S>& at, int direction) const override {
        if constexpr (detail::RubsOnBody<E<double>>) return effect_.friction_limit(at, direction);
        return Effect<S>::friction_limit(at, direction);
    }
    void shape_mesh(MeshLaw<A>& law, const MeshPort<A>& at) const override {
        if constexpr (detail::ShapesMesh<E<double>>) effect_.shape_mesh(law, at);
    }
    void load_contact(ContactSpring<A>& spring, const A& overlap, const MeshLaw<A>& law) const override {
        if constexpr (detail::LoadsContact<E<double>>) effect_.load_contact(spring, overlap, law);
    }
    void shape_inertia(Dual<S, 1>& inertia, const Dual<S, 1>& angle) const override {
        if constexpr (detail::ShapesInertia<E<double>>) effect_.shape_inertia(inertia, angle);
    }
    void instants(std::vector<double>& times) const override {
        if constexpr (detail::ChangesForm<E<double>>) effect_.instants(times);
    }
    S torque_of_motor(const MotorPort<S>& at) const override {
        if constexpr (detail::ActsInMotor<E<double>>) return effect_.torque_of_motor(at);
        return Effect<S>::torque_of_motor(at);
    }
    S voltage_of_motor(const MotorPort<S>& at) const override {
        if constexpr (detail::ActsInCircuit<E<double>>) return effect_.voltage_of_motor(at);
        return Effect<S>::voltage_of_motor(at);
    }
    S torque_estimate(const S& torque) const override {
        if constexpr (detail::Misjudges<E<double>>) return effect_.torque_estimate(torque);
        return Effect<S>::torque_estimate(torque);
    }
    S reading(const S& value, const SensorPort<S>& at) const override {
        if constexpr (detail::ChangesReading<E<double>>) return effect_.reading(value, at);
        return Effect<S>::reading(value, at);
    }
    void flow(const BodyPort<S>& at, S* rate) const override {
        if constexpr (detail::Remembers<E<double>>) effect_.flow(at, rate);
    }
    S delay() const override {
        if constexpr (detail::DelaysReading<E<double>>) return effect_.delay();
        return Effect<S>::delay();
    }

  private:
    E<S> effect_;
};

}  // namespace dualdrive
