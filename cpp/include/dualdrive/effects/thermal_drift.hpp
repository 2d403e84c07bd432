// A motor warmer than its data sheet: more resistance, less flux
//
//   R → R (1 + α ΔT),   K_d → K_d (1 − β ΔT),   C_e → C_e (1 − β ΔT)
//
//   ΔT  rise, K above the temperature of the data sheet;  α = 0.00393 /K, copper at 20 °C;  β  flux loss of the magnets, 1/K
//
// Source: IEC 60034-1 (resistance of copper windings against temperature); Hendershot, Miller, "Design of Brushless
// Permanent-Magnet Machines", 2010: reversible loss of remanence, about 0.1 %/K for NdFeB, 0.2 for ferrite, 0.04 for SmCo.
// Validity: one temperature for winding and magnet, constant over the record. K_d and C_e fall together, so energy closes.
// The drive goes on with the data sheet's numbers. In the torque balance only the torque shows.
#pragma once

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct ThermalDrift {
    S rise, flux_loss;

    static constexpr double copper = 0.00393;  // 1/K
    static constexpr EffectText text{
        .name = "thermal_drift",
        .equation = "R * (1 + 0.00393 * rise), K_d and C_e * (1 - flux_loss * rise)",
        .source =
            "IEC 60034-1 (copper); Hendershot, Miller, Design of Brushless Permanent-Magnet Machines, 2010 (magnets)",
        .validity = "one temperature of winding and magnets, constant over the record",
        .confused_with = "torque_constant_saturation,viscous",
        .places = "motors",
        .affine = true,
        .hypothesis = {.scales = true},
    };

    static constexpr auto parameters() {
        return fields<ThermalDrift, S>({
            {&ThermalDrift::rise,
             {"rise", "K", Bounds{-100.0, 300.0}, 0.0, 30.0, "above the data sheet's temperature"}},
            {&ThermalDrift::flux_loss,
             {"flux_loss", "1/K", Bounds{0.0, 0.01}, 0.001, 0.001, "flux lost per kelvin, by the magnets", true}},
        });
    }

    S torque_of_motor(const MotorPort<S>& at) const { return -(flux_loss * rise * at.torque); }
    S voltage_of_motor(const MotorPort<S>& at) const {
        return rise * (flux_loss * at.back_emf * at.speed - copper * at.resistance * at.current);
    }
};

}  // namespace dualdrive
