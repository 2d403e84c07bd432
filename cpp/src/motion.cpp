#include "dualdrive/motion.hpp"

#include <numbers>
#include <random>
#include <utility>

#include "refuse.hpp"

namespace dualdrive::motion {
namespace {

constexpr double pi = std::numbers::pi;

Harmonic tone(double amplitude, double frequency_hz, double phase, double start) {
    return {amplitude, 2.0 * pi * frequency_hz, phase, start};
}

// A uniform number in [0, 1) with 53 bits; the distributions of <random> differ from library to library.
double uniform(std::mt19937_64& generator) { return static_cast<double>(generator() >> 11) * 0x1.0p-53; }

double schroeder_phase(int line, int lines) {
    const double k = line;
    return std::remainder(-pi * k * (k + 1.0) / lines, 2.0 * pi);  // k counts from zero here
}

}  // namespace

Waveform constant(double value) {
    require_finite("constant", "value", value);
    return Waveform(value);
}

Waveform step(double height, double at) {
    require_finite("step", "height", height);
    require_finite("step", "at", at);
    return Waveform({at}, {Polynomial{0.0}, Polynomial{height}});
}

Waveform ramp(double rate, double start, double end) {
    require_finite("ramp", "rate", rate);
    require_finite("ramp", "start", start);
    if (!(end > start)) refuse("ramp: end = ", end, " must lie after start = ", start);
    if (!std::isfinite(end)) return Waveform({start}, {Polynomial{0.0}, Polynomial{0.0, rate}});
    return Waveform::held({start, end}, {Polynomial{0.0, rate}});
}

Waveform sine(double amplitude, double frequency_hz, double phase, double offset, double start) {
    require_finite("sine", "amplitude", amplitude);
    require_positive("sine", "frequency_hz", frequency_hz);
    require_finite("sine", "phase", phase);
    require_finite("sine", "offset", offset);
    require_finite("sine", "start", start);
    const Waveform swing(std::vector<Harmonic>{tone(amplitude, frequency_hz, phase, start)});
    return offset == 0.0 ? swing : swing + constant(offset);
}

Waveform multisine(const std::vector<double>& amplitudes, const std::vector<double>& frequencies_hz,
                   const std::vector<double>& phases, double start) {
    if (amplitudes.empty()) refuse("multisine: amplitudes is empty: at least one line is needed");
    if (frequencies_hz.size() != amplitudes.size() || phases.size() != amplitudes.size())
        refuse("multisine: ", amplitudes.size(), " amplitudes, ", frequencies_hz.size(), " frequencies_hz and ",
               phases.size(), " phases: the three must be of one length");
    require_finite_list("multisine", "amplitudes", amplitudes);
    require_finite_list("multisine", "phases", phases);
    for (const double frequency : frequencies_hz) require_positive("multisine", "each of frequencies_hz", frequency);
    require_finite("multisine", "start", start);
    std::vector<Harmonic> tones;
    for (std::size_t k = 0; k < amplitudes.size(); ++k)
        tones.push_back(tone(amplitudes[k], frequencies_hz[k], phases[k], start));
    return Waveform(std::move(tones));
}

Waveform odd_multisine(double rms, double base_frequency_hz, int lines, std::uint64_t seed, Phases phases, double start,
                       bool from_zero) {
    require_positive("odd_multisine", "rms", rms);
    require_positive("odd_multisine", "base_frequency_hz", base_frequency_hz);
    require_finite("odd_multisine", "start", start);
    if (lines < 1) refuse("odd_multisine: lines = ", lines, " must be at least 1");
    std::mt19937_64 generator(seed);
    std::vector<Harmonic> tones;
    for (int k = 0; k < lines; ++k) {
        const double phase = phases == Phases::random ? 2.0 * pi * uniform(generator) : schroeder_phase(k, lines);
        tones.push_back(tone(rms * std::sqrt(2.0 / lines), base_frequency_hz * (2.0 * k + 1.0), phase, start));
    }
    Waveform swing(std::move(tones));
    return from_zero ? swing + step(-swing.value(start), start) : swing;
}

Waveform sum(const std::vector<Waveform>& parts) {
    Waveform total;
    for (const Waveform& part : parts) total = std::move(total) + part;
    return total;
}

Waveform scale(const Waveform& waveform, double factor) { return waveform.scaled(factor); }

Waveform shift(const Waveform& waveform, double delay) { return waveform.shifted(delay); }

}  // namespace dualdrive::motion
