// The exact engine behind the face of a solver: between switches machine, controller and inputs are one linear system,
// propagated by its matrix exponential, and every switch is found on that solution.
//
// docs/theory/exact.md says how, and why no crossing can be missed. R is double, or long double for reference runs.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "../tape.hpp"
#include "crossing.hpp"
#include "dualdrive/solver.hpp"
#include "generator.hpp"
#include "laws.hpp"
#include "ledger.hpp"
#include "propagator.hpp"
#include "slopes.hpp"

namespace dualdrive::exact {

template <class R>
class Exact final : public Solver {
  public:
    struct Setup {
        const Machine& machine;
        const Inputs& inputs;
        const Layout& layout;
        const Modes& modes;  // as they are whenever restart() is called
        const Cell& cell;
        double start, grid;                                // s; grid times are start + k grid
        std::vector<int> recorded;                         // signals
        std::vector<std::vector<std::size_t>> parameters;  // slots that move together, per sensitivity
        Tape* tape = nullptr;                              // to write on, for the way back
        std::size_t steps = 0;                             // that the tape will have to hold, about
    };

    Exact(Size size, Setup setup);

    void restart(double t, std::span<const double> atol, double quadrature_atol) override;
    void limit_step(double, double) override {}  // the solution is known at all times: nothing can be stepped over
    Outcome step(double stop) override;
    double time() const override { return t_; }
    double previous_time() const override { return begin_; }
    std::span<double> state() override { return z_; }
    std::span<double> sensitivity(int k) override { return {slopes(last()) + k * rows_, z_.size()}; }
    std::span<double> quadrature() override { return {work(last()), static_cast<std::size_t>(size_.quadratures)}; }
    void go_back(double t) override;
    void state_at(double t, double* z) const override;
    void sensitivity_at(double t, int k, double* s) const override;
    void quadrature_at(double t, double* q) const override;
    std::optional<double> stored_energy_at(double t) const override;
    bool signals_at(std::span<const double> times, double* signals) const override;
    bool signal_slopes_at(double t, double* slopes) const override;
    bool guards_now(double* g) override;
    bool rates_now(double* rate) override;
    std::optional<double> guard_rate_now(int guard) override;
    bool guard_slopes_now(int guard, double* slopes) override;
    std::span<const int> roots() const override { return roots_; }
    bool finds_every_root() const override { return true; }
    Failure failure() const override { return {false, not_finite}; }
    Counts counts() const override { return counts_; }
    std::string name() const override { return "exact"; }

    // For the tape: the guard that falls at the present instant, in the modes as they are, at `rate` per s.
    void write_instant(int guard, double rate);
    // What the laws on the tape owe to parameters.
    std::vector<Laws<R>> derivatives(const Propagator<R>* law, const std::vector<std::vector<std::size_t>>& parameters);

  private:
    static constexpr int block = 16;  // steps that are watched together

    const Propagator<R>& propagator();
    SlopePropagator& slope_propagator();
    void take_modes();
    using Vector = Eigen::Matrix<R, Eigen::Dynamic, 1>;
    Eigen::Map<const Vector> present();
    void take_changes();
    double grid_time(long k) const { return setup_.start + static_cast<double>(k) * setup_.grid; }
    double start_generator(double stop);
    bool aligned() const { return local_ == R(static_cast<double>(part_) * now_->step()); }
    Outcome walk(int count);
    Outcome go_to(R local, bool boundary);
    void take_steps(int count);
    void take_part(R length);
    Outcome arrive();
    Outcome arrive_at_root();
    void stand_on_surface();
    void begin_again();
    int last() const { return done_ + (ended_ ? 1 : 0); }  // column of the present state
    double time_of(int k) const { return begin_ + k * now_->step(); }
    void watch(int count, R fraction);
    int suspect(int from, int count, R fraction) const;
    struct Fall {
        R at;  // in steps
        int guard;
    };
    Quintic<R> quintic(int k, int watched, R fraction) const;
    std::optional<R> fall(const Quintic<R>& q, int terms, R sixth, R noise, bool after_switch) const;
    std::optional<R> first_fall(int k, R fraction);
    struct Judged {
        const Propagator<R>* law = nullptr;
        std::vector<R> y;
        R error{};
    };
    R bound_beside(std::size_t i, const R* y) const;
    void find_place(double t);
    void next_place();
    R* column(int k) { return y_.data() + static_cast<std::ptrdiff_t>(k) * rows_; }
    const R* column(int k) const { return y_.data() + static_cast<std::ptrdiff_t>(k) * rows_; }
    // Where t lies within the last step: after which column, and by how much.
    struct Spot {
        int column;
        double ahead;
    };
    Spot spot(double t) const;
    // y there, in `probe_` unless it is stored.
    const R* y_at(const Spot& at) const;
    void rows_of(const R* y, int count, double* signals) const;
    // S at t within the last step, as y_at.
    const double* slopes_at(double t) const;
    double* slopes(int k) { return slopes_.data() + static_cast<std::ptrdiff_t>(k) * rows_ * size_.sensitivities; }
    const double* slopes(int k) const {
        return slopes_.data() + static_cast<std::ptrdiff_t>(k) * rows_ * size_.sensitivities;
    }
    void take_slopes(int k, double length);
    double* work(int k) { return works_.data() + k * size_.quadratures; }
    const double* work(int k) const { return works_.data() + k * size_.quadratures; }

    const Size size_;
    const Setup setup_;
    const Generator generator_;
    Reader<R> reader_;
    const int n_, rows_;  // of y, and padded
    std::map<Modes, std::unique_ptr<Propagator<R>>> known_;
    const Propagator<R>* now_ = nullptr;
    std::map<const Propagator<R>*, std::unique_ptr<SlopePropagator>> known_slopes_;
    SlopePropagator* slope_now_ = nullptr;  // null without sensitivities
    std::map<const Propagator<R>*, std::unique_ptr<Ledger<R>>> known_ledgers_;
    Ledger<R>* ledger_ = nullptr;  // null without quadratures

    // Where the run stands: t_ = grid_time(place_) + local_, the present state in column done_. Local times keep the
    // digits that t_ loses.
    double t_ = 0.0, begin_ = 0.0;
    long place_ = 0, part_ = 0;  // whole steps within the grid step
    R local_{0}, part_length_{0};
    int done_ = 0;          // whole steps of the last step(): columns 1 to done_
    bool ended_ = false;    // the last step() went on from column done_ for a part of a step, to column done_ + 1
    bool fresh_ = true;     // a switch or a break was here
    bool at_root_ = false;  // the last step ended at a switch it found
    int wide_ = 2;          // steps of the next block
    std::vector<R> y_, scratch_;
    mutable std::vector<R> probe_, probe_scratch_, probe_signals_;
    std::vector<R> watched_, largest_, bounds_, series_;
    std::vector<double> z_, works_;
    std::vector<double> slopes_;  // rows_ × sensitivities, (block + 2) times
    mutable std::vector<double> slope_probe_, slope_y_;
    std::vector<int> roots_;
    std::vector<Fall> falls_;
    std::vector<Judged> judged_;  // per watched quantity
    std::size_t next_knot_ = 0;
    Counts counts_{};
};

extern template class Exact<double>;
extern template class Exact<long double>;

}  // namespace dualdrive::exact
