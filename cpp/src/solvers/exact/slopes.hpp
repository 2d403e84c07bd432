// Forward sensitivities, exactly: s = ∂y/∂p obeys ṡ = A s + (∂A/∂p) y, whose solution over a step is e^{A h} s + L y with
// L the derivative of e^{A h} in the direction ∂A/∂p. L comes out of the same squarings as the exponential itself.
#pragma once

#include <vector>

#include "laws.hpp"
#include "propagator.hpp"

namespace dualdrive::exact {

// ∂(laws)/∂p of one mode, prepared. Most of ∂A/∂p is zero: only rows that are not are kept.
class SlopePropagator {
  public:
    SlopePropagator(const Propagator<double>& propagator, const std::vector<Laws<double>>& derivatives);

    int parameters() const { return parameters_; }
    // S (rows × parameters) and y over step / 2^level.
    void step(int level, const double* y, double* S);
    // Over any part of a step; y is taken along.
    void advance(double length, double* y, double* S);
    // ∂(a guard)/∂p.
    void guard(int guard, const double* y, const double* S, double* slopes) const;
    // ∂(signals)/∂p, signals × parameters row-major.
    void signals(const double* y, const double* S, int count, double* slopes);

  private:
    // Rows of several matrices stacked; row r belongs to entry `target[r]` of the result.
    struct Rows {
        std::vector<double> matrix;
        std::vector<int> target;
        int rows = 0;
        void add_product(int n, const double* x, double factor, double* out, std::vector<double>& scratch) const;
    };
    static Rows compress(const std::vector<const Matrix<double>*>& matrices, int stride);
    void taylor(double length, double* y, double* S);

    const Propagator<double>& propagator_;
    int parameters_, n_, rows_;
    Rows A_, outputs_;
    std::vector<Matrix<double>> guards_;      // per parameter
    std::vector<std::vector<double>> power_;  // per level: the L of all parameters, stacked
    std::vector<double> scratch_, product_, term_, next_, y_term_, y_next_;
};

}  // namespace dualdrive::exact
