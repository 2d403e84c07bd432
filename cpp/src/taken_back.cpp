// The law of a sensor solved for the motion: the very lines of its reading, by Newton's method.
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "dualdrive/effects.hpp"
#include "dualdrive/recorder.hpp"

namespace dualdrive {

namespace {

constexpr int most_steps = 100;

// The angle at which a law reads `said`, and the slope of what it reads there: Newton's method, halving the bracket where that
// leaves it (Press et al., Numerical Recipes, § 9.4).
Gradient angle_of(const Effect<Gradient>& law, double said, const std::string& label) {
    const double enough = 4.0 * std::numeric_limits<double>::epsilon() * std::max(1.0, std::abs(said));
    const auto left_at = [&](double angle) {
        return law.reading(Gradient::variable(angle, 0), {Gradient(0.0), Measures::angle}) - said;
    };
    double reach = 1e-3, angle = said;
    for (int k = 0; k < most_steps && left_at(said - reach).value * left_at(said + reach).value > 0.0; ++k)
        reach *= 2.0;
    double low = said - reach, high = said + reach;
    for (int k = 0; k < most_steps; ++k) {
        const Gradient left = left_at(angle);
        if (!(left.slope[0] > 0.0)) break;
        (left.value > 0.0 ? high : low) = angle;
        double next = angle - left.value / left.slope[0];
        if (std::abs(next - angle) <= enough || high - low <= enough) {
            Gradient found(next);
            found.slope[0] = left.slope[0];
            return found;
        }
        if (!(low < next && next < high)) next = 0.5 * (low + high);
        angle = next;
    }
    throw std::invalid_argument("effect " + label + ": at a reading of " + std::to_string(said) +
                                " rad what it reads does not grow with the angle, so that no reading tells the angle; "
                                "its sizes are too large for a sensor");
}

}  // namespace

double delay_of(const Machine& machine, const std::string& label) {
    const EffectEntry& e = machine.effect(label);
    return make_effect<double>(e.name, machine.values().data() + e.first)->delay();
}

SensedMotion taken_back(const Machine& machine, const std::string& label, const SensedMotion& said) {
    const std::size_t rows = said.angle.size();
    if (said.speed.size() != rows || said.acceleration.size() != rows)
        throw std::invalid_argument("effect " + label + ": angle, speed and acceleration must be of one length");
    const EffectEntry& e = machine.effect(label);
    if (!effect_type(e.name).invertible())
        throw std::invalid_argument("effect " + label + ": its readings can't be taken back");
    const std::vector<Gradient> values(machine.values().begin(), machine.values().end());
    const auto law = make_effect<Gradient>(e.name, values.data() + e.first);
    SensedMotion found = said;
    for (std::size_t row = 0; row < rows; ++row) {
        const Gradient at = angle_of(*law, said.angle[row], label);
        const double slope = at.slope[0], speed = said.speed[row] / slope;
        // the reading of the speed along the motion, the acceleration left out: what is left of d/dt is slope · that
        SensorPort<Gradient> port{Gradient(0.0), Measures::speed};
        port.angle = at.value;
        port.angle.slope[0] = speed;
        port.speed = speed;
        const Gradient rate = law->reading(Gradient(speed), port);
        found.angle[row] = at.value;
        found.speed[row] = speed;
        found.acceleration[row] = (said.acceleration[row] - rate.slope[0]) / slope;
    }
    return found;
}

}  // namespace dualdrive
