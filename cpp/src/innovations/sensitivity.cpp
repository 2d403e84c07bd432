#include "sensitivity.hpp"

#include <algorithm>

#include "../solvers/exact/kernels.hpp"
#include "dense.hpp"
#include "gains.hpp"

namespace dualdrive::innovations {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int at_once = 8;  // rows that the kernels take together

bool late(const std::vector<Reading>& readings) {
    return std::any_of(readings.begin(), readings.end(),
                       [](const Reading& r) { return r.shift() != 0 || r.rest() != 0.0; });
}

// Terms of series that a pattern's propagators must spare: most are met once or for long.
constexpr double worth = 200.0;
// Terms that cost what a replay does, a sample, where no loop ticks; and ticks that cost as much again.
constexpr double terms_a_replay = 0.15, ticks_a_replay = 9.0;
constexpr double few_terms = 4000.0;  // that any record is worth

double value(const std::map<std::string, double>& of, const std::string& name) {
    const auto known = of.find(name);
    return known == of.end() ? 0.0 : known->second;
}

}  // namespace

std::vector<Sensitivities::Entry> Sensitivities::differing(const MatrixXd& of, const MatrixXd& theirs) {
    std::vector<Entry> entries;
    for (Eigen::Index column = 0; column < of.cols(); ++column)
        for (Eigen::Index row = 0; row < of.rows(); ++row)
            if (theirs(row, column) != of(row, column))
                entries.push_back({static_cast<std::size_t>(row), static_cast<std::size_t>(column),
                                   theirs(row, column) - of(row, column)});
    return entries;
}

bool Sensitivities::told(const Flow& flow, const std::vector<Reading>& readings) {
    return flow.told_by_tangents() && flow.affine() && !late(readings);
}

bool Sensitivities::dear() const {
    const auto samples = static_cast<double>(record_.times().size()), seen = static_cast<double>(seen_);
    const double replay = terms_a_replay * (1.0 + flow_->ticks_a_sample() / ticks_a_replay);
    const double allowed = few_terms + replay * static_cast<double>(columns_.size()) * (seen + samples / 4);
    return lost_ || (!how_.at_any_cost && spent_ > allowed);
}

Sensitivities::Sensitivities(const Machine& machine, const SampledRecord& record, const KalmanGains& gains,
                             const std::vector<Neighbour>& neighbours, const std::vector<Reading>& own,
                             const std::vector<double>& offsets, const SensitivityOptions& how)
    : record_(record),
      gains_(gains),
      neighbours_(neighbours),
      own_(own),
      channels_(record.channels().size()),
      how_(how),
      found_(neighbours.size()) {
    flow_ = std::make_unique<Flow>(machine, record, 1, gains.noise);
    if (!told(*flow_, own)) return;
    std::vector<Column> laws;
    for (std::size_t p = 0; p < neighbours.size(); ++p) {
        const Machine& other = *neighbours[p].machine;
        Column own_column{p, std::make_unique<Flow>(other, record, 1, gains.noise), readings_of(other, record),
                          neighbours[p].offsets};
        const Flow& flow = *own_column.flow;
        if (late(own_column.readings) || !flow.told_by_tangents() ||
            (flow.ticks() && !flow.affine() && flow.scope() == Scope::whole) || flow.elements() != flow_->elements() ||
            flow.layout().state_names != flow_->layout().state_names)
            continue;
        own_column.offsets.resize(channels_, 0.0);
        for (std::size_t j = 0; j < std::min(channels_, offsets.size()); ++j) own_column.offsets[j] -= offsets[j];
        (flow.affine() ? columns_ : laws).push_back(std::move(own_column));
    }
    laws_ = laws.size();
    std::move(laws.begin(), laws.end(), std::back_inserter(columns_));
    const auto m = static_cast<int>(channels_);
    n_ = flow_->width();
    states_ = flow_->states();
    disturbances_ = flow_->disturbance_count();
    size_ = states_ + disturbances_ + m * (1 + gains.noise.of_order_two() + gains.noise.drifts());
    rows_ = (size_ + m + at_once - 1) / at_once * at_once;
    shown_ = (states_ + m + at_once - 1) / at_once * at_once;
    MatrixXd kept = MatrixXd::Zero(size_, size_);
    write_memories(gains.noise, states_, kept);
    memories_ = differing(MatrixXd::Zero(size_, size_), kept);
    const auto rows = static_cast<std::size_t>(rows_), all = columns_.size();
    y_.assign(static_cast<std::size_t>(n_) * many, 0.0);
    differing_.assign(static_cast<std::size_t>(shown_) * many * all, 0.0);
    brought_.assign(static_cast<std::size_t>(shown_) * all, 0.0);
    for (auto* v : {&x_, &next_}) v->assign(rows * all, 0.0);
    for (auto* v : {&felt_, &before_}) v->assign(static_cast<std::size_t>(states_) * laws_, 0.0);
    for (auto* v : {&rates_, &more_}) v->assign(felt_.size() * many, 0.0);
    for (auto* v : {&way_, &term_, &last_}) v->assign(static_cast<std::size_t>(exact::padded(n_)) * (all + 1), 0.0);
    e_.assign(channels_ * all, 0.0);
    apart_.assign(all, 0);
    for (Moment& moment : waiting_) moment.outputs.assign(channels_, 0.0);
    for (const Column& c : columns_) found_[c.neighbour].assign(record.times().size() * channels_, 0.0);
}

// What a propagator of y brings about of the machine's own: states and outputs.
MatrixXd Sensitivities::machine_rows(const MatrixXd& flow, const MatrixXd& outputs) const {
    MatrixXd all = MatrixXd::Zero(shown_, flow.cols());
    all.topRows(states_) = flow.topRows(states_);
    all.middleRows(states_, outputs.rows()) = product(outputs, flow);
    return all;
}

// Torques of unknown course and sensors' noise over a sample.
void Sensitivities::remember(const double* x, double* next) const {
    std::fill(next + states_, next + size_, 0.0);
    for (const Entry& e : memories_) next[e.row] += e.value * x[e.column];
}

Sensitivities::Tangent& Sensitivities::tangent(const Modes& modes) {
    const auto [at, added] = tangents_.try_emplace(modes);
    Tangent& own = at->second;
    if (!added) return own;
    own.known = flow_->tangent_in(modes);
    const Frozen& frozen = own.known;
    if (flow_->ticks()) flow_->know_ticks(own.known);
    own.ticking.resize(own.known.ticks.size());
    own.modes = modes;
    own.shown = frozen.outputs.leftCols(states_);
    own.held = flow_->held(modes);
    own.outputs = frozen.outputs;
    own.guards = frozen.guards;
    own.rates = frozen.packed;
    own.bound = frozen.bound;
    for (std::size_t c = 0; c < columns_.size(); ++c) {
        Frozen theirs = columns_[c].flow->tangent_in(modes);
        own.showing.emplace_back(theirs.outputs - frozen.outputs);
        own.shows_otherwise.push_back(!own.showing.back().isZero(0));
        MatrixXd slaving(static_cast<Eigen::Index>(frozen.slaved.size()), n_);
        for (std::size_t k = 0; k < frozen.slaved.size(); ++k)
            slaving.row(static_cast<Eigen::Index>(k)) = theirs.slaved[k].row - frozen.slaved[k].row;
        own.slaving.push_back(std::move(slaving));
        if (c >= columns_.size() - laws_) continue;
        own.differs.push_back(differing(frozen.A, theirs.A));
        own.guarding.emplace_back(theirs.guards - frozen.guards);
        if (!flow_->ticks()) continue;
        columns_[c].flow->know_ticks(theirs);
        for (std::size_t k = 0; k < own.ticking.size(); ++k)
            own.ticking[k].push_back(differing(frozen.ticks[k].topRows(states_), theirs.ticks[k].topRows(states_)));
    }
    return own;
}

// Over a sample in a pattern, null until it has come often enough to be worth it.
const Sensitivities::Propagator* Sensitivities::propagator(Tangent& own, std::size_t phase, Flow::Waiting waiting) {
    Propagator& over = own.propagators[(phase * 2 + waiting.before) * 2 + waiting.after];
    if (over.flow.size() > 0) return &over;
    over.asked += 20.0 + 3.0 * own.bound * record_.step();  // terms
    if (over.asked < worth) return nullptr;
    const MatrixXd whole = machine_rows(flow_->over_a_sample(own.known, phase, waiting), own.outputs);
    over.flow.resize(shown_, states_ + disturbances_);
    over.flow << whole.leftCols(states_), whole.middleCols(flow_->first_disturbance(), disturbances_);
    for (std::size_t c = 0; c < columns_.size() - laws_; ++c) {
        Flow& other = *columns_[c].flow;
        Frozen theirs = other.tangent_in(own.modes);
        over.apart.emplace_back(machine_rows(other.over_a_sample(theirs, phase, waiting), theirs.outputs) - whole);
    }
    if (laws_) over.pushed = machine_rows(flow_->pushed_over_a_sample(own.known, phase, waiting), own.outputs);
    return &over;
}

// Of a replay's modes; a look at the last ones first.
Sensitivities::Tangent& Sensitivities::present(const Flow& flow) {
    if (now_ && flow.modes() == modes_) return *now_;
    modes_ = flow.modes();
    return tangent(modes_);
}

void Sensitivities::begin(std::size_t stretch, std::size_t sample, const Flow& flow,
                          const std::map<std::string, double>& initial) {
    static const std::map<std::string, double> at_zero;
    flush();
    arrived_ = now_ = &present(flow);
    const auto& names = flow.layout().state_names;
    for (std::size_t c = 0; c < columns_.size(); ++c) {
        const auto& theirs = neighbours_[columns_[c].neighbour].initial;
        const auto& other = stretch < theirs.size() ? theirs[stretch] : at_zero;
        double* const x = column(x_, c);
        std::fill_n(x, rows_, 0.0);
        for (std::size_t k = 0; k < names.size(); ++k) x[k] = value(other, names[k]) - value(initial, names[k]);
        if (!flow.layout().delays.empty()) columns_[c].flow->start(sample, other);
        for (const DelayLine& line : flow.layout().delays) {  // told_by_tangents: all are states
            const auto k = static_cast<std::size_t>(line.state);
            x[k] = columns_[c].flow->y()[k] - flow.y()[k];
        }
        Eigen::Map<VectorXd>(x + size_, static_cast<Eigen::Index>(channels_)) =
            now_->shown * Eigen::Map<const VectorXd>(x, states_) +
            now_->showing[c] * Eigen::Map<const VectorXd>(flow.y(), n_);
    }
    if (laws_) feel(sample, flow);
}

// What laws add to the rates of the machine at a sample, before it is corrected.
void Sensitivities::feel(std::size_t sample, const Flow& flow) {
    const std::size_t first = columns_.size() - laws_;
    const bool whole = std::any_of(columns_.begin() + static_cast<std::ptrdiff_t>(first), columns_.end(),
                                   [](const Column& c) { return c.flow->scope() == Scope::whole; });
    // of all the same: a plant by itself turns under the control that was worked out last, each under another one then
    const Scope scope = whole ? Scope::whole : Scope::plant;
    const double* const own = flow_->rates(sample, flow, scope);
    for (std::size_t c = first; c < columns_.size(); ++c) {
        Flow& other = *columns_[c].flow;
        const double* const rates = other.rates(sample, flow, scope);
        double* const felt = felt_.data() + (c - first) * static_cast<std::size_t>(states_);
        for (const int k : other.driven()) felt[k] = rates[k] - own[k];
    }
}

void Sensitivities::correct(std::size_t sample, const double* outputs, const KalmanGains::Set& gain, bool counts) {
    if (count_ == many) flush();
    ++seen_;
    Moment& now = waiting_[count_++];
    now.sample = sample;
    now.counts = counts;
    now.arrived = arrived_;
    now.leaving = nullptr;
    now.over = nullptr;
    now.pieces.clear();
    std::copy_n(outputs, channels_, now.outputs.begin());
    now.gain.assign(gain.stacked.data(), gain.stacked.data() + gain.stacked.size());
}

void Sensitivities::depart(Flow& flow) {
    Moment& now = waiting_[count_ - 1];
    now.leaving = now_ = &present(flow);
    waiting_before_ = flow.waits(now.sample);
    std::copy_n(flow.y(), n_, y_.data() + (count_ - 1) * static_cast<std::size_t>(n_));
    std::swap(felt_, before_);
}

void Sensitivities::arrive(std::size_t sample, const Flow& flow) {
    Moment& left = waiting_[count_ - 1];
    if (flow.changes().empty())
        left.over = propagator(*now_, flow.phase(left.sample), {waiting_before_, flow.waits(sample)});
    left.changes = flow.changes();
    if (!left.over) divide(sample);
    arrived_ = left.over ? now_ : left.pieces.back().tangent;
    if (!laws_) return;
    feel(sample, flow);
    const std::size_t first = columns_.size() - laws_, at = count_ - 1, states = static_cast<std::size_t>(states_);
    for (std::size_t c = 0; c < laws_; ++c) {
        double* const amid = rates_.data() + (c * many + at) * states;
        const double *const now = felt_.data() + c * states, *const before = before_.data() + c * states;
        double* const more = more_.data() + (c * many + at) * states;
        for (std::size_t k = 0; k < states; ++k) {
            amid[k] = 0.5 * (now[k] + before[k]);
            more[k] = 0.5 * (now[k] - before[k]);
        }
        Eigen::Map<VectorXd> seen(
            differing_.data() + ((first + c) * many + at) * static_cast<std::size_t>(shown_) + states_,
            static_cast<Eigen::Index>(channels_));
        if (now_->shows_otherwise[first + c])
            seen = now_->showing[first + c] * Eigen::Map<const VectorXd>(flow.y(), n_);
        else
            seen.setZero();
    }
}

// w of all that waits, and C w.
void Sensitivities::otherwise() {
    const std::size_t affine = columns_.size() - laws_;
    const auto rows = static_cast<std::size_t>(shown_);
    std::vector<double> pushed(rows * many);
    for (std::size_t i = 0; i < count_;) {
        const Propagator* const over = waiting_[i].over;
        std::size_t end = i + 1;
        while (over && end < count_ && waiting_[end].over == over) ++end;
        const auto together = static_cast<int>(end - i);
        for (std::size_t c = 0; over && c < columns_.size(); ++c) {
            double* const to = differing_.data() + (c * many + i) * rows;
            if (c < affine) {
                exact::kernels().product(shown_, n_, over->apart[c].data(), n_,
                                         y_.data() + i * static_cast<std::size_t>(n_), together, to);
                continue;
            }
            exact::kernels().product(shown_, states_, over->pushed.data(), states_,
                                     rates_.data() + ((c - affine) * many + i) * static_cast<std::size_t>(states_),
                                     together, pushed.data());
            const Eigen::Map<const MatrixXd> laws(pushed.data(), shown_, together);
            Eigen::Map<MatrixXd> w(to, shown_, together);
            w.topRows(states_) = laws.topRows(states_);
            w.bottomRows(shown_ - states_) += laws.bottomRows(shown_ - states_);
        }
        i = end;
    }
}

// δe at a sample.
void Sensitivities::innovate(const Moment& now) {
    const double t = record_.times()[now.sample];
    const std::size_t m = channels_, sensor = static_cast<std::size_t>(states_ + disturbances_),
                      zero = static_cast<std::size_t>(size_) - m;
    const bool drifts = gains_.noise.drifts();
    for (std::size_t c = 0; c < columns_.size(); ++c) {
        const Column& own = columns_[c];
        const double *const x = column(x_, c), *const shown = x + size_;
        for (std::size_t j = 0; j < m; ++j) {
            double more = shown[j];
            if (!own.readings[j].plain() || !own_[j].plain()) {
                const double added = x[sensor + j] + (drifts ? x[zero + j] : 0.0);
                more = own.readings[j].read(t, now.outputs[j] + more - added) - own_[j].read(t, now.outputs[j]) + added;
            }
            e_[c * m + j] = -more - own.offsets[j];
        }
    }
}

void Sensitivities::flush() {
    otherwise();
    const auto all = static_cast<int>(columns_.size()), m = static_cast<int>(channels_);
    const std::size_t shown = static_cast<std::size_t>(shown_),
                      sensor = static_cast<std::size_t>(states_ + disturbances_),
                      zero = static_cast<std::size_t>(size_) - channels_;
    const bool drifts = gains_.noise.drifts();
    for (std::size_t i = 0; i < count_; ++i) {
        const Moment& now = waiting_[i];
        innovate(now);
        const std::size_t tall = now.gain.size() / channels_;
        moved_.resize(tall * columns_.size());
        exact::kernels().product(static_cast<int>(tall), m, now.gain.data(), m, e_.data(), all, moved_.data());
        for (std::size_t c = 0; c < columns_.size(); ++c) {
            const double *const r = moved_.data() + c * tall, *const moved = r + channels_;
            if (now.counts) std::copy_n(r, channels_, found_[columns_[c].neighbour].data() + now.sample * channels_);
            double* const x = column(x_, c);
            for (int k = 0; k < size_; ++k) x[k] += moved[k];
        }
        if (!now.leaving) continue;
        if (!now.arrived->known.slaved.empty()) slave(*now.arrived, i);
        for (std::size_t c = 0; c < columns_.size(); ++c)
            for (const std::size_t k : now.leaving->held) column(x_, c)[k] = 0.0;
        const bool whole = now.over;
        if (whole)
            exact::kernels().product(shown_, states_ + disturbances_, now.over->flow.data(), rows_, x_.data(), all,
                                     brought_.data());
        for (std::size_t c = 0; c < columns_.size(); ++c) {
            double* const next = column(next_, c);
            remember(column(x_, c), next);
            if (!whole) continue;
            const double *const w = differing_.data() + (c * many + i) * shown, *const own =
                                                                                    brought_.data() + c * shown;
            for (int k = 0; k < states_; ++k) next[k] = own[k] + w[k];
            for (std::size_t j = 0; j < channels_; ++j) {
                const std::size_t row = static_cast<std::size_t>(states_) + j;
                next[zero + channels_ + j] = own[row] + w[row] + next[sensor + j] + (drifts ? next[zero + j] : 0.0);
            }
        }
        if (!whole) through_changes(now, i);
        std::swap(x_, next_);
    }
    count_ = 0;
}

std::vector<std::vector<double>> Sensitivities::found() {
    flush();
    if (lost_) return std::vector<std::vector<double>>(found_.size());
    const bool rode = this->rode();
    for (std::size_t c = 0; c < columns_.size(); ++c)
        if (static_cast<double>(apart_[c]) > how_.most_apart * static_cast<double>(changes_) ||
            (rode && c >= columns_.size() - laws_ && columns_[c].flow->scope() == Scope::whole))
            found_[columns_[c].neighbour].clear();
    return std::move(found_);
}

}  // namespace dualdrive::innovations
