// Propagators against a series in long double, and the proven bound on a guard's sixth derivative.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "../../cpp/src/solvers/exact/crossing.hpp"
#include "../../cpp/src/solvers/exact/propagator.hpp"
#include "exact_draws.hpp"

using namespace dualdrive;
using namespace dualdrive::exact;

namespace {

using FineVector = Eigen::Matrix<Fine, Eigen::Dynamic, 1>;

struct System {
    Laws<double> laws;
    double norm;  // 1/s, of its matrix in units that suit it
};

// As the engine meets them: states of very different units that mostly die away, a chain of integrators and a rotating
// pair that drive them, and the constant 1.
System random_system(Draw& draw, double speed) {
    const int states = draw.whole(2, 14), chain = draw.whole(1, 6), n = states + chain + 3;
    Matrix<double> A = Matrix<double>::Zero(n, n);
    std::vector<double> unit(static_cast<std::size_t>(n));
    for (double& u : unit) u = draw.size(3);
    for (int i = 0; i < states; ++i)
        for (int j = 0; j < n; ++j)
            if (j == i || draw.chance(0.4)) A(i, j) = speed * (draw.normal() - (i == j ? 2.0 : 0.0));
    for (int i = 0; i < states; ++i)
        for (int j = 0; j < n; ++j) A(i, j) *= unit[static_cast<std::size_t>(i)] / unit[static_cast<std::size_t>(j)];
    for (int k = 0; k + 1 < chain; ++k) A(states + k, states + k + 1) = 1.0;
    const int pair = states + chain;
    A(pair, pair + 1) = draw.uniform(0.1, 30.0);
    A(pair + 1, pair) = -A(pair, pair + 1);
    const auto rows = [&](int count) {
        Matrix<double> m = Matrix<double>::Zero(count, n);
        for (int i = 0; i < count; ++i)
            for (int j = 0; j < n; ++j)
                if (draw.chance(0.5)) m(i, j) = draw.normal() / unit[static_cast<std::size_t>(j)];
        return m;
    };
    return {{A, rows(4), rows(3)}, 40.0 + 2.0 * speed * n};
}

FineVector random_state(Draw& draw, Eigen::Index size) {
    FineVector y(size);
    for (Eigen::Index k = 0; k + 1 < y.size(); ++k) y(k) = Fine(draw.normal() * draw.size(2));
    y(y.size() - 1) = 1;
    return y;
}

// e^{A t} y by a plain series over so many parts that each is short.
FineVector series(const Matrix<double>& A, double norm, FineVector y, Fine t) {
    const Matrix<Fine> fine = A.cast<Fine>();
    const int parts = 1 + static_cast<int>(Fine(norm) * t);
    for (int p = 0; p < parts; ++p) {
        FineVector term = y;
        for (int k = 1; k < 30; ++k) {
            term = (fine * term * (t / Fine(parts) / Fine(k))).eval();
            y += term;
        }
    }
    return y;
}

std::vector<double> padded_copy(const FineVector& y, int rows) {
    std::vector<double> v(static_cast<std::size_t>(rows), 0.0);
    for (Eigen::Index k = 0; k < y.size(); ++k) v[static_cast<std::size_t>(k)] = static_cast<double>(y(k));
    return v;
}

}  // namespace

TEST_CASE("a propagator goes where the series goes, over any part of a step") {
    Draw draw(1);
    double worst = 0.0;
    for (int k = 0; k < 300; ++k) {
        const double speed = draw.size(2), grid = draw.uniform(0.1, 40.0) / speed / 10.0;
        const auto [laws, norm] = random_system(draw, speed);
        const Propagator<double> p(laws, grid);
        CHECK(p.step() * std::exp2(p.halvings()) == grid);
        const double length = draw.chance(0.2) ? p.step() : p.step() * draw.uniform(0.0, 1.0);
        const FineVector y = random_state(draw, laws.A.rows());
        std::vector<double> found = padded_copy(y, p.rows()), scratch(static_cast<std::size_t>(2 * p.rows()));
        const FineVector start = Eigen::Map<const Eigen::VectorXd>(found.data(), y.size()).cast<Fine>();
        p.advance(found.data(), length, scratch.data());
        const FineVector truth = series(laws.A, norm, start, length);
        // |e^{A t} y| ≤ e^{|A| t} |y|: no sum of rounded products can do better than its share of that
        const FineVector bound = series(laws.A.cwiseAbs(), norm, start.cwiseAbs(), length);
        for (Eigen::Index i = 0; i < y.size(); ++i) {
            if (!(bound(i) > 0)) continue;
            const auto off =
                static_cast<double>(std::abs(Fine(found[static_cast<std::size_t>(i)]) - truth(i)) / bound(i));
            worst = std::max(worst, off);
        }
    }
    CHECK(worst < 60 * epsilon);
    MESSAGE("largest error: " << worst / epsilon << " units in the last place of e^{|A| t} |y|");
}

TEST_CASE("squarings keep the digits of slow parts beside fast ones") {
    // A pole of −1e6/s and an integrator of a speed that dies away with 1/s: twenty squarings to one step of 1 s.
    Matrix<double> A = Matrix<double>::Zero(4, 4);
    A(0, 0) = -1e6, A(0, 3) = 1e6, A(1, 2) = 1.0, A(2, 2) = -1.0;
    const Propagator<double> p({A, Matrix<double>::Zero(2, 4), Matrix<double>::Zero(0, 4)}, 1.0);
    CHECK(p.halvings() > 15);
    std::vector<double> y = padded_copy(FineVector::Zero(4), p.rows()), scratch(static_cast<std::size_t>(2 * p.rows()));
    y[2] = y[3] = 1.0;
    for (long k = 0; k < (1L << p.halvings()); ++k) p.advance(y.data(), p.step(), scratch.data());
    CHECK(y[0] == doctest::Approx(1.0).epsilon(1e-12));
    CHECK(y[1] == doctest::Approx(1.0 - std::exp(-1.0)).epsilon(1e-10));
    CHECK(y[2] == doctest::Approx(std::exp(-1.0)).epsilon(1e-10));
}

TEST_CASE("however rarely a run is recorded, its steps are short enough for their series") {
    Matrix<double> A = Matrix<double>::Zero(2, 2);
    A(0, 0) = -1e6;
    const Propagator<double> p({A, Matrix<double>::Zero(2, 2), Matrix<double>::Zero(0, 2)}, 1e4);
    CHECK(p.step() * 1e6 <= 3.0);
    CHECK(p.terms() < most_terms);
}

TEST_CASE("equations that are not finite are refused") {
    Matrix<double> A = Matrix<double>::Zero(3, 3);
    A(0, 1) = std::numeric_limits<double>::quiet_NaN();
    CHECK_THROWS(Propagator<double>({A, Matrix<double>::Zero(2, 3), Matrix<double>::Zero(0, 3)}, 1.0));
}

TEST_CASE("a guard is never further from its quintic than proven") {
    Draw draw(2);
    double closest = 0.0, tightest = 1.0;
    for (int k = 0; k < 250; ++k) {
        const double speed = draw.size(2);
        const auto [laws, norm] = random_system(draw, speed);
        const Propagator<double> p(laws, draw.uniform(0.3, 6.0) / speed / 10.0);
        const FineVector y = random_state(draw, laws.A.rows());
        const Fine h(p.step());
        const FineVector after = series(laws.A, norm, y, h);
        const Matrix<Fine> A = laws.A.cast<Fine>();
        const int m = p.watch_rows();
        FineVector beside = y;  // a state judged before, near or far
        const double apart = std::exp2(-draw.uniform(0.0, 20.0));
        for (Eigen::Index j = 0; j + 1 < y.size(); ++j) beside(j) *= 1 + Fine(apart * draw.normal());
        const std::vector<double> from = padded_copy(y, p.rows()), judged = padded_copy(beside, p.rows());
        for (std::size_t w = 0; w < p.watched().size(); ++w) {
            std::vector<double> terms(static_cast<std::size_t>(padded(p.terms())), 0.0);
            for (std::size_t j = 0; j < static_cast<std::size_t>(p.size()); ++j)
                for (std::size_t i = 0; i < terms.size(); ++i)
                    terms[i] += p.series(w)[j * terms.size() + i] * judged[j];
            const double error = sixth_derivative(terms.data(), p.terms()) / 46080;
            const double by_neighbour = p.bound_beside(w, from.data(), judged.data(), error);
            const Eigen::Matrix<Fine, 1, Eigen::Dynamic> g = laws.guards.row(p.watched()[w].low).cast<Fine>(),
                                                         g1 = g * A * (h / 5), g2 = g1 * A * (h / 4);
            const Fine v0 = g1.dot(y), a0 = g2.dot(y), v1 = g1.dot(after), a1 = g2.dot(after);
            const Fine b0 = g.dot(y), b5 = g.dot(after);
            const std::array<Fine, 6> b{b0, b0 + v0, b0 + 2 * v0 + a0, b5 - 2 * v1 + a1, b5 - v1, b5};
            Fine bound(0);
            for (Eigen::Index j = 0; j < y.size(); ++j)
                bound += Fine(p.bounds()[static_cast<std::size_t>(j * 2 * m) + w]) * std::abs(y(j));
            Fine furthest(0);
            FineVector now = y;
            for (int part = 1; part < 40; ++part) {
                now = series(laws.A, norm, now, h / 40);
                furthest = std::max(furthest, std::abs(g.dot(now) - quintic_at(b, Fine(part) / 40)));
            }
            const Fine rounding = 1e-17L * g.cwiseAbs().dot(y.cwiseAbs() + after.cwiseAbs());
            CHECK(furthest <= bound * (1 + 1e-9L) + rounding);
            CHECK(furthest <= by_neighbour * (1 + 1e-9L) + rounding);
            tightest = std::min(tightest, by_neighbour / static_cast<double>(bound));
            if (bound > 1e3L * rounding) closest = std::max(closest, static_cast<double>(furthest / bound));
        }
    }
    CHECK(tightest < 0.1);  // a neighbour says more, if it is near
    CHECK(closest > 0.05);  // nor is the bound so wide that it says nothing
    MESSAGE("largest share of the bound: " << closest);
}
