// A problem with modes on CVODE alone, written as well as its interface allows: modes are frozen while CVODE integrates, it
// stops where one ends and starts afresh there. What dualdrive's cvode engine is measured by.
//
// A Problem says
//   states, guards                       how many there are
//   rates(t, y, rate)                    in the modes that are
//   jacobian(J)                          by columns; false where CVODE is to take difference quotients
//   roots(t, y, g)                       one for each guard
//   switched(crossed, t, y)              the modes after these roots; how many changed, 0 where the run goes on as it was
//   falling                              whether a root counts only where its guard falls
#pragma once

#include <cvodes/cvodes.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <algorithm>
#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

struct Counts {
    long switches = 0, steps = 0, rhs = 0;
};

constexpr long most_switches = 20'000;  // more are no headway

inline void need(bool fine, const char* what) {
    if (!fine) throw std::runtime_error(std::string(what) + " failed");
}

// y: the state at the first of the times. out: states at every time, one row each. Throws where CVODE gives up.
template <class Problem>
Counts integrate(Problem& problem, int method, double rtol, std::span<const double> atol, std::span<const double> times,
                 std::span<const double> start, double* out) {
    const auto data = [](N_Vector v) { return NV_DATA_S(v); };
    Counts result;
    SUNContext context = nullptr;
#if SUNDIALS_VERSION_MAJOR >= 7
    need(SUNContext_Create(SUN_COMM_NULL, &context) == 0, "SUNContext_Create");
#else
    need(SUNContext_Create(nullptr, &context) == 0, "SUNContext_Create");
#endif
    N_Vector y = N_VNew_Serial(problem.states, context);
    N_VEnableFusedOps_Serial(y, 1);  // CVODE's own vectors are clones of it
    std::ranges::copy(start, data(y));
    N_Vector allowed = N_VClone(y);
    std::ranges::copy(atol, data(allowed));
    SUNMatrix matrix = SUNDenseMatrix(problem.states, problem.states, context);
    SUNLinearSolver linear = SUNLinSol_Dense(y, matrix, context);
    void* cvode = CVodeCreate(method, context);
    const CVRhsFn rates = [](double t, N_Vector z, N_Vector rate, void* user) {
        static_cast<Problem*>(user)->rates(t, NV_DATA_S(z), NV_DATA_S(rate));
        return 0;
    };
    const CVLsJacFn jacobian = [](double, N_Vector, N_Vector, SUNMatrix J, void* user, N_Vector, N_Vector, N_Vector) {
        static_cast<Problem*>(user)->jacobian(SM_DATA_D(J));
        return 0;
    };
    const CVRootFn roots = [](double t, N_Vector z, double* g, void* user) {
        static_cast<Problem*>(user)->roots(t, NV_DATA_S(z), g);
        return 0;
    };
    double t = times.front();
    need(CVodeInit(cvode, rates, t, y) == 0, "CVodeInit");
    CVodeSVtolerances(cvode, rtol, allowed);
    CVodeSetUserData(cvode, &problem);
    CVodeSetMaxNumSteps(cvode, -1);
    CVodeSetLinearSolver(cvode, linear, matrix);
    if (problem.jacobian(SM_DATA_D(matrix))) CVodeSetJacFn(cvode, jacobian);
    CVodeRootInit(cvode, problem.guards, roots);
    std::vector<int> crossed(static_cast<std::size_t>(problem.guards), -1);
    if (problem.falling) CVodeSetRootDirection(cvode, crossed.data());
    CVodeSetNoInactiveRootWarn(cvode);

    const auto count = [&] {
        long n = 0;
        CVodeGetNumSteps(cvode, &n);
        result.steps += n;
        CVodeGetNumRhsEvals(cvode, &n);
        result.rhs += n;
        CVodeGetNumLinRhsEvals(cvode, &n);
        result.rhs += n;
    };
    out = std::copy_n(data(y), problem.states, out);
    for (const double until : times.subspan(1)) {
        while (until - t > 1e-12) {
            const int flag = CVode(cvode, until, y, &t, CV_NORMAL);
            need(flag >= 0, "CVode");
            if (flag != CV_ROOT_RETURN) break;
            CVodeGetRootInfo(cvode, crossed.data());
            const int changed = problem.switched(crossed.data(), t, data(y));
            if (!changed) continue;
            result.switches += changed;
            need(result.switches <= most_switches, "headway among switches");
            count();
            CVodeReInit(cvode, t, y);
        }
        out = std::copy_n(data(y), problem.states, out);
    }
    count();
    CVodeFree(&cvode);
    SUNLinSolFree(linear);
    SUNMatDestroy(matrix);
    N_VDestroy(y);
    N_VDestroy(allowed);
    SUNContext_Free(&context);
    return result;
}
