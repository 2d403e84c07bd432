// Which Kalman gain serves at a sample: by contact pattern, phase of the ticks, and how long ago the stretch began.
#pragma once

#include <map>
#include <memory>

#include "gains.hpp"

namespace dualdrive::innovations {

class GainSchedule {
  public:
    // Machine, record and gains must outlive it. learn: what is worked out on the way stays in `gains`, first gains included;
    // else it is forgotten, and first gains are in use where `gains` has some.
    GainSchedule(const Machine& machine, const SampledRecord& record, KalmanGains& gains, bool learn);

    // A stretch begins, at this phase.
    void begin(std::size_t phase);
    struct Scheduled {
        const KalmanGains::Set& set;
        bool steady;
    };
    // sample: counted from the first of the stretch, not less than before. Throws std::domain_error.
    Scheduled at(unsigned pattern, std::size_t sample, std::size_t phase);

  private:
    struct Pattern {
        const KalmanGains::Phased* steady = nullptr;
        const KalmanGains::First* first = nullptr;  // of the present stretch
        std::size_t piece = 0;                      // of them, at the last sample asked for
        std::unique_ptr<StateSpace> space;          // empty until asked for
        std::map<std::size_t, FirstGains> learning;
    };
    StateSpace& space(unsigned pattern);
    void find_steady(unsigned pattern);
    void find_first(unsigned pattern);
    void reach(unsigned pattern, std::size_t sample);

    const Machine& machine_;
    const SampledRecord& record_;
    KalmanGains& gains_;
    const bool learn_, early_;
    std::size_t begin_ = 0;  // phase of the present stretch's first sample
    std::map<unsigned, Pattern> patterns_;
    std::map<unsigned, KalmanGains::Phased> own_steady_;
    std::map<KalmanGains::Begin, KalmanGains::First> own_first_;
    std::unique_ptr<Flow> tangents_;  // apart from the flow of the replay, whose state it would disturb
};

}  // namespace dualdrive::innovations
