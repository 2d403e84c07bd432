#include "slope_reader.hpp"

namespace dualdrive::exponential {

SlopeReader::SlopeReader(const Machine& machine, const Inputs& inputs, const Layout& layout,
                         const exact::Generator& generator, const std::vector<int>& recorded,
                         const TracedParameters::Slots& parameters)
    : recorded_(recorded),
      parameters_(machine, parameters),
      reader_(machine, inputs, layout, generator, recorded_),
      bent_(machine, inputs, layout, values_at_size(machine, parameters)) {
    reader_.set_parameters(parameters_.values());
    parameters_.keep_trace();
}

SlopeReader::Slopes SlopeReader::read(const Modes& modes, double t, const double* z) {
    parameters_.begin();
    const exact::Laws<Traced> laws = reader_.tangent(modes, t, z);
    const bool affine = bent_.spare(recorded_, modes, t, z);
    Slopes found;
    const auto slopes_of = [&](const exact::Matrix<Traced>& M) {
        const auto rows = M.rows();
        std::vector<Slope> slopes;
        for (const std::vector<double>& own : parameters_.forward({M.data(), static_cast<std::size_t>(M.size())})) {
            Slope& slope = slopes.emplace_back();
            for (Eigen::Index k = 0; k < M.size(); ++k)
                if (const double value = own[static_cast<std::size_t>(k)]; value != 0.0)
                    slope.push_back({static_cast<int>(k % rows), static_cast<int>(k / rows), value});
        }
        return slopes;
    };
    found.rates = slopes_of(laws.A);
    if (!affine) return found;
    found.outputs.rows = laws.outputs.unaryExpr([](const Traced& x) { return x.value; });
    found.outputs.slopes = slopes_of(laws.outputs);
    return found;
}

}  // namespace dualdrive::exponential
