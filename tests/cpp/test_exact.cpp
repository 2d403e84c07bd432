// The exact engine's parts: propagators against a series in long double, the proven bound, the two judges of a crossing,
// the kernels against each other.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#if defined(__x86_64__)
#define DUALDRIVE_KERNELS_X86 1  // as the library is built there
#endif
#include "../../cpp/src/solvers/exact/crossing.hpp"
#include "../../cpp/src/solvers/exact/kernels.hpp"
#include "../../cpp/src/solvers/exact/propagator.hpp"

using namespace dualdrive;
using namespace dualdrive::exact;

namespace {

using Fine = long double;
using FineVector = Eigen::Matrix<Fine, Eigen::Dynamic, 1>;

constexpr double epsilon = std::numeric_limits<double>::epsilon();

class Draw {
  public:
    explicit Draw(unsigned seed) : random_(seed) {}
    double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
    double normal() { return std::normal_distribution<double>()(random_); }
    double size(double decades) { return std::pow(10.0, uniform(-decades, decades)); }
    int whole(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }
    bool chance(double p) { return uniform(0, 1) < p; }

  private:
    std::mt19937 random_;
};

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

// ------------------------------------------------------------------------------------------------ propagators

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

// ------------------------------------------------------------------------------------------------------ bounds

namespace {

Fine at(const std::array<Fine, 6>& b, Fine x) {
    std::array<Fine, 6> c = b;
    for (std::size_t level = 5; level > 0; --level)
        for (std::size_t i = 0; i < level; ++i) c[i] += x * (c[i + 1] - c[i]);
    return c[0];
}

}  // namespace

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
                furthest = std::max(furthest, std::abs(g.dot(now) - at(b, Fine(part) / 40)));
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

// ---------------------------------------------------------------------------------------------------- crossings

namespace {

// A guard whose quintic is b and whose sixth derivative is `sixth` throughout.
Fine guard_at(const std::array<double, 6>& b, double sixth, Fine x) {
    std::array<Fine, 6> fine;
    std::copy(b.begin(), b.end(), fine.begin());
    const Fine bell = x * (x - 1);
    return at(fine, x) + Fine(sixth) / 720 * bell * bell * bell;
}

std::array<double, 6> random_quintic(Draw& draw) {
    std::array<double, 6> b;
    const double lift = draw.uniform(-0.2, 1.5), trend = draw.chance(0.5) ? draw.uniform(-4.0, 1.0) : 0.0;
    for (std::size_t i = 0; i < 6; ++i)
        b[i] = draw.normal() * draw.size(0.3) + lift + trend * (static_cast<double>(i) - 2.5);
    b[0] = std::abs(b[0]);
    return b;
}

}  // namespace

TEST_CASE("a quintic is never said to be clear of a crossing that is there") {
    Draw draw(3);
    int none = 0, one = 0, leaves = 0;
    constexpr int points = 400;
    for (int k = 0; k < 20'000; ++k) {
        Quintic<double> q{random_quintic(draw)};
        const double size = draw.chance(0.5) ? draw.uniform(0.0, 2000.0) : draw.size(3),
                     sixth = draw.chance(0.5) ? size : -size;
        if (draw.chance(0.3)) {  // level, as far above zero as the guard can be from it
            const double level = size / 46080.0 * draw.uniform(0.5, 1.5);
            for (double& c : q.b) c = level * (1.0 + 1e-4 * draw.normal());
        }
        const Verdict verdict = q.judge(size, 1e-14);
        if (verdict != Verdict::unclear) {
            int falls = 0;
            bool below = false;
            Fine least(1);
            for (int i = 0; i <= points; ++i) {
                const Fine value = guard_at(q.b, sixth, Fine(i) / points);
                falls += value < 0 && !below;
                below = value < 0;
                least = std::min(least, value);
            }
            if (verdict == Verdict::none) CHECK(least > 0);
            if (verdict == Verdict::one) {
                CHECK(falls == 1);
                CHECK(below);
                const double x = q.root();
                CHECK(x > 0);
                CHECK(x < 1);
            }
        }
        none += verdict == Verdict::none;
        one += verdict == Verdict::one;
        Quintic<double> from_zero = q;
        from_zero.b[0] = 0.0;
        if (draw.chance(0.3)) {  // rises as slowly as the guard may differ from it
            const double slope = 0.03456 * size / 720.0 * draw.uniform(0.5, 1.5);
            for (std::size_t i = 1; i < 6; ++i) from_zero.b[i] = slope * static_cast<double>(i) / 5.0;
        }
        if (!from_zero.leaves_zero(size, 1e-14)) continue;
        ++leaves;
        for (int i = 1; i <= points; ++i) CHECK(guard_at(from_zero.b, sixth, Fine(i) / points) > 0);
    }
    CHECK(none > 1000);
    CHECK(one > 1000);
    CHECK(leaves > 1000);
}

namespace {

std::vector<double> with_roots(const std::vector<double>& roots, double lead) {
    std::vector<Fine> p{Fine(lead)};
    for (const double r : roots) {
        p.insert(p.begin(), Fine(0));
        for (std::size_t k = 0; k + 1 < p.size(); ++k) p[k] -= Fine(r) * p[k + 1];
    }
    return {p.begin(), p.end()};
}

double noise_of(const std::vector<double>& p) {
    double size = 0.0;
    for (const double c : p) size += std::abs(c);
    return 16 * epsilon * size;
}

std::optional<double> first_fall(const std::vector<double>& p, bool on_surface = false) {
    return FirstFall<double>(p.data(), static_cast<int>(p.size()), noise_of(p), on_surface).find();
}

Fine value(const std::vector<double>& p, Fine x) {
    Fine v(0);
    for (std::size_t k = p.size(); k-- > 0;) v = v * x + Fine(p[k]);
    return v;
}

}  // namespace

TEST_CASE("the first fall is the first root at which a series turns negative") {
    CHECK(*first_fall(with_roots({0.25}, -1)) == doctest::Approx(0.25).epsilon(1e-14));
    CHECK_FALSE(first_fall(with_roots({0.25, 0.5}, -1), true).has_value() == false);  // below at once
    CHECK(*first_fall(with_roots({0.25, 0.5}, 1)) == doctest::Approx(0.25).epsilon(1e-14));
    CHECK_FALSE(first_fall(with_roots({-0.1, 1.1}, -1)).has_value());
    CHECK_FALSE(first_fall(with_roots({0.4, 0.4}, 1)).has_value());  // touches, and turns
    CHECK(*first_fall(with_roots({0.4, 0.4, 0.7}, -1)) == doctest::Approx(0.7).epsilon(1e-7));
    CHECK(*first_fall(with_roots({0.4, 0.4 + 2e-5}, 1)) == doctest::Approx(0.4).epsilon(1e-9));  // dips for a moment
    CHECK_FALSE(first_fall({1, -1}).has_value());  // at the end of the step: the next one falls at once
    CHECK(*first_fall({0, -1}) == 0.0);
}

TEST_CASE("a series that stands at zero falls, rises or comes back") {
    CHECK(*first_fall({0, -1}, true) == 0.0);
    CHECK_FALSE(first_fall({0, 1}, true).has_value());
    CHECK(*first_fall({0, 1, -2}, true) == doctest::Approx(0.5).epsilon(1e-14));
    CHECK(*first_fall({0, 0, -1}, true) == 0.0);
    CHECK_FALSE(first_fall({0, 0, 0, 1}, true).has_value());
    CHECK(*first_fall({0, 0, 1, -1.25}, true) == doctest::Approx(0.8).epsilon(1e-13));
    CHECK(*first_fall({0, 1e-13, -1}, true) == doctest::Approx(1e-13).epsilon(1e-9));  // a rise within rounding is one
    CHECK(*first_fall({0, -1e-13, 1e-14, 0, -1}, true) == doctest::Approx(1e-7).epsilon(1e-9));
    CHECK_FALSE(first_fall({0, -1e-13, 1}, true).has_value());  // a fall within it is none
    CHECK_FALSE(first_fall({0, 0, 0}, true).has_value());       // stays
    CHECK_FALSE(first_fall({-1e-18, 1}).has_value());           // zero but for rounding
    CHECK_FALSE(first_fall({-0.3, 1}, true).has_value());       // told that it stands there, whatever its value
}

TEST_CASE("no fall of a random series is missed, and none is invented") {
    Draw draw(4);
    int found = 0, clear = 0;
    for (int k = 0; k < 4000; ++k) {
        std::vector<double> roots(static_cast<std::size_t>(draw.whole(1, 6)));
        for (double& r : roots) r = draw.uniform(-0.5, 1.5);
        if (draw.chance(0.3)) roots.push_back(roots.front() + draw.size(1) * 1e-5);
        std::vector<double> p = with_roots(roots, 1);
        const int tail = draw.whole(0, 25);  // what a long series adds
        for (int j = 0; j < tail; ++j) p.push_back(1e-4 * draw.normal() * std::pow(0.5, j));
        if (p[0] < 0)
            for (double& c : p) c = -c;
        const double noise = noise_of(p);
        const auto x = first_fall(p);
        constexpr int points = 3000;
        for (int i = 0; i <= points; ++i) {
            const Fine t = Fine(i) / points;
            if (x && t > Fine(*x) - 1e-7L) break;
            CHECK(value(p, t) >= -2 * noise);
        }
        (x ? found : clear) += 1;
        if (!x || *x > 1 - 1e-6) continue;
        // it stands on zero there, and soon after it is below
        CHECK(std::abs(value(p, *x)) < 100 * noise);
        bool falls = false;
        for (Fine ahead = 1e-9L; ahead < 1e-5L; ahead *= 2) falls = falls || value(p, Fine(*x) + ahead) < 0;
        CHECK(falls);
    }
    CHECK(found > 500);
    CHECK(clear > 500);
}

// ------------------------------------------------------------------------------------------------------ kernels

TEST_CASE("every build of the kernels computes the same but for rounding") {
    std::vector<const Kernels*> built{&build::baseline};
#if DUALDRIVE_KERNELS_X86
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) built.push_back(&build::avx2);
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl")) built.push_back(&build::avx512);
#endif
    Draw draw(5);
    const auto fill = [&](std::size_t count) {
        std::vector<double> v(count);
        for (double& x : v) x = draw.normal();
        return v;
    };
    for (int n = 1; n <= 70; n += draw.whole(1, 3)) {
        const int rows = padded(n), tall = padded(draw.whole(1, 120)), count = 5, order = 7;
        const auto size = [](int a, int b) { return static_cast<std::size_t>(a) * static_cast<std::size_t>(b); };
        const std::vector<double> M = fill(size(rows, n)), T = fill(size(tall, n)), x = fill(size(rows, count));
        std::vector<Fine> product(size(tall, count), Fine(0)), bound(product);
        for (int k = 0; k < count; ++k)
            for (int j = 0; j < n; ++j)
                for (int i = 0; i < tall; ++i) {
                    const Fine term = Fine(T[size(j, tall) + static_cast<std::size_t>(i)]) *
                                      Fine(x[size(k, rows) + static_cast<std::size_t>(j)]);
                    product[size(k, tall) + static_cast<std::size_t>(i)] += term;
                    bound[size(k, tall) + static_cast<std::size_t>(i)] += std::abs(term);
                }
        std::vector<double> chained, summed;
        for (const Kernels* kernels : built) {
            CAPTURE(std::string(kernels->name));
            CAPTURE(n);
            std::vector<double> out(size(tall, count));
            kernels->multiply(tall, n, T.data(), rows, x.data(), count, out.data());
            for (std::size_t i = 0; i < out.size(); ++i)
                CHECK(std::abs(Fine(out[i]) - product[i]) <= Fine(n * epsilon) * bound[i]);
            std::vector<double> y(x.begin(), x.begin() + rows), chain(size(rows, count + 1), 0.0);
            y.resize(static_cast<std::size_t>(rows));
            for (int i = n; i < rows; ++i) y[static_cast<std::size_t>(i)] = 0.0;
            std::copy(y.begin(), y.end(), chain.begin());
            kernels->chain(rows, n, M.data(), count, chain.data());
            std::vector<double> scratch(size(2, rows));
            kernels->taylor(rows, n, M.data(), 0.3 / n, order, y.data(), scratch.data());
            if (kernels == built.front()) chained = chain, summed = y;
            double largest = 0.0;
            for (std::size_t i = 0; i < chain.size(); ++i) {
                if (i % static_cast<std::size_t>(rows) == 0) largest = 0.0;
                largest = std::max(largest, std::abs(chained[i]));
            }
            for (int i = 0; i < rows; ++i) {
                const auto last = size(count, rows) + static_cast<std::size_t>(i), at = static_cast<std::size_t>(i);
                CHECK(std::abs(chain[last] - chained[last]) <= 200 * n * epsilon * (1 + largest));
                CHECK(std::abs(y[at] - summed[at]) <= 50 * n * epsilon * (1 + std::abs(summed[at])));
            }
        }
    }
}
