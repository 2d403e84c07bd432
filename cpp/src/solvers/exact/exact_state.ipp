// What is asked of the solution: at the present instant, and within the last step. Included by exact.cpp.

namespace dualdrive::exact {

// Whoever stopped the engine may have changed the state; what was not touched keeps its own digits.
template <class R>
void Exact<R>::take_changes() {
    R* y = column(last());
    for (std::size_t k = 0; k < z_.size(); ++k)
        if (static_cast<double>(y[k]) != z_[k]) y[k] = R(z_[k]);
}

template <class R>
auto Exact<R>::present() -> Eigen::Map<const Vector> {
    take_changes();
    return {column(last()), n_};
}

template <class R>
bool Exact<R>::guards_now(double* g) {
    const Vector values = propagator().laws().guards * present();
    for (Eigen::Index k = 0; k < values.size(); ++k) g[k] = static_cast<double>(values(k));
    return values.allFinite();
}

template <class R>
bool Exact<R>::rates_now(double* rate) {
    const Vector values = propagator().laws().A * present();
    for (Eigen::Index k = 0; k < size_.states; ++k) rate[k] = static_cast<double>(values(k));
    return true;
}

template <class R>
std::optional<double> Exact<R>::guard_rate_now(int guard) {
    const Laws<R>& laws = propagator().laws();
    return static_cast<double>(laws.guards.row(guard).dot(laws.A * present()));
}

template <class R>
bool Exact<R>::guard_slopes_now(int guard, double* out) {
    if constexpr (std::is_same_v<R, double>) {
        if (size_.sensitivities == 0) return false;
        slope_propagator().guard(guard, present().data(), slopes(last()), out);
        return true;
    }
    return false;
}

template <class R>
const double* Exact<R>::slopes_at(double t) const {
    const Spot at = spot(t);
    if (at.ahead == 0.0) return slopes(at.column);
    if constexpr (std::is_same_v<R, double>) {
        slope_probe_.assign(slopes(at.column), slopes(at.column) + rows_ * size_.sensitivities);
        slope_y_.assign(column(at.column), column(at.column) + rows_);
        slope_now_->advance(at.ahead, slope_y_.data(), slope_probe_.data());
    }
    return slope_probe_.data();
}

template <class R>
void Exact<R>::sensitivity_at(double t, int k, double* s) const {
    std::copy_n(slopes_at(t) + k * rows_, size_.states, s);
}

template <class R>
bool Exact<R>::signal_slopes_at(double t, double* out) const {
    if constexpr (std::is_same_v<R, double>) {
        if (!slope_now_) return false;
        slope_now_->signals(y_at(spot(t)), slopes_at(t), static_cast<int>(setup_.recorded.size()), out);
        return true;
    }
    return false;
}

template <class R>
void Exact<R>::write_instant(int guard, double rate) {
    if constexpr (std::is_same_v<R, double>) {
        take_changes();  // several switches may come at one instant, and this be between them
        setup_.tape->add({.kind = Entry::Kind::instant, .law = &propagator(), .count = guard, .length = rate},
                         column(last()), rows_);
    }
}

template <class R>
std::vector<Laws<R>> Exact<R>::derivatives(const Propagator<R>* law,
                                           const std::vector<std::vector<std::size_t>>& parameters) {
    for (const auto& [modes, known] : known_)
        if (known.get() == law) return reader_.derivatives(modes, parameters);
    return {};
}

template <class R>
typename Exact<R>::Spot Exact<R>::spot(double t) const {
    if (std::abs(t - t_) <= instant(t)) return {last(), 0.0};
    const int k = std::clamp(static_cast<int>((t - begin_) / now_->step() + 1e-9), 0, done_);
    const double ahead = t - time_of(k);
    return {k, std::abs(ahead) <= instant(t) ? 0.0 : std::max(0.0, ahead)};
}

template <class R>
const R* Exact<R>::y_at(const Spot& at) const {
    if (at.ahead == 0.0) return column(at.column);
    std::copy_n(column(at.column), rows_, probe_.data());
    now_->advance(probe_.data(), R(at.ahead), probe_scratch_.data());
    return probe_.data();
}

template <class R>
void Exact<R>::state_at(double t, double* z) const {
    const R* y = y_at(spot(t));
    for (int k = 0; k < size_.states; ++k) z[k] = static_cast<double>(y[k]);
}

// Columns in a row, as outputs on the grid are, take one product.
template <class R>
bool Exact<R>::signals_at(std::span<const double> times, double* signals) const {
    const std::size_t width = setup_.recorded.size();
    for (std::size_t k = 0; k < times.size();) {
        const Spot at = spot(times[k]);
        int together = 1;
        for (; at.ahead == 0.0 && k + static_cast<std::size_t>(together) < times.size(); ++together) {
            const Spot next = spot(times[k + static_cast<std::size_t>(together)]);
            if (next.ahead != 0.0 || next.column != at.column + together) break;
        }
        const R* y = y_at(at);
        rows_of(y, together, signals + k * width);
        if constexpr (std::is_same_v<R, double>)
            for (int j = 0; setup_.tape && j < together; ++j)
                setup_.tape->add_output(now_, last() == 0 ? -1 : at.column + j, at.ahead, y, rows_);
        k += static_cast<std::size_t>(together);
    }
    return true;
}

// The recorded signals of `count` states.
template <class R>
void Exact<R>::rows_of(const R* y, int count, double* signals) const {
    const int m = now_->outputs();
    const auto width = static_cast<int>(setup_.recorded.size());
    if constexpr (std::is_same_v<R, double>)
        if (m == width) return Arithmetic<R>::multiply(m, n_, now_->output_rows().data(), rows_, y, count, signals);
    probe_signals_.resize(static_cast<std::size_t>(m * count));
    Arithmetic<R>::multiply(m, n_, now_->output_rows().data(), rows_, y, count, probe_signals_.data());
    for (int k = 0; k < count; ++k)
        for (int s = 0; s < width; ++s)
            signals[k * width + s] = static_cast<double>(probe_signals_[static_cast<std::size_t>(k * m + s)]);
}

template <class R>
void Exact<R>::go_back(double t) {
    const R* y = y_at(spot(t));
    std::vector<R> there(y, y + rows_);
    quadrature_at(t, work(0));
    if (slope_now_) {
        const std::vector<double> S(slopes_at(t), slopes_at(t) + rows_ * size_.sensitivities);
        std::copy(S.begin(), S.end(), slopes(0));
    }
    std::copy(there.begin(), there.end(), column(0));
    done_ = 0;
    ended_ = false;
    for (std::size_t k = 0; k < z_.size(); ++k) z_[k] = static_cast<double>(there[k]);
    t_ = t;
}

template <class R>
void Exact<R>::quadrature_at(double t, double* q) const {
    if (!ledger_) return;
    const Spot at = spot(t);
    std::copy_n(work(at.column), size_.quadratures, q);
    ledger_->add_part(column(at.column), R(at.ahead), q);
}

template <class R>
std::optional<double> Exact<R>::stored_energy_at(double t) const {
    if (!ledger_) return std::nullopt;
    return ledger_->stored(y_at(spot(t)));
}

}  // namespace dualdrive::exact
