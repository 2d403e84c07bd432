// The two judges of a crossing, against guards whose derivatives and roots are known.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "../../cpp/src/solvers/exact/crossing.hpp"
#include "exact_draws.hpp"

using namespace dualdrive;
using namespace dualdrive::exact;

namespace {

// A guard whose quintic is b and whose sixth derivative is `sixth` throughout.
Fine guard_at(const std::array<double, 6>& b, double sixth, Fine x) {
    std::array<Fine, 6> fine;
    std::copy(b.begin(), b.end(), fine.begin());
    const Fine bell = x * (x - 1);
    return quintic_at(fine, x) + Fine(sixth) / 720 * bell * bell * bell;
}

std::array<double, 6> random_quintic(Draw& draw) {
    std::array<double, 6> b;
    const double lift = draw.uniform(-0.2, 1.5), trend = draw.chance(0.5) ? draw.uniform(-4.0, 1.0) : 0.0;
    for (std::size_t i = 0; i < 6; ++i)
        b[i] = draw.normal() * draw.size(0.3) + lift + trend * (static_cast<double>(i) - 2.5);
    b[0] = std::abs(b[0]);
    return b;
}

}  // namespace

TEST_CASE("a quintic is never said to be clear of a crossing that is there") {
    Draw draw(3);
    int none = 0, one = 0, leaves = 0;
    constexpr int points = 400;
    for (int k = 0; k < 20'000; ++k) {
        Quintic<double> q{random_quintic(draw)};
        const double size = draw.chance(0.5) ? draw.uniform(0.0, 2000.0) : draw.size(3),
                     sixth = draw.chance(0.5) ? size : -size;
        if (draw.chance(0.3)) {  // level, as far above zero as the guard can be from it
            const double level = size / 46080.0 * draw.uniform(0.5, 1.5);
            for (double& c : q.b) c = level * (1.0 + 1e-4 * draw.normal());
        }
        const Verdict verdict = q.judge(size, 1e-14);
        if (verdict != Verdict::unclear) {
            int falls = 0;
            bool below = false;
            Fine least(1);
            for (int i = 0; i <= points; ++i) {
                const Fine value = guard_at(q.b, sixth, Fine(i) / points);
                falls += value < 0 && !below;
                below = value < 0;
                least = std::min(least, value);
            }
            if (verdict == Verdict::none) CHECK(least > 0);
            if (verdict == Verdict::one) {
                CHECK(falls == 1);
                CHECK(below);
                const double x = q.root();
                CHECK(x > 0);
                CHECK(x < 1);
            }
        }
        none += verdict == Verdict::none;
        one += verdict == Verdict::one;
        Quintic<double> from_zero = q;
        from_zero.b[0] = 0.0;
        if (draw.chance(0.3)) {  // rises as slowly as the guard may differ from it
            const double slope = 0.03456 * size / 720.0 * draw.uniform(0.5, 1.5);
            for (std::size_t i = 1; i < 6; ++i) from_zero.b[i] = slope * static_cast<double>(i) / 5.0;
        }
        if (!from_zero.leaves_zero(size, 1e-14)) continue;
        ++leaves;
        for (int i = 1; i <= points; ++i) CHECK(guard_at(from_zero.b, sixth, Fine(i) / points) > 0);
    }
    CHECK(none > 1000);
    CHECK(one > 1000);
    CHECK(leaves > 1000);
}

namespace {

std::vector<double> with_roots(const std::vector<double>& roots, double lead) {
    std::vector<Fine> p{Fine(lead)};
    for (const double r : roots) {
        p.insert(p.begin(), Fine(0));
        for (std::size_t k = 0; k + 1 < p.size(); ++k) p[k] -= Fine(r) * p[k + 1];
    }
    return {p.begin(), p.end()};
}

double noise_of(const std::vector<double>& p) {
    double size = 0.0;
    for (const double c : p) size += std::abs(c);
    return 16 * epsilon * size;
}

std::optional<double> first_fall(const std::vector<double>& p, bool on_surface = false) {
    return FirstFall<double>(p.data(), static_cast<int>(p.size()), noise_of(p), on_surface).find();
}

Fine value(const std::vector<double>& p, Fine x) {
    Fine v(0);
    for (std::size_t k = p.size(); k-- > 0;) v = v * x + Fine(p[k]);
    return v;
}

}  // namespace

TEST_CASE("the first fall is the first root at which a series turns negative") {
    CHECK(*first_fall(with_roots({0.25}, -1)) == doctest::Approx(0.25).epsilon(1e-14));
    CHECK_FALSE(first_fall(with_roots({0.25, 0.5}, -1), true).has_value() == false);  // below at once
    CHECK(*first_fall(with_roots({0.25, 0.5}, 1)) == doctest::Approx(0.25).epsilon(1e-14));
    CHECK_FALSE(first_fall(with_roots({-0.1, 1.1}, -1)).has_value());
    CHECK_FALSE(first_fall(with_roots({0.4, 0.4}, 1)).has_value());  // touches, and turns
    CHECK(*first_fall(with_roots({0.4, 0.4, 0.7}, -1)) == doctest::Approx(0.7).epsilon(1e-7));
    CHECK(*first_fall(with_roots({0.4, 0.4 + 2e-5}, 1)) == doctest::Approx(0.4).epsilon(1e-9));  // dips for a moment
    CHECK_FALSE(first_fall({1, -1}).has_value());  // at the end of the step: the next one falls at once
    CHECK(*first_fall({0, -1}) == 0.0);
}

TEST_CASE("a series that stands at zero falls, rises or comes back") {
    CHECK(*first_fall({0, -1}, true) == 0.0);
    CHECK_FALSE(first_fall({0, 1}, true).has_value());
    CHECK(*first_fall({0, 1, -2}, true) == doctest::Approx(0.5).epsilon(1e-14));
    CHECK(*first_fall({0, 0, -1}, true) == 0.0);
    CHECK_FALSE(first_fall({0, 0, 0, 1}, true).has_value());
    CHECK(*first_fall({0, 0, 1, -1.25}, true) == doctest::Approx(0.8).epsilon(1e-13));
    CHECK(*first_fall({0, 1e-13, -1}, true) == doctest::Approx(1e-13).epsilon(1e-9));  // a rise within rounding is one
    CHECK(*first_fall({0, -1e-13, 1e-14, 0, -1}, true) == doctest::Approx(1e-7).epsilon(1e-9));
    CHECK_FALSE(first_fall({0, -1e-13, 1}, true).has_value());  // a fall within it is none
    CHECK_FALSE(first_fall({0, 0, 0}, true).has_value());       // stays
    CHECK_FALSE(first_fall({-1e-18, 1}).has_value());           // zero but for rounding
    CHECK_FALSE(first_fall({-0.3, 1}, true).has_value());       // told that it stands there, whatever its value
}

TEST_CASE("no fall of a random series is missed, and none is invented") {
    Draw draw(4);
    int found = 0, clear = 0;
    for (int k = 0; k < 4000; ++k) {
        std::vector<double> roots(static_cast<std::size_t>(draw.whole(1, 6)));
        for (double& r : roots) r = draw.uniform(-0.5, 1.5);
        if (draw.chance(0.3)) roots.push_back(roots.front() + draw.size(1) * 1e-5);
        std::vector<double> p = with_roots(roots, 1);
        const int tail = draw.whole(0, 25);  // what a long series adds
        for (int j = 0; j < tail; ++j) p.push_back(1e-4 * draw.normal() * std::pow(0.5, j));
        if (p[0] < 0)
            for (double& c : p) c = -c;
        const double noise = noise_of(p);
        const auto x = first_fall(p);
        constexpr int points = 3000;
        for (int i = 0; i <= points; ++i) {
            const Fine t = Fine(i) / points;
            if (x && t > Fine(*x) - 1e-7L) break;
            CHECK(value(p, t) >= -2 * noise);
        }
        (x ? found : clear) += 1;
        if (!x || *x > 1 - 1e-6) continue;
        // it stands on zero there, and soon after it is below
        CHECK(std::abs(value(p, *x)) < 100 * noise);
        bool falls = false;
        for (Fine ahead = 1e-9L; ahead < 1e-5L; ahead *= 2) falls = falls || value(p, Fine(*x) + ahead) < 0;
        CHECK(falls);
    }
    CHECK(found > 500);
    CHECK(clear > 500);
}
