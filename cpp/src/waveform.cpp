#include "dualdrive/waveform.hpp"

#include <algorithm>
#include <numbers>
#include <string>
#include <utility>

#include "refuse.hpp"

namespace dualdrive {
namespace {

void check_pieces(std::size_t knots, const std::vector<Polynomial>& pieces) {
    if (pieces.size() != knots + 1)
        refuse("waveform: ", pieces.size(), " pieces for ", knots, " knots: there must be one piece more than knots");
    for (std::size_t k = 0; k < pieces.size(); ++k)
        require_finite_list("waveform", ("pieces[" + std::to_string(k) + "]").c_str(), pieces[k]);
}

void check_breaks(const std::vector<double>& breaks, const std::vector<double>& knots) {
    require_increasing("waveform", "breaks", breaks);
    for (const double t : breaks)
        if (!std::binary_search(knots.begin(), knots.end(), t)) refuse("waveform: break ", t, " is none of the knots");
}

void check(const Harmonic& h, std::size_t index) {
    const auto say = [index](const char* what, double value, const char* rule) {
        refuse("waveform: harmonics[", index, "].", what, " = ", value, " ", rule);
    };
    if (!std::isfinite(h.amplitude)) say("amplitude", h.amplitude, "is not a finite number");
    if (!std::isfinite(h.angular_frequency) || h.angular_frequency <= 0.0)
        say("angular_frequency", h.angular_frequency, "must be a positive number (rad/s)");
    if (!std::isfinite(h.phase)) say("phase", h.phase, "is not a finite number");
    if (!(h.start < h.end)) say("start", h.start, "must lie before its end");
}

// The most terms any piece needs: a recorded signal that is held stores one number per sample, not six.
std::size_t needed_terms(const std::vector<Polynomial>& pieces) {
    std::size_t terms = 1;
    for (const Polynomial& c : pieces)
        for (std::size_t j = terms; j < polynomial_terms; ++j)
            if (c[j] != 0.0) terms = j + 1;
    return terms;
}

double evaluate(const Polynomial& c, double x) {
    double sum = 0.0;
    for (std::size_t j = polynomial_terms; j-- > 0;) sum = sum * x + c[j];
    return sum;
}

std::vector<double> sorted_once(std::vector<double> times) {
    std::sort(times.begin(), times.end());
    times.erase(std::unique(times.begin(), times.end()), times.end());
    return times;
}

}  // namespace

Track::Track(std::vector<double> knots, const std::vector<Polynomial>& pieces,
             std::optional<std::vector<double>> breaks)
    : knots_(std::move(knots)) {
    require_increasing("waveform", "knots", knots_);
    check_pieces(knots_.size(), pieces);
    terms_ = needed_terms(pieces);
    coefficients_.reserve(pieces.size() * terms_);
    for (const Polynomial& c : pieces)
        coefficients_.insert(coefficients_.end(), c.begin(), c.begin() + static_cast<std::ptrdiff_t>(terms_));
    if (!knots_.empty()) origin_ = knots_.front();
    find_uniform_step();
    if (breaks) check_breaks(*breaks, knots_);
    breaks_ = breaks ? std::move(*breaks) : find_breaks();
}

// Knots no further than half a step from an even grid: the piece guessed from the grid is off by one at most.
void Track::find_uniform_step() {
    const std::size_t n = knots_.size();
    if (n < 3) return;
    const double step = (knots_.back() - knots_.front()) / static_cast<double>(n - 1);
    for (std::size_t k = 0; k < n; ++k)
        if (!(std::abs(knots_[k] - (knots_.front() + static_cast<double>(k) * step)) <= 0.5 * step)) return;
    inverse_step_ = 1.0 / step;
}

std::size_t Track::piece_at(const Instant& at) const {
    const std::size_t n = knots_.size();
    if (n == 0 || !at.is_past(knots_.front())) return 0;
    if (at.is_past(knots_.back())) return n;
    if (inverse_step_ == 0.0) {
        const auto next = std::partition_point(knots_.begin(), knots_.end(), [&](double t) { return at.is_past(t); });
        return static_cast<std::size_t>(next - knots_.begin());
    }
    std::size_t k = std::min(static_cast<std::size_t>((at.t - knots_.front()) * inverse_step_), n - 2);
    while (!at.is_past(knots_[k])) --k;
    while (at.is_past(knots_[k + 1])) ++k;
    return k + 1;
}

double Track::width(std::size_t piece) const {
    if (piece == 0 || piece == knots_.size()) return std::numeric_limits<double>::infinity();
    return knots_[piece] - knots_[piece - 1];
}

double Track::jump(std::size_t knot, int order) const {
    const double t = knots_[knot];
    Instant before(t);
    before.from_left = true;
    const Instant after(t);
    const auto step = [&]<int n>() { return derivative<n>(t, after) - derivative<n>(t, before); };
    return order == 0   ? step.template operator()<0>()
           : order == 1 ? step.template operator()<1>()
                        : step.template operator()<2>();
}

// A bound on the size of a derivative over all pieces, the outer ones at the knots alone.
double Track::largest(int order) const {
    double bound = 0.0;
    for (std::size_t piece = 0; piece <= knots_.size(); ++piece) {
        const double x = std::isfinite(width(piece)) ? width(piece) : 0.0;
        double sum = 0.0;
        for (std::size_t j = terms_; j-- > static_cast<std::size_t>(order);)
            sum = sum * x + factor(j, order) * std::abs(coefficients_[piece * terms_ + j]);
        bound = std::max(bound, sum);
    }
    return bound;
}

// A jump counts when it stands out of the rounding with which such coefficients can be computed at all: of the
// derivative itself, and of differences of values of this size over a piece of this width.
std::vector<double> Track::find_breaks() const {
    constexpr double relative = 1e-12, rounding = 16.0 * std::numeric_limits<double>::epsilon();
    const std::array<double, 3> size{largest(0), largest(1), largest(2)};
    std::vector<double> found;
    for (std::size_t k = 0; k < knots_.size(); ++k) {
        const double h = std::min(width(k), width(k + 1));
        const std::array<double, 3> noise{rounding * size[0], relative * size[1] + rounding * size[0] / h,
                                          relative * size[2] + rounding * size[0] / (h * h)};
        const auto jumps = [&](int order) { return std::abs(jump(k, order)) > noise[static_cast<std::size_t>(order)]; };
        if (jumps(0) || jumps(1) || jumps(2)) found.push_back(knots_[k]);
    }
    return found;
}

double Track::end() const {
    const auto last = coefficients_.end() - static_cast<std::ptrdiff_t>(terms_);
    const bool rests = std::all_of(last + 1, coefficients_.end(), [](double c) { return c == 0.0; });
    if (!rests) return std::numeric_limits<double>::infinity();
    return knots_.empty() ? -std::numeric_limits<double>::infinity() : knots_.back();
}

void Track::add_jet(const Instant& at, Polynomial& jet) const {
    const std::size_t piece = piece_at(at);
    const double x = at.t - begin_of(piece);
    Polynomial c{};  // c[j] xʲ, shifted to x by repeated synthetic division: then c[j] = derivative / j!
    std::copy_n(coefficients_.data() + piece * terms_, terms_, c.begin());
    for (std::size_t j = 0; j + 1 < terms_; ++j)
        for (std::size_t k = terms_ - 1; k-- > j;) c[k] += c[k + 1] * x;
    double factorial = 1.0;
    for (std::size_t j = 0; j < terms_; ++j) {
        if (j > 1) factorial *= static_cast<double>(j);
        jet[j] += factorial * c[j];
    }
}

Track Track::scaled(double factor) const {
    Track result = *this;
    for (double& c : result.coefficients_) {
        c *= factor;
        if (!std::isfinite(c)) refuse("waveform: scaled by ", factor, " it overflows");
    }
    return result;
}

Track Track::shifted(double delay) const {
    Track result = *this;
    for (double& t : result.knots_) t += delay;
    for (double& t : result.breaks_) t += delay;
    result.origin_ += delay;
    require_increasing("waveform", "knots", result.knots_);  // a long delay may round two knots together
    return result;
}

Waveform::Waveform(double constant) : Waveform({}, {Polynomial{constant}}) {}

Waveform::Waveform(std::vector<double> knots, const std::vector<Polynomial>& pieces,
                   std::optional<std::vector<double>> breaks) {
    tracks_.emplace_back(std::move(knots), pieces, std::move(breaks));
}

Waveform Waveform::held(std::vector<double> knots, std::vector<Polynomial> inner) {
    if (inner.empty() || inner.size() + 1 != knots.size())
        refuse("waveform: ", inner.size(), " inner pieces for ", knots.size(),
               " knots: there must be one piece between each two knots");
    const Polynomial before{inner.front()[0]};
    const Polynomial after{evaluate(inner.back(), knots.back() - knots[knots.size() - 2])};
    inner.insert(inner.begin(), before);
    inner.push_back(after);
    return Waveform(std::move(knots), inner);
}

Waveform::Waveform(std::vector<Harmonic> harmonics) : harmonics_(std::move(harmonics)) {
    for (std::size_t k = 0; k < harmonics_.size(); ++k) check(harmonics_[k], k);
}

std::vector<double> Waveform::breaks() const {
    std::vector<double> times;
    for (const Track& track : tracks_) times.insert(times.end(), track.breaks().begin(), track.breaks().end());
    for (const Harmonic& h : harmonics_) {  // its value and its rate are never both zero
        if (h.amplitude == 0.0) continue;
        if (std::isfinite(h.start)) times.push_back(h.start);
        if (std::isfinite(h.end)) times.push_back(h.end);
    }
    return sorted_once(std::move(times));
}

std::vector<double> Waveform::knots() const {
    std::vector<double> times = breaks();
    for (const Track& track : tracks_) times.insert(times.end(), track.knots().begin(), track.knots().end());
    return sorted_once(std::move(times));
}

double Track::turning_time() const {
    double shortest = std::numeric_limits<double>::infinity();
    for (std::size_t piece = 1; piece < knots_.size(); ++piece) {  // the pieces between two knots
        const double* c = coefficients_.data() + piece * terms_;
        if (std::any_of(c + std::min<std::size_t>(2, terms_), c + terms_, [](double x) { return x != 0.0; }))
            shortest = std::min(shortest, 0.5 * width(piece));
    }
    return shortest;
}

double Waveform::turning_time() const {
    double shortest = std::numeric_limits<double>::infinity();
    for (const Harmonic& h : harmonics_)
        if (h.amplitude != 0.0 && h.angular_frequency != 0.0)
            shortest = std::min(shortest, 0.25 * std::numbers::pi / std::abs(h.angular_frequency));
    for (const Track& track : tracks_) shortest = std::min(shortest, track.turning_time());
    return shortest;
}

double Waveform::end() const {
    double last = -std::numeric_limits<double>::infinity();
    for (const Track& track : tracks_) last = std::max(last, track.end());
    for (const Harmonic& h : harmonics_) last = std::max(last, h.end);
    return last == -std::numeric_limits<double>::infinity() ? 0.0 : last;
}

Polynomial Waveform::polynomial_jet(const Instant& at) const {
    Polynomial jet{};
    for (const Track& track : tracks_) track.add_jet(at, jet);
    return jet;
}

std::size_t Waveform::polynomial_order() const {
    std::size_t terms = 1;
    for (const Track& track : tracks_) terms = std::max(terms, track.terms());
    return terms;
}

Waveform Waveform::scaled(double factor) const {
    if (!std::isfinite(factor)) refuse("waveform: factor = ", factor, " is not a finite number");
    Waveform result = *this;
    for (Track& track : result.tracks_) track = track.scaled(factor);
    for (Harmonic& h : result.harmonics_) h.amplitude *= factor;
    for (std::size_t k = 0; k < result.harmonics_.size(); ++k) check(result.harmonics_[k], k);
    return result;
}

Waveform Waveform::shifted(double delay) const {
    if (!std::isfinite(delay)) refuse("waveform: delay = ", delay, " is not a finite number");
    Waveform result = *this;
    for (Track& track : result.tracks_) track = track.shifted(delay);
    for (Harmonic& h : result.harmonics_) {
        if (!std::isfinite(h.start)) h.phase -= h.angular_frequency * delay;
        h.start += delay;
        h.end += delay;
    }
    for (std::size_t k = 0; k < result.harmonics_.size(); ++k) check(result.harmonics_[k], k);
    return result;
}

Waveform operator+(Waveform a, const Waveform& b) {
    a.tracks_.insert(a.tracks_.end(), b.tracks_.begin(), b.tracks_.end());
    a.harmonics_.insert(a.harmonics_.end(), b.harmonics_.begin(), b.harmonics_.end());
    return a;
}

}  // namespace dualdrive
