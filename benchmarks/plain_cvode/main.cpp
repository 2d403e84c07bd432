// The impact case on CVODE alone (driver.hpp), in a process of its own.
//
//   plain_cvode adams|bdf RTOL SECONDS OUTPUT < NUMBERS
//
// NUMBERS: the members of Machine in their order, then the usual sizes of the states, to which absolute tolerances are
// relative. The speeds of the meshes are roots as well, so that a flank touched and left within one step is seen.
// It runs until SECONDS of processor time are spent, once at least. OUTPUT gets 10 s of states, one row of doubles each
// millisecond. Printed: processor time of the best run (ms), contacts, steps, evaluations of the rates.
#include <time.h>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "driver.hpp"
#include "machine.hpp"

namespace {

constexpr int rows = 10001;
constexpr double output_step = 1e-3;  // s

struct Case {
    static constexpr int states = state::count, guards = 6;  // four flanks, two speeds of meshes
    static constexpr bool falling = false;
    Machine machine{};
    Flanks flanks;
    std::array<Matrix, 9> jacobians{};

    Matrix& known(Flanks f) { return jacobians[static_cast<std::size_t>(3 * (f.first + 1) + f.second + 1)]; }

    void rates(double t, const double* y, double* rate) const { ::rates(machine, flanks, t, y, rate); }

    bool jacobian(double* J) {
        std::memcpy(J, known(flanks).data(), sizeof(Matrix));
        return true;
    }

    void roots(double, const double* z, double* g) const {
        const Machine& m = machine;
        g[0] = z[state::x_1] - m.gap;
        g[1] = z[state::x_1] + m.gap;
        g[2] = z[state::x_2] - m.gap;
        g[3] = z[state::x_2] + m.gap;
        g[4] = z[state::omega_c1] - m.i_m * z[state::omega_m];
        g[5] = z[state::omega_c2] - m.i_m * z[state::omega_m];
    }

    int switched(const int* crossed, double, const double*) {
        return switch_flank(flanks.first, crossed[0], crossed[1]) + switch_flank(flanks.second, crossed[2], crossed[3]);
    }

  private:
    // The flank after a root, from the direction of the crossing; whether there was one.
    static bool switch_flank(int& flank, int rises_at_front, int rises_at_back) {
        if (rises_at_front) flank = rises_at_front > 0 ? 1 : 0;
        if (rises_at_back) flank = rises_at_back > 0 ? 0 : -1;
        return rises_at_front || rises_at_back;
    }
};

double processor_time() {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

int measure(const std::string& method, double rtol, double seconds, const char* output) {
    Case c;
    static_assert(sizeof(Machine) % sizeof(double) == 0, "Machine is a list of numbers");
    std::array<double, sizeof(Machine) / sizeof(double)> numbers{};
    for (double& number : numbers) std::cin >> number;
    std::memcpy(&c.machine, numbers.data(), sizeof(Machine));
    std::vector<double> atol(state::count);
    for (double& allowed : atol) {
        std::cin >> allowed;
        allowed *= rtol;
    }
    need(static_cast<bool>(std::cin), "reading the numbers");
    for (int first = -1; first <= 1; ++first)
        for (int second = -1; second <= 1; ++second) c.known({first, second}) = jacobian(c.machine, {first, second});

    std::vector<double> times(rows), states(std::size_t{rows} * state::count);
    for (std::size_t row = 0; row < times.size(); ++row) times[row] = static_cast<double>(row) * output_step;
    const std::vector<double> rest(state::count);
    double best = 1e300;
    Counts counts;
    const double start = processor_time();
    for (double begin = start, end = start; end - start <= seconds || begin == start; begin = end) {
        c.flanks = {};
        counts = integrate(c, method == "bdf" ? CV_BDF : CV_ADAMS, rtol, atol, times, rest, states.data());
        end = processor_time();
        best = std::min(best, end - begin);
    }
    std::ofstream file(output, std::ios::binary);
    file.write(reinterpret_cast<const char*>(states.data()),
               static_cast<std::streamsize>(states.size() * sizeof(double)));
    need(static_cast<bool>(file), "writing the output");
    std::printf("%.6f %ld %ld %ld\n", 1e3 * best, counts.switches, counts.steps, counts.rhs);
    return EXIT_SUCCESS;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 5) {
        std::fprintf(stderr, "usage: plain_cvode adams|bdf RTOL SECONDS OUTPUT < NUMBERS\n");
        return EXIT_FAILURE;
    }
    try {
        return measure(argv[1], std::atof(argv[2]), std::atof(argv[3]), argv[4]);
    } catch (const std::exception& failure) {
        std::fprintf(stderr, "plain_cvode: %s\n", failure.what());
        return EXIT_FAILURE;
    }
}
