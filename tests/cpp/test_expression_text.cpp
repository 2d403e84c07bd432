// Formulas as text: what is refused and in which words, and random ones, sound and damaged.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "dualdrive/expression.hpp"
#include "expression_value.hpp"
#include "refusal.hpp"

using namespace dualdrive;

namespace {

std::string complaint(const std::string& text) {
    return refusal([&] { Expression::parse(text); });
}

}  // namespace

TEST_CASE("malformed formulas are refused with column, token and rule") {
    CHECK(complaint("a + * b") == "formula 'a + * b': column 5, '*': expected a number, a name, '(' or '-'");
    CHECK(contains(complaint(""), "column 1, the end: expected a number"));
    CHECK(contains(complaint("   "), "column 4, the end: expected a number"));
    CHECK(contains(complaint("a +"), "column 4, the end: expected a number"));
    CHECK(contains(complaint("(a"), "column 3, the end: expected ')'"));
    CHECK(contains(complaint("a)"), "column 2, ')': there is no '(' to close"));
    CHECK(contains(complaint("a b"), "column 3, 'b': expected an operator"));
    CHECK(contains(complaint("2x"), "column 2, 'x': expected an operator"));
    CHECK(contains(complaint("1.2.3"), "column 4, '.3': expected an operator"));
    CHECK(contains(complaint("0x10"), "column 2, 'x10': expected an operator"));
    CHECK(contains(complaint("."), "column 1, '.': is no number"));
    CHECK(contains(complaint("1e999"), "column 1, '1e999': number out of range"));
    CHECK(contains(complaint("a ** 2"), "column 3, '**': a power is written with ^"));
    CHECK(contains(complaint("a < b"), "column 3, '<': a comparison stands in if(condition, a, b) alone"));
    CHECK(contains(complaint("if(a, 1, 2)"), "column 5, ',': expected a comparison"));
    CHECK(contains(complaint("if(a == b, 1, 2)"), "column 6, '==': expected a comparison"));
    CHECK(contains(complaint("if(a < b < c, 1, 2)"), "column 10, '<': expected ','"));
    CHECK(contains(complaint("if(a < b, 1)"), "column 12, ')': expected ','"));
    CHECK(contains(complaint("if(a < b, 1, 2, 3)"), "column 15, ',': too many arguments of if"));
    CHECK(contains(complaint("if + 1"), "column 1, 'if': is a function"));
    CHECK(contains(complaint("sin + 1"), "column 1, 'sin': is a function"));
    CHECK(contains(complaint("sin()"), "column 5, ')': expected a number"));
    CHECK(contains(complaint("sin(a, b)"), "column 6, ',': too many arguments of sin"));
    CHECK(contains(complaint("min(a)"), "column 6, ')': expected ','"));
    CHECK(contains(complaint("min(a, b, c)"), "column 9, ',': too many arguments of min"));
    CHECK(contains(complaint("arctan(a)"), "column 1, 'arctan': is no function; known are sin cos"));
    CHECK(contains(complaint("pi(2)"), "column 1, 'pi': is no function"));
    CHECK(contains(complaint("a. + 1"), "column 1, 'a.': each part of a name"));
    CHECK(contains(complaint("a..b"), "each part of a name"));
    CHECK(contains(complaint("a.1"), "each part of a name"));
    CHECK(contains(complaint("θ + 1"), "column 1, 'θ': expected a number"));
    CHECK(contains(complaint("a $ b"), "column 3, '$': expected an operator"));
    CHECK(contains(complaint("a/0"), "column 3, '0': division by zero"));
    CHECK(contains(complaint("a/(2 - 2)"), "column 3, '(2 - 2)': division by zero"));
    CHECK(contains(complaint("a + log(-1)"), "column 5, 'log(-1)': has no finite value"));
    CHECK(contains(complaint("(-8)^(1/3)"), "column 1, '(-8)^(1/3)': has no finite value"));
    CHECK(contains(complaint("a^1001"), "column 3, '1001': an exponent is at most 1000"));
    CHECK(contains(complaint("+a"), "column 1, '+': expected a number"));
    CHECK(contains(complaint("a, b"), "column 2, ',': expected an operator"));
    CHECK(complaint("a +\n*").find('\n') == std::string::npos);  // one line
}

TEST_CASE("formulas without end are refused, long ones are read") {
    const auto repeat = [](const std::string& part, int times) {
        std::string text;
        for (int k = 0; k < times; ++k) text += part;
        return text;
    };
    CHECK(value(repeat("(", 199) + "7" + repeat(")", 199)) == 7.0);
    CHECK(contains(complaint(repeat("(", 200) + "7" + repeat(")", 200)), "nested more than 200 levels deep"));
    CHECK(contains(complaint(repeat("-", 5000) + "7"), "nested more than 200 levels deep"));
    CHECK(contains(complaint(repeat("x^", 4000) + "7"), "nested more than 200 levels deep"));
    CHECK(contains(complaint(repeat("sin(", 2000)), "nested more than 200 levels deep"));
    CHECK(contains(complaint(repeat("x+y*(", 150) + "x" + repeat(")", 150)), "more than 256 values at once"));
    CHECK(value(repeat("x+y*(", 100) + "x" + repeat(")", 100), {{"x", 1.0}, {"y", 0.5}}) == doctest::Approx(2.0));
    CHECK(value(repeat("x+", 4000) + "x", {{"x", 1.0}}) == 4001.0);
    CHECK(contains(complaint(repeat("x+", 6000) + "x"), "at most 10000 are read"));
    CHECK(complaint(repeat("θ", 200)).size() < 500);
}

namespace {

// A random formula as text together with its value, computed on the way by plain C++.
class RandomFormula {
  public:
    explicit RandomFormula(std::uint64_t seed) : random_(seed) {}

    struct Made {
        std::string text;
        double value;
    };

    Made make(int depth) {
        if (depth == 0) return leaf();
        const Made a = make(depth - 1), b = make(depth - 1);
        switch (random_() % 14) {
            case 0:
                return {"(" + a.text + " + " + b.text + ")", a.value + b.value};
            case 1:
                return {"(" + a.text + "-" + b.text + ")", a.value - b.value};
            case 2:
                return {a.text + "*" + b.text, a.value * b.value};
            case 3:
                return {a.text + "/(2 + abs(" + b.text + "))", a.value / (2.0 + std::abs(b.value))};
            case 4:
                return {"(-" + a.text + ")", -a.value};
            case 5:
                return {"sin(" + a.text + ")", std::sin(a.value)};
            case 6:
                return {"tanh(" + a.text + ")", std::tanh(a.value)};
            case 7:
                return {"sqrt(abs(" + a.text + "))", std::sqrt(std::abs(a.value))};
            case 8:
                return {"min(" + a.text + ", " + b.text + ")", std::min(a.value, b.value)};
            case 9:
                return {"max(" + a.text + "," + b.text + ")", std::max(a.value, b.value)};
            case 10:
                return {"sign(" + a.text + ")", a.value < 0.0 ? -1.0 : 1.0};
            case 11:
                return {"(" + a.text + ")^2", a.value * a.value};
            default:
                break;
        }
        const Made c = make(depth - 1), d = make(depth - 1);
        const bool less = random_() % 2 == 0;
        const std::string condition = a.text + (less ? " < " : " >= ") + b.text;
        return {"if(" + condition + ", " + c.text + ", " + d.text + ")",
                (less ? a.value < b.value : a.value >= b.value) ? c.value : d.value};
    }

    static Values values() { return {{"x", 0.37}, {"y", -1.21}, {"mesh_1.torque", 2.5}}; }

  private:
    Made leaf() {
        switch (random_() % 4) {
            case 0:
                return {"x", 0.37};
            case 1:
                return {"y", -1.21};
            case 2:
                return {"mesh_1.torque", 2.5};
            default:
                return {"0.75", 0.75};
        }
    }
    std::mt19937_64 random_;
};

}  // namespace

TEST_CASE("random formulas have the value that plain C++ gives them") {
    int compared = 0;
    for (std::uint64_t seed = 0; seed < 400; ++seed) {
        const auto made = RandomFormula(seed).make(1 + static_cast<int>(seed % 4));
        if (made.text.size() > 10000) continue;
        CAPTURE(made.text);
        const double found = value(made.text, RandomFormula::values());
        CHECK(std::abs(found - made.value) <= 1e-9 * (1.0 + std::abs(made.value)));
        ++compared;
    }
    CHECK(compared > 350);
}

TEST_CASE("no text whatsoever brings the reader down") {
    std::mt19937_64 random(7);
    const std::vector<std::string> pieces{
        "a", "mesh_1.torque", "1", "2.5e-3", "pi",   "+",    "-",    "*", "/", "^", "(", ")",
        ",", "if(",           "<", ">=",     "sin(", "min(", "abs(", ".", " ", "θ", "e"};
    int read = 0;
    for (int k = 0; k < 20000; ++k) {
        std::string text;
        const auto length = random() % 12;
        for (std::uint64_t j = 0; j < length; ++j)
            if (k % 2)
                text += pieces[random() % pieces.size()];
            else
                text += static_cast<char>(random() % 256);
        if (k % 5 == 0) {  // a sound formula, a little damaged
            text = RandomFormula(static_cast<std::uint64_t>(k)).make(2).text;
            text[random() % text.size()] = static_cast<char>(32 + random() % 95);
        }
        try {
            const Expression e = Expression::parse(text);
            const std::vector<double> slots(e.names().size(), 0.5);
            Branches b(static_cast<std::size_t>(e.switches()));
            std::vector<double> out(b.size());
            e.decide(slots.data(), b.data());
            static_cast<void>(e.evaluate(slots.data(), b.data()));
            e.switch_values(slots.data(), b.data(), out.data());
            static_cast<void>(refusal([&] { e.unit([](std::string_view) { return Unit::parse("N*m"); }); }));
            ++read;
        } catch (const std::invalid_argument& refused) {
            if (std::string(refused.what()).find("formula") != 0) FAIL(refused.what());
        }
    }
    CHECK(read > 1000);
}
