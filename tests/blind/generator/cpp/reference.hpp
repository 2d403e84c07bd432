// Commanded motion: pieces of constant jerk from rest, or cubic pieces of even length.
#pragma once

#include <algorithm>
#include <vector>

namespace blind {

struct Command {
    double angle, speed;
};

// One cubic piece: angle and speed at its ends. Neighbours need not join smoothly.
struct Knot {
    double angle, speed, next_angle, next_speed;
};

class Reference {
  public:
    // Jerk from time t on; times increase.
    void add(double t, double jerk) {
        Piece next{t, 0, 0, 0, jerk};
        if (!pieces_.empty()) {
            const Piece& p = pieces_.back();
            double u = t - p.t;
            next.angle = p.angle + u * (p.speed + u * (p.rate / 2 + u * p.jerk / 6));
            next.speed = p.speed + u * (p.rate + u * p.jerk / 2);
            next.rate = p.rate + u * p.jerk;
        }
        pieces_.push_back(next);
    }

    // Cubic pieces from time 0 on, each `step` long; held at rest before and after.
    void set(std::vector<Knot> knots, double step) {
        knots_ = std::move(knots);
        step_ = step;
    }

    Command at(double t) const { return knots_.empty() ? along_pieces(t) : along_knots(t); }

  private:
    struct Piece {
        double t, angle, speed, rate, jerk;
    };

    Command along_pieces(double t) const {
        auto after =
            std::upper_bound(pieces_.begin(), pieces_.end(), t, [](double v, const Piece& p) { return v < p.t; });
        if (after == pieces_.begin()) return {0, 0};
        const Piece& p = *(after - 1);
        double u = t - p.t;
        return {p.angle + u * (p.speed + u * (p.rate / 2 + u * p.jerk / 6)), p.speed + u * (p.rate + u * p.jerk / 2)};
    }

    // Times that are meant to be a knot's may miss it by rounding: they belong to the piece that begins there.
    Command along_knots(double t) const {
        double place = t / step_ + 1e-6;
        if (place < 0) return {knots_.front().angle, 0};
        auto k = static_cast<std::size_t>(place);
        if (k >= knots_.size()) return {knots_.back().next_angle, 0};
        const Knot& p = knots_[k];
        double u = std::max(0.0, t / step_ - static_cast<double>(k)), v = 1 - u;
        double rise = p.next_angle - p.angle;
        double angle = p.angle + rise * u * u * (3 - 2 * u) + step_ * u * v * (p.speed * v - p.next_speed * u);
        double speed = 6 * rise / step_ * u * v + p.speed * v * (1 - 3 * u) + p.next_speed * u * (3 * u - 2);
        return {angle, speed};
    }

    std::vector<Piece> pieces_;
    std::vector<Knot> knots_;
    double step_ = 1;
};

}  // namespace blind
