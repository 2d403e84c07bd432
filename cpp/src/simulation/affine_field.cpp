#include "affine_field.hpp"

#include <algorithm>

#include "../solvers/exact/kernels.hpp"

namespace dualdrive {

namespace {

std::vector<double> padded_rows(const exact::Matrix<double>& m) {
    const Eigen::Index rows = exact::padded(static_cast<int>(m.rows()));
    std::vector<double> out(static_cast<std::size_t>(rows * m.cols()), 0.0);
    for (Eigen::Index j = 0; j < m.cols(); ++j)
        for (Eigen::Index i = 0; i < m.rows(); ++i) out[static_cast<std::size_t>(j * rows + i)] = m(i, j);
    return out;
}

void multiply(const std::vector<double>& M, const std::vector<double>& x, std::vector<double>& out) {
    const int rows = static_cast<int>(out.size()), n = static_cast<int>(x.size());
    exact::kernels().multiply(rows, n, M.data(), n, x.data(), 1, out.data());
}

}  // namespace

AffineField::AffineField(const Machine& machine, const Inputs& inputs, const Layout& layout, const Modes& modes,
                         const Cell& cell)
    : modes_(modes),
      cell_(cell),
      generator_(inputs),
      reader_(machine, inputs, layout, generator_, nothing_),
      states_(static_cast<std::size_t>(layout.size())),
      guards_(layout.switches.size() * guards_per_switch),
      y_(static_cast<std::size_t>(reader_.size()), 1.0),
      rate_(static_cast<std::size_t>(exact::padded(layout.size()))),
      guard_z_(states_),
      guard_(static_cast<std::size_t>(exact::padded(static_cast<int>(2 * guards_)))) {}

const AffineField::Rows& AffineField::rows() {
    if (now_ && now_modes_ == modes_) return *now_;
    now_modes_ = modes_;
    guard_t_ = std::numeric_limits<double>::quiet_NaN();
    auto known = known_.find(modes_);
    if (known == known_.end()) {
        const exact::Laws<double> laws = reader_.read(modes_);
        exact::Matrix<double> guards(2 * laws.guards.rows(), laws.guards.cols());
        guards << laws.guards, laws.guards * laws.A;
        known = known_.emplace(modes_, Rows{padded_rows(laws.A.topRows(reader_.states())), padded_rows(guards)}).first;
    }
    return *(now_ = &known->second);
}

// The inputs are set anew at another time or in another cell only.
void AffineField::set(double t, const double* z) {
    std::copy_n(z, states_, y_.begin());
    if (t == t_ && cell_.low == t_cell_.low && cell_.high == t_cell_.high) return;
    generator_.set(t, cell_, y_.data() + states_);
    t_ = t;
    t_cell_ = cell_;
    guard_t_ = std::numeric_limits<double>::quiet_NaN();
}

void AffineField::rates(double t, const double* z, double* rate) {
    set(t, z);
    multiply(rows().rates, y_, rate_);
    std::copy_n(rate_.begin(), states_, rate);
}

void AffineField::guards(double t, const double* z, double* g) {
    const Rows& now = rows();
    set(t, z);
    if (t != guard_t_ || !std::equal(z, z + states_, guard_z_.begin())) {
        multiply(now.guards, y_, guard_);
        guard_t_ = t;
        std::copy_n(z, states_, guard_z_.begin());
    }
    std::copy_n(guard_.begin(), guards_, g);
}

void AffineField::guard_slopes(double* slope) const {
    std::copy_n(guard_.begin() + static_cast<std::ptrdiff_t>(guards_), guards_, slope);
}

}  // namespace dualdrive
