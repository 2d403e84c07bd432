// What results of the model owe to its states and its parameters: λᵀ ∂(result)/∂(z, p) for all of them at one price, by the
// model on scalars that leave a trace.
#pragma once

#include <span>
#include <vector>

#include "dualdrive/model.hpp"

namespace dualdrive {

// Parameters as variables on a trace, and what they are owed by everything that was ever weighed.
class TracedParameters {
  public:
    using Slots = std::vector<std::vector<std::size_t>>;  // of parameters that move together
    TracedParameters(const Machine& machine, const Slots& parameters);

    const std::vector<Traced>& values() const { return values_; }  // of all slots of the machine
    Trace& trace() { return trace_; }
    // What is on the trace now depends on parameters alone, and stays; begin() forgets the rest.
    void keep_trace();
    void begin();
    // ∂(cost)/∂(result), to be given once what it was made of is on the trace; then back to all of that.
    void weigh(const Traced& result, double weight);
    void walk_back();
    double owed(std::size_t number) const { return bars_[number]; }  // on the trace
    std::vector<double> owed_to_parameters() const;
    // ∂(results)/∂(parameters) of what is on the trace, a row of results for each parameter: forward, where there are more
    // results than parameters.
    std::vector<std::vector<double>> forward(std::span<const Traced> results) const;

  private:
    const Slots parameters_;
    Trace trace_;
    std::vector<Traced> values_;
    std::size_t kept_ = 0;
    std::vector<double> bars_;
};

// Where the model was evaluated.
struct Place {
    double t;
    std::vector<double> z;
    Modes modes;
    Cell cell;
};

// Evaluations since begin() stay on the trace, so that weights may be given once all of them are known.
class Pullback {
  public:
    Pullback(const Machine& machine, const Inputs& inputs, const Layout& layout,
             const TracedParameters::Slots& parameters);

    TracedParameters& parameters() { return parameters_; }
    // Return the number of the first state on the trace; results stand in model() up to the next call.
    std::size_t evaluate(double t, const double* z, const Modes& modes, const Cell& cell, bool energies = false);
    std::size_t evaluate(const Place& at, bool energies = false) {
        return evaluate(at.t, at.z.data(), at.modes, at.cell, energies);
    }
    const Model<Traced>& model() const { return model_; }
    const std::vector<Traced>& state() const { return z_; }

    // ∂(results)/∂z of the last evaluation, whose states begin at `first`: a row for each.
    void slopes(std::size_t first, std::span<const Traced> results, double* rows);

  private:
    TracedParameters parameters_;
    Model<Traced> model_;
    std::vector<Traced> z_;
    std::vector<Lanes> bars_;
};

}  // namespace dualdrive
