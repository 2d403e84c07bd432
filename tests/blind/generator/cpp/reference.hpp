// Commanded motion: pieces of constant jerk, from rest.
#pragma once

#include <algorithm>
#include <vector>

namespace blind {

struct Command {
    double angle, speed;
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

    Command at(double t) const {
        auto after =
            std::upper_bound(pieces_.begin(), pieces_.end(), t, [](double v, const Piece& p) { return v < p.t; });
        if (after == pieces_.begin()) return {0, 0};
        const Piece& p = *(after - 1);
        double u = t - p.t;
        return {p.angle + u * (p.speed + u * (p.rate / 2 + u * p.jerk / 6)), p.speed + u * (p.rate + u * p.jerk / 2)};
    }

  private:
    struct Piece {
        double t, angle, speed, rate, jerk;
    };
    std::vector<Piece> pieces_;
};

}  // namespace blind
