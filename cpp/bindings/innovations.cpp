#include "dualdrive/innovations.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "bindings.hpp"

namespace dualdrive::python {

namespace {

using Doubles = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using ChannelTuple = std::pair<std::string, std::vector<std::string>>;
using NoiseTuple = std::tuple<double, double, double>;
using TorqueTuple = std::pair<double, double>;
using NeighbourTuple = std::tuple<const Machine*, std::vector<std::map<std::string, double>>, std::vector<double>>;

std::vector<double> vector_of(const auto& a) { return {a.data(), a.data() + a.size()}; }

}  // namespace

void bind_innovations(nb::module_& m) {
    nb::class_<SampledRecord>(m, "SampledRecord",
                              "A stretch of a record, made ready to be predicted sample by sample.\n\n"
                              "inputs: name -> Waveform. times: s, shape (n,), increasing. channels: (signal of the "
                              "machine, places whose effects change its reading). measured: SI, shape (n, channels).\n"
                              "Raises ValueError for lengths that differ and times that do not increase.")
        .def(
            "__init__",
            [](SampledRecord* self, const Inputs& inputs, const Doubles& times,
               const std::vector<ChannelTuple>& channels, const Table& measured) {
                std::vector<SampledRecord::Channel> named;
                for (const auto& [name, places] : channels) named.push_back({name, places});
                if (measured.shape(0) != times.size() || measured.shape(1) != named.size())
                    throw std::invalid_argument("record: measured has another shape than (times, channels)");
                new (self) SampledRecord(inputs, vector_of(times), std::move(named), vector_of(measured));
            },
            nb::arg("inputs"), nb::arg("times"), nb::arg("channels"), nb::arg("measured"))
        .def_prop_ro(
            "starts", [](const SampledRecord& r) { return r.starts(); }, "Samples at which a stretch begins.")
        .def_prop_ro(
            "samples", [](const SampledRecord& r) { return r.times().size(); }, "How many.")
        .def("stretches", &SampledRecord::stretches, nb::arg("which"),
             "Stretches of it, (first sample, how many), end to end; sampled loops tick as in the whole one.\n\n"
             "Raises ValueError for none, for fewer than two samples in one, or beyond the end.")
        .def_prop_ro("step", &SampledRecord::step, "Median distance of the times, s.");

    nb::class_<KalmanGains>(m, "KalmanGains",
                            "Kalman gains of a machine: the steady ones where all meshes carry, nothing rests and no "
                            "limit is met, and what was learned along a record.")
        .def("copy", [](const KalmanGains& g) { return KalmanGains(g); })
        .def("begin_as", &KalmanGains::begin_as, nb::arg("other"),
             "Take over how another's stretches begin, and its steady gains.")
        .def("alike", &KalmanGains::alike, nb::arg("other"),
             "Whether these are the gains of the other's machine bit by bit, as far as both are known.")
        .def_prop_ro(
            "phases", [](const KalmanGains& g) { return g.steady.at(g.carrying).sets.size(); },
            "Samples after which the ticks of sampled loops repeat; each has gains of its own.")
        .def(
            "K",
            [](const KalmanGains& g, std::size_t phase) -> Eigen::MatrixXd {
                return g.steady.at(g.carrying)[phase].K();
            },
            nb::arg("phase") = 0,
            "The steady gain, shape (states + disturbances + channels, again where of order two, again where zeros "
            "drift; channels).")
        .def(
            "whitening",
            [](const KalmanGains& g, std::size_t phase) -> Eigen::MatrixXd {
                return g.steady.at(g.carrying)[phase].whitening();
            },
            nb::arg("phase") = 0, "Its S^(-1/2), lower triangular, shape (channels, channels).")
        .def(
            "log_det", [](const KalmanGains& g, std::size_t phase) { return g.steady.at(g.carrying)[phase].log_det; },
            nb::arg("phase") = 0, "Its log det S.")
        .def_prop_ro(
            "learned", [](const KalmanGains& g) { return g.sojourns.size(); },
            "Stays in one pattern of modes (what carries, what rests, which limits are met) whose gains were learned.");

    m.def(
        "kalman_gains",
        [](const Machine& machine, const SampledRecord& record, const std::vector<NoiseTuple>& sensors,
           const std::map<std::string, TorqueTuple>& torque, double speed, const std::vector<TorqueTuple>& drifts,
           const std::map<std::string, TorqueTuple>& first_torque, std::map<std::string, double> first_deviation,
           const std::vector<double>& second, const std::map<std::string, TorqueTuple>& creep) {
            NoiseModel noise;
            FirstState first{{}, std::move(first_deviation)};
            for (const auto& [drive, memory, white] : sensors) noise.sensors.push_back({drive, memory, white});
            if (!second.empty() && second.size() != sensors.size())
                throw std::invalid_argument("kalman_gains: " + std::to_string(second.size()) +
                                            " second partial autocorrelations for " + std::to_string(sensors.size()) +
                                            " sensors");
            for (std::size_t j = 0; j < second.size(); ++j) noise.sensors[j].second = second[j];
            if (!drifts.empty() && drifts.size() != sensors.size())
                throw std::invalid_argument("kalman_gains: " + std::to_string(drifts.size()) + " drifts for " +
                                            std::to_string(sensors.size()) + " sensors");
            for (std::size_t j = 0; j < drifts.size(); ++j)
                noise.sensors[j].drift = {drifts[j].first, drifts[j].second};
            for (const auto& [body, n] : torque) noise.torque[body] = {n.first, n.second};
            for (const auto& [body, n] : creep) noise.creep[body] = {n.first, n.second};
            for (const auto& [body, n] : first_torque) first.torque[body] = {n.first, n.second};
            const nb::gil_scoped_release unlocked;
            return kalman_gains(machine, record, noise, speed, first);
        },
        nb::arg("machine"), nb::arg("record"), nb::arg("sensors"), nb::arg("torque"), nb::arg("speed") = 0.0,
        nb::arg("drifts") = std::vector<TorqueTuple>{}, nb::arg("first_torque") = std::map<std::string, TorqueTuple>{},
        nb::arg("first_deviation") = std::map<std::string, double>{}, nb::arg("second") = std::vector<double>{},
        nb::arg("creep") = std::map<std::string, TorqueTuple>{},
        "Kalman gains: the steady ones where all meshes carry; `predict` learns the others along a record.\n\n"
        "sensors: (drive, memory, white) per channel: n' = memory n + drive w, and a white part. torque: body -> "
        "(drive, memory) of a torque of unknown course, constant over a sample, d' = memory d + drive w, N*m. speed: "
        "table speed, rad/s, about which laws that "
        "are not affine are linearised. drifts: (drive, memory) per channel of a zero that drifts, or none. What is "
        "not known of the first state is where torques like first_torque (those "
        "of torque unless told) would take it, and first_deviation besides, state -> standard deviation. second: per "
        "channel, the second partial autocorrelation of its noise, none for order one; memory is the first. creep: "
        "body -> (drive, memory) of its speed while dry friction holds it, rad/s. Raises ValueError.");

    m.def(
        "linear_filter",
        [](const Machine& machine, const SampledRecord& record, const KalmanGains& gains) {
            LinearFilter own = linear_filter(machine, record, gains);
            return std::tuple(std::move(own.F), std::move(own.C), own.states);
        },
        nb::arg("machine"), nb::arg("record"), nb::arg("gains"),
        "(F by phase, C, states of the machine) of x' = F (x + K e), y = C x + e: its tangent where all meshes carry, "
        "nothing rests and no limit is met, with torques of unknown course and what sensors remember behind its own "
        "states. Raises ValueError.");

    m.def("held_by_friction", &held_by_friction, nb::arg("machine"),
          "Bodies that dry friction may hold, one of each that turn together.");

    m.def(
        "predict",
        [](const Machine& machine, const SampledRecord& record, KalmanGains& gains,
           std::vector<std::map<std::string, double>> initial, const std::vector<double>& offsets, int substeps,
           int given, bool states, bool learn) -> nb::typed<nb::dict, std::string, nb::any> {
            PredictionOptions options{std::move(initial), offsets, substeps, given, states, learn};
            Prediction p;
            {
                const nb::gil_scoped_release unlocked;
                p = predict(machine, record, gains, options);
            }
            const std::size_t n = record.times().size(), c = record.channels().size(), z = p.states.size();
            nb::dict d;
            d["residuals"] = array(std::move(p.residuals), {n, c});
            d["log_det"] = p.log_det;
            d["finite"] = p.finite;
            d["switches"] = p.switches;
            if (states) {
                d["states"] = p.states;
                d["trajectory"] = array(std::move(p.trajectory), {n, z});
                d["corrections"] = array(std::move(p.corrections), {n, z});
                const std::size_t bodies = p.bodies.size();
                d["bodies"] = p.bodies;
                d["torques"] = array(std::move(p.torques), {n, bodies});
                d["innovations"] = array(std::move(p.innovations), {n, c});
                d["pattern"] = array(std::move(p.pattern), {n});
            }
            return d;
        },
        nb::arg("machine"), nb::arg("record"), nb::arg("gains"), nb::kw_only(), nb::arg("initial") = nb::list(),
        nb::arg("offsets") = nb::list(), nb::arg("substeps") = 1, nb::arg("given") = 0, nb::arg("states") = false,
        nb::arg("learn") = false,
        "Replay a record, the state corrected at every sample.\n\n"
        "initial: per stretch, state -> value at its first sample, others 0. offsets: per channel, what its sensor "
        "adds. substeps: "
        "per sample, where a law is not affine. given: first samples of a stretch that the likelihood is conditioned "
        "on, "
        "whose residuals are 0. states: also trajectory, corrections (n, states), torques of unknown "
        "course (n, bodies), innovations (n, "
        "channels) and pattern (n,), bit c of which says whether connection c carries. learn: keep in `gains` what it "
        "lacks of this record; else that is worked out again each time.\n"
        "Returns a dict: residuals (n, channels), whitened; log_det; finite; switches. The GIL is released. Raises "
        "ValueError.");

    m.def(
        "has_sensitivities", &has_sensitivities, nb::arg("machine"), nb::arg("record"),
        "Whether first-order changes of a replay can be told: no law of the machine that is not affine, no delay, and "
        "ticks of sampled loops that repeat within a few samples.");

    m.def(
        "sensitivities",
        [](const Machine& machine, const SampledRecord& record, KalmanGains& gains,
           const std::vector<NeighbourTuple>& neighbours, std::vector<std::map<std::string, double>> initial,
           const std::vector<double>& offsets, int given, double most_apart, bool at_any_cost) {
            const PredictionOptions options{std::move(initial), offsets, 1, given};
            std::vector<Neighbour> others;
            for (const auto& [other, begin, add] : neighbours) others.push_back({other, begin, add});
            std::vector<std::vector<double>> found;
            {
                const nb::gil_scoped_release unlocked;
                found = sensitivities(machine, record, gains, options, others, {most_apart, at_any_cost});
            }
            std::vector<std::optional<Array<double>>> told;
            for (auto& own : found) {
                if (own.empty())
                    told.emplace_back();
                else
                    told.emplace_back(array(std::move(own), {record.times().size(), record.channels().size()}));
            }
            return told;
        },
        nb::arg("machine"), nb::arg("record"), nb::arg("gains"), nb::arg("neighbours"), nb::kw_only(),
        nb::arg("initial") = nb::list(), nb::arg("offsets") = nb::list(), nb::arg("given") = 0,
        nb::arg("most_apart") = 1.0, nb::arg("at_any_cost") = false,
        "How whitened innovations change, to first order, where neighbours of a machine take its place.\n\n"
        "neighbours: (machine, initial, offsets) of each; most_apart: share of the changes of modes that may come more "
        "than a sample before or after in one; at_any_cost: also where replays cost less; all else as in `predict`. "
        "Returns for each an array (n, channels), None where that can't be told (`has_sensitivities`), of neighbours "
        "with other states or switches, and of those apart too often. The GIL is released. Raises ValueError.");
}

}  // namespace dualdrive::python
