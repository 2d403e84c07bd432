// One mode's propagators over steps δ = unit · 2^level: e^{A δ}, and the φ-functions through which a rest n acts.
//
// While n is a polynomial over a step, with c_k = δ^k n⁽ᵏ⁾ at its begin, ẏ = A y + B n has the solution
//     y(δ) = e^{A δ} y(0) + Σ_k δ φ_{k+1}(A δ) B c_k
// (M. Hochbruck, A. Ostermann, Exponential integrators, Acta Numerica 19 (2010) 209–286, section 2.3).
#pragma once

#include <map>
#include <vector>

#include "../exact/laws.hpp"
#include "nodes.hpp"

namespace dualdrive::exponential {

class Propagators {
  public:
    // B: a column of one for each row of y that n drives.
    Propagators(const exact::Matrix<double>& A, const std::vector<int>& driven, double unit);

    int size() const { return n_; }         // of y
    int rows() const { return rows_; }      // of y, padded
    int width() const { return width_; }    // of (y, c): c_k of all driven rows, one k after the other
    int finest() const { return finest_; }  // level down from which the Taylor series is short
    // (e^{A δ}, δ φ_1(A δ) B, δ φ_2(A δ) B, …), rows() × width().
    const double* step(int level);
    // e^{A δ} − 1, rows() × size().
    const std::vector<double>& less_one(int level);
    // What both are made of: A; the rows that n drives; and how many terms of the series count at the finest level.
    const std::vector<double>& A() const { return A_; }
    const std::vector<int>& driven() const { return driven_; }
    double unit() const { return unit_; }
    int order() const { return order_; }
    // A y; `out` has rows().
    void rates(const double* y, double* out) const;
    // Of the sum that is a row of A y.
    double largest_term(int row, const double* y) const;
    // (y, c) → y over `length`, at most the finest step; c as at its begin with δ = `length`. `scratch`: 2 rows().
    void taylor(double length, double* yc, double* scratch) const;

  private:
    struct Step {
        std::vector<double> less_one, whole;  // e^{A δ} − 1, lest slow parts lose their digits in squaring; all
    };
    Step first(double length) const;
    Step doubled(const Step& half) const;
    std::vector<double> times(const std::vector<double>& M, const double* x, int count) const;
    void put_exponential(Step& step) const;

    const double unit_;
    const std::vector<int> driven_;
    const int n_, rows_, m_, width_;
    std::vector<double> A_;  // packed
    int finest_ = 0, order_ = 0;
    std::map<int, Step> known_;
};

}  // namespace dualdrive::exponential
