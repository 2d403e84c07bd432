#include "gain_schedule.hpp"

namespace dualdrive::innovations {

GainSchedule::GainSchedule(const Machine& machine, const SampledRecord& record, KalmanGains& gains, bool learn)
    : machine_(machine), record_(record), gains_(gains), learn_(learn), early_(learn || !gains.first.empty()) {}

void GainSchedule::begin(std::size_t phase) {
    begin_ = phase;
    for (auto& [pattern, own] : patterns_) own.first = nullptr;
}

GainSchedule::Scheduled GainSchedule::at(unsigned pattern, std::size_t sample, std::size_t phase) {
    Pattern& own = patterns_[pattern];
    if (!own.steady) find_steady(pattern);
    if (early_) {
        if (!own.first) find_first(pattern);
        if (!own.first->settled && (own.first->pieces.empty() || own.first->pieces.back().end <= sample))
            reach(pattern, sample);
        const auto& pieces = own.first->pieces;
        while (own.piece < pieces.size() && pieces[own.piece].end <= sample) ++own.piece;
        if (own.piece < pieces.size()) return {pieces[own.piece].sets[phase], false};
    }
    return {(*own.steady)[phase], true};
}

StateSpace& GainSchedule::space(unsigned pattern) {
    Pattern& own = patterns_[pattern];
    if (!own.space) {
        if (!tangents_) {
            std::vector<std::string> bodies;
            for (const auto& [body, torque] : gains_.noise.torque) bodies.push_back(body);
            tangents_ = std::make_unique<Flow>(machine_, record_, 1, bodies);
        }
        own.space = std::make_unique<StateSpace>(*tangents_, record_, gains_.noise, pattern, gains_.speed);
    }
    return *own.space;
}

void GainSchedule::find_steady(unsigned pattern) {
    Pattern& own = patterns_[pattern];
    if (const auto known = gains_.steady.find(pattern); known != gains_.steady.end()) {
        own.steady = &known->second;
    } else {
        auto& more = learn_ ? gains_.steady : own_steady_;
        own.steady = &more.emplace(pattern, space(pattern).steady()).first->second;
    }
}

void GainSchedule::find_first(unsigned pattern) {
    Pattern& own = patterns_[pattern];
    const KalmanGains::Begin begins{pattern, begin_};
    own.piece = 0;
    if (const auto known = gains_.first.find(begins); known != gains_.first.end())
        own.first = &known->second;
    else
        own.first = learn_ ? &gains_.first[begins] : &own_first_[begins];
}

void GainSchedule::reach(unsigned pattern, std::size_t sample) {
    Pattern& own = patterns_[pattern];
    auto learning = own.learning.find(begin_);
    if (learning == own.learning.end()) {
        const KalmanGains::Begin begins{pattern, begin_};
        KalmanGains::First& kept = learn_ ? gains_.first[begins] : own_first_[begins];
        if (own.first != &kept) kept = *own.first;
        own.first = &kept;
        learning = own.learning.try_emplace(begin_, space(pattern), gains_.at_first, begin_, kept).first;
    }
    own.first = &learning->second.kept();
    learning->second.reach(sample, *own.steady);
}

}  // namespace dualdrive::innovations
