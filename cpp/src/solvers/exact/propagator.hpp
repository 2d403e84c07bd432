// One mode's linear system, prepared: propagators, guards with a proven bound, recorded signals.
//
// The step is halved until ‖A‖ h ≤ widest, so that a few terms of every series are enough. e^{A h/2^b} comes for every b
// out of the squarings that lead to e^{A h}; a part of a step is a product of these and a short Taylor series.
#pragma once

#include <vector>

#include "kernels.hpp"
#include "laws.hpp"

namespace dualdrive::exact {

inline constexpr int levels = 5;  // halvings of a step that are kept

// A bound on the spectral radius of |A|, and how many terms of an exponential's series matter where ‖A‖ h = θ.
template <class R>
R spectral_bound(const Matrix<R>& A);
template <class R>
int terms_for(R theta);

// A watched quantity q is valid within (0, upper): the two guards of an element are often q and upper − q.
template <class R>
struct Watched {
    int low, high;  // guards that fall where q reaches 0 and `upper`; -1: none
    R upper;
};
// Of guards that are G y, the last entry of y being 1: pairs that differ in sign and a constant are one quantity, whose row
// is that of `low`; those that never fall are none.
template <class R>
std::vector<Watched<R>> watched_quantities(const Matrix<R>& G);

template <class R>
class Propagator {
  public:
    // grid: the step between grid times, s. Columns and rows of y are padded with zeros to `rows()`.
    Propagator(Laws<R> laws, double grid);

    const Laws<R>& laws() const { return laws_; }
    int size() const { return n_; }     // of y
    int rows() const { return rows_; }  // of y, padded
    int halvings() const { return halvings_; }
    double step() const { return step_; }  // grid / 2^halvings
    int order() const { return order_; }   // of the Taylor series over what is left below step / 2^levels
    const std::vector<R>& A() const { return A_; }
    const std::vector<R>& power(int level) const {
        return power_[static_cast<std::size_t>(level)];
    }  // e^{A step/2^level}

    // y after `length` ≤ step().
    void advance(R* y, R length, R* scratch) const;
    void advance_by_power(int level, R* y, R* scratch) const;
    // Calls use(level) for every step/2^level that `length` is made of, longest first; returns what is left below them.
    template <class Use>
    R halve(R length, const Use& use) const {
        R part(step_);
        for (int level = 0; level <= levels && length > R(0); ++level, part /= 2) {
            if (length < part) continue;
            use(level);
            length -= part;
        }
        return length;
    }

    const std::vector<Watched<R>>& watched() const { return watched_; }
    const std::vector<R>& upper_limits() const { return upper_; }  // padded
    int watch_rows() const { return padded(static_cast<int>(watched_.size())); }
    // Rows for q, q' h/5 and q'' h²/20 of all watched quantities: what the Bernstein form of a quintic is made of.
    const std::vector<R>& watch() const { return watch_; }
    // Two sets of rows for |y|: the largest error of that quintic within a step, and the rounding of q.
    const std::vector<R>& bounds() const { return bounds_; }
    // The first of the two by another state y₀, where the quintic of that quantity errs by `error`: |q⁽⁶⁾| is at most what
    // it was for y₀, and what the difference adds. Large torques that cancel do so in both.
    R bound_beside(std::size_t watched, const R* y, const R* y0, R error) const;
    // Power series of q in t/step: `terms` × size().
    int terms() const { return terms_; }
    const std::vector<R>& series(std::size_t watched) const;

    int outputs() const { return outputs_rows_; }
    const std::vector<R>& output_rows() const { return outputs_; }

  private:
    void exponentials(R norm);
    void find_watched();
    void find_bounds();
    void find_series() const;
    std::vector<R> pack(const Matrix<R>& m, int rows) const;

    Laws<R> laws_;
    int n_, rows_, halvings_ = 0, order_ = 0, terms_ = 0, outputs_rows_ = 0;
    double step_;
    std::vector<R> A_;
    std::vector<std::vector<R>> power_;
    std::vector<Watched<R>> watched_;
    Matrix<R> watched_rows_;  // unpadded
    std::vector<R> upper_, watch_, bounds_, outputs_;
    mutable std::vector<std::vector<R>> series_;
};

extern template class Propagator<double>;
extern template class Propagator<long double>;

}  // namespace dualdrive::exact
