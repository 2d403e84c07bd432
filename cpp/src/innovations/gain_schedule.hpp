// Which Kalman gain serves at a sample: by the way that the modes took since the stretch began.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <tuple>

#include "sojourn.hpp"

namespace dualdrive::innovations {

class GainSchedule {
  public:
    // Machine, record and gains must outlive it. flow: of the machine. learn: what is worked out on the way stays in `gains`; else it is forgotten.
    GainSchedule(const Machine& machine, const SampledRecord& record, KalmanGains& gains, bool learn, const Flow& flow);

    // A stretch begins, its first sample of this phase.
    void begin(const Modes& modes, std::size_t phase);
    // On to the next sample, in the pattern in which the present one, of this phase, is left.
    void depart(const Modes& modes, std::size_t phase);
    // At the present sample, of this phase. Throws std::domain_error.
    const KalmanGains::Set& at(std::size_t phase);

  private:
    using Sojourn = KalmanGains::Sojourn;
    struct Place {  // of a sojourn: among those of `gains`, or own ones
        bool own;
        std::size_t index;
        auto operator<=>(const Place&) const = default;
    };
    struct Tangent {
        std::unique_ptr<StateSpace> space;            // empty until asked for
        const KalmanGains::Phased* steady = nullptr;  // likewise
        bool wanders = false;                         // there are none
    };
    // A pattern of the machine, in the elements that the gains know.
    const Modes& known(const Modes& pattern);
    StateSpace& space(const Modes& pattern);
    const KalmanGains::Phased* steady(const Modes& pattern);  // null where there are none
    const Sojourn& sojourn(const Place& place) const;
    Place more(Sojourn sojourn, bool kept);
    Place after(const Modes& pattern, std::size_t phase);
    void work_out();

    const Machine& machine_;
    const SampledRecord& record_;
    KalmanGains& gains_;
    const bool learn_;
    std::vector<std::size_t>
        where_;          // of every element that the gains know, its place in the machine's; none: `nowhere`
    Modes all_, known_;  // the machine's own pattern in which all meshes carry; the last one, as known
    bool same_;          // the gains know all elements, and no others
    Place now_ = {true, 0};
    std::size_t age_ = 0, piece_ = 0;               // of the present sample in its sojourn
    const KalmanGains::Phased* settled_ = nullptr;  // steady gains, once they serve the present sojourn
    std::deque<Sojourn> own_;
    std::map<KalmanGains::Begin, Place> own_first_;
    std::map<std::tuple<Place, std::size_t, Modes>, Place> own_exits_;
    std::map<std::size_t, Place> longer_;  // own ones that go on where one of `gains` ends
    std::map<Modes, Tangent> tangents_;
    std::map<Modes, KalmanGains::Phased> own_steady_;
    std::unique_ptr<Flow> flow_;  // apart from the flow of the replay, whose state it would disturb
};

}  // namespace dualdrive::innovations
