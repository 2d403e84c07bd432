#include "pullback.hpp"

#include <algorithm>

namespace dualdrive {

TracedParameters::TracedParameters(const Machine& machine, const Slots& parameters)
    : parameters_(parameters), values_(machine.values().begin(), machine.values().end()) {
    for (const auto& slots : parameters)
        for (const std::size_t slot : slots)
            if (values_[slot].weight == 0.0) values_[slot] = Traced::variable(values_[slot].value, trace_);
    keep_trace();
}

void TracedParameters::keep_trace() {
    kept_ = trace_.size();
    bars_.resize(kept_, 0.0);
}

void TracedParameters::begin() {
    trace_.forget_from(kept_);
    bars_.resize(kept_);
}

void TracedParameters::weigh(const Traced& result, double weight) {
    bars_.resize(trace_.size(), 0.0);
    if (result.weight != 0.0) bars_[static_cast<std::size_t>(result.node)] += weight * result.weight;
}

void TracedParameters::walk_back() {
    bars_.resize(trace_.size(), 0.0);
    trace_.walk_back(kept_, trace_.size(), bars_);
}

std::vector<double> TracedParameters::owed_to_parameters() const {
    std::vector<double> bars(bars_.begin(), bars_.begin() + static_cast<std::ptrdiff_t>(kept_)), owed;
    trace_.walk_back(0, kept_, bars);
    for (const auto& slots : parameters_) {
        double sum = 0.0;
        for (const std::size_t slot : slots) sum += bars[static_cast<std::size_t>(values_[slot].node)];
        owed.push_back(sum);
    }
    return owed;
}

std::vector<std::vector<double>> TracedParameters::forward(std::span<const Traced> results) const {
    std::vector<std::vector<double>> slopes(parameters_.size(), std::vector<double>(results.size(), 0.0));
    std::vector<Lanes> dots;
    for (std::size_t first = 0; first < parameters_.size(); first += lanes) {
        const std::size_t count = std::min(lanes, parameters_.size() - first);
        dots.assign(trace_.size(), Lanes{});
        for (std::size_t l = 0; l < count; ++l)
            for (const std::size_t slot : parameters_[first + l])
                dots[static_cast<std::size_t>(values_[slot].node)].each[l] = 1.0;
        trace_.walk_forward(0, trace_.size(), dots);
        for (std::size_t r = 0; r < results.size(); ++r) {
            const Traced& x = results[r];
            if (x.weight == 0.0) continue;
            for (std::size_t l = 0; l < count; ++l)
                slopes[first + l][r] = x.weight * dots[static_cast<std::size_t>(x.node)].each[l];
        }
    }
    return slopes;
}

Pullback::Pullback(const Machine& machine, const Inputs& inputs, const Layout& layout,
                   const TracedParameters::Slots& parameters)
    : parameters_(machine, parameters), model_(machine, inputs, layout), z_(static_cast<std::size_t>(layout.size())) {
    model_.set_parameters(parameters_.values().data());
    parameters_.keep_trace();
}

std::size_t Pullback::evaluate(double t, const double* z, const Modes& modes, const Cell& cell, bool energies) {
    const std::size_t first = parameters_.trace().size();
    for (std::size_t i = 0; i < z_.size(); ++i) z_[i] = Traced::variable(z[i], parameters_.trace());
    model_.evaluate(
        Traced(t), z_.data(),
        {.modes = modes.data(), .cell = cell, .past = nullptr, .scope = energies ? Scope::whole : Scope::dynamics});
    return first;
}

void Pullback::slopes(std::size_t first, std::span<const Traced> results, double* rows) {
    const std::size_t n = z_.size(), end = parameters_.trace().size();
    bars_.resize(end);
    for (std::size_t r = 0; r < results.size(); r += lanes) {
        const std::size_t count = std::min(lanes, results.size() - r);
        std::fill(bars_.begin() + static_cast<std::ptrdiff_t>(first), bars_.end(), Lanes{});
        for (std::size_t l = 0; l < count; ++l)
            if (const Traced& x = results[r + l]; x.weight != 0.0)
                bars_[static_cast<std::size_t>(x.node)].each[l] += x.weight;
        parameters_.trace().walk_back(first + n, end, bars_);
        for (std::size_t l = 0; l < count; ++l)
            for (std::size_t i = 0; i < n; ++i) rows[(r + l) * n + i] = bars_[first + i].each[l];
    }
}

}  // namespace dualdrive
