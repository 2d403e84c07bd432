// Whether a formula is affine between its switches: its tape run on growths in place of numbers, both branches of every if.
#include <algorithm>

#include "dualdrive/expression.hpp"

namespace dualdrive {

class ExpressionGrowth {
  public:
    using Growth = Expression::Growth;

    ExpressionGrowth(const Expression& formula, const std::function<Growth(std::string_view)>& growth_of)
        : formula_(formula), growth_of_(growth_of) {}

    bool is_affine() {
        for (const Step& step : formula_.tape_) take(step);
        return switches_are_affine_ && stack_.back() != Growth::other;
    }

  private:
    using Op = Expression::Op;
    using Step = Expression::Step;

    void take(const Step& step) {
        switch (step.op) {
            case Op::number:
                return stack_.push_back(Growth::none);
            case Op::slot:
                return stack_.push_back(growth_of_(formula_.names_[static_cast<std::size_t>(step.index)]));
            case Op::jump:
                return;
            case Op::when_less:
            case Op::when_greater:
                decide(std::max(pop(), pop()));
                return;
            case Op::join:  // the values of both branches lie on the stack
                return stack_.push_back(std::max(pop(), pop()));
            default:
                stack_.push_back(step.op < Op::add ? unary(step, pop()) : binary(step));
        }
    }

    Growth unary(const Step& step, Growth x) {
        switch (step.op) {
            case Op::negate:
                return x;
            case Op::absolute:
                decide(x);
                return x;
            case Op::sign:  // a number while it keeps its branch
                decide(x);
                return Growth::none;
            case Op::raise:
                if (step.number == 0.0) return Growth::none;
                return step.number == 1.0 ? x : curved(x);
            default:
                return curved(x);
        }
    }

    Growth binary(const Step& step) {
        const Growth right = pop(), left = pop(), both = std::max(left, right);
        switch (step.op) {
            case Op::add:
            case Op::subtract:
                return both;
            case Op::minimum:
            case Op::maximum:
                decide(both);
                return both;
            case Op::multiply:
                return std::min(left, right) == Growth::none ? both : Growth::other;
            case Op::divide:
                return right == Growth::none ? left : Growth::other;
            default:
                return curved(both);
        }
    }

    static Growth curved(Growth x) { return x == Growth::none ? Growth::none : Growth::other; }

    void decide(Growth argument) { switches_are_affine_ = switches_are_affine_ && argument != Growth::other; }

    Growth pop() {
        const Growth top = stack_.back();
        stack_.pop_back();
        return top;
    }

    const Expression& formula_;
    const std::function<Growth(std::string_view)>& growth_of_;
    std::vector<Growth> stack_;
    bool switches_are_affine_ = true;
};

bool Expression::is_affine(const std::function<Growth(std::string_view)>& growth_of) const {
    return ExpressionGrowth(*this, growth_of).is_affine();
}

}  // namespace dualdrive
