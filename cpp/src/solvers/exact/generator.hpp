// The inputs as states: a linear system that, started right, puts out every input of a run.
//
// A polynomial piece of order m is a chain of m integrators that starts with its derivatives; a harmonic is a rotating
// pair. Between two knots nothing else happens, so that machine, controller and inputs together are one linear system
// without excitation. At a knot the states are set anew from the waveform; they are set anew at every start of a step
// besides, so that no rounding gathers in them.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "dualdrive/signal.hpp"

namespace dualdrive::exact {

class Generator {
  public:
    explicit Generator(const Inputs& inputs) {
        for (const auto& [name, waveform] : inputs) {
            Part p{name, &waveform, size_, waveform.polynomial_order(), {}};
            size_ += static_cast<int>(p.order);
            for (const Harmonic& h : waveform.harmonics()) {
                p.harmonics.push_back(&h);
                size_ += 2;
            }
            const auto knots = waveform.knots();
            knots_.insert(knots_.end(), knots.begin(), knots.end());
            parts_.push_back(std::move(p));
        }
        std::sort(knots_.begin(), knots_.end());
        knots_.erase(std::unique(knots_.begin(), knots_.end()), knots_.end());
    }

    int size() const { return size_; }
    const std::vector<double>& knots() const { return knots_; }  // where the states have to be set anew
    std::size_t inputs() const { return parts_.size(); }
    const std::string& name(std::size_t input) const { return parts_[input].name; }

    // The generator's own equations into A, its states from column and row `first` on.
    template <class Matrix>
    void write_equations(Matrix& A, int first) const {
        using R = typename Matrix::Scalar;
        for (const Part& p : parts_) {
            const int s = first + p.first, pairs = s + static_cast<int>(p.order);
            for (int k = 0; k + 1 < static_cast<int>(p.order); ++k) A(s + k, s + k + 1) = R(1);
            for (int k = 0; k < static_cast<int>(p.harmonics.size()); ++k) {
                const R w(p.harmonics[static_cast<std::size_t>(k)]->angular_frequency);
                A(pairs + 2 * k, pairs + 2 * k + 1) = w;
                A(pairs + 2 * k + 1, pairs + 2 * k) = -w;
            }
        }
    }

    // Calls add(state, weight of the input's value there, weight of its rate there) for every state of an input.
    template <class Add>
    void outputs(std::size_t input, const Add& add) const {
        const Part& p = parts_[input];
        for (int k = 0; k < static_cast<int>(p.order); ++k) add(p.first + k, k == 0 ? 1.0 : 0.0, k == 1 ? 1.0 : 0.0);
        for (int k = 0; k < static_cast<int>(p.harmonics.size()); ++k) {
            const int s = p.first + static_cast<int>(p.order) + 2 * k;
            add(s, 1.0, 0.0);
            add(s + 1, 0.0, p.harmonics[static_cast<std::size_t>(k)]->angular_frequency);
        }
    }

    // The states at time t, seen from inside the cell.
    template <class R>
    void set(double t, const Cell& cell, R* states) const {
        using std::cos, std::sin;
        const Instant at(t, cell);
        for (const Part& p : parts_) {
            const Polynomial jet = p.waveform->polynomial_jet(at);
            R* s = std::copy_n(jet.begin(), p.order, states + p.first);
            for (const Harmonic* h : p.harmonics) {
                const R angle = R(h->angular_frequency) * (R(t) - R(h->origin())) + R(h->phase);
                const R size(h->sounds(at) ? h->amplitude : 0.0);
                *s++ = size * sin(angle);
                *s++ = size * cos(angle);
            }
        }
    }

  private:
    struct Part {
        std::string name;
        const Waveform* waveform;
        int first;
        std::size_t order;
        std::vector<const Harmonic*> harmonics;
    };
    std::vector<Part> parts_;
    std::vector<double> knots_;
    int size_ = 0;
};

}  // namespace dualdrive::exact
