// The way back over the exponential engine's steps: the derivative of the collocation solution itself, its polynomial's
// values included.
//
// With v_j what is owed to y at node j and n̄_i to the rest there, a step's equations
//     y_{j+1} = E y_j + Φ c_j,   c_j = Σ_i T_j n_i,   n_i = f(t_i, y_i) − A y_i
// are transposed one by one:
//     v_j = Eᵀ v_{j+1} + (∂n_j/∂y)ᵀ n̄_j,   c̄_j = Φᵀ v_{j+1},   n̄_i = Σ_j T_jᵀ c̄_j,
// solved by sweeps, which contract as those of the step did. f owes n̄ᵀ ∂f/∂p to the parameters, E and Φ what a
// TangentGradient sums up. docs/theory/derivatives.md.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "../adjoint.hpp"
#include "../exact/generator.hpp"
#include "../pullback.hpp"
#include "steps.hpp"
#include "tangent_gradient.hpp"

namespace dualdrive::exponential {

class Adjoint final : public dualdrive::Adjoint {
  public:
    struct Setup {
        const std::vector<Step>& taken;
        const std::vector<Place>& places;  // of outputs and guards
        const exact::Generator& generator;
        const std::vector<int>& recorded;  // signals
        Pullback& pullback;
        // What the recorded signals are of y in these modes, signals × size of y; empty where they are not affine.
        std::function<exact::Matrix<double>(const Tangent&)> outputs;
    };
    // A tangent, and what is owed to it.
    struct Known {
        std::shared_ptr<Tangent> tangent;
        TangentGradient gradient;
        exact::Matrix<double> outputs, outputs_owed;
    };
    Adjoint(const Tape& tape, int states, std::function<void(int, double*)> jump_back, Setup setup);

    // In the order in which they were first met on the way back, so that sums are the same each time.
    const std::vector<std::unique_ptr<Known>>& tangents() const { return tangents_; }

  private:
    using Vector = std::vector<double>;
    // λ that comes in within an interval between nodes.
    struct Arrival {
        std::size_t node;  // before it
        double t;
        Vector lambda;
    };
    // A part of such an interval: whole units of a level, or a series over what is left.
    struct Piece {
        int level;
        double length, begin;  // s; since the node, in distances of nodes
        bool series;
        Vector yc;                             // where it began, c in its own unit
        std::vector<const Arrival*> arrivals;  // at its end
    };

    void present_output_back(const Entry& output) override;
    void steps_back(const Entry& steps, Outputs outputs) override;
    void guard_back(const Entry& instant, double weight) override;

    void open(const Entry& steps);
    Known& known(const std::shared_ptr<Tangent>& tangent);
    void affine_output_back(const Entry& output, double* lambda);
    void add_owed(std::size_t first, double* lambda);
    void output_back(const Entry& output, double* lambda);
    void linearise();
    void arrive(double t, const double* lambda);
    void arrivals_back();
    void solve();
    double sweep();
    void keep();
    void interval_back(std::size_t node, const double* lambda, bool keep, double* owed);
    void pieces_back(bool keep, double* owed);
    double find_pieces(std::size_t node, Vector& y, double from, double to);
    void find_pieces_between_knots(std::size_t node, Vector& y, double from, double to);
    bool knotted(std::size_t node) const;
    double node_time(std::size_t node) const { return step_->origin + static_cast<double>(node) * step_->delta; }
    const double* column(std::size_t node) const { return yc_.data() + node * width_; }
    double* owed_at(std::size_t node) { return owed_.data() + node * tall_; }

    const Setup setup_;
    std::vector<std::unique_ptr<Known>> tangents_;

    // The step at hand.
    const Step* step_ = nullptr;
    Known* known_ = nullptr;
    TangentGradient* gradient_ = nullptr;
    Propagators* propagators_ = nullptr;
    std::size_t width_ = 0, tall_ = 0, rest_width_ = 0;
    Vector yc_;      // [node]: y and c
    Vector within_;  // [node]: what comes in there, and to c there, from within the interval that follows
    Vector owed_;    // [node]: v_j, and c̄_j
    Vector rest_;    // [node][driven]: n̄
    Vector slopes_;  // [node][driven][state]: ∂n/∂y
    std::array<bool, intervals> knotted_{};  // whether the interval holds a knot
    std::vector<std::vector<Traced>> rates_;
    std::vector<Arrival> arrivals_;  // the latest first
    std::vector<Piece> pieces_;
    Vector values_, terms_, all_terms_, moved_, part_, next_, y_;
};

}  // namespace dualdrive::exponential
