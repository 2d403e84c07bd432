// Exponential collocation behind the face of a solver: ẏ = A y + n(t, y) with A the tangent in the present modes and the
// inputs as states. What is linear is propagated by e^{A δ} however fast it is; the rest n is a polynomial through its
// values at nine nodes of a step. For machines whose laws are not affine, and small or smooth beside what is.
//
// A method of one step: it begins with its full order after a switch, and its solution between the nodes is that of the
// polynomial, exactly (M. Hochbruck, A. Ostermann, Appl. Numer. Math. 53 (2005) 323–339). docs/theory/exponential.md.
#pragma once

#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include "../exact/generator.hpp"
#include "../exact/laws.hpp"
#include "dualdrive/solver.hpp"
#include "sensitivities.hpp"
#include "slope_reader.hpp"
#include "steps.hpp"
#include "watch.hpp"

namespace dualdrive {

class Exponential final : public Solver {
  public:
    struct Setup {
        const Machine& machine;
        const Inputs& inputs;
        const Layout& layout;
        const Modes& modes;  // as they are whenever restart() is called
        const Cell& cell;
        double start, grid;                   // s; outputs and ticks come at start + k grid, mostly
        const std::vector<int>& recorded;     // signals
        TracedParameters::Slots parameters;   // slots that move together, per sensitivity
        std::vector<double> scale;            // typical size of each parameter
        exponential::Steps* steps = nullptr;  // to write on, for the way back
    };
    Exponential(Problem& problem, Size size, double rtol, Setup setup);

    void restart(double t, std::span<const double> atol, double quadrature_atol) override;
    void limit_step(double longest, double turning) override;
    Outcome step(double stop) override;
    double time() const override { return t_; }
    double previous_time() const override { return begin_; }
    std::span<double> state() override { return z_; }
    std::span<double> sensitivity(int k) override;
    std::span<double> quadrature() override { return work_; }
    void go_back(double t) override;
    void state_at(double t, double* z) const override;
    void sensitivity_at(double t, int k, double* s) const override;
    bool signal_slopes_at(double t, double* slopes) const override;
    void quadrature_at(double t, double* q) const override;
    std::span<const int> roots() const override { return {}; }
    int looks() const override { return static_cast<int>(exponential::intervals) - 1; }
    bool keeps_off_guards() const override { return keeps_off_; }
    bool stiff() const override { return limited_ >= stiff_after; }
    Failure failure() const override;
    Counts counts() const override {
        Counts c = counts_;
        c.guards = looks_;
        return c;
    }
    std::string name() const override { return "exponential"; }

    // Whether the present state was given, and is not the end of a step.
    bool fresh() const { return !taken_; }
    const exact::Generator& generator() const { return generator_; }

  private:
    static constexpr int stiff_after = 15;  // steps in a row, as the explicit engine has it
    using Vector = std::vector<double>;
    static constexpr std::size_t nodes = exponential::nodes, intervals = exponential::intervals;
    // What belongs to one combination of modes.
    struct Frozen {
        std::shared_ptr<exponential::Tangent> tangent;
        exponential::Watch watch;
        int held;  // steps that were kept short by sweeps
        exponential::SlopeReader::Outputs outputs;
        std::unique_ptr<exponential::SlopePropagators> slopes;  // null without sensitivities
    };
    // Forward sensitivities, if any.
    struct Forward {
        exponential::SlopeReader reader;
        exponential::Sensitivities sensitivities;
        double t;  // at which sensitivities.now() is
    };

    // One step over all nodes, tried.
    void drive_bent_rows();
    bool take_modes();
    double try_step(int level);
    bool rest_at(double t, const double* y, double* rest);
    bool evaluate(std::size_t node);
    void evaluate_unseen(std::size_t node);
    bool evaluate_nodes();
    double sensitivities_over_step();
    void bring_sensitivities() const;
    const double* sensitivities_at(double t) const;
    double begin_of_inputs() const;
    bool predict();
    double past(double places, std::size_t row) const;
    double sweep();
    double interpolation_error() const;
    double unseen_error() const;
    double work_error() const;
    double defect();
    double defect(const double* yc, double t, int level);
    double defect_of_suspects();
    double norm(const double* y) const;
    double end_before(double stop) const;
    void write_step() const;
    void write_end() const;

    // The step taken, in pieces: up to the next stretch that needs a close look for crossings, and over that.
    Outcome deliver(double stop);
    std::size_t stretches() const;
    void walk();
    void look_for_suspects();
    void look_on();
    void find_bends();
    const double* at(double t) const;

    bool knotted(double from, double to) const;
    void pass(const double* yc, int level, double t, double* y) const;
    void advance(int level, double from, double to) const;
    void advance_freely(int level, double length) const;

    double* column(std::size_t node) { return yc_.data() + node * width(); }
    const double* column(std::size_t node) const { return yc_.data() + node * width(); }
    double* point(std::size_t k) { return walked_.data() + k * width(); }
    const double* point(std::size_t k) const { return walked_.data() + k * width(); }
    double node_time(std::size_t node) const { return origin_ + static_cast<double>(node) * delta_; }
    double stride() const { return std::ldexp(setup_.grid, walk_level_); }
    exponential::Propagators& propagators() const { return now_->tangent->propagators; }
    std::size_t width() const { return static_cast<std::size_t>(propagators().width()); }
    std::size_t rows() const { return static_cast<std::size_t>(propagators().rows()); }

    Problem& problem_;
    const Size size_;
    const double rtol_;
    const Setup setup_;
    const exact::Generator generator_;
    const std::vector<int> nothing_;
    exact::Reader<double> reader_;
    const std::size_t states_, one_, guard_count_;
    std::size_t padded_ = 0;   // how many rows are driven
    std::vector<int> driven_;  // rows of y that the rest acts on, in any mode met so far
    std::map<Modes, std::unique_ptr<Frozen>> known_;
    Frozen* now_ = nullptr;
    std::unique_ptr<Forward> forward_;
    Modes modes_;  // at the last restart

    double t_ = 0.0, begin_ = 0.0;                   // now; begin of the last piece
    double origin_ = 0.0, end_ = 0.0, delta_ = 0.0;  // of the step that is being delivered; distance of its nodes
    double longest_ = std::numeric_limits<double>::infinity();
    int level_ = 0, next_level_;
    int limited_ = 0;           // steps in a row that sweeps alone kept short
    double contraction_ = 0.0;  // of a sweep at level_, as last seen
    bool taken_ = false;        // a step is being delivered
    bool finite_ = true, keeps_off_ = false, more_driven_ = false;
    Vector z_, work_, atol_, weight_;
    double quadrature_atol_ = 0.0;
    Vector yc_;           // per node y and c
    Vector rest_, past_;  // [node][driven]: now, and over the step before if no switch came since
    Vector unseen_;       // [node][driven]; empty but for a gradient by laws that the run does not show
    Vector unseen_size_;  // per state
    double past_delta_ = 0.0, past_origin_ = 0.0;
    Vector rest_terms_;                         // [node][order][driven]
    const std::size_t paths_;                   // padded
    Vector powers_, power_terms_, begin_work_;  // [node][path], [node][order][path]
    Vector guards_;                             // [node][guard]

    int walk_level_ = 0, finer_ = 0;                      // halvings that the walk needs besides
    std::size_t points_ = 0, position_ = 0, looked_ = 0;  // looked_: stretches whose guards are known
    Vector walked_, watched_, doubt_, bends_, bend_terms_;
    std::vector<std::size_t> bent_;      // watched quantities whose bend counts
    std::vector<std::size_t> suspects_;  // stretches of the walk, the last one first

    Vector rate_, linear_, before_, between_;
    mutable Vector probe_, kept_, scratch_;
    Counts counts_{};
    mutable long looks_ = 0;  // between the points of the walk; and chunks of it, which cost as much
};

}  // namespace dualdrive
