// An input signal over time: polynomial pieces plus harmonics.
//
// Everything that drives a machine from outside is a Waveform: the commanded motion, a load torque, a recorded channel.
// A solver walks from one breakpoint to the next and must never look across one, so it says in which Cell it stands.
// A Waveform carries no unit of its own; whoever uses it says what it means. Times are in s.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "dualdrive/scalar.hpp"

namespace dualdrive {

// The interval between two breakpoints in which a solver stands. At its ends a signal has the value of this side; a
// little beyond them (a trial step) it goes on with the same piece, so that the solver sees a smooth field.
struct Cell {
    double low = -std::numeric_limits<double>::infinity();
    double high = std::numeric_limits<double>::infinity();
};

// Where a signal is read, and from which side.
struct Instant {
    double t;
    bool from_left;

    Instant(double time, const Cell& cell)
        : t(std::fmin(std::fmax(time, cell.low), cell.high)), from_left(t >= cell.high && t > cell.low) {}
    explicit Instant(double time) : t(time), from_left(false) {}  // right-continuous

    bool is_past(double time) const { return from_left ? time < t : time <= t; }
};

// amplitude · sin(ω (t − start) + phase) while start ≤ t < end, else zero. Without a start, t counts from zero.
struct Harmonic {
    double amplitude;
    double angular_frequency;  // rad/s
    double phase = 0.0;        // rad
    double start = -std::numeric_limits<double>::infinity();
    double end = std::numeric_limits<double>::infinity();

    bool sounds(const Instant& at) const { return at.is_past(start) && !at.is_past(end); }
    double origin() const { return std::isfinite(start) ? start : 0.0; }

    // The derivative of the given order, 0 to 2.
    template <int order, class S>
    S derivative(const S& t) const {
        using std::cos, std::sin;
        const S angle = S(angular_frequency) * (t - S(origin())) + S(phase);
        if constexpr (order == 0) return S(amplitude) * sin(angle);
        if constexpr (order == 1) return S(amplitude * angular_frequency) * cos(angle);
        if constexpr (order == 2) return S(-amplitude * angular_frequency * angular_frequency) * sin(angle);
    }
};

// c[0] + c[1] x + ... + c[5] x⁵ with x the time since the piece began.
inline constexpr std::size_t polynomial_terms = 6;
using Polynomial = std::array<double, polynomial_terms>;

// One piecewise polynomial: piece k ends at knot k, the piece after it begins there; the last goes on for ever.
class Track {
  public:
    Track(std::vector<double> knots, const std::vector<Polynomial>& pieces, std::optional<std::vector<double>> breaks);

    const std::vector<double>& knots() const { return knots_; }
    const std::vector<double>& breaks() const { return breaks_; }
    const std::vector<double>& coefficients() const { return coefficients_; }  // terms() per piece
    double origin() const { return origin_; }  // from which the first piece counts its time
    double end() const;                        // the last knot; infinite when the last piece is not constant
    double turning_time() const;
    std::size_t terms() const { return terms_; }  // of the longest piece
    // Adds the derivatives of orders 0 to 5 at `at` to `jet`, from which the piece goes on as a polynomial.
    void add_jet(const Instant& at, Polynomial& jet) const;
    Track scaled(double factor) const;
    Track shifted(double delay) const;

    template <int order, class S>
    S derivative(const S& t, const Instant& at) const {
        const std::size_t piece = piece_at(at);
        const double* c = coefficients_.data() + piece * terms_;
        const S x = t - S(begin_of(piece));
        S sum(0.0);
        for (std::size_t j = terms_; j-- > order;) sum = sum * x + S(factor(j, order) * c[j]);
        return sum;
    }

  private:
    // What differentiating `order` times brings down from xʲ.
    static constexpr double factor(std::size_t j, int order) {
        const auto n = static_cast<double>(j);
        return order == 0 ? 1.0 : order == 1 ? n : n * (n - 1.0);
    }
    // A piece counts time from its first knot; the one before all knots from the first knot too.
    double begin_of(std::size_t piece) const { return piece == 0 ? origin_ : knots_[piece - 1]; }
    std::size_t piece_at(const Instant& at) const;
    void find_uniform_step();
    std::vector<double> find_breaks() const;
    double jump(std::size_t knot, int order) const;
    double largest(int order) const;
    double width(std::size_t piece) const;

    std::vector<double> knots_;
    std::vector<double> coefficients_;  // `terms_` per piece
    std::size_t terms_ = 1;
    double origin_ = 0.0;
    double inverse_step_ = 0.0;  // of near-uniform knots, whose pieces are found without a search; else 0
    std::vector<double> breaks_;
};

// A sum of piecewise polynomials and harmonics. Immutable, so that threads may share one.
class Waveform {
  public:
    Waveform() = default;  // zero at all times
    explicit Waveform(double constant);

    // pieces[0] before the first knot, pieces[k] from knot k−1 to knot k, the last from the last knot on, each in the
    // time since its own first knot (the first: since the first knot; without knots: since zero). `breaks` may be given
    // by a builder who knows them; otherwise jumps above the rounding of the coefficients are found.
    // Throws std::invalid_argument unless all numbers are finite, knots increase and there is one piece more than knots.
    Waveform(std::vector<double> knots, const std::vector<Polynomial>& pieces,
             std::optional<std::vector<double>> breaks = std::nullopt);

    // Pieces between the knots alone, one fewer than knots; outside the end values are held, with zero rate.
    static Waveform held(std::vector<double> knots, std::vector<Polynomial> inner);

    // Throws std::invalid_argument unless numbers are finite, frequencies positive and every start before its end.
    explicit Waveform(std::vector<Harmonic> harmonics);

    template <class S>
    S value(const S& t, const Cell& cell) const {
        return derivative<0>(t, Instant(value_of(t), cell));
    }
    template <class S>
    S rate(const S& t, const Cell& cell) const {
        return derivative<1>(t, Instant(value_of(t), cell));
    }
    template <class S>
    S acceleration(const S& t, const Cell& cell) const {
        return derivative<2>(t, Instant(value_of(t), cell));
    }

    // Right-continuous: at a breakpoint the side that follows it.
    double value(double t) const { return derivative<0>(t, Instant(t)); }
    double rate(double t) const { return derivative<1>(t, Instant(t)); }
    double acceleration(double t) const { return derivative<2>(t, Instant(t)); }

    // Times, increasing, where the value, the rate or the acceleration of a part jumps (jumps of two parts that cancel
    // are listed too). A knot across which all three are continuous is no break.
    std::vector<double> breaks() const;
    // Times, increasing, where the formula changes: every break, and the smooth knots besides.
    std::vector<double> knots() const;
    // The last knot: from then on the signal rests. Infinite if it never does, zero for a constant.
    double end() const;

    // A time within which the signal cannot swing there and back unseen: an eighth of its fastest period, half of its
    // shortest curved piece. Infinite for steps and ramps. A solver at rest sees its inputs only where it steps.
    double turning_time() const;

    // The parts as a generator of the signal needs them: all derivatives of the polynomial part at an instant, how many
    // of them can differ from zero at any time, and the harmonics.
    Polynomial polynomial_jet(const Instant& at) const;
    std::size_t polynomial_order() const;
    const std::vector<Track>& tracks() const { return tracks_; }
    const std::vector<Harmonic>& harmonics() const { return harmonics_; }

    Waveform scaled(double factor) const;
    Waveform shifted(double delay) const;  // later by `delay` s
    friend Waveform operator+(Waveform a, const Waveform& b);

  private:
    template <int order, class S>
    S derivative(const S& t, const Instant& at) const {
        S sum(0.0);
        for (const Track& track : tracks_) sum = sum + track.derivative<order>(t, at);
        for (const Harmonic& harmonic : harmonics_)
            if (harmonic.sounds(at)) sum = sum + harmonic.derivative<order>(t);
        return sum;
    }

    std::vector<Track> tracks_;
    std::vector<Harmonic> harmonics_;
};

}  // namespace dualdrive
