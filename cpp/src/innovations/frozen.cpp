// Sets of modes made ready: their tangents, and propagators over lengths of time.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "dense.hpp"
#include "flow.hpp"

namespace dualdrive::innovations {

namespace {

constexpr std::size_t most_lengths = 8;  // of time with propagators of their own, per set of modes
constexpr int parts_of_a_step = 256;     // lengths with propagators are apart by one, where times are off by a little
constexpr std::size_t most_near = 64;    // of these
constexpr double worth_squaring = 32.0;  // pieces of series: what the propagators of all halves take
constexpr int most_halvings = 40;        // a machine that is stiffer still is none
constexpr int worth = 12;                // times that a length is flown by a series before it gets one
constexpr double at_rest = 1e-5;         // rad/s: slower, nothing relaxes with the speed
constexpr int most_octaves = 40;
constexpr double alike = 1e-9;  // of a substep: lengths that are the same

}  // namespace

Eigen::MatrixXd Flow::widened(const Eigen::MatrixXd& rows, Eigen::Index height) const {
    Eigen::MatrixXd wide = Eigen::MatrixXd::Zero(height, n_);
    wide.topLeftCorner(rows.rows(), rows.cols()) = rows;
    return wide;
}

// What torques of unknown course do to rates and guards: they move what is free to move, and of what rests they take from what
// friction still bears.
void Flow::push(Eigen::MatrixXd& A, Eigen::MatrixXd& guards, const Modes& modes) const {
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
        const int g = layout_.group_of[static_cast<std::size_t>(bodies_[b])];
        const int element = layout_.stick_of[static_cast<std::size_t>(g)];
        const Eigen::Index column = first_disturbance() + static_cast<Eigen::Index>(b);
        const double torque = model_.ratio(bodies_[b]);
        if (layout_.locked[static_cast<std::size_t>(g)]) continue;
        if (element < 0 || modes[static_cast<std::size_t>(element)] != stick::stuck) {
            A(g, column) = torque / model_.group_inertia(g);
        } else {
            guards(element * guards_per_switch, column) = -torque;
            guards(element * guards_per_switch + 1, column) = torque;
        }
    }
}

// A contact that rings faster than samples can show is without rebound: of its phase no record tells, so that the mean of what it
// does is its rest, and one that had a phase of its own would bounce as no correction could follow. Critical damping takes it
// there, from nothing at Nyquist's frequency on to all of it at twice that. A simulation has its phase from the start.
void Flow::settle_fast_contacts(Eigen::MatrixXd& A, const Modes& modes) const {
    if (bodies_.empty()) return;
    const Eigen::MatrixXd undamped = A;
    for (const int element : contacts_) {
        if (!flank::carries(modes[static_cast<std::size_t>(element)])) continue;
        const auto [twist, frequency] = ring_of(undamped, element);
        const double share = std::clamp(frequency * record_.step() / std::numbers::pi - 1.0, 0.0, 1.0);
        if (share > 0.0) A += (2.0 * share / frequency) * undamped.col(twist) * undamped.row(twist);
    }
}

// What disturbances add to the speeds of what dry friction holds.
Eigen::MatrixXd Flow::creep(const Eigen::MatrixXd& A, const Modes& modes) const {
    Eigen::MatrixXd rates = Eigen::MatrixXd::Zero(n_, disturbance_count());
    auto column = static_cast<Eigen::Index>(bodies_.size());
    for (const int body : creeping_) {
        const int g = layout_.group_of[static_cast<std::size_t>(body)];
        const int element = layout_.stick_of[static_cast<std::size_t>(g)];
        if (element >= 0 && modes[static_cast<std::size_t>(element)] == stick::stuck)
            rates.col(column) = A.col(g) / model_.ratio(body);
        ++column;
    }
    return rates;
}

Frozen Flow::prepare(const exact::Laws<double>& laws, const Modes& modes) const {
    Frozen f;
    f.A = widened(laws.A, n_);
    f.outputs = widened(laws.outputs, laws.outputs.rows());
    f.guards = widened(laws.guards, laws.guards.rows());
    push(f.A, f.guards, modes);
    settle_fast_contacts(f.A, modes);
    f.creep = creep(f.A, modes);
    f.A.middleCols(first_disturbance(), disturbance_count()) += f.creep;
    f.modes = modes;
    find_slaved(f, laws);
    f.bound = spectral_bound(f.A);
    f.packed = packed_rows(f.A);
    f.watched = packed_rows(f.guards);
    f.shown = packed_rows(f.outputs);
    Eigen::MatrixXd differ = Eigen::MatrixXd::Zero(f.outputs.rows(), n_);  // C (e^{−A δ} − 1), to second order
    for (const Delay& d : delays_) {
        const Eigen::MatrixXd along = d.time * f.A, bent = 0.5 * product(along, along);
        f.onward.push_back(packed_rows(along + bent));
        for (const int j : d.channels) differ.row(j) = f.outputs.row(j) * (bent - along);
    }
    f.shifted = packed_rows(differ);
    return f;
}

const Step* Flow::step_of(Frozen& frozen, double length) const {
    if (std::abs(length - h_) <= alike * h_) {
        if (frozen.whole.flow.empty()) work_out(frozen.whole = Step{.length = h_}, frozen);
        return &frozen.whole;
    }
    const auto same = [&](const Step& s) { return std::abs(s.length - length) <= alike * h_; };
    auto own = std::find_if(frozen.parts.begin(), frozen.parts.end(), same);
    if (own == frozen.parts.end()) {
        if (frozen.parts.size() >= most_lengths) return nullptr;
        own = frozen.parts.insert(own, Step{.length = length});
    }
    if (own->flow.empty()) {
        if (++own->asked < worth) return nullptr;
        work_out(*own, frozen);
    }
    return &*own;
}

// Of the nearest whole number of parts of a substep: records whose times are off by a little have a length of their own from
// every sample to the next.
const Step* Flow::near_step(Frozen& frozen, double length) const {
    const int count = static_cast<int>(std::lround(length / h_ * parts_of_a_step));
    const auto own = frozen.grid.find(count);
    if (own == frozen.grid.end() && frozen.grid.size() >= most_near) return nullptr;
    Step& step = own == frozen.grid.end() ? frozen.grid[count] : own->second;
    if (step.flow.empty()) {
        if (++step.asked < worth) return nullptr;
        work_out(step = Step{.length = h_ * count / parts_of_a_step}, frozen);
    }
    return &step;
}

// With the outputs, and the guards of affine laws, where it leads.
std::vector<double> Flow::seen(const Eigen::MatrixXd& flow, const Frozen& frozen) const {
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(step_rows_, flow.cols());
    all.topRows(n_) = flow;
    all.middleRows(n_, outputs_) = product(frozen.outputs, flow);
    if (affine_) all.middleRows(n_ + outputs_, frozen.guards.rows()) = product(frozen.guards, flow);
    return {all.data(), all.data() + all.size()};
}

const std::vector<Step>& Flow::halved(Frozen& frozen, double length) const {
    if (!affine_ || !frozen.halves.empty()) return frozen.halves;
    frozen.pieces += std::floor(frozen.bound * length / longest_series);
    if (!(frozen.pieces >= worth_squaring)) return frozen.halves;
    const int times = 1 + std::min(std::ilogb(frozen.bound * h_ / longest_series), most_halvings);
    for (const Eigen::MatrixXd& flow : exponentials_of_halves(frozen.A, h_, times))
        frozen.halves.push_back(
            {.length = std::ldexp(h_, -static_cast<int>(frozen.halves.size())), .flow = seen(flow, frozen)});
    return frozen.halves;
}

void Flow::work_out(Step& step, const Frozen& frozen) const {
    if (affine_) {
        step.flow = seen(exponential(frozen.A, step.length), frozen);
        return;
    }
    const Exponentials e = exponentials(frozen.A, step.length);
    const auto d = static_cast<Eigen::Index>(driven_.size());
    Eigen::MatrixXd flow(n_, n_ + 3 * d);
    flow.leftCols(n_) = e.flow;
    for (Eigen::Index k = 0; k < d; ++k) {
        const auto row = static_cast<Eigen::Index>(driven_[static_cast<std::size_t>(k)]);
        flow.col(n_ + k) = e.phi1.col(row);
        flow.col(n_ + d + k) = e.phi2.col(row);
        flow.col(n_ + 2 * d + k) = e.phi3.col(row);
    }
    step.flow = seen(flow, frozen);
}

std::vector<int> Flow::octaves() const {
    std::vector<int> found;
    for (const int g : relaxing_) {
        const double speed = std::abs(y_[static_cast<std::size_t>(g)]);
        found.push_back(speed > at_rest ? 1 + std::min(std::ilogb(speed / at_rest), most_octaves) : 0);
    }
    return found;
}

Eigen::VectorXd Flow::touching() const {
    Eigen::VectorXd y = Eigen::Map<const Eigen::VectorXd>(y_.data(), n_);
    for (std::size_t k = 0; k < relaxing_.size(); ++k)
        if (octaves_[k] > 0)
            y(relaxing_[k]) = std::copysign(std::ldexp(std::sqrt(2.0) * at_rest, octaves_[k] - 1), y(relaxing_[k]));
    return y;
}

Frozen& Flow::frozen() {
    octaves_ = octaves();
    auto& known = known_[{modes_, octaves_}];
    if (!known) known = std::make_unique<Frozen>(prepared());
    return *known;
}

Frozen Flow::prepared() {
    const Eigen::VectorXd z = touching();
    const auto laws = affine_ ? reader_.read(modes_) : reader_.tangent(modes_, cell_.low, z.data());
    Frozen own = prepare(laws, modes_);
    if (!affine_)
        own.felt =
            felt(scope_ == Scope::whole ? laws : reader_.tangent(modes_, cell_.low, z.data(), Scope::plant), modes_);
    own.rings = rings_of(own, modes_);
    own.pattern = pattern_of(modes_);
    own.contacts = contacts_of(modes_);
    return own;
}

}  // namespace dualdrive::innovations
