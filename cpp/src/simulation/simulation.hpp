// One run in progress: the loop of steps, switches, ticks and breaks around the solver.
#pragma once

#include <limits>
#include <map>
#include <memory>
#include <queue>

#include "../solvers/exact/exact.hpp"
#include "../solvers/exponential/exponential.hpp"
#include "../solvers/pullback.hpp"
#include "affine_field.hpp"
#include "dualdrive/simulate.hpp"
#include "history.hpp"

namespace dualdrive {

namespace exact {
class Adjoint;
}
namespace exponential {
class Adjoint;
}

class Simulation final : public Problem {
  public:
    Simulation(const Machine& machine, const Inputs& inputs, const SimulateOptions& options);
    Trajectory run();
    // ∂(cost)/∂(options.gradient) from ∂(cost)/∂(recorded values): see gradient.cpp.
    std::vector<double> pull_back(const std::vector<double>& seeds) const;

  private:
    enum class JumpKind { riding, tick, output, encoders };
    struct Parameter {
        std::vector<std::size_t> slots;  // members of a group move together
        int initial_state = -1;
        double scale;
    };

    // run.cpp, options.cpp, start.cpp, record.cpp: set-up, loop, recording
    void read_options();
    bool is_read(const std::string& input) const;
    void read_parameters();
    Parameter read_parameter(const std::string& path) const;
    std::vector<std::unique_ptr<Model<Gradient>>> seeded_models(const std::vector<Parameter>& parameters) const;
    void start();
    void loop();
    void restart();
    double next_stop();
    void record_until(double t);
    void record(std::span<const double> times);
    void record_by_model(double t, const std::vector<std::size_t>& which, double* row);
    std::size_t finite_rows(std::size_t rows) const;
    void record_work(double t);
    double stored_energy(double t);
    void record_sensitivities(double t, std::size_t row);
    void remember(double from, double to);
    bool stop_now();
    Status failure() const;
    void fail(Status status, const std::string& message);
    void finish();
    struct Pace {  // 1/s
        double rings, decays;
    };
    Pace pace();
    bool too_stiff_to_be_exact();
    void choose_solver(int guards, std::span<const double> parameter_scale);
    bool exact_is_possible(std::string& reason) const;
    void refuse_gradient(const std::string& impossible) const;
    void refuse_what_is_not_exact(const std::string& impossible) const;
    bool wants_exact() const;
    bool chooses_engine() const;
    bool suits_exponential() const;
    bool goes_back_by_collocation() const;
    bool steps_may_be_long() const;
    double longest_stretch() const;
    double turning_time() const;
    void take_exact_solver(Solver::Size size);
    std::unique_ptr<Exponential> exponential_solver(Solver::Size size);
    void take_exponential_solver(Solver::Size size);
    double exact_grid() const;
    std::size_t grid_steps() const;
    std::vector<double> tolerances() const;

    static constexpr int settle_passes = 60;  // changes of modes at one instant before it is called chattering

    // modes.cpp: the mode of an element, and the next
    void classify();
    Mode standing_mode(int element);
    Mode next_mode(int element, int which);
    Mode next_limiter_mode(std::size_t block, Mode from, int which);
    double guard_scale(int element, int which) const;

    // events.cpp: everything that changes modes or state at an instant
    bool settle(bool located);
    bool stopped_where_it_broke_loose(int element) const;
    void switch_at(const std::vector<int>& fallen);
    enum class Cause { guard, instant };  // the element's own guard fell here, or something else happened
    bool transition(int element, int which, Cause cause);
    std::vector<double> rates_now();
    void carry_derivatives(const std::vector<double>& before, int zeroed);
    void find_instant_slope(int element, int which, const std::vector<double>& rate);
    void pass_break();
    bool end_rides();
    void apply(JumpKind kind, const Clock* clock = nullptr);
    void slave_riding();
    void add_delayed_breaks(double t, const std::vector<double>& time_slope);

    // gradient.cpp: the tape of a run, and the way back over it
    struct Jump {
        JumpKind kind;
        const Clock* clock;
        Place at;
    };
    Place here() const;
    void write_jump(JumpKind kind, const Clock* clock = nullptr);
    void write_instant(int guard, double rate);
    void write_output(double t);
    void jump_back(const Jump& jump, double* lambda, Pullback& pullback) const;
    TracedParameters::Slots back_slots() const;
    std::vector<double> walk_back(exact::Adjoint& adjoint, const double* seeds, std::vector<double>& gradient) const;
    std::vector<double> walk_back(exponential::Adjoint& adjoint, const double* seeds,
                                  std::vector<double>& gradient) const;
    template <class S>
    void do_jump(JumpKind kind, const Clock* clock, const Model<S>& model, const S* z, S* next) const;

    // crossing.cpp: which guards fell in the last step, and when first
    std::vector<int> fallen_guards(Solver::Outcome outcome);
    struct Crossing {
        double t;
        int guard;
    };
    struct Glimpse {  // a guard at three times
        double x[3], g[3];
    };
    bool find_missed(std::size_t guard, Glimpse seen, Crossing& first);
    void watch(double t, const double* z, std::vector<double>& g, std::vector<double>& slope);
    bool nothing_can_dip(double span) const;
    double guard_at(std::size_t guard, double t);
    double locate(std::size_t guard, double above, double under);

    // problem.cpp: what the solver asks
    bool rhs(double t, const double* z, double* rate) override;
    bool guards(double t, const double* z, double* g) override;
    bool model_guards(double t, const double* z, double* g);  // leaves the model at (t, z)
    bool jacobian(double t, const double* z, double* column_major) override;
    bool sensitivity(double t, const double* z, const double* const* s, double* const* rate) override;
    bool quadrature(double t, const double* z, double* rate) override;
    bool numbers(const double* v, std::size_t n);
    void evaluate(double t, const double* z);
    Model<double>::Now now() const { return {modes_.data(), cell_, past_ ? past_.get() : nullptr, nullptr}; }
    // Directional derivative of the model along (dt, dz): evaluates `along_` with one slope.
    void evaluate_along(double t, const double* z, double dt, const double* dz);
    const double* block_rates(double t, const double* z, int frozen_block = -1);
    bool riding() const;
    // One model per chunk of parameters, seeded with their sensitivities.
    void evaluate_chunk(std::size_t chunk, double t, const double* z,
                        const std::function<double(std::size_t, std::size_t)>& s);
    std::size_t chunks() const { return (parameters_.size() + directions - 1) / directions; }

    const Machine machine_;
    const Inputs inputs_;
    const SimulateOptions options_;
    const Layout layout_;
    Model<double> model_;
    Model<Gradient> along_;
    std::vector<std::unique_ptr<Model<Gradient>>> chunk_;

    std::vector<Parameter> parameters_;       // of forward sensitivities
    std::vector<Parameter> back_parameters_;  // of the gradient
    std::vector<int> recorded_;               // signals
    std::vector<double> times_;
    std::size_t next_output_ = 0;

    Modes modes_;
    Cell cell_;
    struct Evaluated {  // what the model was last asked, for the many questions about one point
        double t = std::numeric_limits<double>::quiet_NaN();
        std::vector<double> z;
        Modes modes;
        Cell cell;
    } evaluated_;
    std::vector<double> breaks_;  // of the inputs, sorted
    std::size_t next_break_ = 0;
    struct DelayedBreak {
        double t;
        std::vector<double> slope;  // dt/dp
        bool operator>(const DelayedBreak& o) const { return t > o.t; }
    };
    std::priority_queue<DelayedBreak, std::vector<DelayedBreak>, std::greater<>> delayed_breaks_;
    std::vector<long> ticks_, outputs_;  // counts done, per clock
    std::unique_ptr<History> history_;
    std::unique_ptr<HistoryView<double>> past_;
    std::unique_ptr<HistoryView<Gradient>> past_along_;
    std::vector<std::unique_ptr<HistoryView<Gradient>>> past_chunk_;

    std::unique_ptr<Solver> solver_;
    std::unique_ptr<AffineField> field_;              // of an affine machine, for a solver that steps
    std::map<Modes, std::vector<double>> jacobians_;  // of an affine machine: one per mode
    bool affine_ = false;
    bool placed_ = true;                     // all recorded signals are what Model::place gives
    std::vector<std::size_t> all_, curved_;  // numbers within recorded_; those that are not linear in the states
    std::vector<double> guard_begin_, guard_end_, guard_probe_;  // of the last step
    std::vector<double> slope_begin_, slope_end_;                // of the guards, with a field
    std::vector<std::vector<double>> guard_inside_;
    std::vector<double> scale_;  // typical size of each state, growing with what was seen
    double energy_scale_ = 0.0, energy_start_ = 0.0, energy_moved_ = 0.0, energy_worst_ = 0.0;
    std::vector<double> z_scratch_, rate_scratch_, block_rate_, work_scratch_;
    std::vector<Gradient> z_along_;
    std::vector<bool> crossed_;          // elements whose own guard fell at the present instant
    std::vector<double> loose_since_;    // when bodies last broke loose or turned, per element
    std::vector<double> instant_slope_;  // of the instant at which switches happen, per sensitivity
    bool bad_numbers_ = false;           // the last rates or guards were not finite
    long crowded_ = 0, guard_calls_ = 0;
    double last_switch_ = 0.0;
    std::vector<Jump> jumps_;
    std::size_t out_rows_ = 0;
    std::unique_ptr<Tape> tape_;
    std::vector<Place> places_;                  // of the tape
    std::unique_ptr<exponential::Steps> steps_;  // beside the tape
    // The solver where it writes on the tape.
    exact::Exact<double>* exact_ = nullptr;
    Exponential* exponential_ = nullptr;
    Trajectory out_;
};

}  // namespace dualdrive
