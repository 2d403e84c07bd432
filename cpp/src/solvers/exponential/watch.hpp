// Which stretches of a step need a close look for crossings. The guards' linear part is known on as fine a walk as its fast
// poles ask for, with slopes and curvatures; what laws make of a guard besides is a polynomial through the nodes, as the
// rest of the rates is.
//
// Between two points of the walk a quantity lies near the quintic through value, slope and curvature at both. How near is
// told by the quintic over two stretches, which is 2⁶ times as far off: it should meet value and slope in the middle.
#pragma once

#include <map>
#include <set>
#include <vector>

#include "../exact/laws.hpp"
#include "../exact/propagator.hpp"

namespace dualdrive::exponential {

class Watch {
  public:
    // unit: time that c is counted in at level 0, as Propagators have it.
    Watch(const exact::Laws<double>& laws, const std::vector<int>& driven, double unit);

    int rows() const { return exact::padded(static_cast<int>(quantities_.size())); }
    const std::vector<exact::Watched<double>>& quantities() const { return quantities_; }
    const std::vector<double>& upper() const { return upper_; }
    // Of (y, c_0, c_1): q, q' w/5 and q'' w²/20 of all quantities, 3 rows() rows, w = unit 2^level.
    const std::vector<double>& matrix(int level);
    const std::vector<double>& values() const { return values_; }  // q of y alone, rows() rows
    // Guards at a node as the model has them: those that are no pair there, or not constant, are watched alone from now on.
    // Returns whether any was new.
    bool set_apart(const double* guards);

  private:
    void find_quantities();

    const exact::Matrix<double> G_, GA_, GAA_;
    const std::vector<int> driven_;
    const double unit_;
    std::set<int> alone_;
    std::vector<exact::Watched<double>> quantities_;
    std::vector<bool> unwatched_;
    std::vector<double> upper_, values_;
    std::map<int, std::vector<double>> known_;
};

// How far the quintics through both neighbours are off in the middle, at most over points 1, 3, … < count; `values` as
// Watch::matrix gives them at count + 1 points.
void largest_doubt(int rows, int count, const double* values, double* doubt);

}  // namespace dualdrive::exponential
