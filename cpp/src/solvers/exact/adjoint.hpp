// The way back over the exact engine's steps.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "../adjoint.hpp"
#include "laws.hpp"
#include "propagator.hpp"

namespace dualdrive::exact {

// ∂(cost)/∂(coefficients) of one law, summed over a run. The exponentials' parts become one of A at the end.
class LawGradient {
  public:
    LawGradient(const Propagator<double>& law, int states);

    // λ is over the states alone: nothing flows from them into the inputs. Its columns have padded(states) rows.
    //
    // λ (count + 1 columns) back over whole steps that began at the columns of y; what comes in at each column is there.
    void steps_back(int count, const double* y, double* lambda);
    // λ back over part of a step that began at y.
    void part_back(double length, const double* y, double* lambda);
    // For `count` columns of y: `push` (as many columns) becomes ∂(cost)/∂y by way of the signals' seeds there.
    void outputs_back(int count, const double* y, const double* seeds, double* push);
    void guard_back(int guard, double weight, const double* y);

    // Σ over all coefficients of their gradient times their derivative.
    double along(const Laws<double>& derivative);

  private:
    using Packed = std::vector<double>;  // by columns of rows_ where nothing else is said
    void power_back(int level, int count, const double* y, double* lambda);
    void series_back(double length, const double* y, double* lambda);
    Packed product(const Packed& a, const Packed& b) const;
    Packed of_exponentials() const;
    void close();

    const Propagator<double>& law_;
    const int n_, rows_, states_, lambda_rows_, signals_;
    std::vector<Packed> transposed_, exponential_;  // per level, by columns of λ: Eᵀ of the states; ∂(cost)/∂E
    Packed A_transposed_, outputs_transposed_;      // by columns of λ
    Packed A_;        // by columns of λ: ∂(cost)/∂A by the series, once closed by all ways
    Packed outputs_;  // ∂(cost)/∂(signals' rows), transposed
    Packed terms_, bars_;
    Matrix<double> guards_;
    bool closed_ = false;
};

class Adjoint final : public dualdrive::Adjoint {
  public:
    Adjoint(const Tape& tape, int states, std::function<void(int, double*)> jump_back);

    struct Owed {
        const Propagator<double>* law;
        LawGradient gradient;
    };
    // In the order in which they were first met on the way back: sums are the same each time, wherever memory was.
    const std::vector<std::unique_ptr<Owed>>& laws() const { return laws_; }

  private:
    void present_output_back(const Entry& output) override;
    void steps_back(const Entry& steps, Outputs outputs) override;
    void guard_back(const Entry& instant, double weight) override;
    LawGradient& gradient(const Propagator<double>* law);
    void outputs_back(Outputs outputs, const Entry& steps);

    std::vector<double> side_;
    std::vector<double> columns_;                 // λ at every column of the present steps
    const Propagator<double>* recent_ = nullptr;  // the law asked for last
    LawGradient* recent_gradient_ = nullptr;
    std::vector<std::unique_ptr<Owed>> laws_;
    std::map<const Propagator<double>*, LawGradient*> known_;
};

}  // namespace dualdrive::exact
