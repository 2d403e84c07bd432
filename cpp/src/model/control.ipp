// Sensors, the master/slave controller, and the ticks of sampled loops.

namespace dualdrive {

template <class S>
S Model<S>::delayed(int line, const S& t) const {
    const DelayLine& d = layout_.delays[static_cast<std::size_t>(line)];
    if (d.state >= 0) return DelayApproximant::output(state_ + d.state);
    const S& delay = delay_[static_cast<std::size_t>(line)];
    if (!now_.past) return signal_[static_cast<std::size_t>(d.source)];
    const double shift = value_of(delay);
    return now_.past->at(line, t - delay, {now_.cell.low - shift, now_.cell.high - shift});
}

// What the teeth of each mesh do to the table: torque in its frame, and the size of that.
template <class S>
void Model<S>::loads_of_teeth() {
    for (std::size_t k = 0; k < tooth_load_.size(); ++k) {
        const int c = layout_.ring_meshes[k];
        const S& torque = signal_[static_cast<std::size_t>(layout_.at.torque[static_cast<std::size_t>(c)])];
        tooth_load_[k] = {torque * connection_[static_cast<std::size_t>(c)].ratio, load_through({c, true, false})};
    }
}

// What the control reads: motor speeds (motor frame) and the table angle, late or shifted where an effect says so.
template <class S>
void Model<S>::sense(const S& t) {
    const auto& at = layout_.at;
    loads_of_teeth();
    for (std::size_t s = 0; s < sensed_.size(); ++s) {
        const bool table = s == motor_.size();
        const int body = table ? layout_.table : machine_.motors()[s].body;
        const bool differenced = !table && machine_.controller().speed_samples > 0;  // then encoder_angle() is read
        S reading(0.0);
        if (body >= 0) {
            const auto b = static_cast<std::size_t>(body);
            const S &angle = signal_[static_cast<std::size_t>(at.angle[b])],
                    &speed = signal_[static_cast<std::size_t>(at.speed[b])];
            reading = table ? angle : speed;
            if (const int line = layout_.sensor_delay[s]; line >= 0) reading = delayed(line, t);
            if (!differenced)
                for (const int e : layout_.sensor_effects[s])
                    reading = effect_[static_cast<std::size_t>(e)]->reading(
                        reading, {t, table ? Measures::angle : Measures::speed, angle, speed, tooth_load_});
        }
        sensed_[s] = reading;
        if (table && machine_.controlled()) sensed_[s] = position_reading(t);
        signal_[static_cast<std::size_t>(at.sensor[s])] = sensed_[s];
    }
}

// Eq. C1: the angle that the position loop is closed on. With the motor's encoder in it, an offset at the table is one of
// the whole reading: where the control believes its zero.
template <class S>
S Model<S>::position_reading(const S& t) {
    using Sensor = ControllerOptions::PositionSensor;
    const Sensor sensor = machine_.controller().position_sensor;
    if (sensor == Sensor::table) return sensed_.back();
    const S motor = encoder_angle(0) / (i_[0] * i_m_[0]);
    S reading = motor;
    if (sensor == Sensor::both) {
        const S& difference = state_[layout_.sensor_filter];
        sensor_rate_ = sensor_difference_rate(controller_, sensed_.back(), motor, difference);
        reading += difference;
        return reading;
    }
    for (const int e : layout_.sensor_effects.back())
        reading = effect_[static_cast<std::size_t>(e)]->reading(reading, {t});
    return reading;
}

// Eq. C6: the torque set-point of a drive behind its filter.
template <class S>
S Model<S>::filtered(std::size_t k, const S& set_point) const {
    const int state = layout_.set_point_filter[k];
    return state < 0 ? set_point : SetPointFilter<S>(motor_[k]).output(set_point, state_ + state);
}

// The output of a block: held between ticks, or continuous with the mode that is frozen.
template <class S>
void Model<S>::limit(std::size_t b, const S* z) {
    Block<S>& block = block_[b];
    const BlockPlace& place = layout_.blocks[b];
    block.raw = block.proportional;
    if (place.integrator >= 0) block.raw += block.gain * z[place.integrator];
    if (place.held >= 0) {
        block.out = z[place.held];
        return;
    }
    const Mode m = mode(place.limiter);
    block.out = limiter::saturated(m) ? double(limiter::side(m)) * block.limit : block.raw;
}

// T_ten, or T_ten · max(0, 1 − |ΣT̂|/T_off) that falls with the load, or nothing.
template <class S>
S Model<S>::tension_set_point() const {
    using Schedule = ControllerOptions::Schedule;
    switch (machine_.controller().tension) {
        case Schedule::off:
            return S(0.0);
        case Schedule::constant:
            return controller_.T_ten;
        case Schedule::falling:
            break;
    }
    return mode(layout_.tension_zero_branch) > 0 ? controller_.T_ten * tension_left_ : S(0.0);
}

// A motor's torque as the equaliser is told it.
template <class S>
S Model<S>::torque_estimate(std::size_t k) const {
    S torque = motor_torque_[k];
    for (const int e : layout_.torque_estimates[k])
        torque = effect_[static_cast<std::size_t>(e)]->torque_estimate(torque);
    return torque;
}

template <class S>
void Model<S>::control(const S& t, const S* z) {
    const auto& at = layout_.at;
    const auto put = [&](int k, const S& v) { signal_[static_cast<std::size_t>(k)] = v; };
    const S& theta_ref = signal_[static_cast<std::size_t>(at.theta_ref)];
    const S& omega_ref = signal_[static_cast<std::size_t>(at.omega_ref)];
    const int table = layout_.table;
    if (table >= 0) put(at.e, theta_ref - signal_[static_cast<std::size_t>(at.angle[static_cast<std::size_t>(table)])]);
    if (!machine_.controlled()) {
        for (std::size_t k = 0; k < motor_.size(); ++k)
            voltage_[k] = layout_.current[k] >= 0 && motor_input_[k] ? motor_input_[k]->value(t, now_.cell) : S(0.0);
        return;
    }
    // Position loop of the master.
    const S e = theta_ref - sensed_.back();
    const S smoothed = layout_.derivative_filter >= 0 ? z[layout_.derivative_filter] : e;
    derivative_rate_ = (e - smoothed) / controller_.tau_d;
    const auto position = static_cast<std::size_t>(layout_.position_block);
    block_[position] = position_loop(controller_, i_m_[0], S(motor_[0].omega_max / i_[0]), e, omega_ref, smoothed);
    limit(position, z);
    S Omega_1 = block_[position].out;
    if (layout_.command_delay >= 0) {
        put(at.Omega_0, Omega_1);
        Omega_1 = delayed(layout_.command_delay, t);
    }
    put(at.Omega_1, Omega_1);
    // The slave's set-point: Ω_2(t) = Ω_1(t − δt).
    const S Omega_slave = layout_.slave_delay >= 0 ? delayed(layout_.slave_delay, t) : Omega_1;

    // Tension and equaliser, one per slave against the master.
    using Target = ControllerOptions::Target;
    const std::size_t slaves = layout_.tension_block.size();
    S correction_of_master(0.0);
    std::vector<S>& correction = correction_;
    const auto equalise = [&](std::size_t k) {
        const auto b = static_cast<std::size_t>(layout_.tension_block[k]);
        const S tension = layout_.tension_filter >= 0 ? z[layout_.tension_filter] : tension_set_point();
        block_[b] = torque_equaliser(controller_, i_[0], torque_estimate(0), torque_estimate(k + 1), tension);
        limit(b, z);
        put(at.tension, tension);
    };
    if (slaves > 0) {
        if (layout_.tension_sum_branch >= 0) {
            tension_sum_ = S(0.0);
            for (std::size_t k = 0; k < motor_.size(); ++k) tension_sum_ += torque_estimate(k);
            tension_left_ = 1.0 - double(mode(layout_.tension_sum_branch)) * tension_sum_ / controller_.T_off;
            branch_argument_[static_cast<std::size_t>(layout_.tension_sum_branch)] = tension_sum_;
            branch_argument_[static_cast<std::size_t>(layout_.tension_zero_branch)] = tension_left_;
        }
        if (layout_.tension_filter >= 0)
            tension_rate_ = (tension_set_point() - z[layout_.tension_filter]) / controller_.tau_t;
    }
    for (std::size_t k = 0; k < slaves; ++k) {
        const auto b = static_cast<std::size_t>(layout_.tension_block[k]);
        if (layout_.blocks[b].held >= 0)
            block_[b].out = z[layout_.blocks[b].held];
        else
            equalise(k);
        correction[k] = block_[b].out;
        correction_of_master += correction[k] / double(slaves);
    }

    // Speed and current loops.
    for (std::size_t k = 0; k < motor_.size(); ++k) {
        const Target target = machine_.controller().equaliser;
        S set = k == 0 ? Omega_1 : Omega_slave;
        if (k == 0 && target != Target::slave) set -= correction_of_master;
        if (k > 0 && target != Target::master) set += correction[k - 1];
        put(at.Omega[k], set);
        const S error = set - measured_speed(k, z) / i_[k];
        const auto speed = static_cast<std::size_t>(layout_.speed_block[k]);
        block_[speed] = speed_loop(controller_, i_[k], motor_[k].T_max, error);
        limit(speed, z);
        torque_ref_[k] = block_[speed].out;
        put(at.T_ref[k], torque_ref_[k]);
        if (at.filtered[k] >= 0) put(at.filtered[k], torque_ref_[k] = filtered(k, torque_ref_[k]));
        if (layout_.current[k] < 0) {
            if (!now_.motor_torque) motor_torque_[k] = torque_ref_[k];
            continue;
        }
        const auto current = static_cast<std::size_t>(layout_.current_block[k]);
        const S& I = signal_[static_cast<std::size_t>(at.I[k])];
        const S& omega =
            signal_[static_cast<std::size_t>(at.speed[static_cast<std::size_t>(machine_.motors()[k].body)])];
        const bool cascade = machine_.controller().current == ControllerOptions::CurrentLoop::cascade;
        block_[current] = cascade ? current_loop(controller_, motor_[k], torque_ref_[k], I, omega)
                                  : voltage_drive<S>(motor_[k], torque_ref_[k]);
        limit(current, z);
        voltage_[k] = block_[current].out;
    }
    for (std::size_t k = 0; k < slaves; ++k)
        if (layout_.blocks[static_cast<std::size_t>(layout_.tension_block[k])].held >= 0) equalise(k);
}

// The motor's speed as the speed loop takes it: true, or the mean of the last n encoder samples, differenced:
// (θ_k − θ_{k−n}) / (n T).
template <class S>
S Model<S>::measured_speed(std::size_t k, const S* z) const {
    const int n = machine_.controller().speed_samples;
    if (n == 0) return sensed_[k];
    return (encoder_angle(k) - z[layout_.encoder_history[k] + n - 1]) / (double(n) * controller_.speed_sample);
}

// The motor's angle as its encoder has it.
template <class S>
S Model<S>::encoder_angle(std::size_t k) const {
    const auto body = static_cast<std::size_t>(machine_.motors()[k].body);
    S angle = signal_[static_cast<std::size_t>(layout_.at.angle[body])];
    for (const int e : layout_.encoder_effects[k])
        angle = effect_[static_cast<std::size_t>(e)]->reading(angle, {time_, Measures::angle});
    return angle;
}

// A tick: outputs are put out (now, or after the latency), integrators step by forward Euler unless saturated outward.
template <class S>
void Model<S>::tick(const Clock& clock, S* next, bool limited) const {
    const S period(clock.period);
    for (std::size_t b = 0; b < block_.size(); ++b) {
        const BlockPlace& place = layout_.blocks[b];
        if (place.loop != clock.loop) continue;
        const Block<S>& block = block_[b];
        const int side = !limited                                       ? 0
                         : value_of(block.raw) > value_of(block.limit)  ? 1
                         : value_of(block.raw) < -value_of(block.limit) ? -1
                                                                        : 0;
        next[place.pending >= 0 ? place.pending : place.held] = side == 0 ? block.raw : double(side) * block.limit;
        const bool outward = side * value_of(block.integrand) > 0;
        if (place.integrator >= 0 && !outward) next[place.integrator] += period * block.integrand;
    }
    if (clock.loop == Loop::position && layout_.derivative_filter >= 0)
        next[layout_.derivative_filter] += period * derivative_rate_;
    if (clock.loop == Loop::position && layout_.sensor_filter >= 0)
        next[layout_.sensor_filter] += period * sensor_rate_;
    if (clock.loop == Loop::tension && layout_.tension_filter >= 0)
        next[layout_.tension_filter] += period * tension_rate_;
    if (clock.loop == Loop::speed)
        for (std::size_t k = 0; k < motor_.size(); ++k) {
            const int n = machine_.controller().speed_samples, first = layout_.encoder_history[k];
            for (int h = n - 1; h > 0; --h) next[first + h] = next[first + h - 1];
            if (n > 0) next[first] = encoder_angle(k);
        }
}

template <class S>
void Model<S>::put_out(const Clock& clock, const S* z, S* next) const {
    for (const BlockPlace& place : layout_.blocks)
        if (place.loop == clock.loop && place.pending >= 0) next[place.held] = z[place.pending];
}

template <class S>
S Model<S>::beyond(int block) const {
    const Block<S>& b = block_[static_cast<std::size_t>(block)];
    const int element = layout_.blocks[static_cast<std::size_t>(block)].limiter;
    const Mode m = element < 0 ? limiter::linear : mode(element);
    if (!limiter::riding(m) || value_of(b.limit) == infinity) return b.raw;
    return b.raw - double(limiter::side(m)) * b.limit;
}

template <class S>
void Model<S>::slave_integrators(S* z) const {
    for (std::size_t b = 0; b < block_.size(); ++b) {
        const BlockPlace& place = layout_.blocks[b];
        if (place.limiter < 0 || place.integrator < 0) continue;
        const Mode m = mode(place.limiter);
        if (!limiter::riding(m)) continue;
        z[place.integrator] = (double(limiter::side(m)) * block_[b].limit - block_[b].proportional) / block_[b].gain;
    }
}

}  // namespace dualdrive
