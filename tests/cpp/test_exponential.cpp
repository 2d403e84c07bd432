// What the exponential engine is made of: polynomials through nodes, φ-functions, the watch over guards.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "../../cpp/src/solvers/exponential/propagators.hpp"
#include "../../cpp/src/solvers/exponential/slope_propagators.hpp"
#include "../../cpp/src/solvers/exponential/watch.hpp"
#include "exact_draws.hpp"

using namespace dualdrive;
using namespace dualdrive::exponential;
using exact::Fine;

namespace {

constexpr int terms = static_cast<int>(nodes);

// φ_{k+1}(x) = ∫ e^{x (1 − s)} s^k/k! ds over 0 … 1, by its series or, where that cancels, by the recurrence.
Fine phi(int k, Fine x) {
    if (std::abs(x) < 8.0L) {
        Fine sum = 0, term = 1.0L / std::tgamma(static_cast<Fine>(k) + 2.0L);
        for (int i = 0; i < 80; ++i) {
            sum += term;
            term *= x / static_cast<Fine>(i + k + 2);
        }
        return sum;
    }
    Fine value = std::expm1(x) / x, factorial = 1.0L;
    for (int j = 1; j <= k; ++j) {
        factorial *= static_cast<Fine>(j);
        value = (value - 1.0L / factorial) / x;
    }
    return value;
}

// Three lags of poles four decades apart and an integrator behind the first; the rest drives the lags.
exact::Matrix<double> lags(const std::array<double, 3>& pole) {
    exact::Matrix<double> A = exact::Matrix<double>::Zero(5, 5);
    for (int k = 0; k < 3; ++k) A(k, k) = -pole[static_cast<std::size_t>(k)];
    A(3, 0) = 1.0;
    return A;
}

}  // namespace

TEST_CASE("derivatives through nodes are those of the polynomial") {
    for (int p = 0; p <= static_cast<int>(intervals); ++p)
        for (std::size_t j = 0; j < nodes; ++j)
            for (int k = 0; k <= p; ++k) {
                double sum = 0.0, true_one = 1.0;
                for (std::size_t i = 0; i < nodes; ++i)
                    sum += through_nodes[j][static_cast<std::size_t>(k)][i] * std::pow(static_cast<double>(i), p);
                for (int f = p; f > p - k; --f) true_one *= f;
                true_one *= std::pow(static_cast<double>(j), p - k);
                CHECK(sum == doctest::Approx(true_one).epsilon(1e-11).scale(std::pow(8.0, p)));
            }
    for (std::size_t p = 0; p < most_back; ++p) {  // e^{−i/4} at 0, −1, …: the slope comes nearer with every value
        double sum = 0.0;
        for (std::size_t i = 0; i <= p; ++i) sum += backward[p][1][i] * std::exp(-0.25 * static_cast<double>(i));
        CHECK(std::abs(sum - 0.25) < 0.26 * std::pow(0.26, static_cast<double>(p)));
    }
}

TEST_CASE("the last Gram polynomial is orthogonal to all of lower degree") {
    double square = 0.0;
    for (const double g : last_gram) square += g * g;
    CHECK(square == last_gram_square);
    for (int p = 0; p < static_cast<int>(intervals); ++p) {
        double sum = 0.0;
        for (std::size_t i = 0; i < nodes; ++i) sum += last_gram[i] * std::pow(static_cast<double>(i), p);
        CHECK(sum == 0.0);
    }
}

TEST_CASE("propagators derived by a parameter are what differences of them tell") {
    const exact::Matrix<double> A = lags({0.3, 40.0, 3000.0});
    const std::vector<int> driven{0, 2};
    // one that moves a pole and couples two lags, one that moves nothing
    const std::vector<SlopePropagators::Slope> slopes{{{1, 1, -40.0}, {2, 1, 7.0}}, {}};
    Propagators propagators(A, driven, 1e-3);
    SlopePropagators derived(propagators, slopes);
    const auto rows = static_cast<std::size_t>(propagators.rows()),
               width = static_cast<std::size_t>(propagators.width());
    std::vector<double> yc(width, 0.0);
    for (std::size_t i = 0; i < 5; ++i) yc[i] = 1.0 + 0.3 * static_cast<double>(i);
    for (std::size_t i = rows; i < width; ++i) yc[i] = std::cos(static_cast<double>(i));
    const auto moved = [&](double h, const auto& advance) {
        exact::Matrix<double> M = A;
        for (const auto& e : slopes[0]) M(e.row, e.column) += h * e.value;
        Propagators p(M, driven, 1e-3);
        std::vector<double> y(yc);
        advance(p, y);
        return y;
    };
    constexpr double h = 1e-4;
    const auto told_by_differences = [&](const auto& advance) {
        const std::vector<double> up = moved(h, advance), down = moved(-h, advance);
        std::vector<double> slope(5);
        for (std::size_t i = 0; i < 5; ++i) slope[i] = (up[i] - down[i]) / (2.0 * h);
        return slope;
    };
    for (const int level : {-9, -3, 0, 2, 5}) {
        const std::vector<double> truth = told_by_differences([&](Propagators& p, std::vector<double>& y) {
            std::vector<double> out(rows);
            exact::kernels().multiply(p.rows(), p.width(), p.step(level), p.width(), y.data(), 1, out.data());
            std::copy(out.begin(), out.end(), y.begin());
        });
        std::vector<double> found(2 * width, 0.0);
        derived.add_step(level, yc.data(), found.data(), width);
        for (std::size_t i = 0; i < 5; ++i) {
            CHECK(found[i] == doctest::Approx(truth[i]).epsilon(1e-7).scale(1e-6));
            CHECK(found[width + i] == 0.0);
        }
    }
    const double length = 0.3 * std::ldexp(1e-3, propagators.finest());
    const std::vector<double> truth = told_by_differences([&](Propagators& p, std::vector<double>& y) {
        std::vector<double> scratch(2 * rows);
        p.taylor(length, y.data(), scratch.data());
    });
    std::vector<double> y(yc), columns(2 * width, 0.0), plain(yc), scratch(2 * rows);
    derived.taylor(length, y.data(), columns.data(), 2);
    propagators.taylor(length, plain.data(), scratch.data());
    for (std::size_t i = 0; i < 5; ++i) {
        CHECK(y[i] == doctest::Approx(plain[i]).epsilon(1e-14));
        CHECK(columns[i] == doctest::Approx(truth[i]).epsilon(1e-7).scale(1e-6));
        CHECK(columns[width + i] == 0.0);
    }
}

TEST_CASE("propagators hold the exponential and the φ-functions, of slow and of fast poles") {
    const std::array<double, 3> pole{0.3, 40.0, 3000.0};
    Propagators propagators(lags(pole), {0, 1, 2}, 1e-3);
    const auto rows = static_cast<std::size_t>(propagators.rows());
    for (const int level : {-9, -3, 0, 2, 5}) {
        const double step = std::ldexp(1e-3, level);
        const double* const M = propagators.step(level);
        for (std::size_t r = 0; r < 3; ++r) {
            const Fine x = -static_cast<Fine>(pole[r]) * step;
            CHECK(M[r * rows + r] == doctest::Approx(static_cast<double>(std::exp(x))).epsilon(1e-13));
            for (int k = 0; k < terms; ++k) {
                const double found = M[(rows + 3 * static_cast<std::size_t>(k) + r) * rows + r];
                CHECK(found == doctest::Approx(static_cast<double>(step * phi(k, x))).epsilon(1e-12));
            }
        }
        // the integrator behind the first lag: (1 − e^x)/0.3
        CHECK(M[3] == doctest::Approx(-std::expm1(-pole[0] * step) / pole[0]).epsilon(1e-13));
    }
}

TEST_CASE("a part of a step and its rest are the step") {
    exact::Draw draw(7);
    for (int pass = 0; pass < 50; ++pass) {
        const int n = draw.whole(2, 9);
        exact::Matrix<double> A(n, n);
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j) A(i, j) = 100.0 * draw.normal();
        Propagators propagators(A, {0, n - 1}, 1e-3);
        const auto rows = static_cast<std::size_t>(propagators.rows()), m = std::size_t{2};
        std::vector<double> yc(static_cast<std::size_t>(propagators.width()), 0.0), scratch(2 * rows);
        for (int i = 0; i < n; ++i) yc[static_cast<std::size_t>(i)] = draw.normal();
        for (std::size_t i = rows; i < yc.size(); ++i) yc[i] = draw.normal();
        const int level = propagators.finest();
        const double step = std::ldexp(1e-3, level), share = draw.uniform(0.1, 0.9);
        const double* const M = propagators.step(level);
        std::vector<double> whole(rows, 0.0), parts(yc);
        for (std::size_t j = 0; j < yc.size(); ++j)
            for (std::size_t i = 0; i < rows; ++i) whole[i] += M[j * rows + i] * yc[j];
        // c at the begin of a part, in its own unit of time
        const auto cut = [&](double from, double length) {
            for (std::size_t r = 0; r < m; ++r)
                for (int k = 0; k < terms; ++k) {
                    double sum = 0.0, term = 1.0;
                    for (int j = k; j < terms; term *= from / (++j - k))
                        sum += term * yc[rows + m * static_cast<std::size_t>(j) + r];
                    parts[rows + m * static_cast<std::size_t>(k) + r] = sum * std::pow(length, k);
                }
        };
        cut(0.0, share);
        propagators.taylor(share * step, parts.data(), scratch.data());
        cut(share, 1.0 - share);
        propagators.taylor((1.0 - share) * step, parts.data(), scratch.data());
        for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i)
            CHECK(parts[i] == doctest::Approx(whole[i]).epsilon(1e-12).scale(1.0));
    }
}

TEST_CASE("what a walk does not resolve is doubted") {
    // guard q = 1 + a sin(ω t) of a rotating pair; one more guard that is off by a constant of its pair
    const double w = 300.0;
    exact::Laws<double> laws{exact::Matrix<double>::Zero(3, 3), exact::Matrix<double>::Zero(2, 3), {}};
    laws.A(0, 1) = w;
    laws.A(1, 0) = -w;
    laws.guards(0, 0) = 1.0;
    laws.guards(0, 2) = 1.0;
    laws.guards(1, 0) = -1.0;
    laws.guards(1, 2) = 2.0;
    Watch watch(laws, {}, 1e-3);
    REQUIRE(watch.quantities().size() == 1);
    CHECK(watch.upper()[0] == 3.0);
    const auto doubt_at = [&](Watch& on, double unit, int level, double phase) {
        const std::vector<double>& M = on.matrix(level);
        const int count = 8, tall = 3 * on.rows();
        std::vector<double> values(static_cast<std::size_t>(tall * (count + 1)), 0.0), doubt(4);
        for (int k = 0; k <= count; ++k) {
            const double angle = w * std::ldexp(unit, level) * k + phase,
                         y[4] = {std::sin(angle), std::cos(angle), 1, 0};
            for (int j = 0; j < 4; ++j)
                for (int i = 0; i < tall; ++i)
                    values[static_cast<std::size_t>(k * tall + i)] += M[static_cast<std::size_t>(j * tall + i)] * y[j];
        }
        largest_doubt(on.rows(), count, values.data(), doubt.data());
        return doubt[0];
    };
    CHECK(doubt_at(watch, 1e-3, 0, 0.3) < 2e-4);   // 0.3 rad a stretch
    CHECK(doubt_at(watch, 1e-3, -2, 0.3) < 1e-7);  // falls with the sixth power
    CHECK(doubt_at(watch, 1e-3, 4, 0.3) > 0.1);    // 4.8 rad
    const double full_turn = 2.0 * std::numbers::pi / w;
    for (const double phase : {0.0, 0.7, 1.5, 3.0}) {  // as many points as turns: values alone would not tell
        Watch turning(laws, {}, full_turn);
        CHECK(doubt_at(turning, full_turn, 0, phase) > 0.1);
    }
    const std::vector<double> pair{0.5, 2.5}, apart{0.5, 2.6};
    CHECK_FALSE(watch.set_apart(pair.data()));
    CHECK(watch.set_apart(apart.data()));
    CHECK(watch.quantities().size() == 2);
}
