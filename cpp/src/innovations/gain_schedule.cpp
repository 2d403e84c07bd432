#include "gain_schedule.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <utility>

namespace dualdrive::innovations {

namespace {

// Samples of a stay, from which the steady gains of its pattern are worth working out.
constexpr std::size_t long_stay = 400;
// Sojourns that are kept: some 100 kB each where they last long. What comes after is worked out again by every replay.
constexpr std::size_t most_sojourns = 2000;
constexpr std::size_t nowhere = std::numeric_limits<std::size_t>::max();

}  // namespace

GainSchedule::GainSchedule(const Machine& machine, const SampledRecord& record, KalmanGains& gains, bool learn,
                           const Flow& flow)
    : machine_(machine), record_(record), gains_(gains), learn_(learn), all_(flow.carrying()), known_(gains.carrying) {
    const auto elements = flow.elements();
    same_ = elements == gains.elements;
    if (!same_ && learn) throw std::invalid_argument("predict: only the gains' own machine can learn");
    for (const auto& name : gains.elements) {
        const auto found = std::find(elements.begin(), elements.end(), name);
        where_.push_back(found == elements.end() ? nowhere : static_cast<std::size_t>(found - elements.begin()));
    }
}

const Modes& GainSchedule::known(const Modes& pattern) {
    if (same_) return pattern;
    for (std::size_t e = 0; e < where_.size(); ++e)
        if (where_[e] != nowhere) known_[e] = pattern[where_[e]];
    return known_;
}

void GainSchedule::begin(const Modes& modes, std::size_t phase) {
    const Modes& pattern = known(modes);
    age_ = piece_ = 0;
    settled_ = nullptr;
    const KalmanGains::Begin key{pattern, phase};
    if (const auto known = gains_.first.find(key); known != gains_.first.end()) {
        now_ = {false, known->second};
    } else if (const auto own = own_first_.find(key); own != own_first_.end()) {
        now_ = own->second;
    } else {
        Sojourn first;
        first.pattern = pattern;
        first.phase = phase;
        first.begin = space(pattern).start(gains_.at_first);
        now_ = more(std::move(first), learn_);
        if (now_.own)
            own_first_[key] = now_;
        else
            gains_.first[key] = now_.index;
    }
}

void GainSchedule::depart(const Modes& modes, std::size_t phase) {
    const Modes& pattern = known(modes);
    if (pattern == sojourn(now_).pattern) {
        ++age_;
        return;
    }
    now_ = after(pattern, phase);
    age_ = piece_ = 0;
    settled_ = nullptr;
}

const KalmanGains::Set& GainSchedule::at(std::size_t phase) {
    while (!settled_) {
        const Sojourn& own = sojourn(now_);
        while (piece_ < own.pieces.size() && own.pieces[piece_].end <= age_) ++piece_;
        if (piece_ < own.pieces.size()) return own.pieces[piece_].sets[phase];
        if (!own.settled) {
            work_out();
            continue;
        }
        settled_ = steady(own.pattern);
        if (!settled_) throw std::domain_error("predict: no steady gain; a state grows that no sensor sees");
    }
    return (*settled_)[phase];
}

const KalmanGains::Sojourn& GainSchedule::sojourn(const Place& place) const {
    return place.own ? own_[place.index] : gains_.sojourns[place.index];
}

GainSchedule::Place GainSchedule::more(Sojourn sojourn, bool kept) {
    if (kept && gains_.sojourns.size() < most_sojourns) {
        gains_.sojourns.push_back(std::move(sojourn));
        return {false, gains_.sojourns.size() - 1};
    }
    own_.push_back(std::move(sojourn));
    return {true, own_.size() - 1};
}

// The sojourn that follows where the present one is left after this sample.
GainSchedule::Place GainSchedule::after(const Modes& pattern, std::size_t phase) {
    const KalmanGains::Exit* nearest = nullptr;
    const auto off = [&](const KalmanGains::Exit& e) { return e.age > age_ ? e.age - age_ : age_ - e.age; };
    for (const auto& exit : sojourn(now_).exits)
        if (exit.pattern == pattern && (!nearest || off(exit) < off(*nearest))) nearest = &exit;
    if (nearest && (!learn_ || nearest->age == age_)) return {false, nearest->next};
    const std::tuple key{now_, age_, pattern};
    if (const auto own = own_exits_.find(key); own != own_exits_.end()) return own->second;

    StateSpace &here = space(sojourn(now_).pattern), &there = space(pattern);
    Eigen::MatrixXd P = covariance(sojourn(now_), here, age_);
    Sojourn next;
    next.pattern = pattern;
    next.phase = (phase + 1) % there.phases();
    there.next(P, here.gain(P), phase);
    next.begin = std::move(P);
    const Place place = more(std::move(next), learn_ && !now_.own);
    if (place.own)
        own_exits_[key] = place;
    else
        gains_.sojourns[now_.index].exits.push_back({age_, pattern, place.index});
    return place;
}

// Gains of the present sojourn, till the present sample at least.
void GainSchedule::work_out() {
    if (!now_.own && !learn_) {
        const auto [longer, added] = longer_.try_emplace(now_.index, Place{true, own_.size()});
        if (added) own_.push_back(gains_.sojourns[now_.index]);
        now_ = longer->second;
    }
    Sojourn& own = now_.own ? own_[now_.index] : gains_.sojourns[now_.index];
    const bool lasts = own.pattern == gains_.carrying || age_ >= long_stay;
    reach(own, space(own.pattern), age_, lasts ? steady(own.pattern) : nullptr);
}

StateSpace& GainSchedule::space(const Modes& pattern) {
    Tangent& own = tangents_[pattern];
    if (!own.space) {
        if (!flow_) flow_ = std::make_unique<Flow>(machine_, record_, 1, gains_.noise);
        Modes modes = same_ ? pattern : all_;  // as the machine has it
        for (std::size_t e = 0; !same_ && e < where_.size(); ++e)
            if (where_[e] != nowhere) modes[where_[e]] = pattern[e];
        own.space = std::make_unique<StateSpace>(*flow_, record_, gains_.noise, modes, gains_.speed);
    }
    return *own.space;
}

const KalmanGains::Phased* GainSchedule::steady(const Modes& pattern) {
    Tangent& own = tangents_[pattern];
    if (own.steady || own.wanders) return own.steady;
    if (const auto known = gains_.steady.find(pattern); known != gains_.steady.end())
        return own.steady = &known->second;
    try {
        auto& more = learn_ ? gains_.steady : own_steady_;
        own.steady = &more.emplace(pattern, space(pattern).steady()).first->second;
    } catch (const std::domain_error&) {
        own.wanders = true;
    }
    return own.steady;
}

}  // namespace dualdrive::innovations
