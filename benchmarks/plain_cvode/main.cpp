// The impact case on CVODE alone, written as well as its interface allows: what dualdrive's cvode engine is measured by.
//
//   plain_cvode adams|bdf RTOL SECONDS OUTPUT < NUMBERS
//
// NUMBERS: the members of Machine in their order, then the usual sizes of the states, to which absolute tolerances are
// relative. Flanks are frozen while CVODE integrates; it stops at every contact made or lost and starts afresh there.
// The speeds of the meshes are roots as well, so that a flank touched and left within one step is seen.
// It runs until SECONDS of processor time are spent, once at least. OUTPUT gets 10 s of states, one row of doubles each
// millisecond. Printed: processor time of the best run (ms), contacts, steps, evaluations of the rates.
#include <cvodes/cvodes.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

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

#include "machine.hpp"

namespace {

constexpr int rows = 10001;
constexpr double output_step = 1e-3;  // s
constexpr int guards = 6;             // four flanks, two speeds of meshes

struct Case {
    Machine machine{};
    Flanks flanks;
    std::array<Matrix, 9> jacobians{};

    Matrix& known(Flanks f) { return jacobians[static_cast<std::size_t>(3 * (f.first + 1) + f.second + 1)]; }
};

struct Result {
    std::vector<double> states;
    long contacts = 0, steps = 0, rhs = 0;
};

double* data(N_Vector v) { return NV_DATA_S(v); }

int on_rates(double t, N_Vector y, N_Vector rate, void* user) {
    const Case& c = *static_cast<Case*>(user);
    rates(c.machine, c.flanks, t, data(y), data(rate));
    return 0;
}

int on_jacobian(double, N_Vector, N_Vector, SUNMatrix J, void* user, N_Vector, N_Vector, N_Vector) {
    Case& c = *static_cast<Case*>(user);
    std::memcpy(SM_DATA_D(J), c.known(c.flanks).data(), sizeof(Matrix));
    return 0;
}

int on_roots(double, N_Vector y, double* g, void* user) {
    const Machine& m = static_cast<Case*>(user)->machine;
    const double* z = data(y);
    g[0] = z[state::x_1] - m.gap;
    g[1] = z[state::x_1] + m.gap;
    g[2] = z[state::x_2] - m.gap;
    g[3] = z[state::x_2] + m.gap;
    g[4] = z[state::omega_c1] - m.i_m * z[state::omega_m];
    g[5] = z[state::omega_c2] - m.i_m * z[state::omega_m];
    return 0;
}

void need(bool fine, const char* what) {
    if (!fine) throw std::runtime_error(std::string(what) + " failed");
}

// The flank after a root, from the direction of the crossing; whether there was one.
bool switch_flank(int& flank, int rises_at_front, int rises_at_back) {
    if (rises_at_front) flank = rises_at_front > 0 ? 1 : 0;
    if (rises_at_back) flank = rises_at_back > 0 ? 0 : -1;
    return rises_at_front || rises_at_back;
}

Result run(Case& c, int method, double rtol, const std::vector<double>& sizes) {
    Result result;
    result.states.resize(std::size_t{rows} * state::count);
    c.flanks = {};
    SUNContext context = nullptr;
#if SUNDIALS_VERSION_MAJOR >= 7
    need(SUNContext_Create(SUN_COMM_NULL, &context) == 0, "SUNContext_Create");
#else
    need(SUNContext_Create(nullptr, &context) == 0, "SUNContext_Create");
#endif
    N_Vector y = N_VNew_Serial(state::count, context);
    N_VEnableFusedOps_Serial(y, 1);  // CVODE's own vectors are clones of it
    N_VConst(0.0, y);
    N_Vector atol = N_VClone(y);
    for (int k = 0; k < state::count; ++k) data(atol)[k] = rtol * sizes[static_cast<std::size_t>(k)];
    SUNMatrix matrix = SUNDenseMatrix(state::count, state::count, context);
    SUNLinearSolver linear = SUNLinSol_Dense(y, matrix, context);
    void* cvode = CVodeCreate(method, context);
    need(CVodeInit(cvode, on_rates, 0.0, y) == 0, "CVodeInit");
    CVodeSVtolerances(cvode, rtol, atol);
    CVodeSetUserData(cvode, &c);
    CVodeSetMaxNumSteps(cvode, -1);
    CVodeSetLinearSolver(cvode, linear, matrix);
    CVodeSetJacFn(cvode, on_jacobian);
    CVodeRootInit(cvode, guards, on_roots);
    CVodeSetNoInactiveRootWarn(cvode);

    const auto count = [&] {
        long n = 0;
        CVodeGetNumSteps(cvode, &n);
        result.steps += n;
        CVodeGetNumRhsEvals(cvode, &n);
        result.rhs += n;
    };
    double t = 0.0;
    std::copy_n(data(y), state::count, result.states.begin());
    for (int row = 1; row < rows; ++row) {
        const double until = row * output_step;
        while (until - t > 1e-12) {
            const int flag = CVode(cvode, until, y, &t, CV_NORMAL);
            need(flag >= 0, "CVode");
            if (flag != CV_ROOT_RETURN) break;
            int crossed[guards];
            CVodeGetRootInfo(cvode, crossed);
            const bool first = switch_flank(c.flanks.first, crossed[0], crossed[1]);
            const bool second = switch_flank(c.flanks.second, crossed[2], crossed[3]);
            if (!first && !second) continue;
            result.contacts += first + second;
            count();
            CVodeReInit(cvode, t, y);
        }
        std::copy_n(data(y), state::count, result.states.begin() + std::ptrdiff_t{row} * state::count);
    }
    count();
    CVodeFree(&cvode);
    SUNLinSolFree(linear);
    SUNMatDestroy(matrix);
    N_VDestroy(y);
    N_VDestroy(atol);
    SUNContext_Free(&context);
    return result;
}

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
    std::vector<double> sizes(state::count);
    for (double& size : sizes) std::cin >> size;
    need(static_cast<bool>(std::cin), "reading the numbers");
    for (int first = -1; first <= 1; ++first)
        for (int second = -1; second <= 1; ++second) c.known({first, second}) = jacobian(c.machine, {first, second});

    double best = 1e300;
    Result result;
    const double start = processor_time();
    for (double begin = start, end = start; end - start <= seconds || begin == start; begin = end) {
        result = run(c, method == "bdf" ? CV_BDF : CV_ADAMS, rtol, sizes);
        end = processor_time();
        best = std::min(best, end - begin);
    }
    std::ofstream file(output, std::ios::binary);
    file.write(reinterpret_cast<const char*>(result.states.data()),
               static_cast<std::streamsize>(result.states.size() * sizeof(double)));
    need(static_cast<bool>(file), "writing the output");
    std::printf("%.6f %ld %ld %ld\n", 1e3 * best, result.contacts, result.steps, result.rhs);
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
