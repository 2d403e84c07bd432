// The rates that are not affine in states and inputs, by their form alone: a law of size zero bends them as well, since its
// derivative by that size is not zero.
#pragma once

#include <memory>
#include <vector>

#include "dualdrive/signal.hpp"
#include "dualdrive/switching.hpp"

namespace dualdrive {

class Machine;
struct Layout;

class BentRows {
  public:
    // parameters: slots, which count as more than zero.
    BentRows(const Machine& machine, const Inputs& inputs, const Layout& layout,
             const std::vector<std::vector<std::size_t>>& parameters);
    BentRows(BentRows&&) noexcept;
    ~BentRows();

    // Numbers of states whose rates are such in these modes, near z and t; increasing.
    std::vector<int> in(const Modes& modes, double t, const double* z);

  private:
    struct Hidden;
    std::unique_ptr<Hidden> h_;
};

}  // namespace dualdrive
