// The coefficients of the explicit engine against the conditions of order.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "../../cpp/src/solvers/explicit/dop853.hpp"
#include "../../cpp/src/solvers/explicit/dopri5.hpp"

using namespace dualdrive;
namespace method = dualdrive::dop853;

namespace {

// ------------------------------------------------------------------------------- the conditions of order

using Weights = std::array<double, method::stages>;  // of the stages

template <std::size_t n>
Weights dense(const method::Row<n>& row) {
    Weights w{};
    for (const auto& t : row) w[t.stage] = t.weight;
    return w;
}

using Matrix = std::array<Weights, method::stages>;  // stages that a method lacks have no weights

const Matrix& matrix() {
    using namespace method;
    static const Matrix a{Weights{}, dense(a1), dense(a2),  dense(a3),  dense(a4), dense(a5),  dense(a6),  dense(a7),
                          dense(a8), dense(a9), dense(a10), dense(a11), dense(b),  dense(a13), dense(a14), dense(a15)};
    return a;
}

const Matrix& short_matrix() {
    using namespace dopri5;
    static const Matrix a = [] {
        Matrix rows{Weights{}, dense(a1), dense(a2), dense(a3), dense(a4), dense(a5)};
        rows[last] = dense(b);
        return rows;
    }();
    return a;
}

double sum(const Weights& w, const Weights& v) { return std::inner_product(w.begin(), w.end(), v.begin(), 0.0); }

// A rooted tree by what its condition needs: what the stages make of it, and its density.
struct Tree {
    int order;
    double density;
    Weights value;
};

// All trees of up to `order` nodes: a root with any multiset of smaller trees on it.
std::vector<Tree> trees(int order, const Matrix& matrix) {
    std::vector<Tree> all{{1, 1.0, {}}};
    all[0].value.fill(1.0);
    for (int n = 2; n <= order; ++n) {
        const std::vector<Tree> smaller = all;
        const auto grow = [&](auto& self, Tree root, std::size_t next) -> void {
            if (root.order == n) {
                root.density *= n;
                all.push_back(root);
                return;
            }
            for (std::size_t k = next; k < smaller.size(); ++k) {
                if (root.order + smaller[k].order > n) continue;
                Tree larger{root.order + smaller[k].order, root.density * smaller[k].density, root.value};
                for (std::size_t i = 0; i < method::stages; ++i) larger.value[i] *= sum(matrix[i], smaller[k].value);
                self(self, larger, k);
            }
        };
        grow(grow, all[0], 0);
    }
    return all;
}

// Weights of the stages at x within a step, from the formula of the extension; d: its highest coefficients.
Weights inside(double x, const Weights& step, const std::array<Weights, 4>& d) {
    Weights w{};
    for (std::size_t i = 0; i < method::stages; ++i) {
        const double first = i == 0, last = i == method::last, y = 1.0 - x;
        const double F[] = {step[i], first - step[i], 2.0 * step[i] - first - last, d[0][i], d[1][i], d[2][i], d[3][i]};
        double power = x;
        for (int k = 0; k < 7; ++k, power *= k % 2 ? y : x) w[i] += power * F[k];
    }
    return w;
}

}  // namespace

TEST_CASE("every stage stands where its row says") {
    for (std::size_t i = 0; i < method::stages; ++i) {
        CAPTURE(i);
        CHECK(std::accumulate(matrix()[i].begin(), matrix()[i].end(), 0.0) ==
              doctest::Approx(method::c[i]).epsilon(1e-14));
    }
}

TEST_CASE("the step fulfils all 200 conditions up to order 8, the estimates theirs and no more") {
    const auto all = trees(9, matrix());
    CHECK(std::count_if(all.begin(), all.end(), [](const Tree& t) { return t.order <= 8; }) == 200);
    double worst = 0.0, fifth = 0.0, third = 0.0, of_9 = 0.0, of_6 = 0.0, of_4 = 0.0;
    const auto keep = [](double& most, double v) { most = std::max(most, std::abs(v)); };
    for (const Tree& t : all) {
        const double off = sum(dense(method::b), t.value) - 1.0 / t.density;
        keep(t.order <= 8 ? worst : of_9, off);
        if (t.order <= 6) keep(t.order <= 5 ? fifth : of_6, sum(dense(method::error_5), t.value));
        if (t.order <= 4) keep(t.order <= 3 ? third : of_4, sum(dense(method::error_3), t.value));
    }
    CHECK(worst < 1e-14);
    CHECK(fifth < 1e-14);
    CHECK(third < 1e-14);
    for (const double beyond : {of_9, of_6, of_4}) CHECK(beyond > 1e-7);
}

TEST_CASE("the extension fulfils all conditions up to order 7 everywhere in the step") {
    const auto all = trees(8, matrix());
    const std::array<Weights, 4> d{dense(method::d0), dense(method::d1), dense(method::d2), dense(method::d3)};
    for (const double x : {0.05, 0.2, 0.37, 0.5, 0.81, 1.0}) {
        CAPTURE(x);
        const Weights w = inside(x, dense(method::b), d);
        double worst = 0.0, beyond = 0.0;
        for (const Tree& t : all) {
            const double off = std::abs(sum(w, t.value) - std::pow(x, t.order) / t.density);
            double& most = t.order <= 7 ? worst : beyond;
            most = std::max(most, off);
        }
        CHECK(worst < 1e-13);
        if (x < 1.0) CHECK(beyond > 1e-9);
    }
}

TEST_CASE("the short step fulfils its conditions up to order 5, its estimate and its extension theirs up to 4") {
    const auto all = trees(6, short_matrix());
    for (std::size_t i = 0; i < dopri5::stages; ++i)
        CHECK(std::accumulate(short_matrix()[i].begin(), short_matrix()[i].end(), 0.0) ==
              doctest::Approx(dopri5::c[i]).epsilon(1e-14));
    double worst = 0.0, of_6 = 0.0, fourth = 0.0, of_5 = 0.0;
    const auto keep = [](double& most, double v) { most = std::max(most, std::abs(v)); };
    for (const Tree& t : all) {
        keep(t.order <= 5 ? worst : of_6, sum(dense(dopri5::b), t.value) - 1.0 / t.density);
        if (t.order <= 5) keep(t.order <= 4 ? fourth : of_5, sum(dense(dopri5::error_4), t.value));
    }
    CHECK(worst < 1e-14);
    CHECK(fourth < 1e-14);
    for (const double beyond : {of_6, of_5}) CHECK(beyond > 1e-5);
    for (const double x : {0.05, 0.2, 0.37, 0.5, 0.81, 1.0}) {
        CAPTURE(x);
        const Weights w = inside(x, dense(dopri5::b), {dense(dopri5::d0)});
        for (const Tree& t : all)
            if (t.order <= 4) CHECK(std::abs(sum(w, t.value) - std::pow(x, t.order) / t.density) < 1e-14);
    }
}
