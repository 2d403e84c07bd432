#include "flow.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "../simulation/affine.hpp"
#include "../simulation/instant.hpp"
#include "../simulation/mode_rules.hpp"
#include "../solvers/exact/kernels.hpp"
#include "riccati.hpp"

namespace dualdrive::innovations {

namespace {

// Switches within one sample that are located; what chatters faster than that slides on in its last mode till the sample
// ends, where the record has its say.
constexpr int most_switches = 12;
constexpr int most_settlings = 8;
constexpr int most_secants = 8;
constexpr int most_terms = 80;
constexpr double found = 1e-9;  // of the step: a switch is located

std::vector<int> signals_of(const Layout& layout, const SampledRecord& record) {
    std::vector<int> signals;
    for (const auto& c : record.channels()) {
        const int s = layout.signal(c.name);
        if (s < 0) throw std::invalid_argument("predict: the machine has no signal " + c.name);
        signals.push_back(s);
    }
    return signals;
}

std::vector<int> bodies_of(const Machine& machine, const std::vector<std::string>& names) {
    std::vector<int> bodies;
    for (const auto& name : names) {
        bodies.push_back(machine.body(name));
        if (bodies.back() < 0) throw std::invalid_argument("kalman_gains: no body " + name);
    }
    return bodies;
}

}  // namespace

// Past values of the delayed signals, one a substep, with straight lines between them.
class Flow::Memory final : public Past<double> {
  public:
    Memory(const Layout& layout, const Machine& machine, double step) : layout_(layout), step_(step) {
        double longest = 0.0;
        for (const auto& d : layout.delays) longest = std::max(longest, machine.values()[d.slot]);
        keep_ = static_cast<std::size_t>(longest / step) + 4;
        lines_.resize(layout.delays.size());
    }
    void append(double t, const Model<double>& model) {
        if (!times_.empty() && t <= times_.back()) {  // the present sample, corrected
            times_.pop_back();
            for (auto& line : lines_) line.pop_back();
        }
        times_.push_back(t);
        for (std::size_t d = 0; d < lines_.size(); ++d)
            lines_[d].push_back(model.signals()[static_cast<std::size_t>(layout_.delays[d].source)]);
        for (; times_.size() > keep_; times_.pop_front())
            for (auto& line : lines_) line.pop_front();
    }
    double at(int line, const double& t, const Cell&) const override {
        const auto& values = lines_[static_cast<std::size_t>(line)];
        if (times_.empty()) return 0.0;
        if (t <= times_.front() || times_.size() == 1) return t <= times_.front() ? values.front() : values.back();
        auto after = std::lower_bound(times_.begin(), times_.end(), t);
        if (after == times_.end()) --after;  // less than a step late: on along the last line
        if (after == times_.begin()) ++after;
        const auto k = static_cast<std::size_t>(after - times_.begin());
        const double x = (t - times_[k - 1]) / (times_[k] - times_[k - 1]);
        return values[k - 1] + x * (values[k] - values[k - 1]);
    }

  private:
    const Layout& layout_;
    double step_;
    std::size_t keep_;
    std::deque<double> times_;
    std::vector<std::deque<double>> lines_;
};

Flow::Flow(const Machine& machine, const SampledRecord& record, int substeps, const std::vector<std::string>& bodies)
    : machine_(machine),
      record_(record),
      layout_(machine, record.inputs()),
      model_(machine, record.inputs(), layout_),
      recorded_(signals_of(layout_, record)),
      reader_(machine, record.inputs(), layout_, record.generator(), recorded_),
      affine_(!effect_that_is_not_affine(machine) && layout_.delays.empty()),
      bodies_(bodies_of(machine, bodies)),
      n_(reader_.size() + static_cast<int>(bodies_.size())),
      outputs_(static_cast<int>(recorded_.size())),
      substeps_(affine_ ? 1 : std::max(1, substeps)),
      h_(record.step() / substeps_) {
    for (std::size_t e = 0; e < layout_.switches.size(); ++e)
        if (layout_.switches[e].kind == SwitchKind::flank) contacts_.push_back(static_cast<int>(e));
    for (std::size_t e = 0; e < layout_.switches.size(); ++e)
        if (layout_.switches[e].kind == SwitchKind::stick) sticks_.push_back(static_cast<int>(e));
    const auto n = static_cast<std::size_t>(exact::padded(n_));
    for (auto* v : {&y_, &trial_, &n0_, &n1_, &slope_}) v->assign(n, 0.0);
    scratch_.assign(2 * n, 0.0);
    for (auto* g : {&g0_, &g1_}) g->assign(guard_count(), 1.0);
    out_.assign(static_cast<std::size_t>(exact::padded(n_ + outputs_ + static_cast<int>(guard_count()))), 0.0);
    y_[static_cast<std::size_t>(reader_.one())] = 1.0;
    modes_.assign(layout_.switches.size(), 0);
    for (std::size_t e = 0; e < modes_.size(); ++e)
        if (layout_.switches[e].kind == SwitchKind::branch) modes_[e] = branch::positive;
}

Flow::~Flow() = default;

unsigned Flow::pattern_of(const Modes& modes) const {
    unsigned pattern = 0;
    for (std::size_t c = 0; c < contacts_.size(); ++c)
        if (flank::carries(modes[static_cast<std::size_t>(contacts_[c])])) pattern |= 1u << c;
    return pattern;
}

Frozen Flow::prepare(const exact::Laws<double>& laws, const Modes& modes) const {
    const auto widened = [&](const Eigen::MatrixXd& rows, Eigen::Index height) {
        Eigen::MatrixXd wide = Eigen::MatrixXd::Zero(height, n_);
        wide.topLeftCorner(rows.rows(), rows.cols()) = rows;
        return wide;
    };
    Frozen f;
    f.A = widened(laws.A, n_);
    f.outputs = widened(laws.outputs, laws.outputs.rows());
    f.guards = widened(laws.guards, laws.guards.rows());
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
        const int g = layout_.group_of[static_cast<std::size_t>(bodies_[b])];
        const int element = layout_.stick_of[static_cast<std::size_t>(g)];
        const bool rests = element >= 0 && modes[static_cast<std::size_t>(element)] == stick::stuck;
        if (!layout_.locked[static_cast<std::size_t>(g)] && !rests)
            f.A(g, first_torque() + static_cast<Eigen::Index>(b)) = model_.ratio(bodies_[b]) / model_.group_inertia(g);
    }
    f.bound = spectral_bound(f.A);
    const int padded = exact::padded(n_);
    f.packed.assign(static_cast<std::size_t>(padded * n_), 0.0);
    Eigen::Map<Eigen::MatrixXd>(f.packed.data(), padded, n_).topRows(n_) = f.A;
    const Exponentials e = exponentials(f.A, h_);
    f.phi1 = e.phi1;
    f.phi2 = e.phi2;
    f.rows = static_cast<int>(out_.size());
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(f.rows, n_);
    all.topRows(n_) = e.flow;
    all.middleRows(n_, outputs_) = f.outputs * e.flow;
    all.middleRows(n_ + outputs_, f.guards.rows()) = f.guards * e.flow;
    f.step.assign(all.data(), all.data() + all.size());
    return f;
}

Frozen& Flow::frozen() {
    auto& known = known_[modes_];
    if (!known) {
        known = std::make_unique<Frozen>(
            prepare(affine_ ? reader_.read(modes_) : reader_.tangent(modes_, cell_.low, y_.data()), modes_));
        known->pattern = pattern_of(modes_);
    }
    return *known;
}

Frozen Flow::tangent(unsigned pattern, double speed) {
    Modes modes(layout_.switches.size(), 0);
    std::vector<double> z(static_cast<std::size_t>(states()), 0.0);
    for (std::size_t e = 0; e < modes.size(); ++e) {
        const Switch& s = layout_.switches[e];
        if (s.kind == SwitchKind::stick) modes[e] = stick::forward;
        if (s.kind == SwitchKind::branch) modes[e] = branch::positive;
    }
    for (int g = 0; g < layout_.groups; ++g) z[static_cast<std::size_t>(g)] = speed;
    for (std::size_t c = 0; c < contacts_.size(); ++c)
        if (pattern >> c & 1u) {
            const auto e = static_cast<std::size_t>(contacts_[c]);
            const auto connection = static_cast<std::size_t>(layout_.switches[e].index);
            modes[e] = flank::front;
            const auto p =
                read_component<Connection<double>>(machine_.values().data() + machine_.connections()[connection].first);
            z[static_cast<std::size_t>(layout_.twist[connection])] = 1.5 * p.gap + 1e-4;
        }
    model_.evaluate(0.0, z.data(), {modes.data(), cell_, nullptr, nullptr});
    Frozen f = prepare(affine_ ? reader_.read(modes) : reader_.tangent(modes, 0.0, z.data()), modes);
    f.pattern = pattern;
    return f;
}

double Flow::signal(std::size_t channel) const {
    return now_->outputs.row(static_cast<Eigen::Index>(channel)).dot(Eigen::Map<const Eigen::VectorXd>(y_.data(), n_));
}

void Flow::evaluate(double t, const double* z) {
    model_.evaluate(t, z, {modes_.data(), cell_, memory_.get(), nullptr});
}

void Flow::start(const std::map<std::string, double>& initial) {
    std::fill(y_.begin(), y_.end(), 0.0);
    y_[static_cast<std::size_t>(reader_.one())] = 1.0;
    for (const auto& [name, value] : initial) {
        const int k = layout_.state(name);
        if (k < 0) throw std::invalid_argument("predict: no state " + name);
        y_[static_cast<std::size_t>(k)] = value;
    }
    const double t = record_.times().front();
    cell_ = {t, record_.times()[1]};
    modes_.assign(layout_.switches.size(), 0);
    for (std::size_t e = 0; e < modes_.size(); ++e)
        if (layout_.switches[e].kind == SwitchKind::branch) modes_[e] = branch::positive;
    memory_.reset();
    std::copy_n(record_.generator_states(0), record_.generator().size(), y_.data() + states());
    for (int pass = 0; pass < most_settlings; ++pass) {
        bool changed = false;
        for (std::size_t e = 0; e < modes_.size(); ++e) {
            evaluate(t, y_.data());
            const Mode m = standing_mode(layout_, model_, y_.data(), static_cast<int>(e), modes_[e]);
            changed = changed || m != modes_[e];
            modes_[e] = m;
        }
        if (!changed) break;
    }
    evaluate(t, y_.data());
    for (std::size_t m = 0; m < layout_.encoder_history.size(); ++m)
        for (int k = 0; k < machine_.controller().speed_samples; ++k)
            y_[static_cast<std::size_t>(layout_.encoder_history[m] + k)] = model_.signals()[static_cast<std::size_t>(
                layout_.at.angle[static_cast<std::size_t>(machine_.motors()[m].body)])];
    if (!layout_.delays.empty()) memory_ = std::make_unique<Memory>(layout_, machine_, h_);
    ticks_.assign(layout_.clocks.size(), 0);
    put_out_.assign(layout_.clocks.size(), 0);
    now_ = &frozen();
    tick(t);
}

double Flow::next_tick(double t) const {
    double next = std::numeric_limits<double>::infinity();
    const double begin = record_.times().front();
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c) {
        const Clock& k = layout_.clocks[c];
        next = std::min(next, begin + static_cast<double>(ticks_[c]) * k.period);
        if (k.latency > 0 && put_out_[c] < ticks_[c])
            next = std::min(next, begin + static_cast<double>(put_out_[c]) * k.period + k.latency);
    }
    return std::max(next, t);
}

void Flow::tick(double t) {
    const double begin = record_.times().front(), now_or_past = t + instant(t);
    std::vector<double> next(static_cast<std::size_t>(states()));
    const auto jump = [&](const auto& apply) {
        evaluate(t, y_.data());
        std::copy_n(y_.data(), states(), next.data());
        apply();
        std::copy_n(next.data(), states(), y_.data());
    };
    bool any = false;
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c) {
        const Clock& k = layout_.clocks[c];
        if (k.latency > 0 && put_out_[c] < ticks_[c] &&
            begin + static_cast<double>(put_out_[c]) * k.period + k.latency <= now_or_past) {
            jump([&] { model_.put_out(k, y_.data(), next.data()); });
            ++put_out_[c];
            any = true;
        }
    }
    for (std::size_t c = 0; c < layout_.clocks.size(); ++c) {
        const Clock& k = layout_.clocks[c];
        if (begin + static_cast<double>(ticks_[c]) * k.period <= now_or_past) {
            jump([&] { model_.tick(k, next.data()); });
            ++ticks_[c];
            any = true;
        }
    }
    if (any && now_) {
        all_guards(t, y_.data(), g0_.data());
        for (std::size_t k = 0; k < g0_.size(); ++k)
            if (g0_[k] < 0 && layout_.switches[k / guards_per_switch].kind == SwitchKind::limiter) {
                evaluate(t, y_.data());
                const auto e = k / guards_per_switch;
                modes_[e] = standing_mode(layout_, model_, y_.data(), static_cast<int>(e), modes_[e]);
                now_ = &frozen();
            }
    }
}

// What the laws add to the tangent at (t, y): the rates less A y.
void Flow::remainder(double t, const double* y, double* n) {
    evaluate(t, y);
    const auto rows = states();
    Eigen::Map<Eigen::VectorXd> rest(n, n_);
    const auto known = first_torque();
    rest = -(now_->A.leftCols(known) * Eigen::Map<const Eigen::VectorXd>(y, known));
    for (int k = 0; k < rows; ++k) n[k] += model_.rate()[static_cast<std::size_t>(k)];
    for (int k = rows; k < n_; ++k) n[k] = 0.0;
}

// to = y after `length` of ẏ = A y + n0 + slope s/length, as a Taylor series of as many terms as the spectral radius asks for.
void Flow::propagate(const double* from, const double* n0, const double* slope, double length, double* to) {
    const double theta = now_->bound * std::abs(length);
    int order = 2;
    for (double term = theta; order < most_terms && (term > 1e-16 || order < theta); ++order) term *= theta / order;
    const int rows = exact::padded(n_);
    if (!n0 && !slope) {
        std::copy_n(from, n_, to);
        return exact::kernels().taylor(rows, n_, now_->packed.data(), length, order, to, scratch_.data());
    }
    double *term = scratch_.data(), *next = term + rows;
    std::copy_n(from, n_, to);
    std::copy_n(from, n_, term);
    for (int k = 1; k <= order; ++k) {
        exact::kernels().multiply(rows, n_, now_->packed.data(), n_, term, 1, next);
        if (n0 && k == 1)
            for (int i = 0; i < n_; ++i) next[i] += n0[i];
        if (slope && k == 2)
            for (int i = 0; i < n_; ++i) next[i] += slope[i];
        for (int i = 0; i < n_; ++i) to[i] += next[i] *= length / k;
        std::swap(term, next);
    }
}

bool Flow::all_guards(double t, const double* y, double* g) {
    if (affine_) {
        Eigen::Map<Eigen::VectorXd>(g, now_->guards.rows()) = now_->guards * Eigen::Map<const Eigen::VectorXd>(y, n_);
        return true;
    }
    evaluate(t, y);
    model_.guards(g, nullptr);
    return true;
}

void Flow::switch_element(double t, int element, int which) {
    const auto e = static_cast<std::size_t>(element);
    const Switch& s = layout_.switches[e];
    const Mode from = modes_[e];
    evaluate(t, y_.data());
    if (s.kind == SwitchKind::limiter) {
        const Block<double>& b = model_.block(s.index);
        const bool integrates = layout_.blocks[static_cast<std::size_t>(s.index)].integrator >= 0;
        if (from == limiter::linear) {
            const int side = which == 0 ? 1 : -1;
            modes_[e] = integrates ? saturated_mode(b, side) : static_cast<Mode>(side);
        } else if (which == 1) {
            const int side = limiter::side(from);
            modes_[e] = static_cast<Mode>(limiter::integrates(from) ? side : 2 * side);
        } else {
            modes_[e] = limiter::linear;
        }
    } else {
        modes_[e] = mode_after(layout_, model_, element, which, from);
    }
    if (s.kind == SwitchKind::stick) y_[static_cast<std::size_t>(s.index)] = 0.0;
    if (modes_[e] != from) ++switches_;
    now_ = &frozen();
}

// From t on, y by y: straight on if nothing falls, else to the first switch, and on from there.
bool Flow::through_switches(double t, double length) {
    double left = length;
    for (int count = 0; left > 0.0; ++count) {
        const double *n0 = nullptr, *slope = nullptr;
        if (!affine_) {
            remainder(t, y_.data(), n0_.data());
            propagate(y_.data(), n0_.data(), nullptr, left, trial_.data());
            remainder(t + left, trial_.data(), n1_.data());
            for (int k = 0; k < n_; ++k)
                slope_[static_cast<std::size_t>(k)] =
                    n1_[static_cast<std::size_t>(k)] - n0_[static_cast<std::size_t>(k)];
            n0 = n0_.data();
            slope = slope_.data();
        }
        // the remainder's slope belongs to the whole of `left`: a part of it gets its share
        const auto part = [&](double fraction, double* to) {
            if (!slope) return propagate(y_.data(), n0, nullptr, fraction * left, to);
            std::vector<double> share(slope_);
            for (double& x : share) x *= fraction;
            propagate(y_.data(), n0, share.data(), fraction * left, to);
        };
        part(1.0, trial_.data());
        if (!std::isfinite(trial_[0])) return false;
        int fallen = -1;
        double fraction = 1.0;
        if (count < most_switches) {
            all_guards(t, y_.data(), g0_.data());
            all_guards(t + left, trial_.data(), g1_.data());
            for (std::size_t k = 0; k < g1_.size(); ++k) {
                if (!(g1_[k] < 0.0)) continue;
                const double at = g0_[k] > 0.0 ? g0_[k] / (g0_[k] - g1_[k]) : 0.0;
                if (fallen < 0 || at < fraction) {
                    fraction = at;
                    fallen = static_cast<int>(k);
                }
            }
        }
        if (fallen < 0) {
            std::copy_n(trial_.data(), n_, y_.data());
            return true;
        }
        const auto f = static_cast<std::size_t>(fallen);
        double low = 0.0, high = 1.0, at_low = std::max(g0_[f], 0.0), at_high = g1_[f];
        std::vector<double> g(g1_.size());
        for (int k = 0; k < most_secants && fraction > 0.0 && high - low > found; ++k) {  // Illinois
            part(fraction, trial_.data());
            all_guards(t + fraction * left, trial_.data(), g.data());
            if (std::abs(g[f]) <= 1e-12 * (std::abs(g0_[f]) + std::abs(g1_[f]))) break;
            if (g[f] > 0.0) {
                low = fraction;
                at_low = g[f];
                at_high /= 2;
            } else {
                high = fraction;
                at_high = g[f];
                at_low /= 2;
            }
            fraction = low + (high - low) * at_low / (at_low - at_high);
        }
        part(fraction, trial_.data());
        std::copy_n(trial_.data(), n_, y_.data());
        t += fraction * left;
        left *= 1.0 - fraction;
        switch_element(t, fallen / guards_per_switch, fallen % guards_per_switch);
    }
    return true;
}

bool Flow::advance(double t, double length) {
    const bool whole = std::abs(length - h_) <= 1e-9 * h_;
    at_end_ = false;
    if (!whole) return through_switches(t, length);
    const auto step = [&](const double* y) {
        exact::kernels().multiply(now_->rows, n_, now_->step.data(), n_, y, 1, out_.data());
    };
    step(y_.data());
    if (!affine_) {
        remainder(t, y_.data(), n0_.data());
        Eigen::Map<Eigen::VectorXd> end(out_.data(), n_);
        const Eigen::Map<const Eigen::VectorXd> first(n0_.data(), n_), last(n1_.data(), n_);
        end += now_->phi1 * first;
        remainder(t + length, out_.data(), n1_.data());
        model_.guards(g1_.data(), nullptr);
        end += now_->phi2 * (last - first);
        const auto fell = std::any_of(g1_.begin(), g1_.end(), [](double g) { return g < 0.0; });
        if (fell) return through_switches(t, length);
        std::copy_n(out_.data(), n_, y_.data());
        return std::isfinite(y_[0]);
    }
    const double* g = out_.data() + n_ + outputs_;
    const auto count = guard_count();
    bool fell = false;
    for (std::size_t k = 0; k < count; ++k) fell = fell || g[k] < 0.0;
    if (fell) return through_switches(t, length);
    std::copy_n(out_.data(), n_, y_.data());
    at_end_ = true;
    return std::isfinite(y_[0]);
}

bool Flow::flow(std::size_t sample) {
    const double begin = record_.times()[sample], end = record_.times()[sample + 1];
    cell_ = {begin, end};
    std::copy_n(record_.generator_states(sample), record_.generator().size(), y_.data() + states());
    double t = begin;
    at_end_ = false;
    while (t < end - instant(end)) {
        if (memory_) {
            evaluate(t, y_.data());
            memory_->append(t, model_);
        }
        const double stop = std::min(end, next_tick(t));
        if (stop > t + instant(t)) {
            const double left = stop - t, length = left > 1.5 * h_ ? h_ : left;
            if (!advance(t, length)) return false;
            t = length == left ? stop : t + length;
        }
        if (!layout_.clocks.empty() && next_tick(t) <= t + instant(t)) {
            tick(t);
            at_end_ = false;
        }
    }
    return true;
}

// A body at rest that a correction has set moving: friction brings it back to rest, within the sample if it can, and what
// it has travelled till then goes into the state; else it slides.
void Flow::stop_or_slide(double t, int element) {
    const auto e = static_cast<std::size_t>(element);
    const auto g = static_cast<std::size_t>(layout_.switches[e].index);
    const double v = y_[g];
    const Mode way = v > 0 ? stick::forward : stick::backward;
    evaluate(t, y_.data());
    const double brake =
        model_.friction_limit(static_cast<int>(g), way) - way * model_.group_torque(static_cast<int>(g));
    const double rest = brake > 0 ? std::abs(v) * model_.group_inertia(static_cast<int>(g)) / brake
                                  : std::numeric_limits<double>::infinity();
    if (rest < record_.step()) {
        modes_[e] = way;
        const Eigen::VectorXd column = frozen().A.col(static_cast<Eigen::Index>(g));
        for (int k = layout_.groups; k < states(); ++k) y_[static_cast<std::size_t>(k)] += column(k) * 0.5 * v * rest;
        y_[g] = 0.0;
        modes_[e] = stick::stuck;
    } else {
        modes_[e] = way;
    }
}

void Flow::outputs(double* out) const {
    if (at_end_) {
        std::copy_n(out_.data() + n_, outputs_, out);
    } else {
        Eigen::Map<Eigen::VectorXd>(out, outputs_) = now_->outputs * Eigen::Map<const Eigen::VectorXd>(y_.data(), n_);
    }
}

std::size_t Flow::resting(int element) const {
    return static_cast<std::size_t>(layout_.switches[static_cast<std::size_t>(element)].index);
}

void Flow::correct(std::size_t sample, const Eigen::MatrixXd& K, const double* e, const double* moved, bool steady) {
    for (int i = 0; i < states(); ++i) y_[static_cast<std::size_t>(i)] += moved[i];
    for (const int element : sticks_)  // friction holds what rests
        if (modes_[static_cast<std::size_t>(element)] == stick::stuck) y_[resting(element)] = 0.0;
    const auto count = guard_count();
    if (steady && at_end_ && affine_) {
        auto& gain = now_->guard_gain;
        if (gain.empty()) {
            gain.resize(count * static_cast<std::size_t>(outputs_));
            Eigen::MatrixXd own = K.topRows(states());
            for (const int element : sticks_)
                if (modes_[static_cast<std::size_t>(element)] == stick::stuck)
                    own.row(static_cast<Eigen::Index>(resting(element))).setZero();
            Eigen::Map<Eigen::MatrixXd>(gain.data(), static_cast<Eigen::Index>(count), outputs_) =
                now_->guards.leftCols(states()) * own;
        }
        double* g = out_.data() + n_ + outputs_;
        for (int j = 0; j < outputs_; ++j)
            for (std::size_t k = 0; k < count; ++k) g[k] += gain[static_cast<std::size_t>(j) * count + k] * e[j];
        bool holds = true;
        for (std::size_t k = 0; k < count; ++k) holds = holds && !(g[k] < 0.0);
        if (!holds) settle(sample);
        return;
    }
    all_guards(record_.times()[sample], y_.data(), g0_.data());
    if (std::any_of(g0_.begin(), g0_.end(), [](double g) { return g < 0.0; })) settle(sample);
}

void Flow::settle(std::size_t sample) {
    const double t = record_.times()[sample];
    for (int pass = 0; pass < most_settlings; ++pass) {
        const Modes before = modes_;
        for (std::size_t e = 0; e < modes_.size(); ++e) {
            const Switch& s = layout_.switches[e];
            if (s.kind == SwitchKind::stick) {
                const double v = y_[static_cast<std::size_t>(s.index)];
                if (v == 0.0 && modes_[e] == stick::stuck) {
                    evaluate(t, y_.data());
                    modes_[e] = standing_mode(layout_, model_, y_.data(), static_cast<int>(e), modes_[e]);
                } else if (modes_[e] == stick::stuck || modes_[e] * v < 0) {
                    modes_[e] = stick::stuck;
                    stop_or_slide(t, static_cast<int>(e));
                }
                continue;
            }
            evaluate(t, y_.data());
            if (s.kind == SwitchKind::limiter && modes_[e] != limiter::linear &&
                model_.guard(static_cast<int>(e), 0, nullptr) >= 0 &&
                model_.guard(static_cast<int>(e), 1, nullptr) >= 0)
                continue;  // saturated and content
            const bool parted = s.kind == SwitchKind::flank && !flank::carries(modes_[e]) && modes_[e] != flank::gap;
            if (parted && model_.guard(static_cast<int>(e), 0, nullptr) >= 0 &&
                model_.guard(static_cast<int>(e), 1, nullptr) >= 0)
                continue;
            modes_[e] = standing_mode(layout_, model_, y_.data(), static_cast<int>(e), modes_[e]);
        }
        if (modes_ == before) break;
        ++switches_;
    }
    now_ = &frozen();
}

}  // namespace dualdrive::innovations
