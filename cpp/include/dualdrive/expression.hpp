// A user's formula, read once into a tape and evaluated on any scalar.
//
//     formula = term (('+' | '-') term)*        term = sign (('*' | '/') sign)*
//     sign = '-' sign | power                   power = operand ['^' sign]
//     operand = number | name | 'pi' | function '(' formula (',' formula)* ')' | '(' formula ')'
//             | 'if' '(' formula ('<' | '<=' | '>' | '>=') formula ',' formula ',' formula ')'
//
// with sin cos tan tanh exp log sqrt abs sign (one argument), min max (two). A name begins with a letter or _ and goes on
// with letters, digits, _ and dots between parts: T, mesh_1.torque. −x^2 is −(x²), 2^3^2 is 2^9.
//
// abs, sign, min, max and if are switches. While a solver runs, each keeps the branch it was given, so that the formula
// is smooth; the argument whose sign decides is offered beside it, for the solver to find where it changes.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "dualdrive/scalar.hpp"
#include "dualdrive/unit.hpp"

namespace dualdrive {

class Expression {
  public:
    // Throws std::invalid_argument naming column (in bytes, from 1), token and rule. Refused are also: more than 10000
    // characters, nesting deeper than 200, more than 256 values held at once, constant parts without a finite value.
    static Expression parse(std::string_view text);

    const std::string& text() const { return text_; }

    // The names used, each once, in the order of their first use.
    const std::vector<std::string>& names() const { return names_; }

    // Where each name finds its value; asked once per name, in the order of names(). Until then a name's slot is its
    // place in names(). Throws std::invalid_argument naming the name when the slot is negative; nothing is bound then.
    void bind(const std::function<int(std::string_view)>& slot_of);

    // How many switches there are, numbered in the order of evaluation: inner before outer, left before right.
    int switches() const { return static_cast<int>(strict_.size()); }

    // The value, with switch k on branch branches[k]: +1 or −1. abs(x): ±x. sign(x): ±1. min(a, b): b or a; max(a, b): a
    // or b; if(c, a, b): a or b. Never allocates. A domain error of log, sqrt or ^ gives what the scalar's function gives.
    template <class S>
    S evaluate(const S* slots, const std::int8_t* branches) const {
        return run(slots, [branches](int k, const S&) { return branches[k]; });
    }

    // The argument that decides each switch: positive while +1 is right. abs(x), sign(x): x. min(a, b), max(a, b): a − b.
    // if(l < r, ...), if(l <= r, ...): r − l, the others l − r. A switch in the branch of an if that is not taken decides
    // nothing: its argument is then its branch itself, which never crosses zero.
    template <class S>
    void switch_values(const S* slots, const std::int8_t* branches, S* out) const {
        for (int k = 0; k < switches(); ++k) out[k] = S(static_cast<double>(branches[k]));
        run(slots, [branches, out](int k, const S& argument) {
            out[k] = argument;
            return branches[k];
        });
    }

    // The branches that are right at these values, written to `branches`; switch `keep` stays as it is, for a solver that
    // stands at its zero and knows on which side it goes on. An argument of exactly zero decides for −1 in if(l < r, ...)
    // and if(l > r, ...), for +1 elsewhere; a switch that decides nothing gets +1.
    void decide(const double* slots, std::int8_t* branches, int keep = -1) const;

    // The unit of the value. 0 fits every unit, other numbers and pi are pure numbers; a base with a unit needs a number as
    // exponent. Throws std::invalid_argument naming the offending part and its unit; passes on what `unit_of` throws.
    Unit unit(const std::function<Unit(std::string_view)>& unit_of) const;

    // How a value changes with the state while every switch keeps its branch.
    enum class Growth : std::uint8_t { none, affine, other };

    // Whether the value and the argument of every switch are affine, each name growing as `growth_of` says. Judged by the
    // formula's form, whatever the branches: a no may be wrong (x*x - x*x), a yes never is.
    bool is_affine(const std::function<Growth(std::string_view)>& growth_of) const;

  private:
    friend class ExpressionParser;
    friend class ExpressionGrowth;
    friend class ExpressionUnits;

    enum class Op : std::uint8_t {
        number,  // push `number`
        slot,    // push the slot of name `index`
        negate,
        sine,
        cosine,
        tangent,
        tanh,
        exponential,
        logarithm,
        root,
        absolute,  // switch `index`
        sign,      // switch `index`
        raise,     // to the constant power `number`
        add,
        subtract,
        multiply,
        divide,
        power,
        minimum,       // switch `index`
        maximum,       // switch `index`
        when_less,     // take two values off; go on if switch `index` (right − left) is +1, else at step `target`
        when_greater,  // the same with left − right
        jump,          // to step `target`
        join           // where the two branches of an if meet
    };

    struct Step {
        Op op;
        int index = 0;
        int target = 0;
        double number = 0.0;
        int begin = 0, end = 0;  // the part of the text that is computed with this step
    };

    static constexpr std::size_t most_values = 256;

    // Chooses the size of the stack, so that usual formulas do not clear memory for unusual ones.
    template <class S, class Choose>
    S run(const S* slots, const Choose& choose) const {
        if (depth_ <= 8) return run_on<8>(slots, choose);
        if (depth_ <= 32) return run_on<32>(slots, choose);
        return run_on<most_values>(slots, choose);
    }

    template <std::size_t size, class S, class Choose>
    S run_on(const S* slots, const Choose& choose) const {
        std::array<S, size> values;
        S* top = values.data();  // one past the last value
        for (std::size_t at = 0; at < tape_.size(); ++at) {
            const Step& step = tape_[at];
            const auto go_to = [&at](int target) { at = static_cast<std::size_t>(target) - 1; };
            switch (step.op) {
                case Op::number:
                    *top++ = S(step.number);
                    break;
                case Op::slot:
                    *top++ = slots[slots_[static_cast<std::size_t>(step.index)]];
                    break;
                case Op::jump:
                    go_to(step.target);
                    break;
                case Op::join:
                    break;
                case Op::when_less:
                case Op::when_greater: {
                    top -= 2;
                    const S argument = step.op == Op::when_less ? top[1] - top[0] : top[0] - top[1];
                    if (choose(step.index, argument) < 0) go_to(step.target);
                    break;
                }
                default:
                    if (step.op < Op::add) {
                        top[-1] = unary(step, top[-1], choose);
                    } else {
                        --top;
                        top[-1] = binary(step, top[-1], top[0], choose);
                    }
            }
        }
        return values[0];
    }

    template <class S, class Choose>
    static S unary(const Step& step, const S& x, const Choose& choose) {
        using std::sin, std::cos, std::tan, std::tanh, std::exp, std::log, std::sqrt, std::pow;
        switch (step.op) {
            case Op::sine:
                return sin(x);
            case Op::cosine:
                return cos(x);
            case Op::tangent:
                return tan(x);
            case Op::tanh:
                return tanh(x);
            case Op::exponential:
                return exp(x);
            case Op::logarithm:
                return log(x);
            case Op::root:
                return sqrt(x);
            case Op::absolute:
                return choose(step.index, x) < 0 ? -x : x;
            case Op::sign:
                return S(choose(step.index, x) < 0 ? -1.0 : 1.0);
            case Op::raise:
                if (step.number == 0.0) return S(1.0);  // its slope is zero at x = 0 too
                return step.number == 2.0 ? x * x : S(pow(x, step.number));
            default:
                return -x;
        }
    }

    template <class S, class Choose>
    static S binary(const Step& step, const S& a, const S& b, const Choose& choose) {
        using std::pow;
        switch (step.op) {
            case Op::add:
                return a + b;
            case Op::subtract:
                return a - b;
            case Op::multiply:
                return a * b;
            case Op::divide:
                return a / b;
            case Op::minimum:
                return choose(step.index, S(a - b)) < 0 ? a : b;
            case Op::maximum:
                return choose(step.index, S(a - b)) < 0 ? b : a;
            default:
                return pow(a, b);
        }
    }

    std::string text_;
    std::vector<std::string> names_;
    std::vector<int> slots_;  // per name
    std::vector<Step> tape_;
    std::vector<std::uint8_t> strict_;  // per switch: at zero the branch is −1
    std::size_t depth_ = 0;             // values held at once
};

}  // namespace dualdrive
