#include "dualdrive/ensemble.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <new>
#include <stdexcept>

namespace dualdrive {

const char* const tally_names[tallies] = {"contact_events", "events", "energy_error", "steps", "seconds"};

namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr std::string_view initial = "initial.";

double processor_seconds() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

[[noreturn]] void refuse(const std::string& what) { throw std::invalid_argument("ensemble: " + what); }

void check(const EnsemblePlan& plan, std::size_t threads) {
    if (threads < 1) refuse("threads = 0: must be at least 1");
    if (plan.runs < 1) refuse("no runs; give at least one row of values");
    if (plan.values.size() != plan.runs * plan.paths.size())
        refuse(std::to_string(plan.values.size()) + " values for " + std::to_string(plan.runs) + " runs of " +
               std::to_string(plan.paths.size()) + " paths; give one row per run, one column per path");
    if (plan.scenarios.size() != 1 && plan.scenarios.size() != plan.runs)
        refuse(std::to_string(plan.scenarios.size()) + " scenarios for " + std::to_string(plan.runs) +
               " runs; give one for all, or one for each");
    if (plan.times.empty()) refuse("times: none; give the output times of the runs");
}

// What is kept of a run while it goes on: reductions, and the signals that are wanted whole.
class Collector {
  public:
    Collector(const Scenario& scenario, const std::vector<std::string>& names, std::size_t kept, std::size_t length)
        : reducers_(scenario.reductions.begin(), scenario.reductions.end()), kept_(kept), length_(length) {
        for (const auto& reduction : scenario.reductions)
            columns_.push_back(
                static_cast<std::size_t>(std::find(names.begin(), names.end(), reduction.signal) - names.begin()));
        signals_.resize(kept * length, none);
    }

    void add(const Trajectory& t) {
        const std::size_t width = t.signals.size();
        for (std::size_t k = 0; k < reducers_.size(); ++k) reducers_[k].add(t.t, t.values.data() + columns_[k], width);
        constexpr std::size_t few = 64;  // rows at a time, so that both sides stay in the cache
        for (std::size_t first = 0; first < t.t.size(); first += few)
            for (std::size_t k = 0; k < kept_; ++k)
                for (std::size_t row = first; row < std::min(t.t.size(), first + few); ++row)
                    signals_[k * length_ + rows_ + row] = t.values[row * width + k];
        rows_ += t.t.size();
    }

    std::vector<double> reduced() const {
        std::vector<double> values;
        for (const auto& reducer : reducers_) values.push_back(reducer.value());
        return values;
    }
    std::vector<double> take_signals() { return std::move(signals_); }

  private:
    std::vector<Reducer> reducers_;
    std::vector<std::size_t> columns_;  // of the reductions, among what is recorded; what is kept comes first there
    std::size_t kept_, length_, rows_ = 0;
    std::vector<double> signals_;
};

// Reversals of every connection, then the tallies.
void count(const Machine& machine, const Trajectory& t, double energy_error, double seconds,
           std::vector<double>& numbers) {
    std::vector<FlankCount> flanks(machine.connections().size());
    for (const Event& e : t.events)
        if (const Switch& s = t.elements[static_cast<std::size_t>(e.element)]; s.kind == SwitchKind::flank)
            flanks[static_cast<std::size_t>(s.index)].add(e.from, e.to);
    long contacts = 0;
    for (const auto& f : flanks) {
        numbers.push_back(static_cast<double>(f.reversals));
        contacts += f.contacts;
    }
    for (const double tally : {static_cast<double>(contacts), static_cast<double>(t.events.size()), energy_error,
                               static_cast<double>(t.statistics.steps), seconds})
        numbers.push_back(tally);
}

}  // namespace

Ensemble::Ensemble(EnsemblePlan plan, std::size_t threads, Order order) : plan_(std::move(plan)), order_(order) {
    check(plan_, threads);
    for (const auto& path : plan_.paths) {
        const bool state = path.starts_with(initial);
        variables_.push_back(state ? Variable{{}, path.substr(initial.size())}
                                   : Variable{plan_.machine.resolve(path), {}});
    }
    threads = std::min(threads, plan_.runs);
    const std::size_t few = plan_.signals.empty() ? 32 : 1;  // small results come in batches
    window_ = 2 * few * threads;
    batch_ = few;
    threads_.reserve(threads);
    try {
        while (threads_.size() < threads) threads_.emplace_back([this] { work(); });
    } catch (const std::exception&) {  // no memory or no thread left: those there are do it all
        if (threads_.empty()) throw;
    }
}

void Ensemble::close() {
    abandoned_ = true;
    stop();
    for (auto& thread : threads_) thread.join();
    threads_.clear();
}

void Ensemble::stop() {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    room_.notify_all();
    finished_.notify_all();
}

bool Ensemble::claim(std::size_t& number) {
    std::unique_lock lock(mutex_);
    room_.wait(lock, [&] { return stopped_ || next_ == plan_.runs || next_ - taken_ < window_; });
    if (stopped_ || next_ == plan_.runs) return false;
    number = next_++;
    return true;
}

void Ensemble::work() {
    try {
        for (std::size_t number = 0; claim(number);) {
            EnsembleRun result = run(number);
            const std::lock_guard lock(mutex_);
            waiting_.emplace(number, std::move(result));
            if (enough()) finished_.notify_all();
        }
    } catch (const std::bad_alloc&) {  // not even for saying so: who takes the runs is told
        const std::lock_guard lock(mutex_);
        exhausted_ = stopped_ = true;
        room_.notify_all();
        finished_.notify_all();
    }
}

bool Ensemble::nothing_more() const { return !exhausted_ && taken_ == next_ && (stopped_ || next_ == plan_.runs); }

// Worth handing over: a batch, or all there is to come.
bool Ensemble::enough() const {
    const bool last = stopped_ || next_ == plan_.runs;
    return exhausted_ || (ready() && waiting_.size() >= batch_) || (last && taken_ + waiting_.size() == next_);
}

bool Ensemble::ready() const {
    return !waiting_.empty() && (order_ == Order::as_finished || waiting_.begin()->first == taken_);
}

bool Ensemble::done() {
    const std::lock_guard lock(mutex_);
    return nothing_more();
}

std::vector<EnsembleRun> Ensemble::take(std::chrono::milliseconds patience) {
    std::unique_lock lock(mutex_);
    finished_.wait_for(lock, patience, [&] { return enough(); });
    if (exhausted_) throw std::bad_alloc();
    std::vector<EnsembleRun> found;
    while (ready()) {
        found.push_back(std::move(waiting_.begin()->second));
        waiting_.erase(waiting_.begin());
        ++taken_;
    }
    room_.notify_all();
    return found;
}

const Scenario& Ensemble::scenario(std::size_t number) const {
    return plan_.scenarios[plan_.scenarios.size() == 1 ? 0 : number];
}

EnsembleRun Ensemble::run(std::size_t number) const {
    EnsembleRun result;
    result.number = number;
    try {
        compute(number, result);
    } catch (const std::bad_alloc&) {
        result.status = "refused";
        result.message = "not enough memory; keep fewer signals or use fewer threads";
    } catch (const std::exception& error) {
        result.status = "refused";
        result.message = plan_.machine.name + ": " + error.what();
    }
    const std::size_t count = scenario(number).reductions.size() + plan_.machine.connections().size() + tallies;
    if (result.status != status_name(Status::success)) result.numbers.assign(count, none);
    return result;
}

// What has to be recorded. Something always is: no name at all would mean every signal.
std::vector<std::string> Ensemble::recorded(const Scenario& s) const {
    std::vector<std::string> names = plan_.signals;
    for (const auto& reduction : s.reductions)
        if (std::find(names.begin(), names.end(), reduction.signal) == names.end()) names.push_back(reduction.signal);
    if (names.empty()) names.push_back("energy.stored");
    return names;
}

void Ensemble::compute(std::size_t number, EnsembleRun& result) const {
    const Scenario& s = scenario(number);
    Machine machine = plan_.machine;
    SimulateOptions options = s.options;
    options.times = plan_.times;
    options.signals = recorded(s);
    options.interrupted = [this] { return abandoned_.load(std::memory_order_relaxed); };
    const double* value = plan_.values.data() + number * plan_.paths.size();
    for (std::size_t k = 0; k < variables_.size(); ++k) {
        if (variables_[k].slots.empty())
            options.initial[variables_[k].state] = value[k];
        else
            machine.set(plan_.paths[k], value[k]);
    }
    Collector collector(s, options.signals, plan_.signals.size(), plan_.times.size());
    options.rows = [&collector](const Trajectory& rows) { collector.add(rows); };
    const double begin = processor_seconds();
    const Trajectory t = simulate(machine, s.inputs, options);
    const double seconds = processor_seconds() - begin;
    result.status = status_name(t.status);
    result.message = t.message;
    result.method = t.statistics.method;
    result.numbers = collector.reduced();
    count(machine, t, options.energy ? t.statistics.energy_error : none, seconds, result.numbers);
    result.signals = collector.take_signals();
}

}  // namespace dualdrive
