// Inputs, kinematics, connections, motors, body torques, dry friction, rates, energy.

namespace dualdrive {

template <class S>
void Model<S>::read_inputs(const S& t) {
    const auto& at = layout_.at;
    const auto put = [&](int k, const S& v) { signal_[static_cast<std::size_t>(k)] = v; };
    put(at.theta_ref, theta_ref_ ? theta_ref_->value(t, now_.cell) : S(0.0));
    put(at.omega_ref, theta_ref_ ? theta_ref_->rate(t, now_.cell) : S(0.0));
    put(at.T_load, T_load_ ? T_load_->value(t, now_.cell) : S(0.0));
    for (std::size_t k = 0; k < input_.size(); ++k)
        if (at.input[k] >= 0)
            put(at.input[k], input_[k] == theta_ref_ ? signal_[static_cast<std::size_t>(at.theta_ref)]
                                                     : input_[k]->value(t, now_.cell));
}

template <class S>
void Model<S>::drive_nothing() {
    signal_[static_cast<std::size_t>(layout_.at.T_load)] = S(0.0);
    std::fill(voltage_.begin(), voltage_.end(), S(0.0));
}

template <class S>
void Model<S>::place(const S* z) {
    const auto& at = layout_.at;
    const auto angle = [&](int b) -> S& {
        return signal_[static_cast<std::size_t>(at.angle[static_cast<std::size_t>(b)])];
    };
    for (std::size_t b = 0; b < body_.size(); ++b)
        signal_[static_cast<std::size_t>(at.speed[b])] = ratio_[b] * z[layout_.group_of[b]];
    for (std::size_t r = 0; r < layout_.roots.size(); ++r) angle(layout_.roots[r]) = z[layout_.root_angle[r]];
    for (const auto& s : layout_.steps) {
        const auto c = static_cast<std::size_t>(s.connection);
        const auto& k = machine_.connections()[c];
        const S& ratio = connection_[c].ratio;
        S twist(0.0);  // θ_driver − ratio θ_driven
        if (layout_.twist[c] >= 0)
            twist = k.frame == TwistFrame::driver ? z[layout_.twist[c]] : z[layout_.twist[c]] * ratio;
        angle(s.body) = s.driver ? ratio * angle(s.from) + twist : (angle(s.from) - twist) / ratio;
    }
    for (std::size_t c = 0; c < connection_.size(); ++c)
        if (layout_.twist[c] >= 0) signal_[static_cast<std::size_t>(at.twist[c])] = z[layout_.twist[c]];
    for (std::size_t k = 0; k < motor_.size(); ++k)
        signal_[static_cast<std::size_t>(at.I[k])] = layout_.current[k] >= 0 ? z[layout_.current[k]] : S(0.0);
}

template <class S>
void Model<S>::add_torque(int body, const S& torque) {
    body_torque_[static_cast<std::size_t>(body)] += torque;
}

// x = θ_c − i_m θ_m, the twist (Eq. 6, Eq. 16), and T = K dz(x; Δ) (Eq. 15) by the frozen mode: the flank's side s in
// {−1, 0, 1} is selector, |s| (Eq. 18, Eq. 20), and offset, β = s Δ (Eq. 19, Eq. 21), of both meshes; all corrected. The
// torque is that of Eq. 22; the driving body gets −T, the driven one the ratio times T, which sums to M_m (Eq. 8).
template <class S>
void Model<S>::connection_torques() {
    const auto& at = layout_.at;
    for (std::size_t c = 0; c < connection_.size(); ++c) {
        const auto& k = machine_.connections()[c];
        if (k.kind == ConnectionKind::rigid) continue;
        const S& ratio = connection_[c].ratio;
        const S weight = k.frame == TwistFrame::driver ? S(1.0) : 1.0 / ratio;
        const S& speed_a = signal_[static_cast<std::size_t>(at.speed[static_cast<std::size_t>(k.driver)])];
        const S& speed_b = signal_[static_cast<std::size_t>(at.speed[static_cast<std::size_t>(k.driven)])];
        const S& angle_a = signal_[static_cast<std::size_t>(at.angle[static_cast<std::size_t>(k.driver)])];
        const S& angle_b = signal_[static_cast<std::size_t>(at.angle[static_cast<std::size_t>(k.driven)])];
        const S& twist = signal_[static_cast<std::size_t>(at.twist[c])];

        // The mesh law with its geometry: x and K as functions of both angles, so forces are derivatives of V = ½ K ξ².
        using A = Dual<S, 2>;
        A x, K(connection_[c].stiffness), gap(connection_[c].gap);
        x.value = twist;
        x.slope = {weight, -weight * ratio};
        S damping(0.0);
        MeshLaw<A> law{A(0.0), gap, K, A(0.0)};
        if (!layout_.effects_on_mesh[c].empty()) {
            const A driver = A::variable(angle_a, 0), driven = A::variable(angle_b, 1);
            MeshPort<A> port{x, driver, driven, driver, 1};
            for (const auto& at_mesh : layout_.effects_on_mesh[c]) {
                port.angle = at_mesh.at_ring ? driven : driver;
                port.number = at_mesh.number;
                effect_[static_cast<std::size_t>(at_mesh.effect)]->shape_mesh(law, port);
            }
            x += law.offset;
            gap = law.gap;
            K = law.stiffness;
            damping = law.damping.value;
        }
        const int element = layout_.flank_of[c];
        const Mode m = element >= 0 ? mode(element) : flank::front;
        const double side = element >= 0 ? flank::side(m) : 0.0;  // without play there is no flank to choose
        const A xi = x - side * gap;
        const S xi_rate = xi.slope[0] * speed_a + xi.slope[1] * speed_b;
        ContactSpring<A> spring{};  // what effects store besides ½ K ξ²
        for (const auto& at_mesh : layout_.effects_on_mesh[c])
            effect_[static_cast<std::size_t>(at_mesh.effect)]->load_contact(spring, xi, law);
        const S elastic = K.value * xi.value + (k.kind == ConnectionKind::compliant ? connection_[c].preload : S(0.0));
        const S damped = elastic + damping * xi_rate;
        const S contact = damped + spring.torque.value;
        const bool carries = element < 0 || flank::carries(m);
        const bool open = element >= 0 && m == flank::gap;

        S torque(0.0);
        if (carries) {
            torque = contact;
            const S half_square = 0.5 * xi.value * xi.value;
            add_torque(k.driver, -(damped * xi.slope[0] + K.slope[0] * half_square + spring.energy.slope[0]));
            add_torque(k.driven, -(damped * xi.slope[1] + K.slope[1] * half_square + spring.energy.slope[1]));
            deliver(Power::mesh, -damping * xi_rate, xi_rate);
        } else if (!open) {
            // Parting: the spring relaxes against its own damper, which takes the energy it still held.
            const S K_rate = K.slope[0] * speed_a + K.slope[1] * speed_b;
            deliver(Power::mesh, elastic, xi_rate);
            deliver(Power::mesh, 0.5 * K_rate * xi.value, xi.value);
            deliver(Power::mesh, spring.energy.slope[0], speed_a);
            deliver(Power::mesh, spring.energy.slope[1], speed_b);
        }
        gap_[c] = gap.value;
        stiffness_[c] = K.value;
        elongation_[c] = open ? S(0.0) : xi.value;
        contact_energy_[c] = open ? S(0.0) : spring.energy.value;
        contact_torque_[c] = contact;
        signal_[static_cast<std::size_t>(at.deflection[c])] = x.value;
        signal_[static_cast<std::size_t>(at.torque[c])] = torque;
        signal_[static_cast<std::size_t>(at.flank[c])] = S(element >= 0 ? double(carries ? flank::side(m) : 0) : 0.0);
    }
}

// T = K_d I, plus what effects add inside the motor (Eq. 2 corrected); of a direct drive the filtered set-point.
template <class S>
void Model<S>::motors(const S* z) {
    const auto& at = layout_.at;
    for (std::size_t k = 0; k < motor_.size(); ++k) {
        const int state = layout_.current[k];
        const S& I = signal_[static_cast<std::size_t>(at.I[k])];
        if (now_.motor_torque)
            motor_torque_[k] = now_.motor_torque[k];
        else if (state >= 0)
            motor_torque_[k] = motor_[k].K_d * I;
        else if (!machine_.controlled())
            motor_torque_[k] = motor_input_[k] ? motor_input_[k]->value(time_, now_.cell) : S(0.0);
        else if (const int held = layout_.blocks[static_cast<std::size_t>(layout_.speed_block[k])].held; held >= 0)
            motor_torque_[k] = filtered(k, z[held]);
    }
}

template <class S>
BodyPort<S> Model<S>::port(std::size_t b, const S& t) const {
    const auto& at = layout_.at;
    BodyPort<S> p{t,
                  signal_[static_cast<std::size_t>(at.angle[b])],
                  signal_[static_cast<std::size_t>(at.speed[b])],
                  S(0.0),
                  signal_.data(),
                  nullptr};
    for (const Layout::Load& load : layout_.loads[b]) p.mesh_torque += load_through(load);
    return p;
}

// The torque of a mesh, ≥ 0, in the frame of the body whose load it is. A flank that carries knows its sign.
template <class S>
S Model<S>::load_through(const Layout::Load& load) const {
    using std::abs;
    const auto c = static_cast<std::size_t>(load.connection);
    const S& torque = now_.load ? now_.load[c] : signal_[static_cast<std::size_t>(layout_.at.torque[c])];
    const int element = now_.load ? -1 : layout_.flank_of[c];
    const S size = element < 0 ? S(abs(torque)) : S(double(flank::side(mode(element))) * torque);
    return load.times_ratio ? size * connection_[c].ratio : load.over_ratio ? size / connection_[c].ratio : size;
}

// Bodies whose inertia varies with the angle: J(θ) into their group, and −½ J'(θ) ω², which does no work that the kinetic
// energy ½ J(θ) ω² does not hold.
template <class S>
void Model<S>::vary_inertia() {
    const auto& at = layout_.at;
    using A = Dual<S, 1>;
    if (layout_.effects_on_inertia.empty()) return;
    inertia_ = constant_inertia_;
    std::vector<A>& varied = varied_;
    for (std::size_t b = 0; b < body_.size(); ++b) varied[b] = A(body_[b].J);
    for (const auto& [e, b] : layout_.effects_on_inertia) {
        const S &angle = signal_[static_cast<std::size_t>(at.angle[b])],
                &speed = signal_[static_cast<std::size_t>(at.speed[b])];
        const A before = varied[b];
        effect_[e]->shape_inertia(varied[b], A::variable(angle, 0));
        const S added = varied[b].value - before.value;
        const S torque = -0.5 * (varied[b].slope[0] - before.slope[0]) * speed * speed;
        inertia_[static_cast<std::size_t>(layout_.group_of[b])] += ratio_[b] * ratio_[b] * added;
        signal_[static_cast<std::size_t>(at.effect[e])] += torque;
        add_torque(static_cast<int>(b), torque);
    }
}

// An effect's own states at a body; null when it keeps none.
template <class S>
const S* Model<S>::memory_of(int effect, int body) const {
    for (const auto& m : layout_.memories)
        if (m.effect == effect && m.body == body) return state_ + m.state;
    return nullptr;
}

template <class S>
void Model<S>::body_torques(const S& t) {
    const auto& at = layout_.at;
    for (const int s : at.effect)
        if (s >= 0) signal_[static_cast<std::size_t>(s)] = S(0.0);
    vary_inertia();
    for (std::size_t k = 0; k < motor_.size(); ++k) {
        const auto b = static_cast<std::size_t>(machine_.motors()[k].body);
        const S& speed = signal_[static_cast<std::size_t>(at.speed[b])];
        const S& I = signal_[static_cast<std::size_t>(at.I[k])];
        S torque = motor_torque_[k];
        added_voltage_[k] = S(0.0);
        for (const int e : layout_.effects_in_motor[k]) {
            const auto effect = static_cast<std::size_t>(e);
            const MotorPort<S> p{t,
                                 signal_[static_cast<std::size_t>(at.angle[b])],
                                 speed,
                                 I,
                                 motor_torque_[k],
                                 motor_[k].R,
                                 motor_[k].C_e,
                                 motor_[k].T_rated};
            const S added = effect_[effect]->torque_of_motor(p);
            if (at.effect[effect] >= 0) signal_[static_cast<std::size_t>(at.effect[effect])] += added;
            torque += added;
            added_voltage_[k] += effect_[effect]->voltage_of_motor(p);
        }
        signal_[static_cast<std::size_t>(at.T[k])] = motor_torque_[k];
        signal_[static_cast<std::size_t>(at.U[k])] = voltage_[k];
        add_torque(machine_.motors()[k].body, torque);
        if (layout_.current[k] >= 0) {
            deliver(Power::delivered, voltage_[k], I);
            deliver(Power::copper, -motor_[k].R * I, I);
            if (!layout_.effects_in_motor[k].empty()) deliver(Power::effects, added_voltage_[k], I);
            deliver(Power::conversion, torque - motor_[k].C_e * I, speed);  // zero when K_d = C_e
        } else {
            deliver(Power::delivered, torque, speed);
        }
    }
    for (std::size_t b = 0; b < body_.size(); ++b) {
        const S& speed = signal_[static_cast<std::size_t>(at.speed[b])];
        add_torque(static_cast<int>(b), -body_[b].b * speed);
        deliver(Power::viscous, -body_[b].b * speed, speed);
        if (layout_.effects_on_body[b].empty()) continue;
        BodyPort<S> p = port(b, t);
        for (const int e : layout_.effects_on_body[b]) {
            const auto effect = static_cast<std::size_t>(e);
            p.memory = memory_of(e, static_cast<int>(b));
            if (const int element = layout_.branch_of[effect][b]; element >= 0) {
                p.branches = now_.modes + element;
                effect_[effect]->switch_values(p, branch_argument_.data() + element);
            }
            const S torque = effect_[effect]->torque_on_body(p);
            signal_[static_cast<std::size_t>(at.effect[effect])] += torque;
            add_torque(static_cast<int>(b), torque);
            deliver(Power::effects, torque, speed);
        }
    }
    for (std::size_t b = 0; now_.pushing && b < body_.size(); ++b) add_torque(static_cast<int>(b), now_.pushing[b]);
    if (const int table = layout_.table; table >= 0) {
        const S& load = signal_[static_cast<std::size_t>(at.T_load)];
        add_torque(table, -load);
        deliver(Power::load, -load, signal_[static_cast<std::size_t>(at.speed[static_cast<std::size_t>(table)])]);
    }
}

// All torques on bodies that turn together, in the frame of the group: b_n = i² b_d + b_c and K_mn = i K_d of Eq. 11. Dry
// friction is set-valued at rest: sliding takes the limit of its direction, a stuck group takes what it needs.
template <class S>
void Model<S>::friction(const S& t) {
    const auto& at = layout_.at;
    std::fill(torque_.begin(), torque_.end(), S(0.0));
    for (std::size_t b = 0; b < body_.size(); ++b)
        torque_[static_cast<std::size_t>(layout_.group_of[b])] += ratio_[b] * body_torque_[b];
    if (!rubs_) return;
    std::fill(limit_forward_.begin(), limit_forward_.end(), S(0.0));
    std::fill(limit_backward_.begin(), limit_backward_.end(), S(0.0));
    for (std::size_t b = 0; b < body_.size(); ++b) {
        const auto g = static_cast<std::size_t>(layout_.group_of[b]);
        if (layout_.friction_on_body[b].empty() || layout_.stick_of[g] < 0) continue;
        const BodyPort<S> p = port(b, t);
        const Mode direction = mode(layout_.stick_of[g]);
        for (const int e : layout_.friction_on_body[b]) {
            const auto effect = static_cast<std::size_t>(e);
            const S forward = effect_[effect]->friction_limit(p, 1), backward = effect_[effect]->friction_limit(p, -1);
            limit_forward_[g] += ratio_[b] * forward;
            limit_backward_[g] += ratio_[b] * backward;
            S& torque = signal_[static_cast<std::size_t>(at.effect[effect])];
            if (direction > 0) torque -= forward;
            if (direction < 0) torque += backward;
            // at rest the share of each law is not determined; show what it could give of what is needed
            const S limit = value_of(torque_[g]) > 0 ? forward : backward;
            const S all = value_of(torque_[g]) > 0 ? limit_forward_[g] : limit_backward_[g];
            if (direction == 0 && value_of(all) > 0) torque -= torque_[g] * limit / all;
        }
    }
}

// J ω̇ = Σ torques − b ω of the motor (Eq. 3), the driving gear (Eq. 5) and the table (Eq. 7), or of all that the reducer
// joins rigidly (Eq. 11); then the twists, and the currents.
template <class S>
void Model<S>::rates(const S* z) {
    const auto& at = layout_.at;
    std::fill(rate_.begin(), rate_.end(), S(0.0));
    for (int g = 0; g < layout_.groups; ++g) {
        const auto k = static_cast<std::size_t>(g);
        const Mode direction = layout_.stick_of[k] >= 0 ? mode(layout_.stick_of[k]) : Mode(0);
        const bool stuck = layout_.stick_of[k] >= 0 && direction == stick::stuck;
        const S dry = direction > 0 ? limit_forward_[k] : direction < 0 ? -limit_backward_[k] : S(0.0);
        acceleration_[k] = layout_.locked[k] || stuck ? S(0.0) : (torque_[k] - dry) / inertia_[k];
        rate_[k] = acceleration_[k];
        if (!stuck && direction != 0) deliver(Power::effects, -dry, z[g]);
    }
    for (std::size_t b = 0; b < body_.size(); ++b)
        signal_[static_cast<std::size_t>(at.acceleration[b])] =
            ratio_[b] * acceleration_[static_cast<std::size_t>(layout_.group_of[b])];
    for (std::size_t c = 0; c < connection_.size(); ++c) {
        if (layout_.twist[c] < 0) continue;
        const auto& k = machine_.connections()[c];
        const S difference =
            signal_[static_cast<std::size_t>(at.speed[static_cast<std::size_t>(k.driver)])] -
            connection_[c].ratio * signal_[static_cast<std::size_t>(at.speed[static_cast<std::size_t>(k.driven)])];
        rate_[static_cast<std::size_t>(layout_.twist[c])] =
            k.frame == TwistFrame::driver ? difference : difference / connection_[c].ratio;
    }
    for (const auto& memory : layout_.memories) {
        BodyPort<S> p = port(static_cast<std::size_t>(memory.body), time_);
        p.memory = state_ + memory.state;
        effect_[static_cast<std::size_t>(memory.effect)]->flow(p, rate_.data() + memory.state);
    }
    for (std::size_t r = 0; r < layout_.roots.size(); ++r)
        rate_[static_cast<std::size_t>(layout_.root_angle[r])] =
            signal_[static_cast<std::size_t>(at.speed[static_cast<std::size_t>(layout_.roots[r])])];
    for (std::size_t k = 0; k < motor_.size(); ++k)  // L İ + R I + C_e ω = U   (Eq. 1; Eq. 12, Eq. 13 with ω = i ω_c)
        if (const int s = layout_.current[k]; s >= 0) {
            const S& speed =
                signal_[static_cast<std::size_t>(at.speed[static_cast<std::size_t>(machine_.motors()[k].body)])];
            rate_[static_cast<std::size_t>(s)] =
                (voltage_[k] + added_voltage_[k] - motor_[k].R * z[s] - motor_[k].C_e * speed) / motor_[k].L;
        }
}

// Of integrators and filters.
template <class S>
void Model<S>::control_rates(const S* z) {
    const auto& at = layout_.at;
    for (std::size_t b = 0; b < block_.size(); ++b) {
        const auto& place = layout_.blocks[b];
        if (place.integrator < 0 || place.held >= 0) continue;
        if (limiter::integrates(mode(place.limiter)))
            rate_[static_cast<std::size_t>(place.integrator)] = block_[b].integrand;
    }
    if (layout_.derivative_filter >= 0 && layout_.blocks[static_cast<std::size_t>(layout_.position_block)].held < 0)
        rate_[static_cast<std::size_t>(layout_.derivative_filter)] = derivative_rate_;
    if (layout_.sensor_filter >= 0 && layout_.blocks[static_cast<std::size_t>(layout_.position_block)].held < 0)
        rate_[static_cast<std::size_t>(layout_.sensor_filter)] = sensor_rate_;
    for (std::size_t k = 0; k < layout_.set_point_filter.size(); ++k)
        if (const int s = layout_.set_point_filter[k]; s >= 0)
            SetPointFilter<S>(motor_[k]).flow(signal_[static_cast<std::size_t>(at.T_ref[k])], z + s,
                                              &rate_[static_cast<std::size_t>(s)]);
    if (layout_.tension_filter >= 0 && layout_.blocks[static_cast<std::size_t>(layout_.tension_block[0])].held < 0)
        rate_[static_cast<std::size_t>(layout_.tension_filter)] = tension_rate_;
    for (std::size_t k = 0; k < layout_.delays.size(); ++k)
        if (const DelayLine& line = layout_.delays[k]; line.state >= 0)
            DelayApproximant::flow(signal_[static_cast<std::size_t>(line.source)], delay_[k], z + line.state,
                                   &rate_[static_cast<std::size_t>(line.state)]);
}

template <class S>
void Model<S>::deliver(Power path, const S& a, const S& b) {
    if (now_.scope != Scope::whole) return;
    const auto k = static_cast<std::size_t>(path);
    power_[k] += a * b;
    if (products_) products_->push_back({k, a, b});
}

template <class S>
void Model<S>::store(const S& a, const S& b) {
    stored_ += a * b;
    if (products_) products_->push_back({powers, a, b});
}

template <class S>
void Model<S>::energy(const S* z) {
    for (int g = 0; g < layout_.groups; ++g) store(0.5 * inertia_[static_cast<std::size_t>(g)] * z[g], z[g]);
    for (std::size_t k = 0; k < motor_.size(); ++k)
        if (const int s = layout_.current[k]; s >= 0) store(0.5 * motor_[k].L * z[s], z[s]);
    for (std::size_t c = 0; c < connection_.size(); ++c)
        if (layout_.twist[c] >= 0) {
            store(0.5 * stiffness_[c] * elongation_[c], elongation_[c]);
            if (!layout_.effects_on_mesh[c].empty()) store(contact_energy_[c], S(1.0));
            if (machine_.connections()[c].kind == ConnectionKind::compliant)
                store(connection_[c].preload, elongation_[c]);
        }
    signal_[static_cast<std::size_t>(layout_.at.stored_energy)] = stored_;
}

}  // namespace dualdrive
