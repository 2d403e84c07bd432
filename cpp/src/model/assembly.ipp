// Construction of a model and its derived parameters.

namespace dualdrive {

template <class S>
Model<S>::Model(const Machine& machine, const Inputs& inputs, const Layout& layout)
    : machine_(machine), layout_(layout) {
    set_inputs(inputs);
    const auto resize = [](std::size_t n, auto&... v) { (v.assign(n, S(0.0)), ...); };
    resize(machine.bodies().size(), body_torque_, ratio_);
    resize(static_cast<std::size_t>(layout.groups), torque_, limit_forward_, limit_backward_, acceleration_, inertia_);
    resize(machine.connections().size(), elongation_, stiffness_, gap_, contact_torque_, contact_energy_);
    varied_.resize(machine.bodies().size());
    resize(machine.motors().size(), motor_torque_, voltage_, added_voltage_, torque_ref_, correction_, i_, i_m_);
    resize(machine.motors().size() + 1, sensed_);
    tooth_load_.resize(layout.ring_meshes.size());
    resize(layout.switches.size(), branch_argument_);
    resize(layout.signals.size(), signal_);
    resize(static_cast<std::size_t>(layout.size()), rate_);
    block_.resize(layout.blocks.size());
    for (const auto& laws : layout.friction_on_body) rubs_ = rubs_ || !laws.empty();
    if constexpr (!std::is_same_v<S, double>) {
        const std::vector<S> lifted(machine.values().begin(), machine.values().end());
        set_parameters(lifted.data());
    } else {
        set_parameters(machine.values().data());
    }
}

template <class S>
void Model<S>::set_inputs(const Inputs& inputs) {
    input_.clear();
    motor_input_.clear();
    theta_ref_ = T_load_ = nullptr;
    for (const auto& [name, waveform] : inputs) {
        input_.push_back(&waveform);
        if (name == "theta_ref") theta_ref_ = &waveform;
        if (name == "T_load") T_load_ = &waveform;
    }
    for (const auto& m : machine_.motors()) {
        const auto wanted = (m.kind == MotorKind::armature ? "U_" : "T_") + channel_suffix(m.name);
        const auto found = inputs.find(wanted);
        motor_input_.push_back(found == inputs.end() ? nullptr : &found->second);
    }
}

template <class S>
void Model<S>::set_parameters(const S* values) {
    body_.clear();
    connection_.clear();
    motor_.clear();
    effect_.clear();
    for (const auto& b : machine_.bodies()) body_.push_back(read_component<Body<S>>(values + b.first));
    for (const auto& c : machine_.connections()) connection_.push_back(read_component<Connection<S>>(values + c.first));
    for (const auto& m : machine_.motors()) motor_.push_back(read_component<Motor<S>>(values + m.first));
    if (machine_.controlled()) controller_ = read_component<Controller<S>>(values + machine_.controller_first());
    for (const auto& e : machine_.effects()) {
        if (!e.formula.empty())
            effect_.push_back(std::make_unique<FormulaEffect<S>>(e, machine_, layout_, values + e.first));
        else if (!e.axes.empty())
            effect_.push_back(std::make_unique<CurveEffect<S>>(e, layout_, values + e.first));
        else
            effect_.push_back(make_effect<S>(e.name, values + e.first));
    }
    delay_.clear();
    for (const DelayLine& line : layout_.delays) delay_.push_back(values[line.slot]);
    // ω_body = ratio · ω_group, θ_n = i θ_cn (Eq. 4): J_n = i² J_d + J_c of Eq. 11 is this sum; b_n = i² b_d + b_c and
    // K_mn = i K_d come out where `friction` sums torques. That is Eq. 10, Eq. 9 (torques at the motor) times i.
    std::fill(ratio_.begin(), ratio_.end(), S(1.0));
    for (const auto& s : layout_.steps) {
        const auto c = static_cast<std::size_t>(s.connection);
        if (machine_.connections()[c].kind != ConnectionKind::rigid) continue;
        const S& from = ratio_[static_cast<std::size_t>(s.from)];
        ratio_[static_cast<std::size_t>(s.body)] = s.driver ? from * connection_[c].ratio : from / connection_[c].ratio;
    }
    std::fill(inertia_.begin(), inertia_.end(), S(0.0));
    for (std::size_t b = 0; b < body_.size(); ++b)
        inertia_[static_cast<std::size_t>(layout_.group_of[b])] += ratio_[b] * ratio_[b] * body_[b].J;
    for (std::size_t b = 0; b < body_.size(); ++b) {
        const auto g = static_cast<std::size_t>(layout_.group_of[b]);
        if (!(value_of(inertia_[g]) > 0) && !layout_.locked[g])
            throw std::invalid_argument(
                "body " + machine_.bodies()[b].name +
                ": J and that of all bodies joined rigidly to it is 0; a moving part needs inertia");
    }
    constant_inertia_ = inertia_;
    for (std::size_t k = 0; k < motor_.size(); ++k) {
        const auto& m = machine_.motors()[k];
        i_[k] = m.gearbox < 0 ? S(1.0) : connection_[static_cast<std::size_t>(m.gearbox)].ratio;
        i_m_[k] = m.mesh < 0 ? S(1.0) : connection_[static_cast<std::size_t>(m.mesh)].ratio;
    }
}

template <class S>
void Model<S>::instants(std::vector<double>& times) const {
    for (const auto& effect : effect_) effect->instants(times);
}

// The whole right-hand side: without play that of Eq. 14, with it that of Eq. 17, by selectors that of Eq. 22.
template <class S>
void Model<S>::evaluate(const S& t, const S* z, const Now& now) {
    now_ = now;
    time_ = t;
    state_ = z;
    power_.fill(S(0.0));
    stored_ = S(0.0);
    if (products_) products_->clear();
    std::fill(body_torque_.begin(), body_torque_.end(), S(0.0));
    const bool driven = now.scope != Scope::plant;
    driven ? read_inputs(t) : drive_nothing();
    place(z);
    connection_torques();
    motors(z);
    if (driven) sense(t);
    if (driven) control(t, z);
    body_torques(t);
    friction(t);
    rates(z);
    if (driven) control_rates(z);
    if (now.scope == Scope::whole) energy(z);
}

}  // namespace dualdrive
