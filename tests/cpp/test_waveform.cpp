#include <doctest/doctest.h>

#include <numbers>

#include "dualdrive/motion.hpp"
#include "dualdrive/waveform.hpp"
#include "refusal.hpp"

using namespace dualdrive;

namespace {

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double pi = std::numbers::pi;

}  // namespace

TEST_CASE("a piece is a polynomial in the time since its own knot") {
    // 1 + 2x + 3x² + 4x³ + 5x⁴ + 6x⁵ at x = 0.5 from the knot at 2; derivatives by hand.
    const Waveform w({2.0}, {Polynomial{}, Polynomial{1, 2, 3, 4, 5, 6}});
    CHECK(w.value(1.9) == 0.0);
    CHECK(w.value(2.5) == doctest::Approx(1 + 1 + 0.75 + 0.5 + 0.3125 + 0.1875).epsilon(1e-15));
    CHECK(w.rate(2.5) == doctest::Approx(2 + 3 + 3 + 2.5 + 1.875).epsilon(1e-15));
    CHECK(w.acceleration(2.5) == doctest::Approx(6 + 12 + 15 + 15).epsilon(1e-15));
    CHECK(w.end() == inf);
}

TEST_CASE("outside its knots a held signal rests at its end values") {
    const Waveform w = Waveform::held({1.0, 3.0}, {Polynomial{5.0, -1.0}});
    CHECK(w.value(-100.0) == 5.0);
    CHECK(w.rate(-100.0) == 0.0);
    CHECK(w.value(2.0) == 4.0);
    CHECK(w.rate(2.0) == -1.0);
    CHECK(w.value(100.0) == 3.0);
    CHECK(w.rate(100.0) == 0.0);
    CHECK(w.breaks() == std::vector<double>{1.0, 3.0});
    CHECK(w.end() == 3.0);
}

TEST_CASE("at the ends of a cell a signal belongs to the cell's side") {
    const Waveform w({1.0}, {Polynomial{2.0}, Polynomial{3.0, 7.0}});
    const Cell before{0.0, 1.0}, after{1.0, 2.0};
    CHECK(w.value(1.0, before) == 2.0);
    CHECK(w.rate(1.0, before) == 0.0);
    CHECK(w.value(1.0, after) == 3.0);
    CHECK(w.rate(1.0, after) == 7.0);
    CHECK(w.value(1.0) == 3.0);  // right-continuous
    SUBCASE("a trial step beyond the cell stays on its piece") {
        CHECK(w.value(1.1, before) == 2.0);
        CHECK(w.value(0.9, after) == doctest::Approx(3.0 - 0.7));
    }
    SUBCASE("a cell that ends elsewhere than at a knot") {
        CHECK(w.value(0.5, Cell{0.2, 0.5}) == 2.0);
        CHECK(w.value(1.5, Cell{1.5, 1.7}) == 6.5);
        CHECK(w.value(0.5, Cell{}) == 2.0);
        CHECK(w.value(1.0, Cell{1.0, 1.0}) == 3.0);  // an empty cell: what follows
    }
}

TEST_CASE("a harmonic sounds between its start and its end") {
    const Waveform w(std::vector<Harmonic>{{2.0, 3.0, 0.4, 1.0, 5.0}});
    const double x = 3.0 * (2.5 - 1.0) + 0.4;
    CHECK(w.value(2.5) == doctest::Approx(2.0 * std::sin(x)).epsilon(1e-14));
    CHECK(w.rate(2.5) == doctest::Approx(6.0 * std::cos(x)).epsilon(1e-14));
    CHECK(w.acceleration(2.5) == doctest::Approx(-18.0 * std::sin(x)).epsilon(1e-14));
    CHECK(w.value(0.999) == 0.0);
    CHECK(w.value(5.0) == 0.0);
    CHECK(w.value(1.0, Cell{0.0, 1.0}) == 0.0);
    CHECK(w.value(1.0, Cell{1.0, 2.0}) == doctest::Approx(2.0 * std::sin(0.4)));
    CHECK(w.value(5.0, Cell{4.0, 5.0}) == doctest::Approx(2.0 * std::sin(12.4)));
    CHECK(w.breaks() == std::vector<double>{1.0, 5.0});
    CHECK(w.end() == 5.0);
    CHECK(Waveform(std::vector<Harmonic>{{1.0, 2.0}}).breaks().empty());
    CHECK(Waveform(std::vector<Harmonic>{{1.0, 2.0}}).end() == inf);
}

TEST_CASE("breaks are jumps of value, rate or acceleration, not smooth knots") {
    const auto breaks = [](const Polynomial& a, const Polynomial& b) {
        return Waveform({1.0, 2.0, 3.0}, {Polynomial{a[0]}, a, b, Polynomial{}}).breaks();
    };
    const auto is_break = [&](const Polynomial& a, const Polynomial& b) {
        for (const double t : breaks(a, b))
            if (t == 2.0) return true;
        return false;
    };
    const Polynomial a{1.0, 0.3, 0.2, 0.1};  // at x = 1: 1.6, rate 1.0, acceleration 1.0
    CHECK_FALSE(is_break(a, {1.6, 1.0, 0.5, 0.1}));
    CHECK_FALSE(is_break(a, {1.6, 1.0, 0.5, -7.0}));  // a jump of the third derivative
    CHECK(is_break(a, {1.6 + 1e-12, 1.0, 0.5, 0.1}));
    CHECK(is_break(a, {1.6, 1.0 + 1e-9, 0.5, 0.1}));
    CHECK(is_break(a, {1.6, 1.0, 0.5 + 1e-9, 0.1}));
    CHECK(Waveform(3.0).breaks().empty());
}

TEST_CASE("a straight line through many samples has no breaks but its ends, however large its offset") {
    std::vector<double> times, values;
    for (int k = 0; k <= 1000; ++k) {
        times.push_back(k * 1e-3);
        values.push_back(1000.0 + 0.1 * times.back());
    }
    const auto breaks = motion::sampled(times, values, motion::Interpolation::linear).breaks();
    CHECK(breaks == std::vector<double>{0.0, 1.0});
}

TEST_CASE("pieces are found on even, jittering and wild knots alike") {
    const auto knots_of = [](int kind) {
        std::vector<double> t;
        for (int k = 0; k < 500; ++k)
            t.push_back(kind == 0 ? 0.1 * k : kind == 1 ? 0.1 * k + 0.02 * std::sin(7.0 * k) : std::pow(1.03, k));
        return t;
    };
    for (int kind = 0; kind < 3; ++kind) {
        CAPTURE(kind);
        const std::vector<double> t = knots_of(kind);
        std::vector<double> count;
        for (std::size_t k = 0; k < t.size(); ++k) count.push_back(static_cast<double>(k));
        const Waveform w = motion::sampled(t, count, motion::Interpolation::hold);
        bool right = true;
        for (std::size_t k = 0; k + 1 < t.size(); ++k) {
            right = right && w.value(t[k]) == count[k];
            right = right && w.value(0.5 * (t[k] + t[k + 1])) == count[k];
            right = right && w.value(std::nextafter(t[k + 1], 0.0)) == count[k];
            right = right && w.value(t[k + 1], Cell{t[k], t[k + 1]}) == count[k];
            right = right && w.value(t[k], Cell{t[k], t[k + 1]}) == count[k];
        }
        CHECK(right);
        CHECK(w.value(-1e300) == 0.0);
        CHECK(w.value(1e300) == 499.0);
    }
}

TEST_CASE("duals carry the rate, long doubles the digits") {
    using D = Dual<double, 1>;
    const Waveform w = Waveform({0.0}, {Polynomial{}, Polynomial{1, -2, 3, 0.5, 0.25, -0.125}}) +
                       Waveform(std::vector<Harmonic>{{0.7, 11.0, 0.3}});
    const D t = D::variable(0.8, 0);
    const D v = w.value(t, Cell{0.0, 1.0}), r = w.rate(t, Cell{0.0, 1.0});
    CHECK(v.value == w.value(0.8));
    CHECK(v.slope[0] == doctest::Approx(w.rate(0.8)).epsilon(1e-14));
    CHECK(r.slope[0] == doctest::Approx(w.acceleration(0.8)).epsilon(1e-14));
    const long double third = 1.0L / 3.0L;
    const Waveform square({0.0}, {Polynomial{}, Polynomial{0, 0, 1}});
    CHECK(static_cast<double>(std::abs(square.value(third, Cell{}) - third * third)) < 1e-19);
}

TEST_CASE("sum, scale and shift") {
    const Waveform a({1.0}, {Polynomial{}, Polynomial{2.0, 1.0}});
    const Waveform b(std::vector<Harmonic>{{1.0, 2.0, 0.5}});
    const Waveform c = (a + b).scaled(3.0).shifted(10.0);
    for (const double t : {9.0, 10.9, 11.0, 12.7}) {
        CHECK(c.value(t) == doctest::Approx(3.0 * (a.value(t - 10.0) + b.value(t - 10.0))).epsilon(1e-13));
        CHECK(c.rate(t) == doctest::Approx(3.0 * (a.rate(t - 10.0) + b.rate(t - 10.0))).epsilon(1e-13));
    }
    CHECK(c.breaks() == std::vector<double>{11.0});
    const Waveform started = Waveform(std::vector<Harmonic>{{1.0, 2.0, 0.5, 1.0, 4.0}}).shifted(-3.0);
    CHECK(started.breaks() == std::vector<double>{-2.0, 1.0});
    CHECK(started.value(-1.0) == doctest::Approx(std::sin(2.5)));
    CHECK(Waveform().value(3.0) == 0.0);
    CHECK(Waveform(2.0).end() == 0.0);
    CHECK((Waveform(2.0) + motion::step(1.0, -5.0)).end() == -5.0);
    // A track without knots counts from zero; shifted, from the shift.
    CHECK(Waveform({}, {Polynomial{1.0, 2.0}}).shifted(3.0).value(4.0) == 3.0);
}

TEST_CASE("refusals name the place, the value and the rule") {
    const Polynomial p{};
    CHECK(contains(refusal([&] { Waveform({0.0, 2.0, 2.0}, {p, p, p, p}); }),
                   "knots[2] = 2 does not lie above knots[1]"));
    CHECK(contains(refusal([&] { Waveform({0.0, inf}, {p, p, p}); }), "knots[1] = inf is not a finite number"));
    CHECK(contains(refusal([&] { Waveform({0.0}, {p}); }), "1 pieces for 1 knots"));
    CHECK(contains(refusal([&] { Waveform({0.0}, {p, {1.0, std::nan("")}}); }), "pieces[1][1] = nan"));
    CHECK(
        contains(refusal([&] { Waveform({0.0}, {p, p}, std::vector<double>{1.0}); }), "break 1 is none of the knots"));
    CHECK(contains(refusal([&] { Waveform::held({0.0}, {}); }), "0 inner pieces for 1 knots"));
    CHECK(contains(refusal([&] { Waveform(std::vector<Harmonic>{{1.0, 1.0}, {1.0, 0.0}}); }),
                   "harmonics[1].angular_frequency = 0 must be a positive number"));
    CHECK(contains(refusal([&] { Waveform(std::vector<Harmonic>{{1.0, 1.0, 0.0, 2.0, 2.0}}); }),
                   "harmonics[0].start = 2 must lie before its end"));
    CHECK(contains(refusal([&] { Waveform(1.0).scaled(inf); }), "factor = inf"));
    CHECK(contains(refusal([&] { Waveform(1e300).scaled(1e300); }), "overflows"));
    CHECK(contains(refusal([&] { Waveform(std::nan("")); }), "pieces[0][0] = nan"));
    CHECK(contains(refusal([&] { Waveform({1.0, 1.0 + 1e-15}, {p, p, p}).shifted(1e9); }), "must increase"));
}

TEST_CASE("a signal tells how fast it may turn") {
    using dualdrive::Waveform;
    CHECK(std::isinf(Waveform(3.0).turning_time()));
    const Waveform sine({dualdrive::Harmonic{1.0, 2.0 * std::numbers::pi * 5.0}});
    CHECK(sine.turning_time() == doctest::Approx(0.2 / 8.0));
    const dualdrive::Polynomial flat{1.0}, curved{0.0, 0.0, 3.0};
    const Waveform bump({0.0, 0.5, 2.0}, {flat, curved, flat, flat});
    CHECK(bump.turning_time() == doctest::Approx(0.25));
    CHECK((bump + sine).turning_time() == doctest::Approx(0.2 / 8.0));
}
