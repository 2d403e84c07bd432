// Moves from rest to rest: profiles of constant jerk, and cycles of them.
#include <algorithm>
#include <utility>

#include "dualdrive/motion.hpp"
#include "refuse.hpp"

namespace dualdrive::motion {
namespace {

struct Limits {
    double speed, acceleration, jerk;
};

void check(const char* builder, const Limits& limits) {
    require_positive(builder, "speed", limits.speed);
    require_positive(builder, "acceleration", limits.acceleration);
    if (!(limits.jerk > 0.0))
        refuse(builder, ": jerk = ", limits.jerk, " must be positive, or infinite for a trapezoid of speed");
}

// How long a move of one distance takes, phase by phase. It speeds up and slows down alike: T_j with rising, then
// with constant, then T_j with falling acceleration, T_a in all.
struct Timing {
    double jerking;       // T_j
    double accelerating;  // T_a
    double cruising;      // T_v
    double acceleration;  // reached
    double speed;         // reached
};

// h = v (T_a + T_v) with v = a (T_a − T_j) and a = j T_j, each of v and a at its limit or below it.
Timing timing_of(double h, const Limits& limits) {
    const auto [v, a, j] = limits;
    const bool reaches_acceleration = v / a >= a / j;  // on the way to full speed
    const double to_speed_jerking = reaches_acceleration ? a / j : std::sqrt(v / j);
    const double to_speed = to_speed_jerking + (reaches_acceleration ? v / a : to_speed_jerking);
    if (h / v >= to_speed)
        return {to_speed_jerking, to_speed, h / v - to_speed, reaches_acceleration ? a : j * to_speed_jerking, v};

    // Too short for full speed, T_v = 0: h = a (T_a − T_j) T_a.
    const double full = a / j;
    const double t_a = 0.5 * (full + std::sqrt(full * full + 4.0 * h / a));
    if (reaches_acceleration && t_a >= 2.0 * full) return {full, t_a, 0.0, a, a * (t_a - full)};

    // Too short for full acceleration as well, T_a = 2 T_j: h = 2 j T_j³.
    const double t_j = std::cbrt(0.5 * h / j);
    return {t_j, 2.0 * t_j, 0.0, j * t_j, j * t_j * t_j};
}

// One phase of a move. `at` and `position` count from the start of the move.
struct Phase {
    double duration, at, position, speed, acceleration, jerk;
};

struct Phases {
    std::array<Phase, 7> list;
    double duration;
};

// The ends of the phases come from closed forms, not from the phase before, so that rounding does not add up.
Phases phases_of(double way, const Limits& limits) {
    const double direction = way < 0.0 ? -1.0 : 1.0;
    const Timing m = timing_of(std::abs(way), limits);
    const double t_j = m.jerking, t_a = m.accelerating, cruise = m.cruising;
    const double flat = std::max(0.0, t_a - 2.0 * t_j);
    const double j = std::isfinite(limits.jerk) ? direction * limits.jerk : 0.0;
    const double a = direction * m.acceleration, v = direction * m.speed;
    const double bend = 0.5 * j * t_j * t_j;  // speed gained while the first jerk acts, and way covered
    const double rise = j * t_j * t_j * t_j / 6.0;
    const double half = 0.5 * v * t_a;  // way covered while speeding up
    return {{{
                {t_j, 0.0, 0.0, 0.0, 0.0, j},
                {flat, t_j, rise, bend, a, 0.0},
                {t_j, t_j + flat, half - v * t_j + rise, v - bend, a, -j},
                {cruise, t_a, half, v, 0.0, 0.0},
                {t_j, t_a + cruise, way - half, v, 0.0, -j},
                {flat, t_a + cruise + t_j, way - half + v * t_j - rise, v - bend, -a, 0.0},
                {t_j, t_a + cruise + t_j + flat, way - rise, bend, -a, j},
            }},
            2.0 * t_a + cruise};
}

// A signal written down piece by piece from left to right.
class Path {
  public:
    Path(double start, double from) : time_(start), position_(from), pieces_{Polynomial{from}} { rest(); }

    double time() const { return time_; }

    void move_to(double target, const Limits& limits);
    void wait(double duration) {
        time_ += duration;
        rest();
    }
    Waveform waveform(bool smooth) && {
        return smooth ? Waveform(std::move(knots_), pieces_, std::vector<double>{})
                      : Waveform(std::move(knots_), pieces_);
    }

  private:
    // A piece too short to be told from nothing at this time is replaced by the one after it.
    void begin(const Polynomial& piece) {
        if (knots_.empty() || time_ > knots_.back()) {
            knots_.push_back(time_);
            pieces_.push_back(piece);
        } else {
            pieces_.back() = piece;
        }
    }
    void rest() { begin({position_}); }

    double time_, position_;
    std::vector<double> knots_;
    std::vector<Polynomial> pieces_;
};

void Path::move_to(double target, const Limits& limits) {
    const Phases phases = phases_of(target - position_, limits);
    const double begun = time_;
    for (const Phase& p : phases.list) {
        if (p.duration == 0.0) continue;
        time_ = begun + p.at;
        begin({position_ + p.position, p.speed, 0.5 * p.acceleration, p.jerk / 6.0});
    }
    time_ = begun + phases.duration;
    position_ = target;
    rest();
}

struct Cycle {
    const std::vector<double>& targets;
    Limits limits;
    double dwell, start;
    int repeats;
    double from;
};

void check(const char* builder, const Cycle& cycle) {
    constexpr std::size_t most_moves = 1000000;
    if (cycle.targets.empty()) refuse(builder, ": targets is empty: at least one is needed");
    require_finite_list(builder, "targets", cycle.targets);
    check(builder, cycle.limits);
    require_finite(builder, "dwell", cycle.dwell);
    if (cycle.dwell < 0.0) refuse(builder, ": dwell = ", cycle.dwell, " must not be negative");
    require_finite(builder, "start", cycle.start);
    require_finite(builder, "from", cycle.from);
    if (cycle.repeats < 1) refuse(builder, ": repeats = ", cycle.repeats, " must be at least 1");
    if (static_cast<std::size_t>(cycle.repeats) > most_moves / cycle.targets.size())
        refuse(builder, ": repeats = ", cycle.repeats, " of ", cycle.targets.size(), " targets is more than ",
               most_moves, " moves");
}

Path path_of(const Cycle& cycle, std::vector<Dwell>& dwells) {
    check("cycle_of_moves", cycle);
    Path path(cycle.start, cycle.from);
    for (int round = 0; round < cycle.repeats; ++round)
        for (const double target : cycle.targets) {
            path.move_to(target, cycle.limits);
            const double arrived = path.time();
            path.wait(cycle.dwell);
            dwells.push_back({target, arrived, path.time()});
        }
    return path;
}

}  // namespace

Waveform jerk_limited_move(double distance, double speed, double acceleration, double jerk, double start, double from) {
    constexpr const char* builder = "jerk_limited_move";
    const Limits limits{speed, acceleration, jerk};
    require_finite(builder, "distance", distance);
    check(builder, limits);
    require_finite(builder, "start", start);
    require_finite(builder, "from", from);
    Path path(start, from);
    path.move_to(from + distance, limits);
    return std::move(path).waveform(std::isfinite(jerk));
}

Waveform cycle_of_moves(const std::vector<double>& targets, double speed, double acceleration, double jerk,
                        double dwell, double start, int repeats, double from) {
    std::vector<Dwell> dwells;
    return path_of({targets, {speed, acceleration, jerk}, dwell, start, repeats, from}, dwells)
        .waveform(std::isfinite(jerk));
}

std::vector<Dwell> dwells_of_cycle(const std::vector<double>& targets, double speed, double acceleration, double jerk,
                                   double dwell, double start, int repeats, double from) {
    std::vector<Dwell> dwells;
    path_of({targets, {speed, acceleration, jerk}, dwell, start, repeats, from}, dwells);
    return dwells;
}

std::vector<double> bidirectional_targets(const std::vector<double>& positions, double overrun) {
    constexpr const char* builder = "bidirectional_targets";
    if (positions.size() < 2) refuse(builder, ": ", positions.size(), " positions: at least two are needed");
    require_increasing(builder, "positions", positions);
    require_positive(builder, "overrun", overrun);
    std::vector<double> targets{positions.front() - overrun};
    targets.insert(targets.end(), positions.begin(), positions.end());
    targets.push_back(positions.back() + overrun);
    targets.insert(targets.end(), positions.rbegin(), positions.rend());
    return targets;
}

}  // namespace dualdrive::motion
