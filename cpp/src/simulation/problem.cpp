// What the solver asks of a run: rates, guards, Jacobian, sensitivities, work.
#include <algorithm>
#include <cmath>

#include "mode_rules.hpp"
#include "simulation.hpp"

namespace dualdrive {

// Whether all are finite; the solver tries a smaller step if not, and the run says so if that ends it.
bool Simulation::numbers(const double* v, std::size_t n) {
    double sum = 0.0;  // 0 x is no number where x is none or infinite
    for (std::size_t k = 0; k < n; ++k) sum += 0.0 * v[k];
    bad_numbers_ = sum != 0.0;
    return !bad_numbers_;
}

// Rates, guards, work and records ask for the same points again and again; with delays the past counts too.
void Simulation::evaluate(double t, const double* z) {
    Evaluated& last = evaluated_;
    if (!history_ && t == last.t && cell_.low == last.cell.low && cell_.high == last.cell.high &&
        modes_ == last.modes && std::equal(last.z.begin(), last.z.end(), z))
        return;
    last.t = t;
    last.z.assign(z, z + layout_.size());
    last.modes = modes_;
    last.cell = cell_;
    model_.evaluate(t, last.z.data(), now());
}

bool Simulation::rhs(double t, const double* z, double* rate) {
    if (field_) {
        field_->rates(t, z, rate);
    } else {
        evaluate(t, z);
        std::copy(model_.rate().begin(), model_.rate().end(), rate);
    }
    return numbers(rate, model_.rate().size());
}

bool Simulation::riding() const {
    for (std::size_t e = 0; e < modes_.size(); ++e)
        if (layout_.switches[e].kind == SwitchKind::limiter && limiter::riding(modes_[e])) return true;
    return false;
}

bool Simulation::guards(double t, const double* z, double* g) {
    if (!field_) return model_guards(t, z, g);
    field_->guards(t, z, g);
    return numbers(g, modes_.size() * guards_per_switch);
}

bool Simulation::model_guards(double t, const double* z, double* g) {
    const double* rates = riding() ? block_rates(t, z) : nullptr;
    evaluate(t, z);
    model_.guards(g, rates);
    return numbers(g, modes_.size() * guards_per_switch);
}

void Simulation::evaluate_along(double t, const double* z, double dt, const double* dz) {
    Gradient time(t);
    time.slope[0] = dt;
    for (std::size_t k = 0; k < z_along_.size(); ++k) {
        z_along_[k] = Gradient(z[k]);
        z_along_[k].slope[0] = dz[k];
    }
    along_.evaluate(time, z_along_.data(), {modes_.data(), cell_, past_along_.get(), nullptr});
}

// d(raw)/dt of every block along the flow, with integrators as the modes hold them; `frozen_block`'s held as well.
const double* Simulation::block_rates(double t, const double* z, int frozen_block) {
    evaluate(t, z);
    std::vector<double> rate(model_.rate());
    if (frozen_block >= 0)
        if (const int s = layout_.blocks[static_cast<std::size_t>(frozen_block)].integrator; s >= 0)
            rate[static_cast<std::size_t>(s)] = 0.0;
    const Model<Gradient>::Now now{modes_.data(), cell_, past_along_.get(), nullptr};
    rates_of_blocks(along_, t, z, rate.data(), now, z_along_, block_rate_);
    return block_rate_.data();
}

bool Simulation::jacobian(double t, const double* z, double* column_major) {
    const std::size_t n = z_along_.size();
    if (affine_)
        if (const auto known = jacobians_.find(modes_); known != jacobians_.end()) {
            std::copy(known->second.begin(), known->second.end(), column_major);
            return true;
        }
    for (std::size_t first = 0; first < n; first += directions) {
        for (std::size_t k = 0; k < n; ++k) {
            z_along_[k] = Gradient(z[k]);
            if (k >= first && k < first + directions) z_along_[k].slope[k - first] = 1.0;
        }
        along_.evaluate(Gradient(t), z_along_.data(), {modes_.data(), cell_, past_along_.get(), nullptr});
        for (std::size_t k = first; k < std::min(n, first + directions); ++k)
            for (std::size_t row = 0; row < n; ++row) column_major[k * n + row] = along_.rate()[row].slope[k - first];
    }
    if (!numbers(column_major, n * n)) return false;
    if (affine_) jacobians_[modes_] = std::vector<double>(column_major, column_major + n * n);
    return true;
}

void Simulation::evaluate_chunk(std::size_t chunk, double t, const double* z,
                                const std::function<double(std::size_t, std::size_t)>& s) {
    const std::size_t first = chunk * directions, last = std::min(first + directions, parameters_.size());
    for (std::size_t state = 0; state < z_along_.size(); ++state) {
        z_along_[state] = Gradient(z[state]);
        for (std::size_t k = first; k < last; ++k) z_along_[state].slope[k - first] = s(k, state);
    }
    const Past<Gradient>* past = past_chunk_.empty() ? nullptr : past_chunk_[chunk].get();
    chunk_[chunk]->evaluate(Gradient(t), z_along_.data(), {modes_.data(), cell_, past, nullptr});
}

// ṡ = (∂f/∂z) s + ∂f/∂p, one directional derivative per parameter, `directions` of them at a time.
bool Simulation::sensitivity(double t, const double* z, const double* const* s, double* const* rate) {
    for (std::size_t c = 0; c < chunks(); ++c) {
        evaluate_chunk(c, t, z, [&](std::size_t k, std::size_t state) { return s[k][state]; });
        for (std::size_t k = c * directions; k < std::min((c + 1) * directions, parameters_.size()); ++k) {
            for (std::size_t state = 0; state < z_along_.size(); ++state)
                rate[k][state] = chunk_[c]->rate()[state].slope[k - c * directions];
            if (!numbers(rate[k], z_along_.size())) return false;
        }
    }
    return true;
}

bool Simulation::quadrature(double t, const double* z, double* rate) {
    evaluate(t, z);
    std::copy(model_.power().begin(), model_.power().end(), rate);
    return numbers(rate, powers);
}

}  // namespace dualdrive
