#include "sojourn.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace dualdrive::innovations {

namespace {

constexpr int eighths = 3;  // of every octave: a power of two of pieces
constexpr std::size_t most_pieces = 400;
constexpr double settled_gain = 1e-7;  // difference of log det S per channel: the steady gain takes over unnoticed

// A covariance on its way, before the sample `of`, and its gain once that is asked for.
struct Way {
    Eigen::MatrixXd& P;
    std::size_t& of;
    std::optional<KalmanGains::Set> known = std::nullopt;

    const KalmanGains::Set& gain(StateSpace& space) {
        if (!known) known = space.gain(P);
        return *known;
    }
};

// Sample by sample to the first phase, then whole periods at once.
void go_on(Way& way, StateSpace& space, std::size_t first_phase, std::size_t sample) {
    const std::size_t period = space.phases();
    const auto phase = [&] { return (first_phase + way.of) % period; };
    const auto one = [&] {
        space.next(way.P, way.gain(space), phase());
        way.known.reset();
        ++way.of;
    };
    while (way.of < sample && (phase() != 0 || sample - way.of == 1)) one();
    const std::size_t leap = (sample - way.of) / period * period;
    if (leap > 0) {
        way.P = space.later(way.P, leap / period);
        way.known.reset();
        way.of += leap;
    }
    while (way.of < sample) one();
}

}  // namespace

void reach(KalmanGains::Sojourn& sojourn, StateSpace& space, std::size_t sample, const KalmanGains::Phased* steady) {
    auto& pieces = sojourn.pieces;
    const std::size_t period = space.phases();
    const auto phase = [&](std::size_t k) { return (sojourn.phase + k) % period; };
    if (sojourn.P.size() == 0) sojourn.P = sojourn.begin;
    Way way{sojourn.P, sojourn.of};
    if (!pieces.empty()) way.known = pieces.back().sets[phase(sojourn.of)];  // that of P
    while (!sojourn.settled && (pieces.empty() || pieces.back().end <= sample)) {
        const std::size_t begin = pieces.empty() ? 0 : pieces.back().end;
        std::size_t length = 1, middle = begin;
        if (begin >= one_by_one) {
            length = std::max(period, std::size_t{1} << (std::ilogb(static_cast<double>(begin)) - eighths));
            middle = begin + length / 2;
            middle += (period - phase(middle)) % period;  // from there whole periods are leapt over
        }
        go_on(way, space, sojourn.phase, middle);
        auto sets = length == 1 ? KalmanGains::Phased{{way.gain(space)}} : space.gains(sojourn.P, phase(middle));
        const double own = sets[phase(middle)].log_det;
        if (steady) {
            const double away = std::abs(own - (*steady)[phase(middle)].log_det);
            sojourn.settled = away <= settled_gain * static_cast<double>(space.outputs());
        }
        // the machine's tangent may grow beyond numbers
        sojourn.settled = sojourn.settled || !std::isfinite(own) || pieces.size() >= most_pieces;
        if (std::isfinite(own)) pieces.push_back({std::move(sets), begin + length});
    }
}

Eigen::MatrixXd covariance(const KalmanGains::Sojourn& sojourn, StateSpace& space, std::size_t sample) {
    const bool later = sojourn.P.size() > 0 && sojourn.of <= sample;
    Eigen::MatrixXd P = later ? sojourn.P : sojourn.begin;
    std::size_t of = later ? sojourn.of : 0;
    Way way{P, of};
    go_on(way, space, sojourn.phase, sample);
    return P;
}

}  // namespace dualdrive::innovations
