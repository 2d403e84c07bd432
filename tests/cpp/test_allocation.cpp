// Every allocation fails in turn: what was asked for is then refused as std::bad_alloc (or as a status of a run), nothing
// is lost of what was there, nothing leaks, and the same asked again has the same bits.
#include <doctest/doctest.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <functional>
#include <new>
#include <string>
#include <vector>

#include "dualdrive/ensemble.hpp"
#include "dualdrive/expression.hpp"
#include "dualdrive/innovations.hpp"
#include "dualdrive/simulate.hpp"
#include "held_pinions.hpp"

namespace {

std::atomic<bool> armed{false};
std::atomic<long> until{0};  // allocations that still succeed
std::atomic<bool> for_good{false};
std::atomic<bool> libraries{true};  // those of Eigen and SUNDIALS fail, too
std::atomic<long> made{0}, live{0};

bool fails() {
    if (!armed) return false;
    const long before = until.fetch_sub(1);
    ++made;
    return before == 0 || (for_good && before < 0);
}

void* counted(void* block) {
    if (armed && block) ++live;
    return block;
}

void returned(void* block) {
    if (armed && block) --live;
}

}  // namespace

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__GLIBC__)
// The sanitizers have a malloc of their own: C++ allocations alone fail.
#define CLEAN_MALLOC std::malloc
#define CLEAN_FREE std::free
#else
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);

static void* none() {
    errno = ENOMEM;
    return nullptr;
}
static bool library_fails() { return libraries && fails(); }
void* malloc(std::size_t size) { return library_fails() ? none() : counted(__libc_malloc(size)); }
void* calloc(std::size_t n, std::size_t size) { return library_fails() ? none() : counted(__libc_calloc(n, size)); }
void* realloc(void* block, std::size_t size) {
    if (library_fails()) return none();
    returned(block);
    return counted(__libc_realloc(block, size));
}
void* aligned_alloc(std::size_t at, std::size_t n) {
    return library_fails() ? none() : counted(__libc_memalign(at, n));
}
int posix_memalign(void** block, std::size_t at, std::size_t size) {
    *block = library_fails() ? nullptr : counted(__libc_memalign(at, size));
    return *block ? 0 : ENOMEM;
}
void free(void* block) {
    returned(block);
    __libc_free(block);
}
}
#define CLEAN_MALLOC __libc_malloc
#define CLEAN_FREE __libc_free
#endif

void* operator new(std::size_t size) {
    void* block = fails() ? nullptr : counted(CLEAN_MALLOC(size ? size : 1));
    if (!block) throw std::bad_alloc();
    return block;
}
void* operator new[](std::size_t size) { return operator new(size); }
void operator delete(void* block) noexcept {
    returned(block);
    CLEAN_FREE(block);
}
void operator delete(void* block, std::size_t) noexcept { operator delete(block); }
void operator delete[](void* block) noexcept { operator delete(block); }
void operator delete[](void* block, std::size_t) noexcept { operator delete(block); }

using namespace dualdrive;

namespace {

using Numbers = std::vector<double>;
using Action = std::function<Numbers()>;

struct Outcome {
    bool refused = false;  // std::bad_alloc
    std::string other;     // what else was thrown
    Numbers numbers;
    long leaked = 0, asked = 0;
};

Outcome attempt(const Action& action, long succeed, bool good) {
    Outcome outcome;
    live = 0;
    made = 0;
    until = succeed;
    for_good = good;
    armed = true;
    try {
        const Numbers found = action();
        armed = false;
        outcome.numbers = found;
        armed = true;
    } catch (const std::bad_alloc&) {
        outcome.refused = true;
    } catch (const std::exception& error) {
        armed = false;
        outcome.other = error.what();
    }
    armed = false;
    outcome.leaked = live;
    outcome.asked = made;
    return outcome;
}

// In turn up to `each` allocations, and beyond them every seventh.
void in_turn(const Action& action, long each = 600, bool counts_leaks = true) {
    const Numbers reference = action();  // tables that are made once are there from now on
    constexpr long never = 1'000'000'000;
    const Outcome whole = attempt(action, never, false);
    REQUIRE_FALSE(whole.refused);
    const long usual = whole.leaked;
    for (const bool good : {false, true})
        for (long n = 0; n < whole.asked; n += n < each ? 1 : 7) {
            const Outcome o = attempt(action, n, good);
            CAPTURE(n);
            CAPTURE(good);
            CAPTURE(o.other);
            // a library that returns a code where it has no memory is told as solver trouble, in words
            CHECK((o.refused || o.other.find("solver: ") == 0 || o.numbers == reference));
            if (counts_leaks && o.refused) CHECK(o.leaked <= usual);
        }
    CHECK(action() == reference);
}

Numbers run(Engine engine, const std::vector<std::string>& sensitivities = {}) {
    SimulateOptions o;
    o.end = 0.2;
    o.output_step = 0.01;
    o.engine = engine;
    o.initial = {{"omega_m", 0.1}};
    o.signals = {"omega_m", "theta_m"};
    o.sensitivities = sensitivities;
    const Trajectory t = simulate(bouncing(), {}, o);
    return t.status == Status::success ? t.values : Numbers{};
}

}  // namespace

TEST_CASE("formulas and units") {
    in_turn([] {
        const Unit unit = Unit::parse("kg*m^2*rad/s^2");
        const std::string text = unit.text();
        return Numbers{static_cast<double>(text.size()), unit == Unit::parse("N*m") ? 1.0 : 0.0};
    });
}

TEST_CASE("a machine that is built and copied") {
    in_turn([] {
        const Machine first = bouncing();
        Machine second = first;
        second.set("table.J", 7.0);
        return Numbers{second.get("table.J"), first.get("table.J")};
    });
}

TEST_CASE("a run of every engine") {
    SUBCASE("exact") {
        in_turn([] { return run(Engine::exact); }, 200);
    }
    SUBCASE("exponential") {
        in_turn([] { return run(Engine::exponential); }, 200);
    }
    SUBCASE("explicit") {
        in_turn([] { return run(Engine::explicit_rk); }, 200);
    }
    SUBCASE("CVODE") {
        libraries = false;  // N_VClone of SUNDIALS 6 writes to the vector that it could not make
        in_turn([] { return run(Engine::cvode); }, 200);
    }
    libraries = true;
    SUBCASE("with sensitivities") {
        in_turn([] { return run(Engine::exact, {"meshes.stiffness"}); }, 200);
    }
}

TEST_CASE("an ensemble on two threads ends, whoever finds no memory") {
    const auto all = [] {
        EnsemblePlan p;
        p.machine = bouncing();
        p.runs = 3;
        p.paths = {"meshes.gap"};
        p.values = {0.0, 1e-4, 2e-4};
        Scenario s;
        s.options.end = 0.05;
        s.options.initial = {{"omega_m", 0.1}};
        s.reductions = {{"theta_m", Measure::peak}};
        p.scenarios = {s};
        p.times = {0.0, 0.02, 0.05};
        Ensemble runs(p, 2, Ensemble::Order::by_number);
        Numbers found;
        bool complete = true;
        while (!runs.done())
            for (const auto& run : runs.take(std::chrono::milliseconds(10))) {
                complete = complete && run.status == "success";
                found.push_back(run.numbers.at(0));
            }
        if (!complete) throw std::bad_alloc();  // told as the run's own status
        return found;
    };
    in_turn(all, 300, false);
}
