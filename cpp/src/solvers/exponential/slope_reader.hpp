// What a tangent of the machine changes by per parameter, and the recorded signals where they are affine: read off the one
// model, on scalars that leave a trace.
#pragma once

#include <vector>

#include "../pullback.hpp"
#include "../unseen_laws.hpp"
#include "slope_propagators.hpp"
#include "steps.hpp"

namespace dualdrive::exponential {

class SlopeReader {
  public:
    using Slope = SlopePropagators::Slope;
    // What the recorded signals are of y, and how that changes per parameter; both empty where they are not affine.
    struct Outputs {
        exact::Matrix<double> rows;
        std::vector<Slope> slopes;
    };
    struct Slopes {
        std::vector<Slope> rates;
        Outputs outputs;
    };
    SlopeReader(const Machine& machine, const Inputs& inputs, const Layout& layout, const exact::Generator& generator,
                const std::vector<int>& recorded, const TracedParameters::Slots& parameters);

    Slopes read(const Modes& modes, double t, const double* z);

  private:
    const std::vector<int> recorded_;
    TracedParameters parameters_;
    exact::Reader<Traced> reader_;
    BentRows bent_;
};

}  // namespace dualdrive::exponential
