// Which step may hold a crossing, and where it is. Included by exact.cpp.

namespace dualdrive::exact {

// Where a guard that fell reads one state alone, that state stands where the guard is zero: a gap that is tiny beside the
// twist would drown in the twist's rounding.
template <class R>
void Exact<R>::stand_on_surface() {
    R* y = column(last());
    const auto states = static_cast<Eigen::Index>(size_.states);
    for (const Fall& f : falls_) {
        if (roots_[static_cast<std::size_t>(f.guard)] == 0) continue;
        const auto row = now_->laws().guards.row(f.guard);
        if ((row.array() != R(0)).count() - (row(reader_.one()) != R(0)) != 1) continue;
        for (Eigen::Index k = 0; k < states; ++k)
            if (row(k) != R(0)) y[k] = -row(reader_.one()) / row(k);
    }
}

// Watched quantities, their scaled derivatives, and over all steps the bounds of what a quintic does not show of them.
template <class R>
void Exact<R>::watch(int count, R fraction) {
    const int m = now_->watch_rows();
    watched_.resize(static_cast<std::size_t>(3 * m * (block + 2)));
    bounds_.resize(static_cast<std::size_t>(2 * m));
    largest_.resize(static_cast<std::size_t>(rows_));
    if (m == 0) return;
    Arithmetic<R>::multiply(3 * m, n_, now_->watch().data(), rows_, column(0), count + 1, watched_.data());
    Arithmetic<R>::largest(rows_, count, column(0), largest_.data());
    Arithmetic<R>::multiply(2 * m, n_, now_->bounds().data(), rows_, largest_.data(), 1, bounds_.data());
    const R cube = fraction * fraction * fraction, sixth = cube * cube;
    for (int i = 0; i < m; ++i)
        bounds_[static_cast<std::size_t>(i)] =
            bounds_[static_cast<std::size_t>(i)] * sixth + bounds_[static_cast<std::size_t>(m + i)];
}

// The first step of those from `from` on that may hold a crossing: where the Bernstein coefficients of the quintic through
// both ends (value, slope, curvature) do not keep their distance from the limits.
template <class R>
int Exact<R>::suspect(int from, int count, R fraction) const {
    return Arithmetic<R>::suspect(now_->watch_rows(), from, count, fraction, watched_.data(), bounds_.data(),
                                  now_->upper_limits().data());
}

template <class R>
Quintic<R> Exact<R>::quintic(int k, int i, R fraction) const {
    const int m = now_->watch_rows();
    const R *a = watched_.data() + static_cast<std::ptrdiff_t>(k) * 3 * m + i, *b = a + 3 * m;
    const R square = fraction * fraction;
    const R b1 = a[0] + fraction * a[m], b4 = b[0] - fraction * b[m];
    return {{a[0], b1, b1 + fraction * a[m] + square * a[2 * m], b4 - fraction * b[m] + square * b[2 * m], b4, b[0]}};
}

// Where the guard falls first whose power series over the step is in `series_`.
template <class R>
std::optional<R> Exact<R>::fall(const Quintic<R>& q, int terms, R sixth, R noise, bool after_switch) const {
    const bool on_surface = after_switch && series_[0] <= noise;
    if (on_surface && q.leaves_zero(sixth, noise)) return std::nullopt;
    if (!on_surface) {
        const Verdict verdict = q.judge(sixth, noise);
        if (verdict == Verdict::none) return std::nullopt;
        if (verdict == Verdict::one) return polish_root(series_.data(), terms, q.root());
    }
    return FirstFall<R>(series_.data(), terms, noise, on_surface).find();
}

// What the quintic of quantity i may be wrong by over a whole step from y on, by the last state judged in these modes.
template <class R>
R Exact<R>::bound_beside(std::size_t i, const R* y) const {
    const Judged& last = judged_[i];
    if (last.law != now_) return std::numeric_limits<R>::infinity();
    return now_->bound_beside(i, y, last.y.data(), last.error);
}

// The earliest crossing within step k, from the power series of all quantities; marks the guards that fall there, those
// included that rounding alone tells apart.
template <class R>
std::optional<R> Exact<R>::first_fall(int k, R fraction) {
    ++counts_.guards;
    const int m = now_->watch_rows(), terms = now_->terms();
    const R* noise = bounds_.data() + m;
    const R cube = fraction * fraction * fraction, sixth_power = cube * cube;
    judged_.resize(std::max(judged_.size(), now_->watched().size()));
    falls_.clear();
    series_.resize(static_cast<std::size_t>(padded(terms)));
    for (std::size_t i = 0; i < now_->watched().size(); ++i) {
        const auto& quantity = now_->watched()[i];
        Quintic<R> q = quintic(k, static_cast<int>(i), fraction);
        const auto [least, largest] = std::minmax_element(q.b.begin(), q.b.end());
        const auto keeps_off = [&, low = *least, high = *largest](R margin) {
            return low > margin && high + margin < quantity.upper;
        };
        if (keeps_off(bounds_[i]) || keeps_off(bound_beside(i, column(k)) * sixth_power + noise[i])) continue;
        Arithmetic<R>::multiply(padded(terms), n_, now_->series(i).data(), rows_, column(k), 1, series_.data());
        R power(1);
        for (int j = 1; j < terms && fraction != R(1); ++j) series_[static_cast<std::size_t>(j)] *= power *= fraction;
        const R sixth = sixth_derivative(series_.data(), terms);
        if (fraction == R(1)) {
            judged_[i].law = now_;
            judged_[i].y.assign(column(k), column(k) + n_);
            judged_[i].error = sixth / R(46080);
        }
        const int left = terms_above(series_.data(), terms, noise[i] / R(16));
        const auto look = [&](int guard) {
            if (const auto x = fall(q, left, sixth, noise[i], fresh_ && k == 0))
                falls_.push_back({*x * fraction, guard});
        };
        look(quantity.low);
        if (quantity.high < 0) continue;
        for (R& c : series_) c = -c;
        series_[0] += quantity.upper;
        for (R& c : q.b) c = quantity.upper - c;
        look(quantity.high);
    }
    if (falls_.empty()) return std::nullopt;
    R first = falls_.front().at;
    for (const Fall& f : falls_) first = std::min(first, f.at);
    const R same = R(100 * std::numeric_limits<double>::epsilon() * (std::abs(t_) / now_->step() + 1.0));
    std::fill(roots_.begin(), roots_.end(), 0);
    for (const Fall& f : falls_)
        if (f.at - first <= same) roots_[static_cast<std::size_t>(f.guard)] = -1;
    return first;
}

}  // namespace dualdrive::exact
