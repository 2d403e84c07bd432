#include "adjoint.hpp"

#include <utility>

#include "exact/kernels.hpp"

namespace dualdrive {

Adjoint::Adjoint(const Tape& tape, int states, std::function<void(int, double*)> jump_back)
    : tape_(tape), states_(states), lambda_rows_(exact::padded(states)), jump_back_(std::move(jump_back)) {}

void Adjoint::present_outputs_back(Outputs outputs) {
    for (const Entry& e : outputs)
        if (e.column < 0) present_output_back(e);
}

void Adjoint::switch_back(const Entry& e) {
    const double* y = values(e);
    switch (e.kind) {
        case Entry::Kind::shift:  // s⁺ = s⁻ + (f⁻ − f⁺) τ', a state set to zero having none
            for (int i = 0; i < states_; ++i) instant_ += y[i] * lambda_[static_cast<std::size_t>(i)];
            if (e.column >= 0) lambda_[static_cast<std::size_t>(e.column)] = 0.0;
            return;
        case Entry::Kind::instant:  // τ' = −(g_z s + g_p) / ġ
            return guard_back(e, -std::exchange(instant_, 0.0) / e.length);
        case Entry::Kind::still:
            instant_ = 0.0;
            return;
        case Entry::Kind::jump:
            return jump_back_(e.count, lambda_.data());
        default:
            return;
    }
}

void Adjoint::walk(const double* seeds, std::size_t signals) {
    seeds_ = seeds;
    signals_ = signals;
    lambda_.assign(static_cast<std::size_t>(lambda_rows_), 0.0);
    std::size_t end = tape_.entries.size();  // of the outputs that follow the entry at hand
    for (std::size_t k = end; k-- > 0;) {
        const Entry& e = tape_.entries[k];
        if (e.kind == Entry::Kind::outputs) continue;
        const Outputs outputs(tape_.entries.data() + k + 1, end - k - 1);
        present_outputs_back(outputs);
        if (e.kind == Entry::Kind::steps)
            steps_back(e, outputs);
        else
            switch_back(e);
        end = k;
    }
    present_outputs_back({tape_.entries.data(), end});
}

}  // namespace dualdrive
