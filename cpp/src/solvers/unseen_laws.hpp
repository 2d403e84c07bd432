// Laws that a run does not show and a gradient asks for all the same: of size zero, as a fit begins with them. Their
// derivative by that size is not zero, and wants to be seen at the nodes of a step.
#pragma once

#include <memory>
#include <vector>

#include "dualdrive/model.hpp"

namespace dualdrive {

// The machine's values, with parameters of laws that are far below their typical size set to that.
std::vector<double> values_at_size(const Machine& machine, const std::vector<std::vector<std::size_t>>& parameters);

// The rates that are not affine in states and inputs, by their form alone and whatever the size of a law.
class BentRows {
  public:
    BentRows(const Machine& machine, const Inputs& inputs, const Layout& layout, const std::vector<double>& values);
    BentRows(BentRows&&) noexcept;
    ~BentRows();

    // Numbers of states whose rates are such in these modes, near z and t; increasing.
    std::vector<int> in(const Modes& modes, double t, const double* z);
    // Whether all of these signals are affine there.
    bool spare(const std::vector<int>& signals, const Modes& modes, double t, const double* z);

  private:
    struct Hidden;
    // Calls see() after each of two evaluations: with inputs that grow, and with time that bends what has it.
    template <class See>
    void evaluate(const Modes& modes, double t, const double* z, const See& see);
    std::unique_ptr<Hidden> h_;
};

// What such laws would add to the rates: steps may be no longer than that allows.
class UnseenLaws {
  public:
    UnseenLaws(const Machine& machine, const Inputs& inputs, const Layout& layout, const std::vector<double>& values);

    bool any() const { return any_; }
    // The rates with them.
    const std::vector<double>& rates(double t, const double* z, const Modes& modes, const Cell& cell);

  private:
    const bool any_;
    Model<double> model_;
};

}  // namespace dualdrive
