// The flow of a machine between samples: exact where it is affine in its modes, an exponential multistep method of order 3
// where a law is not (multistep.cpp), every switch located within the sample.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "../solvers/exact/laws.hpp"
#include "delay_memory.hpp"
#include "dualdrive/innovations.hpp"
#include "dualdrive/layout.hpp"
#include "dualdrive/model.hpp"

namespace dualdrive::innovations {

// A length of time for which a set of modes has its propagator: a substep, or what lies between ticks and samples.
struct Step {
    double length = 0.0;  // s
    int asked = 0;        // how often, until it is worked out
    // [e^{A h}; C e^{A h}; G e^{A h}], column-major, padded rows; empty until then. Where a law is not affine
    // [e^{A h}, h φ₁, h φ₂, h φ₃; C times that], of φ the columns of driven rows
    std::vector<double> flow = {};
};

// A contact that rings faster than a step is long: its guard g, ġ and g̈ along the tangent, and its angular frequency.
struct Ring {
    std::vector<double> rows;  // of g, ġ, g̈, one after the other
    double frequency = 0.0;    // rad/s
};

// A sample with the ticks of sampled loops in it, as one step: the lifted system of a sampled-data loop (Chen, Francis, Optimal
// Sampled-Data Control Systems, 1995, ch. 8).
struct Lifted {
    // What must not fall on the way, a row each: a guard before a tick, a limit at one.
    struct Check {
        int felt;     // which of the guards that feel laws; −1: none
        double when;  // within the step, of its length
    };
    // When the first ones come, of a sample, and how many before its end.
    struct Due {
        double tick = 1.0, output = 1.0;
        long ticks = 0, outputs = 0;
    };
    Step step;  // to its end, before the ticks there; checks below
    std::vector<Check> checks;
    std::vector<Due> due;  // per clock
};

// The integrator of a limiter that rides, as a row of y: what keeps the block's unlimited value on the limit.
struct Slaved {
    Eigen::Index state;
    Eigen::RowVectorXd row;
};

// Times the spectral radius: the length that a Taylor series serves; beyond, its terms cancel.
constexpr double longest_series = 16.0;

// One set of modes, prepared. y = (states, generator of the inputs, 1, disturbances).
struct Frozen {
    Eigen::MatrixXd A, outputs, guards;
    Eigen::MatrixXd creep;  // of A, what disturbances add to the speed of what rests
    std::vector<double> packed, watched, shown,
        shifted;                              // A, guards, outputs, and what late ones differ by: padded rows
    std::vector<std::vector<double>> onward;  // e^{A δ} − 1 of every delay δ, likewise
    std::vector<double> felt;                 // rates and guards that laws act on: of the tangent; likewise
    double bound = 0.0;                       // on the spectral radius of A, 1/s
    std::vector<Slaved> slaved;               // of limiters that ride
    std::vector<Ring> rings;                  // of its contacts
    Step whole;                               // a substep
    std::vector<Step> parts;                  // most_lengths at most
    std::map<int, Step> grid;                 // by whole parts of a substep: see Flow::near_step
    std::vector<Step> halves;                 // of a substep, each half as long as the one before: see Flow::halved
    double pieces = 0.0;                      // of series that these would have spared
    unsigned contacts = 0;                    // bit c: connection c carries
    Modes modes;
    Modes pattern;  // what its tangent depends on: see Flow::pattern_of
    // Per clock, its tick where no limit is met, and by how much none is (exact::Reader::tick); packed. Empty until worth it.
    std::vector<Eigen::MatrixXd> ticks;
    std::vector<std::vector<double>> ticking;
    int ticked = 0;
    std::vector<Lifted> lifted;  // by phase
};

// Whether any guard has fallen.
inline bool any_negative(const double* g, std::size_t count) {
    bool any = false;
    for (std::size_t k = 0; k < count; ++k) any |= g[k] < 0.0;
    return any;
}

// Whether signals of the past come back into a machine that are no states of it.
inline bool keeps_past(const Layout& layout) {
    return std::any_of(layout.delays.begin(), layout.delays.end(), [](const DelayLine& d) { return d.state < 0; });
}

class Flow final {
  public:
    // How a channel shows.
    struct Output {
        double late = 0.0;  // how much earlier than the state it is, s: less than a sample
        // by how much a step of integration may bend it
        double tolerance = std::numeric_limits<double>::infinity();
    };
    // Machine and record must outlive the flow. noise: on which bodies torques of unknown course act, and which may creep.
    // outputs: per channel; empty: they are as above.
    Flow(const Machine& machine, const SampledRecord& record, int substeps, const NoiseModel& noise,
         std::vector<Output> outputs = {});
    ~Flow();

    const Layout& layout() const { return layout_; }
    bool affine() const { return affine_; }
    int states() const { return layout_.size(); }
    Frozen& now() { return *now_; }
    const Modes& modes() const { return modes_; }
    double* y() { return y_.data(); }
    const double* y() const { return y_.data(); }
    // Torques of unknown course, one a body, then speeds of creep, and where they stand in y. What rests the torques move no more
    // than any other torque does: as far as friction lets them.
    double* disturbances() { return y_.data() + reader_.size(); }
    int disturbance_count() const { return static_cast<int>(bodies_.size() + creeping_.size()); }
    int first_disturbance() const { return reader_.size(); }
    // Outputs at a sample, whose state is not corrected yet.
    const double* outputs(std::size_t sample);
    std::size_t guard_count() const { return layout_.switches.size() * guards_per_switch; }
    long switches() const { return switches_; }

    // At the first sample of a stretch.
    void start(std::size_t sample, const std::map<std::string, double>& initial);
    // From sample k to the next one; false where numbers are lost.
    bool flow(std::size_t sample);
    // The state moved by K e at a sample; `moved` has it, and gets what late outputs make of it. Modes that no longer hold
    // there are found anew.
    // holds: friction holds what rests; else a correction may set it moving, as where a record begins in the midst of a
    // motion.
    void correct(std::size_t sample, const KalmanGains::Set& gain, const double* e, double* moved, bool holds);
    std::vector<std::string> elements() const;  // of the patterns
    Modes carrying() const;                     // all meshes carry, all slides, no limit is met
    // The tangent for gains in a pattern: what slides does so at table speed `speed`, and what rests slips under torques of
    // unknown course, as if each had moved it freely for a few samples. Whether it rests is known by the mean alone; and
    // without it no such torque could be told while a body rests.
    Frozen tangent(const Modes& pattern, double speed);
    // Samples after which the ticks of sampled loops repeat; 1 where none tick, or too many would be.
    std::size_t phases() const { return phases_; }
    std::size_t phase(std::size_t sample) const;
    // Ticks that belong at a sample, and come after it where the record's times are off: of the first sample of two, and of the
    // second.
    struct Waiting {
        bool before = false, after = false;
    };
    // e^{A h} from one sample to the next, the ticks of sampled loops in it, those at its end among them unless they wait, and
    // what integrators of riding limiters are then.
    Eigen::MatrixXd over_a_sample(Frozen& frozen, std::size_t phase, Waiting waiting);
    Eigen::MatrixXd over_a_sample(Frozen& frozen, std::size_t phase) { return over_a_sample(frozen, phase, Waiting{}); }
    // What constant rates of the states become of it.
    Eigen::MatrixXd pushed_over_a_sample(Frozen& frozen, std::size_t phase, Waiting waiting);
    bool waits(std::size_t sample) const;
    // A tick of sampled loops on the way from a sample to the next one, or a clock's outputs that waited: see `jump`.
    struct Event {
        double time;
        std::size_t event;
    };
    std::vector<Event> events_after(std::size_t sample) const;
    bool ticks() const { return !layout_.clocks.empty(); }
    double ticks_a_sample() const;  // of all clocks, on average
    // What such an event makes of rows of y, where no limit is met.
    template <class Rows>
    void jump(const Frozen& frozen, std::size_t event, Rows& rows) const;
    // The ticks of all clocks in its modes, where no limit is met.
    void know_ticks(Frozen& frozen);
    // Whether tangents over samples have all that the flow does: nothing is late, and ticks repeat soon.
    bool told_by_tangents() const { return !keeps_past(layout_) && delays_.empty() && !spread_; }
    // Of y.
    int width() const { return n_; }
    // The tangent in these modes, where all laws are affine.
    Frozen tangent_in(const Modes& modes);
    // Speeds that friction holds at 0 in these modes.
    std::vector<std::size_t> held(const Modes& modes) const;
    // What a tick does otherwise where it meets limits: states that it leaves as they were, and that it sets to a limit.
    struct Limited {
        std::vector<int> kept = {};
        std::vector<std::pair<int, double>> set = {};
    };
    // When modes changed on the way from the last sample, s, which guard had fallen (−1: a tick had), and into which; or when the
    // tick of a clock met limits.
    struct Change {
        double time;
        int guard;
        Modes modes;
        int limited_clock = -1;
        Limited limited = {};
    };
    const std::vector<Change>& changes() const { return changes_; }  // none unless `hear_changes` was asked
    void hear_changes() { heard_ = true; }
    // Rates of the states at a sample where another flow is, in its modes; of driven ones at least. The layouts are alike.
    const double* rates(std::size_t sample, const Flow& other, Scope scope);
    // A guard in these modes, at a state between this sample and the next.
    double guard(std::size_t sample, const Modes& modes, const double* y, int guard);
    const std::vector<int>& driven() const { return driven_; }
    Scope scope() const { return scope_; }

  private:
    Frozen prepare(const exact::Laws<double>& laws, const Modes& modes) const;
    // The propagator over a length of time, null while that length has not come often enough to be worth one.
    const Step* step_of(Frozen& frozen, double length) const;
    const Step* near_step(Frozen& frozen, double length) const;
    void work_out(Step& step, const Frozen& frozen) const;
    std::vector<double> seen(const Eigen::MatrixXd& flow, const Frozen& frozen) const;
    // Propagators over a substep and its halves, down to what a series serves; empty while they are not worth their squarings, and
    // where laws are not affine.
    const std::vector<Step>& halved(Frozen& frozen, double length) const;
    Frozen& frozen();
    Frozen prepared();  // in the present modes, about the present state
    // Octaves of the speeds of bodies where a law's memory relaxes as fast as the body turns: LuGre's bristles by σ0 |ω|/g, far
    // stiffer than a sample. Within an octave of where the tangent touches, what it leaves of such a rate is less than the rate
    // itself, and exponential integrators bear that (Hochbruck & Ostermann, Acta Numerica 19, 2010, §2.1).
    std::vector<int> octaves() const;
    // Where the tangent of these modes touches: the state, those speeds amid their octaves.
    Eigen::VectorXd touching() const;
    void evaluate(double t, const double* y, Scope scope = Scope::whole);
    void remainder(double t, const double* y, double* n);
    void enter(std::size_t sample);  // the inputs from a sample on
    bool advance(double t, double length);
    std::pair<int, double> ring_of(const Eigen::MatrixXd& A, int element) const;
    void settle_fast_contacts(Eigen::MatrixXd& A, const Modes& modes) const;
    std::vector<Ring> rings_of(const Frozen& frozen, const Modes& modes) const;
    int pieces_for(double length) const;
    std::vector<int> driven_rows() const;
    std::vector<int> watching_guards() const;
    std::vector<double> felt(const exact::Laws<double>& laws, const Modes& modes) const;
    Eigen::MatrixXd widened(const Eigen::MatrixXd& rows, Eigen::Index height) const;
    void push(Eigen::MatrixXd& A, Eigen::MatrixXd& guards, const Modes& modes) const;
    Eigen::MatrixXd creep(const Eigen::MatrixXd& A, const Modes& modes) const;
    std::vector<int> felt_states() const;
    void feel(double t, const double* y);
    void feel_correction(double t, const double* before);
    void guards_near(double t, const double* y, double* g);
    enum class Flown { done, bent, fallen };
    Flown fly(double t, const Step& step, const std::vector<Lifted::Check>& checks);
    bool integrate(double t, const Step& step);
    bool leap(std::size_t sample);
    void go_a_little(double length);
    bool nearly(double t, double length, const Step& step);
    bool halves(double t, double length);
    void begin_step(double t, double length);
    void bend(const Step& step);
    double bending() const;
    void lengthen();
    std::size_t resting(int element) const;  // the speed that a friction holds
    void straight(double t, double piece, bool known);
    bool through_switches(double t, double length, bool felt = false);
    double leap_to_switch(double most, bool watched);
    double guard_along(double t, double length, int guard, double fraction);
    std::pair<int, double> first_fallen(int besides) const;
    double crossing(double t, double length, int guard, double guess, double end);
    void expand(const double* y, const double* n0, const double* slope, double length);
    void at(double fraction, double* y) const;
    void all_guards(double t, const double* y, double* g);
    // y as it was before the loops ticked at a sample, if they did: along it the signals came there.
    const double* arriving(std::size_t sample) const;
    void carry_on(const KalmanGains::Set& gain, const double* e, double* moved);
    void switch_element(double t, int element, int which);
    bool rides(int element) const;
    void find_slaved(Frozen& frozen, const exact::Laws<double>& laws) const;
    const double* block_rates(double t, const double* y, int held = -1);
    double model_guard(double t, const double* y, int guard);
    Eigen::Vector2d riding_guards(int element, const double* rates) const;
    void write_riding_guards(double t, const double* y, double* g);
    void slave(double t);
    static void slave(const Frozen& frozen, Eigen::MatrixXd& flow);
    Mode limiter_mode_after(double t, int element, int which);
    void wind_clocks(double t);
    std::size_t common_period() const;
    std::vector<std::pair<double, std::size_t>> events(std::size_t phase) const;
    Eigen::MatrixXd spread_over_a_sample(Frozen& frozen);
    bool ticks_are_affine() const { return affine_ || scope_ == Scope::plant; }
    std::vector<std::pair<double, std::size_t>> events(std::size_t phase, Waiting waiting) const;
    void note_limits(double t, std::size_t clock);
    Lifted lift(Frozen& frozen, std::size_t phase);
    const Lifted* lifted(Frozen& frozen, std::size_t phase);
    bool comes_as(const Lifted& own, double begin, double end) const;
    bool tick_by_map(std::size_t clock);
    void tick(double t);
    void tick_if_due(std::size_t sample, double t);
    double next_tick(double t) const;
    void settle(std::size_t sample);
    void stop_or_slide(double t, int element);
    unsigned contacts_of(const Modes& modes) const;
    // Modes whose tangents are alike as one: a mesh carries or not, a body rests or slides, a limit is met or not, whichever
    // way.
    Modes pattern_of(const Modes& modes) const;

    // A delay of outputs, s, and the channels that have it.
    struct Delay {
        double time;
        std::vector<int> channels;
    };

    const Machine& machine_;
    const SampledRecord& record_;
    const Layout layout_;
    Model<double> model_;
    std::vector<int> recorded_;
    exact::Reader<double> reader_;
    const bool affine_;
    const Scope scope_;                         // of what laws that are not affine are felt by
    const std::vector<int> driven_;             // rates on which they act
    const std::vector<int> watching_;           // guards that feel them
    const std::vector<int> feeling_;            // states that they feel
    const std::vector<int> bodies_, creeping_;  // on which torques of unknown course act; which may creep
    const int n_;                               // of y
    int outputs_, substeps_, order_ = 0, step_rows_ = 0;
    double h_;                                       // substep
    std::vector<int> contacts_, sticks_, limiters_;  // elements: flanks; bodies with dry friction; limits
    Modes modes_;
    std::map<std::pair<Modes, std::vector<int>>, std::unique_ptr<Frozen>> known_;  // by modes and octaves
    std::vector<int> relaxing_;  // groups on which a law's memory relaxes
    std::vector<int> octaves_;   // of their speeds, for which now_ was prepared
    Frozen* now_ = nullptr;
    std::vector<Delay> delays_;
    std::vector<double> y_;  // behind it n, what laws add to the tangent's driven rates, and its change over a step
    std::vector<double> pushing_;      // torques of unknown course, on all bodies
    std::vector<double> felt_;         // n and what they add to its guards, where they were felt last
    const Frozen* rest_of_ = nullptr;  // whose tangent n belongs to; null: it is not known at the present state
    const Frozen* along_ = nullptr;    // likewise its change, over a step of this length, s
    double along_length_ = 0.0;
    double before_ = 0.0;         // ρ, the step before over the present one
    int finer_ = 0;               // halvings of a substep that steps of laws took last
    double most_bent_ = 0.0;      // of what they may, over the present sample
    std::vector<double> slopes_;  // by how much the laws' own slopes along these states differ from the tangent's
    const Frozen* slopes_of_ = nullptr;               // likewise
    int slopes_serve_ = 0;                            // corrections for which they serve
    std::unique_ptr<Model<Gradient>> along_the_way_;  // of rates of blocks; null until asked for
    std::vector<Gradient> z_along_;
    std::vector<double> block_rates_, rates_;
    std::vector<Output> shows_;
    std::vector<double> falling_;  // a guard's share in each term of a series
    std::vector<double> out_, terms_, trial_, n0_, n1_, slope_, bend_, shift_, g0_, g1_, shown_, earlier_;
    std::vector<double> arriving_;           // y before the ticks at a sample
    std::vector<double> rest_;               // what guards felt at the beginning of a step
    std::vector<double> departed_, little_;  // y where a step began; terms of a short series
    std::vector<double> ticked_;             // states after a tick, and how far limits are
    bool heard_ = false;                     // whether changes are asked for
    std::vector<Change> changes_;
    double ticked_at_ = -1.0;  // s
    Cell cell_;
    std::vector<long> ticks_, put_out_;
    std::size_t phases_ = 1;
    bool spread_ = false;  // ticks do not repeat soon: their gains are those of ticks spread over time
    std::unique_ptr<DelayMemory> memory_;
    long switches_ = 0;
    bool at_end_ = false;  // out_ holds outputs of the present state: no tick came after the last step
};

template <class Rows>
void Flow::jump(const Frozen& frozen, std::size_t event, Rows& rows) const {
    if (event >= layout_.clocks.size()) {
        rows.topRows(states()) = (frozen.ticks[event - layout_.clocks.size()].topRows(states()) * rows).eval();
        return;
    }
    for (const BlockPlace& place : layout_.blocks)
        if (place.loop == layout_.clocks[event].loop && place.pending >= 0)
            rows.row(place.held) = rows.row(place.pending);
}

}  // namespace dualdrive::innovations
