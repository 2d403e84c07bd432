// ∂(cost)/∂A of one tangent, summed over a run, by way of all propagators that were made of it.
//
// λ and all derivatives are over the states alone: nothing flows from them into the inputs. Matrices by columns; those of
// λ have padded(states) rows.
#pragma once

#include <map>
#include <vector>

#include "propagators.hpp"

namespace dualdrive::exponential {

class TangentGradient {
  public:
    TangentGradient(Propagators& propagators, int states);

    // Before a step of `level`, what λ after it is by y, and from owed_to_rest() on by c. `out` has tall() rows.
    void back(int level, const double* lambda, double* out);
    int tall() const { return tall_; }
    int owed_to_rest() const { return lambda_rows_; }
    // What `count` steps of that level owe to their propagator: from the columns of (y, c) to those of λ.
    void keep(int level, int count, const double* yc, const double* lambda);
    // The same of Propagators::taylor; what it owes to A is kept if `keep` says so.
    void series_back(double length, const double* yc, const double* lambda, bool keep, double* out);
    // The rest is n = f − A y: `rest` is what it is owed in each driven row, at `count` columns of (y, c).
    void keep_rest(int count, const double* yc, const double* rest);

    // The sum, padded(states) × (size of y). To be asked for at the end.
    const std::vector<double>& total();
    const Propagators& propagators() const { return propagators_; }

  private:
    using Packed = std::vector<double>;
    struct Shares {
        Packed less_one, phi;  // of e^{A δ} − 1 and of δ φ_k(A δ) B
    };
    Packed product(const Packed& M, int n, const Packed& x, int count) const;
    void add_kept(int level, Shares& shares);
    void halve(int level, Shares& shares) const;
    void finest_back(double length, Shares shares);
    void exponential_back(const Packed& X, const Packed& X_transposed, Packed bar, Packed& owed) const;
    void phi_back(double length, const Packed& X, const Packed& X_transposed, const Packed& bars, Packed& owed) const;
    Packed phi_of(int level) const;

    Propagators& propagators_;
    const int states_, lambda_rows_, n_, rows_, m_, width_, tall_;
    const Packed A_transposed_;
    std::map<int, Packed> transposed_, kept_;  // per level; kept_: ∂(cost)/∂(e^{A δ}, δ φ_1(A δ) B, …)
    Packed A_, weights_;
    bool closed_ = false;
};

}  // namespace dualdrive::exponential
