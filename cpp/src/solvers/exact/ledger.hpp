// What energy flows by each path while modes are frozen.
//
// A power is a symmetric form of the state, p = y' Q y, and so is what flows within a time r:
//
//   ∫ p dt = y' W(r) y,   W(r) = ∫ e^{A's} Q e^{As} ds = Σ M_k r^{k+1}/(k+1)!,   M_0 = Q,  M_{k+1} = A'M_k + M_k A,
//
// from which W(2r) = W(r) + e^{A'r} W(r) e^{Ar} (C. Van Loan, IEEE Trans. Automatic Control 23, 1978). All paths together
// are one matrix for the products y_i y_j: a step of the ledger costs about as much as one of the engine.
#pragma once

#include <array>
#include <vector>

#include "laws.hpp"
#include "propagator.hpp"

namespace dualdrive::exact {

template <class R>
class Ledger {
  public:
    // `law` must outlive the ledger.
    Ledger(const Energies<R>& forms, const Propagator<R>& law);

    // Adds what flows by each path (`powers` of them) from y on, within a step or within a length of at most a step.
    void add_step(const R* y, double* energy);
    void add_part(const R* y, R length, double* energy);
    double stored(const R* y);

  private:
    static constexpr int smooth = 4;  // derivatives of the power at both ends, of which a short part is summed up

    using Square = std::vector<R>;  // n × n, rows padded as those of A
    Square square(const Matrix<R>& form) const;
    Square times(const Square& a, const Square& b) const;
    Square transposed(const Square& a) const;
    std::vector<R> pack(const std::vector<Square>& forms) const;
    void find_parts(std::vector<Square> derivative);
    const R* products(const R* y);
    const R* of_form(const std::vector<R>& rows, const R* products);
    void add_short(R* y, R length, double* energy);
    void add(const R* sums, double* energy) const;

    const Propagator<R>& law_;
    const int n_, ld_;                                // of y, and padded
    std::vector<std::size_t> paths_;                  // by which anything flows
    int rows_ = 0;                                    // of those, padded
    std::array<std::vector<R>, levels + 1> parts_;    // W(step / 2^level)
    std::array<std::vector<R>, smooth> derivatives_;  // M_k
    std::vector<R> stored_;
    std::vector<R> products_, sums_, y_, scratch_;
};

extern template class Ledger<double>;
extern template class Ledger<long double>;

}  // namespace dualdrive::exact
