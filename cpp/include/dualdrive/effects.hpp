// The registry of physical effects: one line each. What stands here exists everywhere, from machine files to fits.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "dualdrive/effect.hpp"
#include "dualdrive/effects/angle_dependent_friction.hpp"
#include "dualdrive/effects/cogging.hpp"
#include "dualdrive/effects/coulomb.hpp"
#include "dualdrive/effects/current_limit.hpp"
#include "dualdrive/effects/cutting_torque.hpp"
#include "dualdrive/effects/dead_time.hpp"
#include "dualdrive/effects/eccentricity.hpp"
#include "dualdrive/effects/encoder_eccentricity.hpp"
#include "dualdrive/effects/gearbox_backlash.hpp"
#include "dualdrive/effects/hertzian_stiffness.hpp"
#include "dualdrive/effects/hydrostatic_drag.hpp"
#include "dualdrive/effects/load_dependent_mesh_loss.hpp"
#include "dualdrive/effects/lugre.hpp"
#include "dualdrive/effects/mesh_damping.hpp"
#include "dualdrive/effects/pitch_error.hpp"
#include "dualdrive/effects/position_dependent_inertia.hpp"
#include "dualdrive/effects/quantisation.hpp"
#include "dualdrive/effects/radial_shift.hpp"
#include "dualdrive/effects/sensor_delay.hpp"
#include "dualdrive/effects/sensor_offset.hpp"
#include "dualdrive/effects/shaft_compliance.hpp"
#include "dualdrive/effects/stribeck.hpp"
#include "dualdrive/effects/table_tilt.hpp"
#include "dualdrive/effects/tension_mismatch.hpp"
#include "dualdrive/effects/thermal_drift.hpp"
#include "dualdrive/effects/time_varying_mesh_stiffness.hpp"
#include "dualdrive/effects/torque_constant_saturation.hpp"
#include "dualdrive/effects/torque_ripple.hpp"
#include "dualdrive/effects/transmission_error.hpp"
#include "dualdrive/effects/transport_delay.hpp"
#include "dualdrive/effects/unbalance.hpp"
#include "dualdrive/effects/viscous.hpp"
#include "dualdrive/effects/voltage_limit.hpp"
#include "dualdrive/effects/wear.hpp"

namespace dualdrive {

template <template <class> class... E>
struct EffectList {};

// clang-format off: one effect a line
using Registry = EffectList<
    Viscous,
    Coulomb,
    Stribeck,
    LuGre,
    AngleDependentFriction,
    LoadDependentMeshLoss,
    MeshDamping,
    Eccentricity,
    TransmissionError,
    PitchError,
    TimeVaryingMeshStiffness,
    HertzianStiffness,
    Wear,
    Cogging,
    TorqueRipple,
    Unbalance,
    CuttingTorque,
    HydrostaticDrag,
    PositionDependentInertia,
    SensorDelay,
    SensorOffset,
    Quantisation,
    EncoderEccentricity,
    RadialShift,
    TableTilt,
    TorqueConstantSaturation,
    ThermalDrift,
    DeadTime,
    TensionMismatch,
    CurrentLimit,
    VoltageLimit,
    TransportDelay,
    GearboxBacklash,
    ShaftCompliance>;
// clang-format on

// Every registered effect, in the order of the registry.
const std::vector<EffectType>& effect_types();

// Effects whose law a user writes without a compiler: no parameters are declared of them, and make_effect knows none.
const std::vector<EffectType>& user_laws();
bool is_user_law(const EffectType& type);

// The effect of that name, users' laws included; std::invalid_argument names the nearest known ones if there is none.
const EffectType& effect_type(std::string_view name);

// A new effect whose parameters are read from consecutive `values`, in the order of effect_type(name).parameters.
// S is what Model is built for. Throws as effect_type does.
template <class S>
std::unique_ptr<Effect<S>> make_effect(std::string_view name, const S* values);

}  // namespace dualdrive
