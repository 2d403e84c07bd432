#include <doctest/doctest.h>

#include <map>
#include <numbers>
#include <random>

#include "dualdrive/expression.hpp"
#include "refusal.hpp"

using namespace dualdrive;

namespace {

using Values = std::map<std::string, double, std::less<>>;
using Branches = std::vector<std::int8_t>;

std::vector<double> slots_of(const Expression& e, const Values& values) {
    std::vector<double> slots;
    for (const std::string& name : e.names()) slots.push_back(values.at(name));
    return slots;
}

// With every switch on the branch that is right at these values.
double value(const std::string& text, const Values& values = {}) {
    const Expression e = Expression::parse(text);
    const std::vector<double> slots = slots_of(e, values);
    Branches branches(static_cast<std::size_t>(e.switches()));
    e.decide(slots.data(), branches.data());
    return e.evaluate(slots.data(), branches.data());
}

std::string complaint(const std::string& text) {
    return refusal([&] { Expression::parse(text); });
}

}  // namespace

TEST_CASE("arithmetic follows the usual precedence") {
    CHECK(value("1 + 2 * 3") == 7.0);
    CHECK(value("(1 + 2) * 3") == 9.0);
    CHECK(value("8 - 3 - 2") == 3.0);
    CHECK(value("16 / 4 / 2") == 2.0);
    CHECK(value("-2^2") == -4.0);
    CHECK(value("2^3^2") == 512.0);
    CHECK(value("2^-1") == 0.5);
    CHECK(value("2*-3") == -6.0);
    CHECK(value("--3") == 3.0);
    CHECK(value("1.5e3 + .5 + 2.") == 1502.5);
    CHECK(value(" \t1\n+\r2 ") == 3.0);
    const Values v{{"a", 3.0}, {"b", -2.0}};
    CHECK(value("a - b - a*b/a^2", v) == doctest::Approx(5.0 + 2.0 / 3.0).epsilon(1e-15));
    CHECK(value("-a^2", v) == -9.0);
    CHECK(value("b^3", v) == -8.0);
    CHECK(value("b^-2", v) == 0.25);
    CHECK(value("b^0", v) == 1.0);
    CHECK(value("a^b", v) == doctest::Approx(1.0 / 9.0).epsilon(1e-15));
    CHECK(value("a^0.5^2", v) == doctest::Approx(std::pow(3.0, 0.25)).epsilon(1e-15));
}

TEST_CASE("functions and names") {
    const Values v{{"x", 0.7}, {"mesh_1.torque", 4.0}, {"_k2", 0.1}, {"pi.x", 5.0}, {"e", 2.0}};
    CHECK(value("sin(x)", v) == doctest::Approx(std::sin(0.7)).epsilon(1e-15));
    CHECK(value("cos(x)", v) == doctest::Approx(std::cos(0.7)).epsilon(1e-15));
    CHECK(value("tan(x)", v) == doctest::Approx(std::tan(0.7)).epsilon(1e-15));
    CHECK(value("tanh(x)", v) == doctest::Approx(std::tanh(0.7)).epsilon(1e-15));
    CHECK(value("exp(x)", v) == doctest::Approx(std::exp(0.7)).epsilon(1e-15));
    CHECK(value("log(x)", v) == doctest::Approx(std::log(0.7)).epsilon(1e-15));
    CHECK(value("sqrt (x)", v) == std::sqrt(0.7));
    CHECK(value("pi") == std::numbers::pi);
    CHECK(value("mesh_1.torque*_k2 + pi.x + e", v) == doctest::Approx(7.4));
    CHECK(value("abs(-x) + sign(-x) + min(x, 2) + max(x, 2)", v) == doctest::Approx(0.7 - 1.0 + 0.7 + 2.0));
    const Expression e = Expression::parse("b + a*b + mesh_1.torque + a");
    CHECK(e.names() == std::vector<std::string>{"b", "a", "mesh_1.torque"});
    CHECK(e.text() == "b + a*b + mesh_1.torque + a");
    CHECK(Expression::parse("3").names().empty());
}

TEST_CASE("names are bound to slots") {
    Expression e = Expression::parse("a - b");
    const double slots[] = {0.0, 10.0, 20.0, 30.0};
    CHECK(e.evaluate(slots, nullptr) == -10.0);
    e.bind([](std::string_view name) { return name == "a" ? 3 : 1; });
    CHECK(e.evaluate(slots, nullptr) == 20.0);
    CHECK(refusal([&] { e.bind([](std::string_view name) { return name == "b" ? -1 : 0; }); }) ==
          "formula 'a - b': the name 'b' is not known here");
    CHECK(e.evaluate(slots, nullptr) == 20.0);  // as bound before
}

TEST_CASE("a switch keeps its branch, and tells the argument that decides") {
    struct Case {
        const char* text;
        double plus, minus, argument;  // with a = 3, b = 5
    };
    const Case cases[] = {
        {"abs(a)", 3.0, -3.0, 3.0},          {"sign(a)", 1.0, -1.0, 3.0},          {"min(a, b)", 5.0, 3.0, -2.0},
        {"max(a, b)", 3.0, 5.0, -2.0},       {"if(a < b, 1, 2)", 1.0, 2.0, 2.0},   {"if(a <= b, 1, 2)", 1.0, 2.0, 2.0},
        {"if(a > b, 1, 2)", 1.0, 2.0, -2.0}, {"if(a >= b, 1, 2)", 1.0, 2.0, -2.0},
    };
    for (const Case& c : cases) {
        CAPTURE(c.text);
        const Expression e = Expression::parse(c.text);
        const std::vector<double> slots = slots_of(e, {{"a", 3.0}, {"b", 5.0}});
        REQUIRE(e.switches() == 1);
        const std::int8_t plus = 1, minus = -1;
        CHECK(e.evaluate(slots.data(), &plus) == c.plus);
        CHECK(e.evaluate(slots.data(), &minus) == c.minus);
        double argument = 0.0;
        e.switch_values(slots.data(), &plus, &argument);
        CHECK(argument == c.argument);
        std::int8_t right = 0;
        e.decide(slots.data(), &right);
        CHECK(right == (c.argument > 0.0 ? 1 : -1));
    }
}

TEST_CASE("at zero a strict comparison is false, everything else is on +1") {
    const Values v{{"a", 2.0}, {"z", 0.0}};
    CHECK(value("if(a < 2, 10, 20)", v) == 20.0);
    CHECK(value("if(a <= 2, 10, 20)", v) == 10.0);
    CHECK(value("if(a > 2, 10, 20)", v) == 20.0);
    CHECK(value("if(a >= 2, 10, 20)", v) == 10.0);
    CHECK(value("sign(z)", v) == 1.0);
}

TEST_CASE("switches nest; in a branch that is not taken they decide nothing") {
    const Expression e = Expression::parse("if(x > 0, abs(y) + min(y, 1), sqrt(abs(-1 - abs(x)))) + max(x, y)");
    // In order of evaluation: x > 0; abs(y), min; abs(x), abs(-1 - abs(x)); max.
    REQUIRE(e.switches() == 6);
    REQUIRE(e.names() == std::vector<std::string>{"x", "y"});
    Branches b(6);
    std::vector<double> out(6);
    const double right[] = {2.0, -3.0}, left[] = {-2.0, -3.0};

    e.decide(right, b.data());
    CHECK(b == Branches{1, -1, -1, 1, 1, 1});
    CHECK(e.evaluate(right, b.data()) == 3.0 - 3.0 + 2.0);
    b = {1, -1, -1, -1, 1, 1};
    e.switch_values(right, b.data(), out.data());
    CHECK(out == std::vector<double>{2.0, -3.0, -4.0, -1.0, 1.0, 5.0});

    e.decide(left, b.data());
    CHECK(b == Branches{-1, 1, 1, -1, -1, 1});
    CHECK(e.evaluate(left, b.data()) == doctest::Approx(std::sqrt(3.0) - 2.0));
    b = {-1, -1, 1, -1, -1, 1};
    e.switch_values(left, b.data(), out.data());
    CHECK(out == std::vector<double>{-2.0, -1.0, 1.0, -2.0, -3.0, 1.0});

    SUBCASE("a solver at a zero keeps the side it goes on to, the rest follows") {
        const double edge[] = {0.0, -3.0};
        e.decide(edge, b.data());
        CHECK(b[0] == -1);
        b[0] = 1;
        e.decide(edge, b.data(), 0);
        CHECK(b == Branches{1, -1, -1, 1, 1, 1});
    }
}

TEST_CASE("a domain error in the branch not taken does no harm") {
    const double x[] = {-4.0};
    const Expression e = Expression::parse("if(x > 0, sqrt(x), x^2)");
    const std::int8_t branch = -1;
    CHECK(e.evaluate(x, &branch) == 16.0);
    using D = Dual<double, 1>;
    const D dual[] = {D::variable(-4.0, 0)};
    CHECK(e.evaluate(dual, &branch).slope[0] == -8.0);
}

TEST_CASE("slopes agree with central differences") {
    using D = Dual<double, 2>;
    for (const char* text : {"x*y - y/x + 3", "sin(x)*cos(y) + tan(x*y/5)", "exp(-x^2)*log(y) + sqrt(x + y)",
                             "x^y + x^2.5 + x^-3", "tanh(3*x)*abs(x - y)",
                             "if(x < y, x^3, y^3) + max(x, 2*y)*min(x, y)", "-(x - 2*y)^2*sign(y - x)", "x^0 + y^1"}) {
        CAPTURE(text);
        const Expression e = Expression::parse(text);
        const double at[] = {0.8, 1.3};
        Branches b(static_cast<std::size_t>(e.switches()));
        e.decide(at, b.data());
        const D dual[] = {D::variable(at[0], 0), D::variable(at[1], 1)};
        const D f = e.evaluate(dual, b.data());
        CHECK(f.value == doctest::Approx(e.evaluate(at, b.data())).epsilon(1e-15));
        for (std::size_t k = 0; k < 2; ++k) {
            const double h = 1e-6;
            double ahead[] = {at[0], at[1]}, behind[] = {at[0], at[1]};
            ahead[k] += h;
            behind[k] -= h;
            const double slope = (e.evaluate(ahead, b.data()) - e.evaluate(behind, b.data())) / (2.0 * h);
            CHECK(f.slope[k] == doctest::Approx(slope).epsilon(1e-8));
        }
    }
    // Where exp(p log x) would fail: at zero and below.
    const D zero[] = {D::variable(0.0, 0)}, below[] = {D::variable(-2.0, 0)};
    CHECK(Expression::parse("x^2").evaluate(zero, nullptr).slope[0] == 0.0);
    CHECK(Expression::parse("x^0").evaluate(zero, nullptr).slope[0] == 0.0);
    CHECK(Expression::parse("x^1.5").evaluate(zero, nullptr).slope[0] == 0.0);
    CHECK(Expression::parse("x^3").evaluate(below, nullptr).slope[0] == 12.0);
}

TEST_CASE("long double and nested duals") {
    const long double x[] = {1.0L / 3.0L};
    const auto cube = Expression::parse("x^3 - x*x*x").evaluate(x, nullptr);
    CHECK(std::abs(static_cast<double>(cube)) < 1e-19);
    using D = Dual<Dual<double, 1>, 1>;
    D t;
    t.value = Dual<double, 1>::variable(0.6, 0);
    t.slope[0] = Dual<double, 1>(1.0);
    const D f = Expression::parse("sin(t)*t^3").evaluate(&t, nullptr);
    const double second = -std::sin(0.6) * 0.216 + 6.0 * 0.36 * std::cos(0.6) + 6.0 * 0.6 * std::sin(0.6);
    CHECK(f.slope[0].slope[0] == doctest::Approx(second).epsilon(1e-14));
}

TEST_CASE("units") {
    const std::map<std::string, const char*, std::less<>> units{
        {"T", "N*m"}, {"J", "kg*m^2"},  {"alpha", "rad/s^2"}, {"w", "rad/s"},   {"b", "N*m*s/rad"}, {"phi", "rad"},
        {"I", "A"},   {"K", "N*m/A"},   {"R", "ohm"},         {"v_s", "rad/s"}, {"x", "m"},         {"v", "m/s"},
        {"t", "s"},   {"k", "N*m/rad"}, {"U", "V"},           {"L", "H"}};
    const auto unit_of = [&](std::string_view name) { return Unit::parse(units.find(name)->second); };
    const auto unit = [&](const std::string& text) { return Expression::parse(text).unit(unit_of); };
    const auto is = [&](const std::string& text, const char* expected) { return unit(text) == Unit::parse(expected); };
    const auto wrong = [&](const std::string& text) { return refusal([&] { unit(text); }); };

    CHECK(is("J*alpha + b*w + k*phi - T", "N*m"));
    CHECK(is("T*tanh(w/v_s)", "N*m"));
    CHECK(is("U - R*I", "V"));
    CHECK(is("L*I/t", "V"));
    CHECK(is("sqrt(x^2 + (v*t)^2)", "m"));
    CHECK(is("x^0.5", "m^0.5"));
    CHECK(is("abs(T)*sign(w)*sin(3*phi + 0.2)", "N*m"));
    CHECK(is("if(w > 0, T, b*w)", "N*m"));
    CHECK(is("max(T, 0) + if(w >= v_s, 0, T)", "N*m"));  // 0 fits every unit
    CHECK(is("0*x + T", "N*m"));
    CHECK(is("(1 - 1) + T", "N*m"));
    CHECK(is("0", "1"));
    CHECK(is("2^phi*exp(-t/(3*t))", "1"));
    CHECK(is("w/v_s*pi", "1"));

    CHECK(wrong("J*alpha + v*t") ==
          "formula 'J*alpha + v*t': in 'J*alpha + v*t' one can't add 'J*alpha' [N*m] and 'v*t' [m]");
    CHECK(contains(wrong("2*(T - 1)"), "in 'T - 1' one can't subtract 'T' [N*m] and '1' [1]"));
    CHECK(contains(wrong("sin(x/t)"), "the argument of a function must be a pure number: 'x/t' [m/s]"));
    CHECK(contains(wrong("min(T, x)"), "in 'min(T, x)' one can't compare 'T' [N*m] and 'x' [m]"));
    CHECK(contains(wrong("if(x < T, 1, 2)"), "in 'x < T' one can't compare 'x' [m] and 'T' [N*m]"));
    CHECK(contains(wrong("if(w > 0, T, x)"), "in 'if(w > 0, T, x)' one can't choose between 'T' [N*m] and 'x' [m]"));
    CHECK(contains(wrong("2^x"), "an exponent must be a pure number: 'x' [m]"));
    CHECK(contains(wrong("x^phi"), "the base of a power whose exponent varies must be a pure number: 'x' [m]"));
    CHECK(refusal([&] { Expression::parse("q").unit([](std::string_view) -> Unit { return Unit::parse("?"); }); }) ==
          "unit '?': column 1: expected a unit");
}

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
