#include "dualdrive/delay_approximant.hpp"

#include <doctest/doctest.h>

#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <utility>

using dualdrive::DelayApproximant;

namespace {

constexpr int n = DelayApproximant::order;
using Vector = Eigen::Matrix<double, n, 1>;

// Rates under a signal of 0 or 1 in one state each: the columns of the system; and those that the signal drives.
struct System {
    Eigen::Matrix<double, n, n> A;
    Vector B;

    explicit System(double delay) {
        Vector m = Vector::Zero();
        DelayApproximant::flow(1.0, delay, m.data(), B.data());
        for (int j = 0; j < n; ++j) {
            m.setZero();
            m(j) = 1.0;
            Vector rate;
            DelayApproximant::flow(0.0, delay, m.data(), rate.data());
            A.col(j) = rate;
        }
    }
};

}  // namespace

TEST_CASE("a sine comes out as it was a delay before") {
    const double delay = 1.7e-3;
    const System system(delay);
    for (const auto& [turn, error] : {std::pair{1.0, 1e-13}, {3.0, 1e-9}, {5.0, 1e-6}}) {
        const std::complex<double> s(0.0, turn / delay);
        const Eigen::Matrix<std::complex<double>, n, 1> m =
            (s * Eigen::Matrix<std::complex<double>, n, n>::Identity() - system.A.cast<std::complex<double>>())
                .partialPivLu()
                .solve(system.B.cast<std::complex<double>>());
        CHECK(std::abs(DelayApproximant::output(m.data()) - std::exp(-s * delay)) < error);
    }
}

TEST_CASE("what has always been the same stays so, and is the first state") {
    Vector m = Vector::Zero(), rate;
    m(0) = 4.2;
    DelayApproximant::flow(4.2, 1e-3, m.data(), rate.data());
    CHECK(rate.isZero(1e-9));
    CHECK(DelayApproximant::output(m.data()) == 4.2);
}

TEST_CASE("its poles decay, and lie within a few orders over the delay") {
    const System system(1.0);
    const auto poles = system.A.eigenvalues();
    for (const auto& pole : poles) {
        CHECK(pole.real() < 0.0);
        CHECK(std::abs(pole) < 4.0 * n);
    }
}
