// Rates and guards of an affine machine as matrix products: what a stepping engine asks most often.
//
// The matrices are the exact engine's, read off the one model with the modes frozen. Guards come with their slopes,
// which tell cheaply that a guard can't have dipped below zero within a step.
#pragma once

#include <limits>
#include <map>
#include <vector>

#include "../solvers/exact/generator.hpp"
#include "../solvers/exact/laws.hpp"

namespace dualdrive {

class AffineField {
  public:
    // All of them must outlive the field; `modes` and `cell` are read as they stand at each call.
    AffineField(const Machine& machine, const Inputs& inputs, const Layout& layout, const Modes& modes,
                const Cell& cell);

    void rates(double t, const double* z, double* rate);
    void guards(double t, const double* z, double* g);
    // dg/dt where guards() was asked last.
    void guard_slopes(double* slope) const;

  private:
    struct Rows {                           // column-major, rows padded
        std::vector<double> rates, guards;  // guards: values, then slopes
    };
    const Rows& rows();
    void set(double t, const double* z);

    const Modes& modes_;
    const Cell& cell_;
    const exact::Generator generator_;
    const std::vector<int> nothing_;
    exact::Reader<double> reader_;
    std::size_t states_, guards_;
    std::map<Modes, Rows> known_;
    const Rows* now_ = nullptr;
    Modes now_modes_;
    std::vector<double> y_, rate_, guard_z_, guard_;  // y: states, inputs' generator, 1
    double t_ = std::numeric_limits<double>::quiet_NaN(), guard_t_ = t_;
    Cell t_cell_;
};

}  // namespace dualdrive
