// A problem whose functions another compiler made, on CVODE alone: a library that plain.py loads.
#include "driver.hpp"

namespace {

struct Compiled {
    using Values = void (*)(double t, const double* y, const long long* modes, double* out);
    using Switch = void (*)(long long guard, double t, double* y, long long* modes);

    int states, guards;
    Values rates_in, guards_in;
    Switch change;
    long long* modes;
    static constexpr bool falling = true;

    void rates(double t, const double* y, double* rate) const { rates_in(t, y, modes, rate); }
    bool jacobian(double*) const { return false; }
    void roots(double t, const double* y, double* g) const { guards_in(t, y, modes, g); }
    int switched(const int* crossed, double t, double* y) const {
        int found = 0;
        for (int k = 0; k < guards; ++k)
            if (crossed[k]) {
                change(k, t, y, modes);
                ++found;
            }
        return found;
    }
};

}  // namespace

// modes: as they are at the first of the times, changed as the run goes. counts: switches, steps, evaluations of the rates.
// Returns 0, or 1 where CVODE gave up.
extern "C" int plain_cvode(Compiled::Values rates, Compiled::Values guards, Compiled::Switch change, int n_states,
                           int n_guards, long long* modes, int bdf, double rtol, const double* atol,
                           const double* times, int rows, const double* start, double* out, long* counts) {
    Compiled problem{n_states, n_guards, rates, guards, change, modes};
    const auto n = static_cast<std::size_t>(n_states);
    try {
        const Counts found = integrate(problem, bdf ? CV_BDF : CV_ADAMS, rtol, {atol, n},
                                       {times, static_cast<std::size_t>(rows)}, {start, n}, out);
        counts[0] = found.switches;
        counts[1] = found.steps;
        counts[2] = found.rhs;
    } catch (const std::exception&) {
        return 1;
    }
    return 0;
}
