#include "dualdrive/balance.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <type_traits>

#include "dualdrive/effects.hpp"
#include "dualdrive/model.hpp"

namespace dualdrive {

namespace {

using Channels = std::map<std::string, std::vector<double>>;

// S: double, or Gradient where slopes by parameters are asked for, `directions` of them at a time.
template <class S>
class Replay {
  public:
    Replay(const Machine& machine, const Channels& channels, const std::vector<std::string>& parameters,
           double standstill)
        : machine_(machine),
          channels_(channels),
          standstill_(standstill),
          layout_(machine_, extra_inputs(channels)),
          inputs_(extra_inputs(channels)) {
        check();
        for (const auto& p : parameters) {
            members_.push_back(machine_.resolve(p));
            check_seen(p);
        }
        find_sources();
        find_ways();
        find_inputs();
        build_models();
        speed_.resize(source_.size());
        angle_ = rate_ = speed_;
        torque_.resize(torques_.size());
        z_.resize(static_cast<std::size_t>(layout_.size()));
        const auto& effects = machine_.effects();
        by_load_ = std::any_of(effects.begin(), effects.end(),
                               [](const EffectEntry& e) { return effect_type(e.name).text.by_load; });
        if (by_load_) find_driver_sides();
    }

    Balance run() {
        Balance out;
        out.equations.push_back("total");
        for (int g = 0; g < layout_.groups; ++g) out.equations.push_back(reference_name(g));
        for (const auto& e : machine_.effects()) out.effect_names.push_back(e.label);
        const std::size_t np = members_.size(), eq = out.equations.size();
        out.residual.assign(eq * rows_, 0.0);
        out.jacobian.assign(eq * rows_ * np, 0.0);
        out.standstill.assign(eq * rows_, 0);
        out.effects.assign(machine_.effects().size() * rows_, 0.0);
        for (std::size_t c = 0; c < models_.size(); ++c) {
            weight_ = kinematic_weights(*models_[c]);
            for (std::size_t row = 0; row < rows_; ++row) evaluate(c, row, out, np);
        }
        return out;
    }

  private:
    using Recorded = const std::vector<double>*;
    // What is recorded of a group: of the body that stands for it; −1: none does, it moves with a neighbour.
    struct Source {
        int body = -1;
        Recorded speed = nullptr, angle = nullptr, rate = nullptr;
    };
    // From a group whose motion is known to one that moves with it.
    struct Way {
        std::size_t from, to;
        int connection;
        bool to_driver;
    };

    const Machine& machine_;
    const Channels& channels_;
    const double standstill_;
    const Layout layout_;
    Inputs inputs_;  // of the present row
    std::size_t rows_ = 0;
    std::vector<std::vector<std::size_t>> members_;
    std::vector<std::unique_ptr<Model<S>>> models_;
    std::vector<Source> source_;     // per group
    std::vector<Way> ways_;          // in the order in which groups become known
    std::vector<Recorded> torques_;  // per motor
    Recorded time_ = nullptr;
    std::vector<std::pair<Waveform*, Recorded>> read_;   // inputs
    bool by_load_ = false;                               // some effect's losses go by the load of a connection
    std::vector<std::vector<std::size_t>> driver_side_;  // per connection, where they do
    // Ω_g per table speed, were every connection rigid: the weights under which inner torques cancel
    std::vector<S> weight_;
    std::vector<S> speed_, angle_, rate_, torque_, z_;  // of the present row
    Modes modes_;

    static Inputs extra_inputs(const Channels& channels) {
        Inputs in;
        for (const auto& [name, v] : channels) {
            const bool kinematic =
                name.starts_with("theta_") || name.starts_with("omega_") || name.starts_with("alpha_") || name == "t";
            if (!kinematic)
                in.emplace(name, Waveform(0.0));  // a name that formulas may read; values are set row by row
        }
        return in;
    }

    const std::vector<double>* channel(const std::string& name) const {
        const auto it = channels_.find(name);
        return it == channels_.end() ? nullptr : &it->second;
    }

    void check() {
        if (!layout_.memories.empty())
            throw std::invalid_argument(
                "torque balance: effect " +
                machine_.effects()[static_cast<std::size_t>(layout_.memories.front().effect)].label +
                " keeps a state of its own, which no record holds; use stribeck or coulomb here, or the closed loop");
        if (channels_.empty()) throw std::invalid_argument("torque balance: no channels");
        rows_ = channels_.begin()->second.size();
        if (rows_ == 0) throw std::invalid_argument("torque balance: the trace has no rows");
        for (const auto& [name, v] : channels_) {
            if (v.size() != rows_)
                throw std::invalid_argument("torque balance: channel " + name + " has " + std::to_string(v.size()) +
                                            " rows, others " + std::to_string(rows_));
            for (std::size_t k = 0; k < v.size(); ++k)
                if (!std::isfinite(v[k]))
                    throw std::invalid_argument("torque balance: channel " + name + ", row " + std::to_string(k) +
                                                " is not finite; mask or repair it first");
        }
        for (const auto& m : machine_.motors())
            if (!channel("T_" + channel_suffix(m.name)))
                throw std::invalid_argument("torque balance: channel T_" + channel_suffix(m.name) + " (torque of " +
                                            m.name + ") is missing");
    }

    // A sensor's or a limit's number would come out with a slope of zero.
    void check_seen(const std::string& path) const {
        for (const auto& e : machine_.effects())
            for (const auto& type : effect_types())
                if (e.name == type.text.name && path.starts_with(e.label + ".") && !type.in_balance())
                    throw std::invalid_argument("torque balance: " + path + ": no balance of torques contains " +
                                                e.label + "; fit it in the closed loop");
    }

    void build_models() {
        const std::size_t np = members_.size();
        for (std::size_t first = 0; first == 0 || first < np; first += directions) {
            models_.push_back(std::make_unique<Model<S>>(machine_, inputs_, layout_));
            std::vector<S> values(machine_.values().begin(), machine_.values().end());
            if constexpr (!std::is_same_v<S, double>)
                for (std::size_t d = 0; d < directions && first + d < np; ++d)
                    for (const auto slot : members_[first + d]) values[slot].slope[d] = 1.0;
            models_.back()->set_parameters(values.data());
        }
    }

    void find_sources() {
        source_.resize(static_cast<std::size_t>(layout_.groups));
        for (std::size_t b = 0; b < machine_.bodies().size(); ++b) {
            const auto name = channel_suffix(machine_.bodies()[b].name);
            auto& source = source_[static_cast<std::size_t>(layout_.group_of[b])];
            const Source own{static_cast<int>(b), channel("omega_" + name), channel("theta_" + name),
                             channel("alpha_" + name)};
            if (source.body < 0 && own.speed && own.angle && own.rate) source = own;
        }
        if (std::all_of(source_.begin(), source_.end(), [](const Source& s) { return s.body < 0; }))
            throw std::invalid_argument(
                "torque balance: no body has theta_, omega_ and alpha_ channels (theta_m for the table, theta_c1 for a "
                "pinion, theta_1 for a motor)");
    }

    void find_ways() {
        std::vector<bool> known;
        for (const Source& s : source_) known.push_back(s.body >= 0);
        for (std::size_t pass = 0; pass < known.size(); ++pass)
            for (std::size_t c = 0; c < machine_.connections().size(); ++c) {
                const auto& k = machine_.connections()[c];
                const auto driver = static_cast<std::size_t>(layout_.group_of[static_cast<std::size_t>(k.driver)]);
                const auto driven = static_cast<std::size_t>(layout_.group_of[static_cast<std::size_t>(k.driven)]);
                if (known[driver] == known[driven]) continue;
                const bool to_driver = known[driven];
                ways_.push_back(
                    {to_driver ? driven : driver, to_driver ? driver : driven, static_cast<int>(c), to_driver});
                known[driver] = known[driven] = true;
            }
    }

    void find_inputs() {
        time_ = channel("t");
        for (const auto& m : machine_.motors()) torques_.push_back(channel("T_" + channel_suffix(m.name)));
        // any may stand in a formula; else the torques that motors give are recorded, and the loop's inputs move no body
        const auto& effects = machine_.effects();
        const bool formulas =
            std::any_of(effects.begin(), effects.end(), [](const EffectEntry& e) { return e.of_user(); });
        for (auto& [name, waveform] : inputs_)
            if (formulas || name == "T_load") read_.emplace_back(&waveform, channel(name));
    }

    std::string reference_name(int g) const { return layout_.state_names[static_cast<std::size_t>(g)].substr(6); }

    // A recorded quantity as every group sees it: its own channel, or its neighbour's through the ratio between them.
    void read_groups(const Model<S>& model, Recorded Source::* kind, std::size_t row, std::vector<S>& v) const {
        for (std::size_t g = 0; g < v.size(); ++g)
            v[g] = source_[g].body < 0 ? S(0.0) : S((*(source_[g].*kind))[row]) / model.ratio(source_[g].body);
        for (const Way& way : ways_) {
            const auto& k = machine_.connections()[static_cast<std::size_t>(way.connection)];
            const S step = model.connection_ratio(way.connection) * model.ratio(k.driven) /
                           model.ratio(k.driver);  // Ω of the driver's group over that of the driven one
            v[way.to] = way.to_driver ? v[way.from] * step : v[way.from] / step;
        }
    }

    // Flanks and signs start anywhere and are then settled by the model's own guards.
    void begin_modes() {
        modes_.assign(layout_.switches.size(), 0);
        for (std::size_t e = 0; e < modes_.size(); ++e) {
            const Switch& s = layout_.switches[e];
            if (s.kind == SwitchKind::stick)
                modes_[e] = value_of(speed_[static_cast<std::size_t>(s.index)]) >= 0 ? stick::forward : stick::backward;
            if (s.kind == SwitchKind::branch) modes_[e] = branch::positive;
        }
    }

    void evaluate(std::size_t chunk, std::size_t row, Balance& out, std::size_t np) {
        Model<S>& model = *models_[chunk];
        read_groups(model, &Source::speed, row, speed_);
        read_groups(model, &Source::angle, row, angle_);
        read_groups(model, &Source::rate, row, rate_);
        std::fill(z_.begin(), z_.end(), S(0.0));
        std::copy(speed_.begin(), speed_.end(), z_.begin());
        for (std::size_t r = 0; r < layout_.roots.size(); ++r)
            z_[static_cast<std::size_t>(layout_.root_angle[r])] =
                angle_[static_cast<std::size_t>(layout_.group_of[static_cast<std::size_t>(layout_.roots[r])])];
        for (std::size_t c = 0; c < machine_.connections().size(); ++c) {
            if (layout_.twist[c] < 0) continue;
            const auto& k = machine_.connections()[c];
            const auto of = [&](int body) {
                return angle_[static_cast<std::size_t>(layout_.group_of[static_cast<std::size_t>(body)])] *
                       model.ratio(body);
            };
            const S ratio = model.connection_ratio(static_cast<int>(c));
            const S d = of(k.driver) - ratio * of(k.driven);
            z_[static_cast<std::size_t>(layout_.twist[c])] = k.frame == TwistFrame::driver ? d : d / ratio;
        }
        for (std::size_t m = 0; m < torques_.size(); ++m) torque_[m] = S((*torques_[m])[row]);
        begin_modes();
        for (const auto& [waveform, recorded] : read_) *waveform = Waveform((*recorded)[row]);
        const S t(time_ ? (*time_)[row] : 0.0);
        const typename Model<S>::Now now{modes_.data(), {-infinity, infinity}, nullptr, torque_.data()};
        model.evaluate(t, z_.data(), now);
        settle(model, t, now);
        if (by_load_) follow_loads(model, t, now);
        write(model, chunk, row, out, np);
    }

    // Losses go by the torque that each connection must carry for its driver's side to move as recorded: the model's own,
    // from the deflection, less what the residuals of that side lack. A mesh that is recorded on one side only, and so has
    // no deflection, carries its load all the same. Each pass is better by the share that is lost.
    void follow_loads(Model<S>& model, const S& t, typename Model<S>::Now now) const {
        constexpr int passes = 4;
        std::vector<S> load(machine_.connections().size(), S(0.0));
        now.load = load.data();
        for (int pass = 0; pass < passes; ++pass) {
            model.evaluate(t, z_.data(), now);
            std::vector<S> lacking;
            for (int g = 0; g < layout_.groups; ++g) lacking.push_back(residual(model, g));
            for (std::size_t c = 0; c < load.size(); ++c) {
                const auto& k = machine_.connections()[c];
                if (layout_.twist[c] < 0) continue;
                const auto driver = static_cast<std::size_t>(layout_.group_of[static_cast<std::size_t>(k.driver)]);
                S side(0.0);  // in the frame of the driver
                for (const std::size_t g : driver_side_[c]) side += weight_[g] / weight_[driver] * lacking[g];
                side /= model.ratio(k.driver);
                const bool own_frame = k.frame == TwistFrame::driver;
                const S& torque = model.signals()[static_cast<std::size_t>(layout_.at.torque[c])];
                load[c] = torque - (own_frame ? side : side * model.connection_ratio(static_cast<int>(c)));
            }
        }
        model.evaluate(t, z_.data(), now);
    }

    // The groups that lie on the driver's side of each connection.
    void find_driver_sides() {
        driver_side_.resize(machine_.connections().size());
        for (std::size_t c = 0; c < driver_side_.size(); ++c) {
            auto& side = driver_side_[c];
            const auto group = [&](int body) {
                return static_cast<std::size_t>(layout_.group_of[static_cast<std::size_t>(body)]);
            };
            const auto has = [&](std::size_t g) { return std::find(side.begin(), side.end(), g) != side.end(); };
            side.push_back(group(machine_.connections()[c].driver));
            for (std::size_t reached = 0; reached < side.size(); ++reached)
                for (std::size_t other = 0; other < driver_side_.size(); ++other) {
                    const auto& k = machine_.connections()[other];
                    if (other == c || layout_.twist[other] < 0) continue;
                    for (const auto& [from, to] : {std::pair(k.driver, k.driven), std::pair(k.driven, k.driver)})
                        if (group(from) == side[reached] && !has(group(to))) side.push_back(group(to));
                }
        }
    }

    // Flanks and the signs that a formula decides are taken as they stand on the record: the deflection says which flank
    // overlaps, the torque whether it carries or its damper would pull.
    void settle(Model<S>& model, const S& t, const typename Model<S>::Now& now) {
        const auto falls = [&](std::size_t e, int which) {
            return value_of(model.guard(static_cast<int>(e), which, nullptr)) < 0;
        };
        const auto next = [&](std::size_t e) {
            const Mode m = modes_[e];
            if (layout_.switches[e].kind == SwitchKind::branch) return falls(e, 0) ? static_cast<Mode>(-m) : m;
            if (layout_.switches[e].kind != SwitchKind::flank) return m;
            if (m == flank::gap) return falls(e, 0) ? flank::front : falls(e, 1) ? flank::back : m;
            return flank::carries(m) && falls(e, 0) ? static_cast<Mode>(2 * m) : m;
        };
        for (std::size_t pass = 0; pass < 2 + layout_.switches.size(); ++pass) {
            const Modes before = modes_;
            for (std::size_t e = 0; e < modes_.size(); ++e) modes_[e] = next(e);
            if (modes_ == before) return;
            model.evaluate(t, z_.data(), now);
        }
    }

    void write(const Model<S>& model, std::size_t chunk, std::size_t row, Balance& out, std::size_t np) {
        S total(0.0);
        bool any_standstill = false;
        const auto put = [&](std::size_t eq, const S& r, bool standstill) {
            out.residual[eq * rows_ + row] = value_of(r);
            out.standstill[eq * rows_ + row] = standstill;
            if constexpr (!std::is_same_v<S, double>)
                for (std::size_t d = 0; d < directions && chunk * directions + d < np; ++d)
                    out.jacobian[(eq * rows_ + row) * np + chunk * directions + d] = r.slope[d];
        };
        for (int g = 0; g < layout_.groups; ++g) {
            const auto k = static_cast<std::size_t>(g);
            const bool standstill =
                layout_.stick_of[k] >= 0 && std::abs(value_of(speed_[k]) / value_of(weight_[k])) < standstill_;
            const S r = residual(model, g);
            total += weight_[k] * r;
            any_standstill = any_standstill || standstill;
            put(k + 1, r, standstill);
        }
        put(0, total, any_standstill);
        if (chunk == 0)
            for (std::size_t e = 0; e < layout_.at.effect.size(); ++e)
                if (layout_.at.effect[e] >= 0)
                    out.effects[e * rows_ + row] =
                        value_of(model.signals()[static_cast<std::size_t>(layout_.at.effect[e])]);
    }

    // What the motion of a group as recorded needs beyond the torques on it.
    S residual(const Model<S>& model, int g) const {
        const auto k = static_cast<std::size_t>(g);
        S dry(0.0);
        if (const int e = layout_.stick_of[k]; e >= 0)
            dry = modes_[static_cast<std::size_t>(e)] > 0 ? model.friction_limit(g, 1) : -model.friction_limit(g, -1);
        return model.group_inertia(g) * rate_[k] - model.group_torque(g) + dry;
    }

    std::vector<S> kinematic_weights(const Model<S>& model) const {
        std::vector<S> w(static_cast<std::size_t>(layout_.groups), S(1.0));
        for (const auto& s : layout_.steps) {
            const auto g = static_cast<std::size_t>(layout_.group_of[static_cast<std::size_t>(s.body)]);
            const auto from = static_cast<std::size_t>(layout_.group_of[static_cast<std::size_t>(s.from)]);
            if (g == from) continue;
            const S ratio = model.connection_ratio(s.connection);
            const S step = s.driver ? ratio : 1.0 / ratio;  // ω_body / ω_from
            w[g] = w[from] * model.ratio(s.from) * step / model.ratio(s.body);
        }
        return w;
    }
};

}  // namespace

Balance torque_balance(const Machine& machine, const std::map<std::string, std::vector<double>>& channels,
                       const std::vector<std::string>& parameters, double standstill) {
    if (parameters.empty()) return Replay<double>(machine, channels, parameters, standstill).run();
    return Replay<Gradient>(machine, channels, parameters, standstill).run();
}

}  // namespace dualdrive
