// Switches of a flow: located within a sample, and what a correction at a sample does to the modes.
#include <algorithm>
#include <cmath>
#include <limits>

#include "../simulation/mode_rules.hpp"
#include "../solvers/exact/kernels.hpp"
#include "flow.hpp"

namespace dualdrive::innovations {

namespace {

// Switches of a way that are located. Under corrections what chatters faster slides on in its last mode till the sample ends, where
// the record has its say; a simulation that did would gain energy.
constexpr int most_switches = 12, most_of_simulation = 1000;
constexpr int most_passes = 8;  // over the modes, until they stand
constexpr int most_secants = 40, most_halvings = 12;
constexpr int most_pieces = 1000;  // of a way, each as long as one series serves: beyond, the machine is none
constexpr int most_parts = 500;    // of a step, for a contact that rings: an end of all rings
constexpr double found = 1e-9;     // of the step: a switch is located
constexpr double most_turn = 0.5;  // rad, of a contact's ring over a step: between its ends hardly more opens

}  // namespace

// The twist of a contact, and how fast it rings about it, rad/s; 0 where it does not.
std::pair<int, double> Flow::ring_of(const Eigen::MatrixXd& A, int element) const {
    const Switch& s = layout_.switches[static_cast<std::size_t>(element)];
    const int twist = layout_.twist[static_cast<std::size_t>(s.index)];
    const double squared = -A.row(twist).head(states()).dot(A.col(twist).head(states()));
    return {twist, std::sqrt(std::max(squared, 0.0))};
}

// Contacts whose ring goes through more than a part of its turn in a step: their guards may fall and rise again within. Only of
// a simulation, which has its state from nowhere else: under torques of unknown course such a contact is one without rebound,
// since a rebound that is shorter than a sample is none that a correction could follow.
std::vector<Ring> Flow::rings_of(const Frozen& frozen, const Modes& modes) const {
    std::vector<Ring> rings;
    if (!bodies_.empty()) return rings;
    for (const int element : contacts_) {
        const auto e = static_cast<std::size_t>(element);
        if (!flank::carries(modes[e])) continue;
        const double frequency = ring_of(frozen.A, element).second;
        if (!(frequency > most_turn / h_)) continue;
        for (int which = 0; which < guards_per_switch; ++which) {
            const Eigen::RowVectorXd g = frozen.guards.row(element * guards_per_switch + which);
            if (g.head(states()).isZero(0)) continue;
            const Eigen::RowVectorXd rate = g * frozen.A, second = rate * frozen.A;
            Ring ring;
            ring.frequency = frequency;
            for (const auto* row : {&g, &rate, &second}) ring.rows.insert(ring.rows.end(), row->begin(), row->end());
            rings.push_back(std::move(ring));
        }
    }
    return rings;
}

// Into how many pieces a step goes so that no contact opens and closes again within one unseen; 1 where none could: its guard
// swings about g + g̈/ω² by what is there now.
int Flow::pieces_for(double length) const {
    double turn = 0.0;
    for (const Ring& ring : now_->rings) {
        const double along = ring.frequency * length;
        if (!(along > std::max(most_turn, turn))) continue;
        double g[3] = {0.0, 0.0, 0.0};
        for (int k = 0; k < 3; ++k)
            for (int j = 0; j < n_; ++j)
                g[k] += ring.rows[static_cast<std::size_t>(k * n_ + j)] * y_[static_cast<std::size_t>(j)];
        const double off = g[2] / (ring.frequency * ring.frequency);
        if (g[0] + off < std::hypot(off, g[1] / ring.frequency)) turn = along;
    }
    return turn > 0.0 ? static_cast<int>(std::min(std::ceil(turn / most_turn), double{most_parts})) : 1;
}

void Flow::all_guards(double t, const double* y, double* g) {
    if (affine_) {
        const int rows = exact::padded(static_cast<int>(guard_count()));
        return exact::kernels().multiply(rows, n_, now_->watched.data(), n_, y, 1, g);
    }
    evaluate(t, y);
    model_.guards(g, nullptr);
    if (!now_->slaved.empty()) write_riding_guards(t, y, g);
}

void Flow::switch_element(double t, int element, int which) {
    const auto e = static_cast<std::size_t>(element);
    const Switch& s = layout_.switches[e];
    const Mode from = modes_[e];
    if (s.kind == SwitchKind::limiter) {
        if (rides(element)) slave(t);  // its integrator goes on from where the ride has led it
        modes_[e] = limiter_mode_after(t, element, which);
    } else {
        evaluate(t, y_.data());
        modes_[e] = mode_after(layout_, model_, element, which, from);
    }
    if (s.kind == SwitchKind::stick) y_[static_cast<std::size_t>(s.index)] = 0.0;
    if (modes_[e] != from) {
        ++switches_;
        if (heard_) changes_.push_back({t, element * guards_per_switch + which, modes_});
    }
    now_ = &frozen();
}

// A guard along the series from t on, at a fraction of its length: where laws are affine a polynomial, too.
double Flow::guard_along(double t, double length, int guard, double fraction) {
    if (affine_) {
        double g = 0.0;
        for (int k = order_; k >= 0; --k) g = falling_[static_cast<std::size_t>(k)] + fraction * g;
        return g;
    }
    at(fraction, trial_.data());
    evaluate(t + fraction * length, trial_.data());
    return model_guard(t + fraction * length, trial_.data(), guard);
}

// The guard that falls first besides one, as straight lines from g0_ to g1_ would, and where on that way; −1: none has fallen.
std::pair<int, double> Flow::first_fallen(int besides) const {
    std::pair<int, double> first{-1, 1.0};
    for (int k = 0; k < static_cast<int>(guard_count()); ++k) {
        const auto g = static_cast<std::size_t>(k);
        if (!(g1_[g] < 0.0) || k == besides) continue;
        const double at = g0_[g] > 0.0 ? g0_[g] / (g0_[g] - g1_[g]) : 0.0;
        if (first.first < 0 || at < first.second) first = {k, at};
    }
    return first;
}

// Where a guard falls through zero along the series, before an end where it has (g1_); both in fractions of its length. By the
// Illinois rule: an end of the interval that stays twice weighs half (Dowell & Jarratt, BIT 11, 1971).
double Flow::crossing(double t, double length, int guard, double guess, double end) {
    const auto f = static_cast<std::size_t>(guard);
    const Eigen::Map<const Eigen::MatrixXd> terms(terms_.data(), exact::padded(n_), order_ + 1);
    Eigen::Map<Eigen::RowVectorXd>(falling_.data(), order_ + 1) = now_->guards.row(guard) * terms.topRows(n_);
    const double rounding = 1e-12 * (std::abs(g0_[f]) + std::abs(g1_[f]));
    double low = 0.0, high = end, at_low = g0_[f], at_high = g1_[f], fraction = guess;
    // of what has just switched it begins at zero, below or above by rounding, and may rise first
    for (int k = 1; !(at_low > rounding) && k <= most_halvings; ++k)
        at_low = guard_along(t, length, guard, low = std::ldexp(end, -k));
    if (!(at_low > rounding)) return 0.0;
    if (low > 0.0) fraction = low + (high - low) * at_low / (at_low - at_high);
    int moved = 0;  // which end did: −1 the lower one, 1 the upper one
    for (int k = 0; k < most_secants && high - low > found; ++k) {
        const double g = guard_along(t, length, guard, fraction);
        if (std::abs(g) <= rounding) break;
        const int moves = g > 0.0 ? -1 : 1;
        (moves < 0 ? low : high) = fraction;
        (moves < 0 ? at_low : at_high) = g;
        if (moves == moved) (moves < 0 ? at_high : at_low) /= 2;
        moved = moves;
        fraction = low + (high - low) * at_low / (at_low - at_high);
    }
    return fraction;
}

// What laws add over a piece, as a straight line: from where it was felt over a whole step already, else from where the piece
// leads without its change.
void Flow::straight(double t, double piece, bool known) {
    if (known) {
        std::fill(n0_.begin(), n0_.end(), 0.0);
        std::fill(slope_.begin(), slope_.end(), 0.0);
        for (std::size_t k = 0; k < driven_.size(); ++k) {
            const auto row = static_cast<std::size_t>(driven_[k]);
            n0_[row] = y_[static_cast<std::size_t>(n_) + k];
            slope_[row] = felt_[k] - n0_[row];
        }
        return;
    }
    remainder(t, y_.data(), n0_.data());
    expand(y_.data(), n0_.data(), nullptr, piece);
    at(1.0, trial_.data());
    remainder(t + piece, trial_.data(), n1_.data());
    for (std::size_t k = 0; k < n1_.size(); ++k) slope_[k] = n1_[k] - n0_[k];
}

// Of a stiff machine, by the longest half of a substep at whose end no guard has fallen; 0 where all hold a switch, or are
// longer than the way. A joint that creeps back within a thousandth of a sample would ask for as many series.
double Flow::leap_to_switch(double most, bool watched) {
    for (const Step& step : halved(*now_, most)) {
        if (step.length > most) continue;
        exact::kernels().multiply(step_rows_, n_, step.flow.data(), n_, y_.data(), 1, out_.data());
        if (watched && any_negative(out_.data() + n_ + outputs_, guard_count())) continue;
        std::copy_n(out_.data(), n_, y_.data());
        return step.length;
    }
    return 0.0;
}

// From t on: straight on if no guard falls, else to the first switch, and on from there.
// felt: what laws add was felt at both ends of the length already.
bool Flow::through_switches(double t, double length, bool felt) {
    const int most_located = bodies_.empty() ? most_of_simulation : most_switches;
    double left = length;
    for (int count = 0, pieces = 0; left > found * length;) {
        if (++pieces > most_pieces + most_located) return false;
        const double most = left / pieces_for(left), piece = std::min(most, longest_series / now_->bound);
        if (const double leapt = piece < most ? leap_to_switch(most, count < most_located) : 0.0; leapt > 0.0) {
            if (!std::isfinite(y_[0])) return false;
            t += leapt;
            left -= leapt;
            continue;
        }
        if (!affine_) straight(t, piece, felt && piece == length);
        expand(y_.data(), affine_ ? nullptr : n0_.data(), slope_.data(), piece);
        at(1.0, trial_.data());
        if (!std::isfinite(trial_[0])) return false;
        int fallen = -1;
        double fraction = 1.0;
        if (count < most_located) {
            all_guards(t, y_.data(), g0_.data());
            all_guards(t + piece, trial_.data(), g1_.data());
            // till none has fallen before: the lines that guess which is first are but chords
            for (std::size_t tries = 0; tries < guard_count() && fraction > 0.0; ++tries) {
                const auto [next, guess] = first_fallen(fallen);
                if (next < 0) break;
                fallen = next;
                fraction = crossing(t, piece, fallen, guess * fraction, fraction);
                at(fraction, trial_.data());
                all_guards(t + fraction * piece, trial_.data(), g1_.data());
            }
        }
        std::copy_n(trial_.data(), n_, y_.data());
        t += fraction * piece;
        left -= fraction * piece;
        felt = false;
        if (fallen >= 0) {
            switch_element(t, fallen / guards_per_switch, fallen % guards_per_switch);
            ++count;
        }
    }
    return true;
}

std::size_t Flow::resting(int element) const {
    return static_cast<std::size_t>(layout_.switches[static_cast<std::size_t>(element)].index);
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

void Flow::settle(std::size_t sample) {
    const double t = record_.times()[sample];
    bool evaluated = false;  // at the present state and modes
    const auto evaluate_once = [&] {
        if (!evaluated) evaluate(t, y_.data());
        evaluated = true;
    };
    std::vector<std::size_t> ended;  // rides: they leave a block on its limit, whose side rounding would tell
    for (int pass = 0; pass < most_passes; ++pass) {
        const Modes before = modes_;
        for (std::size_t e = 0; e < modes_.size(); ++e) {
            const Switch& s = layout_.switches[e];
            const Mode from = modes_[e];
            const auto holds = [&](int which) {
                return model_guard(t, y_.data(), static_cast<int>(e) * guards_per_switch + which) >= 0;
            };
            if (s.kind == SwitchKind::stick) {
                const double v = y_[static_cast<std::size_t>(s.index)];
                if (v == 0.0 && from == stick::stuck) {
                    evaluate_once();
                    modes_[e] = standing_mode(layout_, model_, y_.data(), static_cast<int>(e), from);
                } else if (from == stick::stuck || from * v < 0) {
                    modes_[e] = stick::stuck;
                    stop_or_slide(t, static_cast<int>(e));
                    evaluated = false;
                }
            } else if (rides(static_cast<int>(e))) {
                evaluate_once();
                if (const int fallen = !holds(0) ? 0 : !holds(1) ? 1 : -1; fallen >= 0) {
                    slave(t);
                    modes_[e] = limiter_mode_after(t, static_cast<int>(e), fallen);
                    ended.push_back(e);
                }
            } else if (std::find(ended.begin(), ended.end(), e) == ended.end()) {
                evaluate_once();
                const bool saturated = s.kind == SwitchKind::limiter && from != limiter::linear;
                const bool parted = s.kind == SwitchKind::flank && !flank::carries(from) && from != flank::gap;
                if (!(saturated || parted) || !holds(0) || !holds(1))
                    modes_[e] = standing_mode(layout_, model_, y_.data(), static_cast<int>(e), from);
            }
            evaluated = evaluated && modes_[e] == from;
        }
        if (modes_ == before) break;
        ++switches_;
    }
    now_ = &frozen();
    rest_of_ = nullptr;
}

}  // namespace dualdrive::innovations
