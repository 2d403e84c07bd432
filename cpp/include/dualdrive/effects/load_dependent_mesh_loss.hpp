// Load-dependent loss of a mesh: friction that grows with the torque it carries, F = μ |T_mesh|
//
//   μ  fraction of the mesh torque that is lost;  T_mesh  torque of the meshes in the frame of the body, N·m: of those it
//   drives, and of the table, which drives none, of all that drive it
//
// Source: Niemann, Winter, "Maschinenelemente II", Springer: tooth losses go with the transmitted power, 0.5 … 3 % per
// mesh; ISO/TR 14179-2 has the same form.
// Validity: mean over a tooth pitch, mixed lubrication, a loss factor that does not depend on speed. Of both wheels of one
// mesh give it to one. Dry friction: at rest it holds, and it never delivers power in either direction of the flow.
#pragma once

#include "dualdrive/effect.hpp"

namespace dualdrive {

template <class S>
struct LoadDependentMeshLoss {
    S fraction;

    static constexpr EffectText text{
        .name = "load_dependent_mesh_loss",
        .equation = "T = -fraction * |mesh torque| * sign(speed); at rest any torque within that",
        .source = "Niemann, Winter, Maschinenelemente II, Springer: tooth losses of 0.5 to 3 % per mesh",
        .validity = "mean over a tooth pitch, loss factor independent of speed",
        .confused_with = "coulomb",
        .places = "pinions,table,motors",
        .by_load = true,
    };

    static constexpr auto parameters() {
        return fields<LoadDependentMeshLoss, S>({
            {&LoadDependentMeshLoss::fraction,
             {"fraction", "", fraction_of_torque, 0.0, 0.02, "share of the mesh torque that is lost"}},
        });
    }

    S friction_limit(const BodyPort<S>& at, int /*direction*/) const { return fraction * at.mesh_torque; }

  private:
    static constexpr Bounds fraction_of_torque{0.0, 0.5};
};

}  // namespace dualdrive
