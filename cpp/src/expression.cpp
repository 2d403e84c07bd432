#include "dualdrive/expression.hpp"

#include <algorithm>
#include <numbers>
#include <utility>

#include "formula_tokens.hpp"

namespace dualdrive {
namespace {

bool is_well_formed(std::string_view name) {
    for (std::size_t k = 0; k < name.size(); ++k)
        if (name[k] == '.' && (k + 1 == name.size() || !begins_name(name[k + 1]))) return false;
    return true;
}

constexpr const char* operand_rule = "expected a number, a name, '(' or '-'";

}  // namespace

// Recursive descent; every rule writes its steps to the tape and returns the part of the text it has read.
class ExpressionParser : private FormulaTokens {
  public:
    explicit ExpressionParser(std::string_view text) : FormulaTokens(text) { result_.text_ = text; }

    Expression read() {
        formula();
        if (!token_.empty()) fail_at_operator();
        for (std::size_t k = 0; k < result_.names_.size(); ++k) result_.slots_.push_back(static_cast<int>(k));
        return std::move(result_);
    }

  private:
    using Op = Expression::Op;
    using Step = Expression::Step;
    static constexpr int deepest = 200;

    struct Part {
        int begin, end;     // in the text
        std::size_t first;  // its steps on the tape: from this one to the last
    };
    struct Function {
        std::string_view name;
        Op op;
        int arguments;
    };
    static constexpr Function functions[] = {
        {"sin", Op::sine, 1},        {"cos", Op::cosine, 1},    {"tan", Op::tangent, 1}, {"tanh", Op::tanh, 1},
        {"exp", Op::exponential, 1}, {"log", Op::logarithm, 1}, {"sqrt", Op::root, 1},   {"abs", Op::absolute, 1},
        {"sign", Op::sign, 1},       {"min", Op::minimum, 2},   {"max", Op::maximum, 2},
    };
    static constexpr std::string_view known_functions = "sin cos tan tanh exp log sqrt abs sign min max if";

    [[noreturn]] void fail_at_operator() const {
        if (token_ == ")") fail("there is no '(' to close");
        if (token_[0] == '<' || token_[0] == '>') fail("a comparison stands in if(condition, a, b) alone");
        if (token_ == "**") fail("a power is written with ^");
        fail("expected an operator: '+', '-', '*', '/' or '^'");
    }
    [[noreturn]] void fail_in(const Part& part, const std::string& rule) const {
        const auto begin = static_cast<std::size_t>(part.begin);
        fail_at(begin, text_.substr(begin, static_cast<std::size_t>(part.end - part.begin)), rule);
    }

    // --- grammar --------------------------------------------------------------------------------------------------

    Part formula() {
        Part left = term();
        while (token_ == "+" || token_ == "-") {
            const Op op = token_ == "+" ? Op::add : Op::subtract;
            next();
            left = two(op, left, term());
        }
        return left;
    }

    Part term() {
        Part left = sign();
        while (token_ == "*" || token_ == "/") {
            const bool divides = token_ == "/";
            next();
            const Part right = sign();
            if (divides && is_constant(right) && last().number == 0.0) fail_in(right, "division by zero");
            left = two(divides ? Op::divide : Op::multiply, left, right);
        }
        return left;
    }

    // Every way into a deeper level leads through here.
    Part sign() {
        if (++level_ > deepest) fail("nested more than 200 levels deep");
        const Part part = token_ == "-" ? negative() : power();
        --level_;
        return part;
    }

    Part negative() {
        const int begin = here();
        next();
        Part part = sign();
        part.begin = begin;
        return one(Op::negate, part);
    }

    Part power() {
        const Part base = operand();
        if (!take("^")) return base;
        const Part exponent = sign();
        return is_constant(exponent) ? to_constant(base, exponent) : two(Op::power, base, exponent);
    }

    Part operand() {
        if (token_.empty()) fail(operand_rule);
        if (token_ == "(") return parenthesis();
        if (begins_name(token_[0])) return name();
        if (is_digit(token_[0]) || token_[0] == '.') return number();
        fail(operand_rule);
    }

    Part parenthesis() {
        const int begin = here();
        next();
        Part part = formula();
        close();
        return {begin, static_cast<int>(after_), part.first};
    }

    void close() {
        if (!take(")")) fail("expected ')'");
    }
    void comma() {
        if (!take(",")) fail("expected ','");
    }

    Part number() {
        double value = 0.0;
        const auto [end, error] = std::from_chars(token_.data(), token_.data() + token_.size(), value);
        if (error == std::errc::result_out_of_range) fail("number out of range");
        if (error != std::errc() || end != token_.data() + token_.size()) fail("is no number");
        return constant(value);
    }

    Part constant(double value) {
        const Part part{here(), here() + static_cast<int>(token_.size()), tape().size()};
        next();
        push({Op::number, 0, 0, value, part.begin, part.end}, 1);
        return part;
    }

    Part name() {
        const std::string_view word = token_;
        const bool called = is_called();
        if (word == "if" && called) return choice();
        for (const Function& function : functions)
            if (function.name == word && called) return call(function);
        if (called) fail("is no function; known are " + std::string(known_functions));
        if (is_function(word)) fail("is a function: its arguments follow in parentheses");
        if (word == "pi") return constant(std::numbers::pi);
        if (!is_well_formed(word)) fail("each part of a name after a '.' begins with a letter or _");
        return variable(word);
    }

    static bool is_function(std::string_view word) {
        const auto has_name = [word](const Function& function) { return function.name == word; };
        return word == "if" || std::any_of(std::begin(functions), std::end(functions), has_name);
    }

    bool is_called() const {
        const std::string_view rest = text_.substr(at_ + token_.size());
        return rest.substr(count(rest, is_blank)).starts_with('(');
    }

    Part variable(std::string_view word) {
        auto& names = result_.names_;
        const auto found = std::find(names.begin(), names.end(), word);
        const auto index = static_cast<int>(found - names.begin());
        if (found == names.end()) names.emplace_back(word);
        const Part part{here(), here() + static_cast<int>(word.size()), tape().size()};
        next();
        push({Op::slot, index, 0, 0.0, part.begin, part.end}, 1);
        return part;
    }

    Part call(const Function& function) {
        const int begin = here();
        next();
        next();
        Part first = formula();
        Part second = first;
        if (function.arguments == 2) {
            comma();
            second = formula();
        }
        if (token_ == ",") fail("too many arguments of " + std::string(function.name));
        close();
        first.begin = begin;
        second.end = first.end = static_cast<int>(after_);
        return function.arguments == 2 ? two(function.op, first, second) : one(function.op, first);
    }

    // left right WHEN else / a JUMP join / else: b / join:
    Part choice() {
        const int begin = here();
        next();
        next();
        const std::size_t first = tape().size();
        const std::size_t when = condition();
        comma();
        formula();
        const std::size_t jump = tape().size();
        push({Op::jump}, -1);  // on this path the value stays; the other one starts without it
        tape()[when].target = static_cast<int>(tape().size());
        comma();
        formula();
        if (token_ == ",") fail("too many arguments of if");
        close();
        tape()[jump].target = static_cast<int>(tape().size());
        const Part part{begin, static_cast<int>(after_), first};
        push({Op::join, 0, 0, 0.0, part.begin, part.end}, 0);
        return part;
    }

    std::size_t condition() {
        const Part left = formula();
        const std::string_view comparison = token_;
        if (comparison != "<" && comparison != "<=" && comparison != ">" && comparison != ">=")
            fail("expected a comparison: '<', '<=', '>' or '>='");
        next();
        const Part right = formula();
        const Op op = comparison[0] == '<' ? Op::when_less : Op::when_greater;
        push({op, new_switch(comparison.size() == 1), 0, 0.0, left.begin, right.end}, -2);
        return tape().size() - 1;
    }

    // --- tape -----------------------------------------------------------------------------------------------------

    std::vector<Step>& tape() { return result_.tape_; }
    const Step& last() const { return result_.tape_.back(); }
    int here() const { return static_cast<int>(at_); }
    bool is_constant(const Part& part) const {
        return part.first + 1 == result_.tape_.size() && last().op == Op::number;
    }

    void push(const Step& step, int values) {
        result_.tape_.push_back(step);
        held_ += values;
        result_.depth_ = std::max(result_.depth_, static_cast<std::size_t>(held_));
        if (result_.depth_ > Expression::most_values)
            fail("the formula holds more than 256 values at once: write it in smaller parts");
    }

    int new_switch(bool strict) {
        result_.strict_.push_back(strict);
        return static_cast<int>(result_.strict_.size()) - 1;
    }

    static bool is_switch(Op op) {
        return op == Op::absolute || op == Op::sign || op == Op::minimum || op == Op::maximum;
    }

    Part one(Op op, const Part& part) {
        if (is_constant(part)) return fold({op}, part, last().number, 0.0);
        push({op, is_switch(op) ? new_switch(false) : 0, 0, 0.0, part.begin, part.end}, 0);
        return part;
    }

    Part two(Op op, const Part& left, const Part& right) {
        const Part part{left.begin, right.end, left.first};
        if (right.first == left.first + 1 && is_constant(right) && tape()[left.first].op == Op::number)
            return fold({op}, part, tape()[left.first].number, last().number);
        push({op, is_switch(op) ? new_switch(false) : 0, 0, 0.0, part.begin, part.end}, -1);
        return part;
    }

    // x^p with a number p: right for negative x and whole p too, and with the right slope at zero.
    Part to_constant(const Part& base, const Part& exponent) {
        const double p = last().number;
        const Part part{base.begin, exponent.end, base.first};
        if (std::abs(p) > 1000.0) fail_in(exponent, "an exponent is at most 1000");
        tape().pop_back();
        --held_;
        const Step step{Op::raise, 0, 0, p, part.begin, part.end};
        if (is_constant(base)) return fold(step, part, last().number, 0.0);
        push(step, 0);
        return part;
    }

    // Replaces a constant part by its value.
    Part fold(const Step& step, const Part& part, double a, double b) {
        const auto by_sign = [](int, double x) { return x < 0.0 ? -1 : 1; };
        const double value =
            step.op < Op::add ? Expression::unary(step, a, by_sign) : Expression::binary(step, a, b, by_sign);
        if (!std::isfinite(value)) fail_in(part, "has no finite value");
        held_ -= static_cast<int>(tape().size() - part.first);
        tape().erase(tape().begin() + static_cast<std::ptrdiff_t>(part.first), tape().end());
        push({Op::number, 0, 0, value, part.begin, part.end}, 1);
        return part;
    }

    int level_ = 0, held_ = 0;
    Expression result_;
};

Expression Expression::parse(std::string_view text) {
    constexpr std::size_t longest = 10000;
    if (text.size() > longest) refuse("formula of ", text.size(), " characters: at most ", longest, " are read");
    return ExpressionParser(text).read();
}

void Expression::bind(const std::function<int(std::string_view)>& slot_of) {
    std::vector<int> slots;
    for (const std::string& name : names_) {
        slots.push_back(slot_of(name));
        if (slots.back() < 0) refuse("formula ", quoted(text_), ": the name ", quoted(name), " is not known here");
    }
    slots_ = std::move(slots);
}

void Expression::decide(const double* slots, std::int8_t* branches, int keep) const {
    for (int k = 0; k < switches(); ++k)
        if (k != keep) branches[k] = 1;
    run(slots, [this, branches, keep](int k, double argument) {
        const bool positive = argument > 0.0 || (argument == 0.0 && !strict_[static_cast<std::size_t>(k)]);
        if (k != keep) branches[k] = positive ? 1 : -1;
        return branches[k];
    });
}

}  // namespace dualdrive
