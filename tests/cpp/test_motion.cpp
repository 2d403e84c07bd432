#include <doctest/doctest.h>

#include <algorithm>
#include <numbers>
#include <random>

#include "dualdrive/motion.hpp"
#include "refusal.hpp"

using namespace dualdrive;
using namespace dualdrive::motion;

namespace {

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double pi = std::numbers::pi;

struct Move {
    double distance, speed, acceleration, jerk;
};

// Between two neighbouring knots, seen from inside.
template <class Look>
void in_every_cell(const Waveform& w, Look look) {
    const std::vector<double> knots = w.knots();
    for (std::size_t k = 0; k + 1 < knots.size(); ++k) look(Cell{knots[k], knots[k + 1]});
}

// The third derivative is constant on a cell: the slope of the acceleration.
double jerk_on(const Waveform& w, const Cell& cell) {
    return (w.acceleration(cell.high, cell) - w.acceleration(cell.low, cell)) / (cell.high - cell.low);
}

// A move is the fastest there is when at every instant one of its limits is reached.
void check_move(const Move& m, double start, double from) {
    CAPTURE(m.distance);
    CAPTURE(m.speed);
    CAPTURE(m.acceleration);
    CAPTURE(m.jerk);
    const Waveform w = jerk_limited_move(m.distance, m.speed, m.acceleration, m.jerk, start, from);
    const double size = std::abs(m.distance) + std::abs(from), duration = w.end() - start;
    CHECK(w.value(start) == from);
    CHECK(w.value(w.end()) == from + m.distance);
    CHECK(w.rate(w.end()) == 0.0);
    CHECK(w.value(start + 0.5 * duration) == doctest::Approx(from + 0.5 * m.distance).epsilon(1e-12));

    const double tick = 1e-15 * w.end();  // a knot is rounded to the clock
    double travelled = 0.0;
    in_every_cell(w, [&](const Cell& cell) {
        const double ends[] = {cell.low, 0.5 * (cell.low + cell.high), cell.high};
        double fastest = 0.0, hardest = 0.0;
        for (const double t : ends) {
            fastest = std::max(fastest, std::abs(w.rate(t, cell)));
            hardest = std::max(hardest, std::abs(w.acceleration(t, cell)));
            CHECK(w.rate(t, cell) * m.distance >= -1e-12 * m.speed * std::abs(m.distance));
        }
        const double jerk = std::abs(jerk_on(w, cell));
        CHECK(fastest <= m.speed * (1.0 + 1e-12) + m.acceleration * tick);
        CHECK(hardest <= m.acceleration * (1.0 + 1e-12) + m.jerk * tick);
        const double rounding = 1e-14 * m.acceleration / (cell.high - cell.low);
        CHECK(jerk <= m.jerk * (1.0 + 1e-9) + rounding);
        const bool cruising = std::abs(w.rate(ends[1], cell)) >= m.speed * (1.0 - 1e-9) && hardest == 0.0;
        const bool full = std::abs(w.acceleration(ends[1], cell)) >= m.acceleration * (1.0 - 1e-9);
        const bool bending = std::abs(jerk - m.jerk) <= 1e-6 * m.jerk + rounding;
        CHECK((cruising || full || bending));
        travelled += w.value(cell.high, cell) - w.value(cell.low, cell);
    });
    CHECK(std::abs(travelled - m.distance) <= 1e-12 * size);
}

void check_smooth(const Waveform& w, double rounding) {
    CHECK(w.breaks().empty());
    for (const double t : w.knots()) {
        const Cell before{t - 1e-3, t}, after{t, t + 1e-3};
        CHECK(std::abs(w.value(t, before) - w.value(t, after)) <= rounding);
        CHECK(std::abs(w.rate(t, before) - w.rate(t, after)) <= rounding);
        CHECK(std::abs(w.acceleration(t, before) - w.acceleration(t, after)) <= rounding);
    }
}

void check_derivatives(const Waveform& w, double from, double to, double tolerance) {
    const double h = 1e-5;
    for (int k = 0; k < 200; ++k) {
        const double t = from + (to - from) * (k + 0.37) / 200.0;
        CHECK(std::abs((w.value(t + h) - w.value(t - h)) / (2.0 * h) - w.rate(t)) <= tolerance);
        CHECK(std::abs((w.rate(t + h) - w.rate(t - h)) / (2.0 * h) - w.acceleration(t)) <= tolerance);
    }
}

}  // namespace

TEST_CASE("a move lasts as the textbook says") {
    const auto duration = [](double h, double v, double a, double j) { return jerk_limited_move(h, v, a, j).end(); };
    // All seven phases: h/v + v/a + a/j.
    CHECK(duration(1.0, 0.5, 1.0, 10.0) == doctest::Approx(2.6).epsilon(1e-14));
    // Full speed, never full acceleration: h/v + 2 √(v/j).
    CHECK(duration(1.0, 0.4, 1.0, 0.9) == doctest::Approx(2.5 + 4.0 / 3.0).epsilon(1e-14));
    // Full acceleration, never full speed: T_a = (a/j + √((a/j)² + 4h/a)) / 2, twice.
    CHECK(duration(0.8, 10.0, 1.0, 2.0) == doctest::Approx(0.5 + std::sqrt(0.25 + 3.2)).epsilon(1e-14));
    // Neither: 4 (h/2j)^⅓.
    CHECK(duration(0.016, 10.0, 10.0, 1.0) == doctest::Approx(0.8).epsilon(1e-14));
    // Trapezoid and triangle of speed.
    CHECK(duration(1.0, 0.5, 1.0, inf) == doctest::Approx(2.5).epsilon(1e-14));
    CHECK(duration(0.04, 0.5, 1.0, inf) == doctest::Approx(0.4).epsilon(1e-14));
    CHECK(duration(-1.0, 0.5, 1.0, 10.0) == doctest::Approx(2.6).epsilon(1e-14));
    CHECK(duration(0.0, 0.5, 1.0, 10.0) == 0.0);
    // Where two cases meet: full speed and full acceleration are just touched.
    CHECK(duration(2.0, 1.0, 1.0, 1.0) == doctest::Approx(4.0).epsilon(1e-14));
}

TEST_CASE("a move ends at its target, keeps its limits and wastes no time") {
    check_move({0.04, 0.05, 0.03, 0.06}, 2.0, 0.0);  // the heavy table
    check_move({-0.04, 0.05, 0.03, 0.06}, 2.0, 0.7);
    check_move({1.0, 0.5, 1.0, 10.0}, 0.0, 0.0);
    check_move({1.0, 0.4, 1.0, 0.9}, 0.0, 0.0);
    check_move({0.8, 10.0, 1.0, 2.0}, 0.0, 0.0);
    check_move({0.016, 10.0, 10.0, 1.0}, 0.0, 0.0);
    check_move({2.0, 1.0, 1.0, 1.0}, 0.0, 0.0);
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> decade(-2.0, 2.0);
    for (int k = 0; k < 300; ++k) {
        const auto any = [&] { return std::pow(10.0, decade(random)); };
        check_move({(k % 2 ? -1.0 : 1.0) * any(), any(), any(), any()}, 0.0, 0.0);
    }
}

TEST_CASE("a jerk-limited move is smooth, a trapezoid breaks where its acceleration jumps") {
    const Waveform smooth = jerk_limited_move(0.04, 0.05, 0.03, 0.06, 2.0);
    check_smooth(smooth, 1e-14);
    check_derivatives(smooth, 1.5, 6.0, 1e-6);
    const Waveform trapezoid = jerk_limited_move(1.0, 0.5, 1.0, inf, 1.0);
    const std::vector<double> breaks = trapezoid.breaks();
    REQUIRE(breaks.size() == 4);
    CHECK(breaks[0] == 1.0);
    CHECK(breaks[1] == doctest::Approx(1.5));
    CHECK(breaks[2] == doctest::Approx(3.0));
    CHECK(breaks[3] == doctest::Approx(3.5));
    CHECK(trapezoid.acceleration(1.0, Cell{0.0, 1.0}) == 0.0);
    CHECK(trapezoid.acceleration(1.0, Cell{1.0, 1.5}) == 1.0);
    CHECK(trapezoid.rate(2.0) == 0.5);
    CHECK(jerk_limited_move(0.04, 0.5, 1.0, inf).breaks().size() == 3);
    CHECK(jerk_limited_move(1e-30, 1.0, 1.0, 1.0, 1e6).value(2e6) == 1e-30);  // shorter than the clock resolves
}

TEST_CASE("a cycle of moves visits its targets, dwells and repeats") {
    const std::vector<double> targets{0.1, 0.3, 0.3, -0.2};
    const Waveform w = cycle_of_moves(targets, 0.5, 1.0, 10.0, 0.25, 1.0, 3, 0.05);
    const std::vector<Dwell> dwells = dwells_of_cycle(targets, 0.5, 1.0, 10.0, 0.25, 1.0, 3, 0.05);
    REQUIRE(dwells.size() == 12);
    double position = 0.05, time = 1.0;
    for (std::size_t k = 0; k < dwells.size(); ++k) {
        const Dwell& d = dwells[k];
        CHECK(d.target == targets[k % 4]);
        CHECK(d.begin == doctest::Approx(time + jerk_limited_move(d.target - position, 0.5, 1.0, 10.0).end()));
        CHECK(d.end == doctest::Approx(d.begin + 0.25));
        for (const double t : {d.begin, 0.5 * (d.begin + d.end)}) {
            CHECK(w.value(t) == d.target);
            CHECK(w.rate(t) == 0.0);
        }
        position = d.target;
        time = d.end;
    }
    CHECK(w.end() == dwells.back().end);
    CHECK(w.value(0.0) == 0.05);
    check_smooth(w, 1e-13);
    SUBCASE("without a dwell one move follows the other") {
        const Waveform v = cycle_of_moves({1.0, 0.0}, 0.5, 1.0, 10.0);
        CHECK(v.end() == doctest::Approx(5.2));
        CHECK(v.value(2.6) == doctest::Approx(1.0));
        CHECK(v.value(1.3) == doctest::Approx(v.value(3.9)));
    }
}

TEST_CASE("a bidirectional cycle approaches every position from below and from above") {
    const auto targets = bidirectional_targets({0.0, 1.0, 2.0}, 0.1);
    CHECK(targets == std::vector<double>{-0.1, 0.0, 1.0, 2.0, 2.1, 2.0, 1.0, 0.0});
    CHECK(dwells_of_cycle(targets, 1.0, 1.0, 1.0, 1.0, 0.0, 5).size() == 40);
}

TEST_CASE("constant, step, ramp and sine") {
    CHECK(constant(3.0).value(-7.0) == 3.0);
    const Waveform s = step(2.0, 1.0);
    CHECK(s.value(1.0, Cell{0.0, 1.0}) == 0.0);
    CHECK(s.value(1.0, Cell{1.0, inf}) == 2.0);
    CHECK(s.breaks() == std::vector<double>{1.0});
    CHECK(s.end() == 1.0);
    const Waveform r = ramp(0.5, 1.0, 3.0);
    CHECK(r.value(2.0) == 0.5);
    CHECK(r.value(9.0) == 1.0);
    CHECK(r.rate(9.0) == 0.0);
    CHECK(r.breaks() == std::vector<double>{1.0, 3.0});
    CHECK(ramp(0.5).value(1000.0) == 500.0);
    CHECK(ramp(0.5).end() == inf);
    const Waveform w = sine(2.0, 5.0, 0.3, 1.0, 0.5);
    CHECK(w.value(0.4) == 1.0);
    CHECK(w.value(0.73) == doctest::Approx(1.0 + 2.0 * std::sin(2.0 * pi * 5.0 * 0.23 + 0.3)).epsilon(1e-13));
    CHECK(w.breaks() == std::vector<double>{0.5});
    check_derivatives(sine(0.1, 1.0, 0.3), 0.0, 2.0, 1e-7);
}

TEST_CASE("multisines") {
    const Waveform w = multisine({1.0, 0.5}, {1.0, 3.0}, {0.1, 0.2}, 1.0);
    CHECK(w.value(1.2) == doctest::Approx(std::sin(0.4 * pi + 0.1) + 0.5 * std::sin(1.2 * pi + 0.2)).epsilon(1e-13));
    CHECK(w.value(0.9) == 0.0);

    const auto figures = [](const Waveform& v) {  // over one period of 2 s
        double square = 0.0, peak = 0.0, odd = 0.0;
        for (int k = 0; k < 4096; ++k) {
            const double t = 2.0 * k / 4096.0, x = v.value(t);
            square += x * x / 4096.0;
            peak = std::max(peak, std::abs(x));
            odd = std::max(odd, std::abs(x + v.value(t + 1.0)));  // odd harmonics alone: half-wave symmetry
        }
        return std::array<double, 3>{std::sqrt(square), peak, odd};
    };
    const auto random = figures(odd_multisine(0.7, 0.5, 20, 42));
    const auto schroeder = figures(odd_multisine(0.7, 0.5, 20, 0, Phases::schroeder));
    CHECK(random[0] == doctest::Approx(0.7).epsilon(1e-12));
    CHECK(random[2] < 1e-12);
    CHECK(schroeder[0] == doctest::Approx(0.7).epsilon(1e-12));
    CHECK(schroeder[1] / schroeder[0] < 2.0);  // in phase it would be √(2·20) = 6.3
    CHECK(odd_multisine(1.0, 1.0, 9, 1).value(0.3) == odd_multisine(1.0, 1.0, 9, 1).value(0.3));
    CHECK(odd_multisine(1.0, 1.0, 9, 1).value(0.3) != odd_multisine(1.0, 1.0, 9, 2).value(0.3));
    const Waveform level = odd_multisine(1.0, 1.0, 9, 1, Phases::random, 2.0, true);
    CHECK(level.value(1.0) == 0.0);
    CHECK(std::abs(level.value(2.0)) < 1e-15);
}

TEST_CASE("sample and hold, and a polygon") {
    const std::vector<double> t{0.0, 1.0, 3.0}, v{1.0, 4.0, 2.0};
    const Waveform held = sampled(t, v, Interpolation::hold);
    CHECK(held.value(-1.0) == 1.0);
    CHECK(held.value(0.99) == 1.0);
    CHECK(held.value(1.0) == 4.0);
    CHECK(held.value(1.0, Cell{0.0, 1.0}) == 1.0);
    CHECK(held.value(3.0) == 2.0);
    CHECK(held.breaks() == std::vector<double>{1.0, 3.0});
    CHECK(sampled({2.0}, {5.0}, Interpolation::hold).value(0.0) == 5.0);
    const Waveform line = sampled(t, v, Interpolation::linear);
    CHECK(line.value(0.5) == 2.5);
    CHECK(line.value(2.0) == 3.0);
    CHECK(line.rate(2.0) == -1.0);
    CHECK(line.value(-1.0) == 1.0);
    CHECK(line.value(4.0) == 2.0);
    CHECK(line.breaks() == t);
    CHECK(line.end() == 3.0);
}

TEST_CASE("a spline passes through its samples and reproduces cubics, on uneven times too") {
    const auto cubic = [](double t) { return 1.0 - 2.0 * t + 0.5 * t * t + 0.3 * t * t * t; };
    const auto slope = [](double t) { return -2.0 + t + 0.9 * t * t; };
    const auto bend = [](double t) { return 1.0 + 1.8 * t; };
    for (const std::vector<double>& times :
         {std::vector<double>{0.0, 0.5, 0.7, 2.0}, {-1.0, 0.1, 0.2, 0.9, 2.5, 2.6, 3.0}}) {
        std::vector<double> values;
        for (const double t : times) values.push_back(cubic(t));
        const Waveform w = sampled(times, values, Interpolation::cubic);
        for (int k = 0; k <= 50; ++k) {
            const double t = times.front() + (times.back() - times.front()) * k / 50.0;
            const Cell cell{times.front(), times.back()};
            CHECK(w.value(t, cell) == doctest::Approx(cubic(t)).epsilon(1e-12));
            CHECK(w.rate(t, cell) == doctest::Approx(slope(t)).epsilon(1e-11));
            CHECK(w.acceleration(t, cell) == doctest::Approx(bend(t)).epsilon(1e-10));
        }
        CHECK(w.breaks() == std::vector<double>{times.front(), times.back()});
        CHECK(w.rate(times.back() + 1.0) == 0.0);
    }
    // Fewer samples than a cubic needs: a line, a parabola.
    CHECK(sampled({0.0, 2.0}, {1.0, 5.0}, Interpolation::cubic).value(0.5) == doctest::Approx(2.0));
    CHECK(sampled({0.0, 1.0, 3.0}, {0.0, 1.0, 9.0}, Interpolation::cubic).value(2.0) == doctest::Approx(4.0));
}

TEST_CASE("a spline of jittering samples is C2 and converges with the fourth power of the step") {
    const auto worst = [](int samples) {
        std::vector<double> times, values;
        for (int k = 0; k <= samples; ++k) {
            times.push_back((k + 0.3 * std::sin(5.0 * k)) / samples);
            values.push_back(std::sin(6.0 * times.back()));
        }
        const Waveform w = sampled(times, values, Interpolation::cubic);
        double error = 0.0;
        for (std::size_t k = 1; k + 1 < times.size(); ++k) {
            const Cell before{times[k - 1], times[k]}, after{times[k], times[k + 1]};
            CHECK(std::abs(w.value(times[k], before) - values[k]) <= 1e-15);
            CHECK(std::abs(w.rate(times[k], before) - w.rate(times[k], after)) <= 1e-12);
            CHECK(std::abs(w.acceleration(times[k], before) - w.acceleration(times[k], after)) <= 1e-10);
            error = std::max(
                error, std::abs(w.value(0.5 * (times[k] + times[k + 1])) - std::sin(3.0 * (times[k] + times[k + 1]))));
        }
        return error;
    };
    const double order = std::log2(worst(40) / worst(80));
    CHECK(order > 3.5);
    CHECK(worst(80) < 1e-6);
}

TEST_CASE("refusals name argument, value and rule") {
    CHECK(contains(refusal([] { jerk_limited_move(1, 1, inf, 1); }), "acceleration = inf must be a positive number"));
    CHECK(contains(refusal([] { jerk_limited_move(1, 0, 1, 1); }), "speed = 0 must be a positive number"));
    CHECK(contains(refusal([] { jerk_limited_move(1, 1, 1, -1); }), "jerk = -1 must be positive"));
    CHECK(contains(refusal([] { jerk_limited_move(1, 1, 1, std::nan("")); }), "jerk = nan"));
    CHECK(contains(refusal([] { jerk_limited_move(inf, 1, 1, 1); }), "distance = inf"));
    CHECK(contains(refusal([] { cycle_of_moves({}, 1, 1, 1); }), "targets is empty"));
    CHECK(contains(refusal([] { cycle_of_moves({0.0, std::nan("")}, 1, 1, 1); }), "targets[1] = nan"));
    CHECK(contains(refusal([] { cycle_of_moves({1.0}, 1, 1, 1, -0.1); }), "dwell = -0.1"));
    CHECK(contains(refusal([] { cycle_of_moves({1.0}, 1, 1, 1, 0, 0, 0); }), "repeats = 0"));
    CHECK(contains(refusal([] { cycle_of_moves({1.0}, 1, 1, 1, 0, 0, 2000000000); }), "more than 1000000 moves"));
    CHECK(contains(refusal([] { bidirectional_targets({1.0, 0.0}, 0.1); }), "positions[1] = 0"));
    CHECK(contains(refusal([] { bidirectional_targets({0.0, 1.0}, 0.0); }), "overrun = 0"));
    CHECK(contains(refusal([] { ramp(1.0, 2.0, 2.0); }), "end = 2 must lie after start = 2"));
    CHECK(contains(refusal([] { sine(1.0, -1.0); }), "frequency_hz = -1"));
    CHECK(
        contains(refusal([] { multisine({1.0}, {1.0, 2.0}, {0.0}); }), "1 amplitudes, 2 frequencies_hz and 1 phases"));
    CHECK(contains(refusal([] { odd_multisine(1.0, 1.0, 0); }), "lines = 0"));
    CHECK(contains(refusal([] { sampled({0.0, 1.0}, {0.0}, Interpolation::hold); }), "2 times and 1 values"));
    CHECK(contains(refusal([] { sampled({0.0}, {0.0}, Interpolation::linear); }), "1 samples"));
    CHECK(contains(refusal([] { sampled({0.0, 1.0, 1.0}, {0, 0, 0}, Interpolation::cubic); }), "times[2] = 1"));
    CHECK(contains(refusal([] { sampled({0.0, 1.0}, {0, inf}, Interpolation::linear); }), "values[1] = inf"));
}
