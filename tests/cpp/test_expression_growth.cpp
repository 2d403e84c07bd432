// Whether a formula is affine between its switches, as it says and as its second differences do.
#include <doctest/doctest.h>

#include <random>

#include "dualdrive/expression.hpp"
#include "refusal.hpp"

using namespace dualdrive;

namespace {

using Branches = std::vector<std::int8_t>;
using Growth = Expression::Growth;

// x, y and speed move with the state, a, b and c are numbers, t is time.
Growth growth(std::string_view name) {
    if (name == "t") return Growth::other;
    return name == "a" || name == "b" || name == "c" ? Growth::none : Growth::affine;
}

bool is_affine(const std::string& text) { return Expression::parse(text).is_affine(growth); }

// The largest second difference of value and switch arguments along random lines, all branches random but fixed, over
// the size of what it is taken from.
double bend(const Expression& e, std::mt19937& random) {
    std::uniform_real_distribution<double> number(0.5, 2.0);
    std::vector<double> at, along;
    for (const std::string& name : e.names()) {
        at.push_back(number(random));
        along.push_back(growth(name) == Growth::affine ? number(random) : 0.0);
    }
    const auto count = static_cast<std::size_t>(e.switches());
    Branches branches(count);
    for (auto& b : branches) b = random() % 2 ? 1 : -1;
    std::vector<std::vector<double>> seen;
    for (const double way : {0.0, 1.0, 2.0}) {
        std::vector<double> slots(at), values(count);
        for (std::size_t k = 0; k < slots.size(); ++k) slots[k] += way * along[k];
        e.switch_values(slots.data(), branches.data(), values.data());
        values.push_back(e.evaluate(slots.data(), branches.data()));
        seen.push_back(values);
    }
    double worst = 0.0;
    for (std::size_t k = 0; k <= count; ++k) {
        const double size = 1.0 + std::abs(seen[0][k]) + std::abs(seen[1][k]) + std::abs(seen[2][k]);
        worst = std::max(worst, std::abs(seen[0][k] - 2.0 * seen[1][k] + seen[2][k]) / size);
    }
    return worst;
}

double largest_bend(const std::string& text) {
    const Expression e = Expression::parse(text);
    std::mt19937 random(1);
    double worst = 0.0;
    for (int k = 0; k < 60; ++k) worst = std::max(worst, bend(e, random));
    return worst;
}

// A formula of random form over x, y, a, b.
std::string random_formula(std::mt19937& random, int depth) {
    static const char* const leaves[] = {"x", "y", "a", "b", "2", "0.5"};
    if (depth == 0 || random() % 6 == 0) return leaves[random() % 6];
    const auto part = [&] { return random_formula(random, depth - 1); };
    switch (random() % 12) {
        case 0:
            return "abs(" + part() + ")";
        case 1:
            return "sign(" + part() + ")";
        case 2:
            return "min(" + part() + ", " + part() + ")";
        case 3:
            return "if(" + part() + " < " + part() + ", " + part() + ", " + part() + ")";
        case 4:
        case 5:
            return "(" + part() + " * " + part() + ")";
        case 6:
            return "(" + part() + " / " + part() + ")";
        case 7:
            return "-(" + part() + ")";
        case 8:
            return "exp(" + part() + " / 9)";
        default:
            return "(" + part() + (random() % 2 ? " + " : " - ") + part() + ")";
    }
}

}  // namespace

TEST_CASE("affine is said of formulas that are") {
    for (const char* text :
         {"1", "x", "-c * speed", "-c * sign(speed)", "a * x + b * y - c", "x / a", "exp(a) * x + sqrt(b)", "x^1",
          "x^0", "a^b * y", "abs(x)", "-(a + c * abs(speed)) * sign(speed)", "min(x, max(y, a))", "if(x > a, b * x, y)",
          "if(x < y, if(y >= a, x, 0), sign(x) * y)", "sign(x) * sign(y) * abs(x)", "(x - y) * (a - b)"}) {
        CAPTURE(text);
        CHECK(is_affine(text));
        CHECK(largest_bend(text) < 1e-14);
    }
}

TEST_CASE("affine is not said of formulas that are not") {
    for (const char* text : {"x * x", "x * y", "x^2", "sin(x)", "tanh(speed / a)", "exp(x)", "sqrt(x)", "log(x)",
                             "a / x", "a^x", "x^a", "-c * speed * abs(speed)", "x * min(y, a)", "if(x * y > a, b, c)",
                             "sign(x * y)", "abs(sin(x))", "min(x^2, a)", "if(x > a, y, y^3)"}) {
        CAPTURE(text);
        CHECK_FALSE(is_affine(text));
        CHECK(largest_bend(text) > 1e-6);
    }
    for (const char* text : {"t", "t * x", "sin(t)", "if(t > a, b, c)"}) CHECK_FALSE(is_affine(text));
}

TEST_CASE("affine is said of no random formula that bends") {
    std::mt19937 random(7);
    int affine = 0, bent = 0;
    for (int k = 0; k < 4000; ++k) {
        const std::string text = random_formula(random, 4);
        CAPTURE(text);
        if (refusal([&] { Expression::parse(text); }) != "") continue;  // a constant part without a value
        if (is_affine(text)) {
            CHECK(largest_bend(text) < 1e-12);
            ++affine;
        } else {
            bent += largest_bend(text) > 1e-9;
        }
    }
    CHECK(affine > 500);
    CHECK(bent > 500);
}
