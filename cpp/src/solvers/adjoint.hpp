// The way back over a tape: λ = ∂(cost)/∂y at each point, and with it the cost's gradient. What happens at an instant is
// here; what lies between two instants is for the engine that went there.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "tape.hpp"

namespace dualdrive {

class Adjoint {
  public:
    // jump_back(number, λ): takes λ, over the states, back over a jump of the simulation and keeps what it owes to
    // parameters.
    Adjoint(const Tape& tape, int states, std::function<void(int, double*)> jump_back);
    virtual ~Adjoint() = default;
    Adjoint(const Adjoint&) = delete;
    Adjoint& operator=(const Adjoint&) = delete;

    // seeds: ∂(cost)/∂(recorded signals), rows × signals.
    void walk(const double* seeds, std::size_t signals);
    const std::vector<double>& lambda() const { return lambda_; }  // at the start

  protected:
    using Outputs = std::span<const Entry>;
    // Outputs read from the state as a switch or a jump left it.
    virtual void present_output_back(const Entry& output) = 0;
    // Over the steps of an entry and the outputs within them.
    virtual void steps_back(const Entry& steps, Outputs outputs) = 0;
    // λ takes `weight` times the guard's slopes.
    virtual void guard_back(const Entry& instant, double weight) = 0;

    const double* values(const Entry& e) const { return tape_.values.data() + e.y; }
    const double* seeds(const Entry& e) const { return seeds_ + static_cast<std::size_t>(e.row) * signals_; }

    const Tape& tape_;
    const int states_, lambda_rows_;
    std::vector<double> lambda_;

  private:
    void present_outputs_back(Outputs outputs);
    void switch_back(const Entry& entry);

    std::function<void(int, double*)> jump_back_;
    const double* seeds_ = nullptr;
    std::size_t signals_ = 0;
    double instant_ = 0.0;  // ∂(cost)/∂(time of the instant)
};

}  // namespace dualdrive
