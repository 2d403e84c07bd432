// Many runs of one machine with other numbers, inputs or options, on many threads, in bounded memory.
//
//   Ensemble runs(plan, threads, Ensemble::Order::as_finished);
//   while (!runs.done())
//       for (const EnsembleRun& run : runs.take(patience)) ...
//
// What a run leaves does not depend on threads or order: every run is the simulate() of its own machine. A run that is
// refused or fails carries that as its status; no run stops another. Runs are summed up while they go on: what is not
// kept whole takes no memory, however long they are.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "dualdrive/machine.hpp"
#include "dualdrive/simulate.hpp"
#include "dualdrive/summary.hpp"

namespace dualdrive {

// What a machine is put through, and what of it is summed up. times, signals, rows and interrupted of the options are set
// by the ensemble.
struct Scenario {
    Inputs inputs;
    SimulateOptions options;
    std::vector<Reduction> reductions;
};

struct EnsemblePlan {
    Machine machine;
    std::size_t runs = 0;
    std::vector<std::string> paths;    // of what differs: parameter paths, tie groups, initial.<state>
    std::vector<double> values;        // runs × paths, SI
    std::vector<Scenario> scenarios;   // one for all runs, or one for each
    std::vector<double> times;         // output times of all runs, s, increasing
    std::vector<std::string> signals;  // kept whole; empty = none
};

// Columns of EnsembleRun::numbers behind the reductions and the reversals of every connection.
enum class Tally { contact_events, events, energy_error, steps, seconds };
inline constexpr std::size_t tallies = 5;
extern const char* const tally_names[tallies];  // seconds: processor time of this run alone

struct EnsembleRun {
    std::size_t number = 0;
    std::string status;   // of the trajectory; refused: such a machine or option cannot be, message says why
    std::string message;  // what went wrong and what to try
    std::string method;   // of the solver
    // Reductions, reversals of every connection, tallies; NaN unless the run succeeded: part of a run is not comparable.
    std::vector<double> numbers;
    std::vector<double> signals;  // signals × times; NaN from where the run failed
};

class Ensemble {
  public:
    enum class Order { as_finished, by_number };

    // Errors: std::invalid_argument for a plan that makes no sense, such as an unknown path.
    Ensemble(EnsemblePlan plan, std::size_t threads, Order order);
    ~Ensemble() { close(); }
    Ensemble(const Ensemble&) = delete;
    Ensemble& operator=(const Ensemble&) = delete;

    // What can be handed over, once it is a batch, it is all that will come, or patience ends. std::bad_alloc where there
    // was no memory to keep a run.
    std::vector<EnsembleRun> take(std::chrono::milliseconds patience);
    // Whether everything that will ever come was taken.
    bool done();
    // Begin no more runs; those under way are finished and handed over.
    void stop();
    // Cut the runs under way short, as interrupted, and end the threads.
    void close();

    const EnsemblePlan& plan() const { return plan_; }

  private:
    struct Variable {  // what a column of values sets
        std::vector<std::size_t> slots;
        std::string state;  // initial.<state>, in place of slots
    };

    void work();
    bool claim(std::size_t& number);
    bool nothing_more() const;
    bool ready() const;
    bool enough() const;
    EnsembleRun run(std::size_t number) const;
    void compute(std::size_t number, EnsembleRun& result) const;
    std::vector<std::string> recorded(const Scenario& scenario) const;
    const Scenario& scenario(std::size_t number) const;

    const EnsemblePlan plan_;
    const Order order_;
    std::vector<Variable> variables_;
    std::size_t window_;  // runs that may be begun and not yet taken: what bounds the memory
    std::size_t batch_;   // runs worth waking who takes them

    std::mutex mutex_;
    std::condition_variable room_, finished_;
    std::map<std::size_t, EnsembleRun> waiting_;  // finished, to be taken
    std::size_t next_ = 0, taken_ = 0;            // to begin; handed over so far
    bool stopped_ = false;
    bool exhausted_ = false;  // a thread found no memory to hand its run over
    std::atomic<bool> abandoned_{false};
    std::vector<std::thread> threads_;
};

}  // namespace dualdrive
