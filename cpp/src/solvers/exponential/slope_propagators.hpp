// One mode's propagators derived by parameters: with A_p = ∂A/∂p, the derivative of
//     y(δ) = e^{A δ} y(0) + Σ_k δ φ_{k+1}(A δ) B c_k
// by p while y(0) and c stay as they are. It comes out of the same series and the same squarings as the propagators do.
#pragma once

#include <map>
#include <vector>

#include "propagators.hpp"

namespace dualdrive::exponential {

class SlopePropagators {
  public:
    // An entry of A_p, in the row and column of A.
    struct Entry {
        int row, column;
        double value;
    };
    using Slope = std::vector<Entry>;
    // A_p per parameter; empty where A does not depend on it.
    SlopePropagators(Propagators& propagators, std::vector<Slope> slopes);

    bool none() const { return moving_.empty(); }
    // out[:, p] += A_p y for all parameters, in columns `apart` from each other.
    void add_rates(const double* y, double* out, std::size_t apart) const;
    // sizes[:, p] = the largest of the terms that those are sums of.
    void largest_terms(const double* y, double* sizes, std::size_t apart) const;
    // S[:, p] += the derivative of (y, c) over a step of `level`, in columns `apart` from each other.
    void add_step(int level, const double* yc, double* S, std::size_t apart);
    // (y, c) over `length`, as Propagators::taylor, and the columns (s, c of s) of `count` parameters with it.
    void taylor(double length, double* yc, double* columns, int count) const;

  private:
    using Packed = std::vector<double>;  // rows() × width(), of (e^{A δ}, δ φ_1(A δ) B, …)
    const std::vector<Packed>& step(int level);
    Packed first(double length, const Slope& slope) const;
    Packed doubled(int level, const Packed& half);
    Packed times(const double* M, const double* x, int count) const;
    void add_product(const Slope& slope, double factor, const double* x, int count, Packed& out) const;

    Propagators& propagators_;
    const std::vector<Slope> slopes_;
    std::vector<std::size_t> moving_;  // parameters that A depends on
    const int n_, rows_, m_, width_;
    std::map<int, std::vector<Packed>> known_;  // per level, of the moving ones
    Packed moved_;
};

}  // namespace dualdrive::exponential
