// A signal travels as its tracks and harmonics: numbers alone, so that it has the same bits where it arrives.
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <utility>

#include "pickle.hpp"

namespace dualdrive::python {

namespace nb = nanobind;

namespace {

using Row = std::tuple<double, double, double, double, double>;  // of a harmonic
using Doubles = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

nb::object array_of(const std::vector<double>& values) {
    auto* kept = new std::vector<double>(values);
    const nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
    return nb::cast(nb::ndarray<nb::numpy, double>(kept->data(), {kept->size()}, owner));
}

std::vector<double> list_of(const nb::handle& array) {
    const auto numbers = nb::cast<Doubles>(array);
    return {numbers.data(), numbers.data() + numbers.size()};
}

nb::tuple state_of(const Track& track) {
    return nb::make_tuple(array_of(track.knots()), array_of(track.coefficients()), track.terms(),
                          array_of(track.breaks()), track.origin());
}

Waveform track_of(const nb::tuple& state) {
    std::vector<double> knots = list_of(state[0]);
    const std::vector<double> coefficients = list_of(state[1]);
    const auto terms = std::clamp<std::size_t>(nb::cast<std::size_t>(state[2]), 1, polynomial_terms);
    std::vector<Polynomial> pieces(coefficients.size() / terms, Polynomial{});
    for (std::size_t k = 0; k < pieces.size(); ++k)
        std::copy_n(coefficients.begin() + static_cast<std::ptrdiff_t>(k * terms), terms, pieces[k].begin());
    // without knots nothing else says since when the only piece counts its time
    const double origin = knots.empty() ? nb::cast<double>(state[4]) : 0.0;
    const Waveform made(std::move(knots), pieces, list_of(state[3]));
    return origin == 0.0 ? made : made.shifted(origin);
}

}  // namespace

nb::tuple state_of(const Waveform& waveform) {
    nb::list tracks, harmonics;
    for (const Track& track : waveform.tracks()) tracks.append(state_of(track));
    for (const Harmonic& h : waveform.harmonics())
        harmonics.append(Row(h.amplitude, h.angular_frequency, h.phase, h.start, h.end));
    return nb::make_tuple(tracks, harmonics);
}

Waveform waveform_of(const nb::tuple& state) {
    Waveform sum;
    for (const nb::handle track : nb::cast<nb::list>(state[0]))
        sum = std::move(sum) + track_of(nb::cast<nb::tuple>(track));
    std::vector<Harmonic> harmonics;
    for (const auto& [amplitude, frequency, phase, start, end] : nb::cast<std::vector<Row>>(state[1]))
        harmonics.push_back({amplitude, frequency, phase, start, end});
    return std::move(sum) + Waveform(std::move(harmonics));
}

}  // namespace dualdrive::python
