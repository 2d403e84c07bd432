// Which unit a formula has: its tape run on units in place of numbers, both branches of every if.
#include "dualdrive/expression.hpp"
#include "refuse.hpp"

namespace dualdrive {

class ExpressionUnits {
  public:
    ExpressionUnits(const Expression& formula, const std::function<Unit(std::string_view)>& unit_of)
        : formula_(formula), unit_of_(unit_of) {}

    Unit unit() {
        for (const Step& step : formula_.tape_) take(step);
        return stack_.back().unit;
    }

  private:
    using Op = Expression::Op;
    using Step = Expression::Step;

    // One value: its unit, the part of the text it comes from, and whether it is 0, which fits every unit.
    struct Value {
        Unit unit;
        int begin, end;
        bool is_zero = false;
    };

    void take(const Step& step) {
        switch (step.op) {
            case Op::number:
                return push(step, Unit(), step.number == 0.0);
            case Op::slot:
                return push(step, unit_of_(formula_.names_[static_cast<std::size_t>(step.index)]));
            case Op::jump:
                return;
            case Op::when_less:
            case Op::when_greater:
                alike(step, "compare");
                return;
            case Op::join:
                return stack_.push_back(alike(step, "choose between"));
            default:
                return step.op < Op::add ? unary(step) : binary(step);
        }
    }

    void unary(const Step& step) {
        const Value x = pop();
        switch (step.op) {
            case Op::negate:
            case Op::absolute:
                return push(step, x.unit, x.is_zero);
            case Op::sign:
                return push(step, Unit());
            case Op::root:
                return push(step, x.unit.power(0.5));
            case Op::raise:
                return push(step, x.unit.power(step.number));
            default:
                require_number(x, "the argument of a function");
                return push(step, Unit());
        }
    }

    void binary(const Step& step) {
        switch (step.op) {
            case Op::add:
                return stack_.push_back(alike(step, "add"));
            case Op::subtract:
                return stack_.push_back(alike(step, "subtract"));
            case Op::minimum:
            case Op::maximum:
                return stack_.push_back(alike(step, "compare"));
            case Op::power:
                return power(step);
            default:
                return product(step);
        }
    }

    void product(const Step& step) {
        const Value right = pop(), left = pop();
        const bool divides = step.op == Op::divide;
        push(step, divides ? left.unit / right.unit : left.unit * right.unit, left.is_zero || right.is_zero);
    }

    void power(const Step& step) {
        const Value exponent = pop(), base = pop();
        require_number(exponent, "an exponent");
        require_number(base, "the base of a power whose exponent varies");
        push(step, Unit());
    }

    // Takes off two values that must be of one unit; the result is of that unit and stands for both.
    Value alike(const Step& step, const char* what) {
        const Value right = pop(), left = pop();
        if (!left.is_zero && !right.is_zero && !(left.unit == right.unit))
            refuse("formula ", quoted(formula_.text_), ": in ", part(step.begin, step.end), " one can't ", what, " ",
                   named(left), " and ", named(right));
        return {left.is_zero ? right.unit : left.unit, step.begin, step.end, left.is_zero && right.is_zero};
    }

    void require_number(const Value& x, const char* what) const {
        if (!x.unit.is_number())
            refuse("formula ", quoted(formula_.text_), ": ", what, " must be a pure number: ", named(x));
    }

    void push(const Step& step, const Unit& unit, bool is_zero = false) {
        stack_.push_back({unit, step.begin, step.end, is_zero});
    }
    Value pop() {
        const Value top = stack_.back();
        stack_.pop_back();
        return top;
    }

    std::string part(int begin, int end) const {
        const std::string_view text = formula_.text_;
        return quoted(text.substr(static_cast<std::size_t>(begin), static_cast<std::size_t>(end - begin)));
    }
    std::string named(const Value& x) const { return part(x.begin, x.end) + " [" + x.unit.text() + "]"; }

    const Expression& formula_;
    const std::function<Unit(std::string_view)>& unit_of_;
    std::vector<Value> stack_;
};

Unit Expression::unit(const std::function<Unit(std::string_view)>& unit_of) const {
    return ExpressionUnits(*this, unit_of).unit();
}

}  // namespace dualdrive
