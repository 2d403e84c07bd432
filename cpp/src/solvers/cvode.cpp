#include "cvode.hpp"

#include <cvodes/cvodes.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_config.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>
#include <new>
#include <stdexcept>
#include <utility>

namespace dualdrive {

namespace {

#if SUNDIALS_VERSION_MAJOR >= 7
using Context = SUNContext;
int create_context(SUNContext* c) { return SUNContext_Create(SUN_COMM_NULL, c); }
#else
int create_context(SUNContext* c) { return SUNContext_Create(nullptr, c); }
#endif

void silence(int, const char*, const char*, char*, void*) {}  // failures come back as a status, not on stderr

std::string advice(int flag) {
    switch (flag) {
        case CV_TOO_MUCH_ACC:
            return "the tolerance is finer than arithmetic allows; raise rtol";
        case CV_ERR_FAILURE:
        case CV_CONV_FAILURE:
            return "the step size fell to nothing; try method = bdf, a larger rtol, or look for a stiffness or gain "
                   "that is far too large";
        case CV_RHSFUNC_FAIL:
        case CV_FIRST_RHSFUNC_ERR:
        case CV_REPTD_RHSFUNC_ERR:
        case CV_UNREC_RHSFUNC_ERR:
        case CV_QRHSFUNC_FAIL:
        case CV_FIRST_QRHSFUNC_ERR:
        case CV_REPTD_QRHSFUNC_ERR:
        case CV_UNREC_QRHSFUNC_ERR:
        case CV_SRHSFUNC_FAIL:
        case CV_FIRST_SRHSFUNC_ERR:
        case CV_REPTD_SRHSFUNC_ERR:
        case CV_UNREC_SRHSFUNC_ERR:
            return Solver::not_finite;
        case CV_LSETUP_FAIL:
        case CV_LSOLVE_FAIL:
            return "the linear solver failed; try method = adams or smaller gains";
        case CV_RTFUNC_FAIL:
            return "a switching condition was not finite; check parameters and initial state";
        default:
            return "CVODE returned code " + std::to_string(flag);
    }
}

}  // namespace

struct Cvode::Hidden {
    Problem& problem;
    Size size;
    Method method;
    double rtol;
    SUNContext context = nullptr;
    void* memory = nullptr;
    N_Vector y = nullptr, tolerance = nullptr, scratch = nullptr, q = nullptr;
    N_Vector *s = nullptr, q_scratch = nullptr;
    SUNMatrix matrix = nullptr;
    SUNLinearSolver linear = nullptr;
    double t = 0.0, begin = 0.0, longest = std::numeric_limits<double>::infinity();
    int flag = 0;
    bool started = false;
    std::vector<int> root, direction;
    std::vector<double> scale;
    std::vector<const double*> s_in;
    std::vector<double*> s_out;
    std::exception_ptr thrown;  // carried across SUNDIALS' C frames
    Counts before{};

    Hidden(Problem& p, Size n, Method m, double relative) : problem(p), size(n), method(m), rtol(relative) {}
    ~Hidden() {
        if (memory) CVodeFree(&memory);
        if (linear) SUNLinSolFree(linear);
        if (matrix) SUNMatDestroy(matrix);
        if (s) N_VDestroyVectorArray(s, size.sensitivities);
        for (N_Vector v : {y, tolerance, scratch, q, q_scratch})
            if (v) N_VDestroy(v);
        if (context) SUNContext_Free(&context);
    }

    template <class F>
    int guarded(F&& f) {
        try {
            return f() ? 0 : 1;  // 1: recoverable, try a smaller step
        } catch (...) {
            thrown = std::current_exception();
            return -1;
        }
    }

    static int rhs(double t, N_Vector y, N_Vector rate, void* user) {
        auto& h = *static_cast<Hidden*>(user);
        return h.guarded([&] { return h.problem.rhs(t, N_VGetArrayPointer(y), N_VGetArrayPointer(rate)); });
    }
    static int roots(double t, N_Vector y, double* g, void* user) {
        auto& h = *static_cast<Hidden*>(user);
        return h.guarded([&] { return h.problem.guards(t, N_VGetArrayPointer(y), g); });
    }
    static int jacobian(double t, N_Vector y, N_Vector, SUNMatrix J, void* user, N_Vector, N_Vector, N_Vector) {
        auto& h = *static_cast<Hidden*>(user);
        return h.guarded([&] { return h.problem.jacobian(t, N_VGetArrayPointer(y), SUNDenseMatrix_Data(J)); });
    }
    static int sensitivity(int n, double t, N_Vector y, N_Vector, N_Vector* s, N_Vector* rate, void* user, N_Vector,
                           N_Vector) {
        auto& h = *static_cast<Hidden*>(user);
        for (int k = 0; k < n; ++k) {
            h.s_in[static_cast<std::size_t>(k)] = N_VGetArrayPointer(s[k]);
            h.s_out[static_cast<std::size_t>(k)] = N_VGetArrayPointer(rate[k]);
        }
        return h.guarded(
            [&] { return h.problem.sensitivity(t, N_VGetArrayPointer(y), h.s_in.data(), h.s_out.data()); });
    }
    static int quadrature(double t, N_Vector y, N_Vector rate, void* user) {
        auto& h = *static_cast<Hidden*>(user);
        return h.guarded([&] { return h.problem.quadrature(t, N_VGetArrayPointer(y), N_VGetArrayPointer(rate)); });
    }

    static void need(int status, const char* what, int no_memory = CV_MEM_FAIL) {
        if (status == no_memory) throw std::bad_alloc();
        if (status != 0)
            throw std::runtime_error(std::string("solver: ") + what + " failed with code " + std::to_string(status));
    }

    template <class T>
    static T* made(T* block) {
        if (!block) throw std::bad_alloc();
        return block;
    }

    Counts read_counts() const {
        Counts c{};
        CVodeGetNumSteps(memory, &c.steps);
        CVodeGetNumRhsEvals(memory, &c.rhs);
        CVodeGetNumJacEvals(memory, &c.jacobians);
        CVodeGetNumGEvals(memory, &c.guards);
        CVodeGetNumErrTestFails(memory, &c.error_test_failures);
        return c;
    }
};

Cvode::Cvode(Problem& problem, Size size, Method method, double rtol, std::span<const int> root_direction,
             std::span<const double> parameter_scale)
    : h_(std::make_unique<Hidden>(problem, size, method, rtol)) {
    Hidden& h = *h_;
    if (create_context(&h.context) != 0) throw std::bad_alloc();  // it does nothing but allocate
    h.y = Hidden::made(N_VNew_Serial(size.states, h.context));
    h.tolerance = Hidden::made(N_VNew_Serial(size.states, h.context));
    h.scratch = Hidden::made(N_VNew_Serial(size.states, h.context));
    N_VConst(0.0, h.y);
    N_VConst(1.0, h.tolerance);
    if (size.sensitivities > 0) {
        h.s = Hidden::made(N_VCloneVectorArray(size.sensitivities, h.y));
        for (int k = 0; k < size.sensitivities; ++k) N_VConst(0.0, h.s[k]);
        h.s_in.resize(static_cast<std::size_t>(size.sensitivities));
        h.s_out.resize(static_cast<std::size_t>(size.sensitivities));
    }
    if (size.quadratures > 0) {
        h.q = Hidden::made(N_VNew_Serial(size.quadratures, h.context));
        h.q_scratch = Hidden::made(N_VNew_Serial(size.quadratures, h.context));
        N_VConst(0.0, h.q);
    }
    h.direction.assign(root_direction.begin(), root_direction.end());
    h.root.assign(h.direction.size(), 0);
    h.scale.assign(parameter_scale.begin(), parameter_scale.end());
    h.memory = Hidden::made(CVodeCreate(method == Method::bdf ? CV_BDF : CV_ADAMS, h.context));
}

Cvode::~Cvode() = default;

void Cvode::restart(double t, std::span<const double> atol, double quadrature_atol) {
    Hidden& h = *h_;
    std::copy(atol.begin(), atol.end(), N_VGetArrayPointer(h.tolerance));
    h.t = h.begin = t;
    if (!h.started) {
        Hidden::need(CVodeInit(h.memory, Hidden::rhs, t, h.y), "CVodeInit");
        CVodeSetUserData(h.memory, &h);
#if SUNDIALS_VERSION_MAJOR >= 7
        SUNContext_ClearErrHandlers(h.context);
#else
        CVodeSetErrHandlerFn(h.memory, silence, nullptr);
#endif
        CVodeSetMaxNumSteps(h.memory, -1);
        CVodeSetNoInactiveRootWarn(h.memory);
        Hidden::need(CVodeSVtolerances(h.memory, h.rtol, h.tolerance), "CVodeSVtolerances");
        h.matrix = Hidden::made(SUNDenseMatrix(h.size.states, h.size.states, h.context));
        h.linear = Hidden::made(SUNLinSol_Dense(h.y, h.matrix, h.context));
        Hidden::need(CVodeSetLinearSolver(h.memory, h.linear, h.matrix), "CVodeSetLinearSolver", CVLS_MEM_FAIL);
        Hidden::need(CVodeSetJacFn(h.memory, Hidden::jacobian), "CVodeSetJacFn");
        if (h.size.guards > 0) {
            Hidden::need(CVodeRootInit(h.memory, h.size.guards, Hidden::roots), "CVodeRootInit");
            Hidden::need(CVodeSetRootDirection(h.memory, h.direction.data()), "CVodeSetRootDirection");
        }
        if (h.size.quadratures > 0) {
            Hidden::need(CVodeQuadInit(h.memory, Hidden::quadrature, h.q), "CVodeQuadInit");
            Hidden::need(CVodeQuadSStolerances(h.memory, h.rtol, quadrature_atol), "CVodeQuadSStolerances");
            CVodeSetQuadErrCon(h.memory, SUNTRUE);
        }
        if (h.size.sensitivities > 0) {
            Hidden::need(CVodeSensInit(h.memory, h.size.sensitivities, CV_STAGGERED, Hidden::sensitivity, h.s),
                         "CVodeSensInit");
            Hidden::need(CVodeSetSensParams(h.memory, nullptr, h.scale.data(), nullptr), "CVodeSetSensParams");
            Hidden::need(CVodeSensEEtolerances(h.memory), "CVodeSensEEtolerances");
            CVodeSetSensErrCon(h.memory, SUNTRUE);  // off (its default) the sensitivities are wrong by whole per cents
        }
        h.started = true;
    } else {
        const Counts c = h.read_counts();
        h.before = {h.before.steps + c.steps, h.before.rhs + c.rhs, h.before.jacobians + c.jacobians,
                    h.before.guards + c.guards, h.before.error_test_failures + c.error_test_failures};
        Hidden::need(CVodeReInit(h.memory, t, h.y), "CVodeReInit");
        Hidden::need(CVodeSVtolerances(h.memory, h.rtol, h.tolerance), "CVodeSVtolerances");
        if (h.size.quadratures > 0) CVodeQuadReInit(h.memory, h.q);
        if (h.size.sensitivities > 0) CVodeSensReInit(h.memory, CV_STAGGERED, h.s);
    }
    if (std::isfinite(h.longest)) CVodeSetMaxStep(h.memory, h.longest);
}

void Cvode::limit_step(double longest, double turning) { h_->longest = std::min(longest, turning); }

Solver::Outcome Cvode::step(double stop) {
    Hidden& h = *h_;
    CVodeSetStopTime(h.memory, stop);
    h.begin = h.t;
    double reached = h.t;
    h.flag = CVode(h.memory, stop, h.y, &reached, CV_ONE_STEP);
    if (h.thrown) std::rethrow_exception(std::exchange(h.thrown, nullptr));
    if (h.flag == CV_TOO_CLOSE) {  // nothing left to integrate before the stop
        h.t = stop;
        return Outcome::stopped;
    }
    if (h.flag < 0) return Outcome::failed;
    h.t = reached;
    if (h.size.sensitivities > 0) CVodeGetSens(h.memory, &reached, h.s);
    if (h.size.quadratures > 0) CVodeGetQuad(h.memory, &reached, h.q);
    if (h.flag == CV_ROOT_RETURN) {
        CVodeGetRootInfo(h.memory, h.root.data());
        return Outcome::root;
    }
    return h.flag == CV_TSTOP_RETURN ? Outcome::stopped : Outcome::stepped;
}

double Cvode::time() const { return h_->t; }
double Cvode::previous_time() const { return h_->begin; }
std::span<double> Cvode::state() { return {N_VGetArrayPointer(h_->y), static_cast<std::size_t>(h_->size.states)}; }
std::span<double> Cvode::sensitivity(int k) {
    return {N_VGetArrayPointer(h_->s[k]), static_cast<std::size_t>(h_->size.states)};
}
std::span<double> Cvode::quadrature() {
    if (!h_->q) return {};
    return {N_VGetArrayPointer(h_->q), static_cast<std::size_t>(h_->size.quadratures)};
}

void Cvode::go_back(double t) {
    Hidden& h = *h_;
    CVodeGetDky(h.memory, t, 0, h.y);
    if (h.size.sensitivities > 0) CVodeGetSensDky(h.memory, t, 0, h.s);
    if (h.size.quadratures > 0) CVodeGetQuadDky(h.memory, t, 0, h.q);
    h.t = t;
}

void Cvode::state_at(double t, double* z) const {
    Hidden& h = *h_;
    const double* from = N_VGetArrayPointer(h.y);
    if (t != h.t && CVodeGetDky(h.memory, t, 0, h.scratch) == CV_SUCCESS) from = N_VGetArrayPointer(h.scratch);
    std::copy(from, from + h.size.states, z);
}

void Cvode::sensitivity_at(double t, int k, double* s) const {
    Hidden& h = *h_;
    const double* from = N_VGetArrayPointer(h.s[k]);
    if (t != h.t && CVodeGetSensDky1(h.memory, t, 0, k, h.scratch) == CV_SUCCESS) from = N_VGetArrayPointer(h.scratch);
    std::copy(from, from + h.size.states, s);
}

void Cvode::quadrature_at(double t, double* q) const {
    Hidden& h = *h_;
    if (!h.q) return;
    const double* from = N_VGetArrayPointer(h.q);
    if (t != h.t && CVodeGetQuadDky(h.memory, t, 0, h.q_scratch) == CV_SUCCESS) from = N_VGetArrayPointer(h.q_scratch);
    std::copy(from, from + h.size.quadratures, q);
}

std::span<const int> Cvode::roots() const { return h_->root; }
std::string Cvode::name() const { return h_->method == Method::bdf ? "bdf" : "adams"; }

Solver::Failure Cvode::failure() const {
    const bool vanished = h_->flag == CV_ERR_FAILURE || h_->flag == CV_CONV_FAILURE || h_->flag == CV_TOO_MUCH_ACC;
    return {vanished, advice(h_->flag)};
}

Solver::Counts Cvode::counts() const {
    const Hidden& h = *h_;
    if (!h.started) return h.before;
    const Counts c = h.read_counts();
    return {h.before.steps + c.steps, h.before.rhs + c.rhs, h.before.jacobians + c.jacobians,
            h.before.guards + c.guards, h.before.error_test_failures + c.error_test_failures};
}

}  // namespace dualdrive
