// integrate_ensemble(): reads the record of an ensemble, runs its designs in threads without the GIL, and wraps the
// columns that they fill.
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>

#include "ensemble.hpp"
#include "integrate.hpp"
#include "interrupt.hpp"
#include "problem_reading.hpp"

namespace bellcrank {
namespace {

using RunLanes = void (*)(const char* method, const Ensemble& ensemble, Worker& worker);

bool has_avx512() {
#ifdef BELLCRANK_AVX512
  return has_avx2() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
         __builtin_cpu_supports("avx512vl");
#else
  return false;
#endif
}

// The engine for kernels of so many lanes; null where this machine or this build has none.
RunLanes engine_of(int width) {
  if (width == 2) return baseline::run_lanes;
#ifdef BELLCRANK_AVX2
  if (width == 4 && has_avx2()) return avx2::run_lanes;
#endif
#ifdef BELLCRANK_AVX512
  if (width == 8 && has_avx512()) return avx512::run_lanes;
#endif
  return nullptr;
}

// The record EnsembleProblem (simulation/integration/ensemble.py).
struct EnsembleReading : ProblemReading {
  Ensemble ensemble{};
  int threads;
  nb::object progress;

  explicit EnsembleReading(nb::handle record) {
    x0_ = get<Matrix>(record, "x0"), parameters_ = get<Matrix>(record, "parameters"), t1_ = get<Vector>(record, "t1");
    Designs& d = ensemble.designs;
    d.count = static_cast<std::int64_t>(x0_.shape(0)), d.np = static_cast<int>(parameters_.shape(1));
    require(parameters_.shape(0) == x0_.shape(0) && t1_.shape(0) == x0_.shape(0),
            "integrate_ensemble: t1, x0 and parameters need one row a design");
    d.x0 = x0_.data(), d.p = parameters_.data(), d.t1 = t1_.data();
    for (std::int64_t i = 0; i < d.count; ++i)
      require(std::isfinite(d.t1[i]) && d.t1[i] >= 0, "integrate_ensemble: t1 must be finite and not negative");
    read_settings(record.attr("settings"));
    read(record, static_cast<int>(x0_.shape(1)), d.step != nullptr);
    read_held(record.attr("held"));
    ensemble.common = plain;
    ensemble.jumps = jumps.data(), ensemble.jump_count = static_cast<int>(jumps.size());
    ensemble.observed = get<int>(record, "observed"), ensemble.observed_within = get<int>(record, "observed_within");
    ensemble.common.observe = ensemble.observed ? function<Kernel>(record, "observe") : nullptr;
    ensemble.common.observed = ensemble.observed, ensemble.common.observed_within = ensemble.observed_within;
    require(ensemble.observed >= ensemble.observed_within && ensemble.observed_within >= 0 &&
                (ensemble.observed == 0 || ensemble.common.observe),
            "integrate_ensemble: observed quantities need a function");
    read_lanes(record.attr("lanes"));
    threads = std::max(1, get<int>(record, "threads"));
    progress = record.attr("progress");
  }

  RunLanes engine = nullptr;  // null: every design is a single run

 private:
  Matrix x0_, parameters_;
  Vector t1_;
  std::vector<Vector> settings_;

  void read_settings(nb::handle settings) {
    Designs& d = ensemble.designs;
    const double** const of[] = {&d.rtol, &d.atol, &d.step, &d.first_step, &d.max_step, &d.max_evaluations};
    const char* const names[] = {"rtol", "atol", "step", "first_step", "max_step", "max_evaluations"};
    for (auto [key, value] : nb::cast<nb::dict>(settings)) {
      const auto name = nb::cast<std::string>(key);
      const auto found = std::find(std::begin(names), std::end(names), name);
      require(found != std::end(names), "integrate_ensemble: unknown setting");
      Vector column;
      require(nb::try_cast(value, column) && static_cast<std::int64_t>(column.shape(0)) == d.count,
              "integrate_ensemble: settings need one number a design");
      for (std::int64_t i = 0; i < d.count; ++i)
        require(column.data()[i] >= 0, "integrate_ensemble: settings must not be negative");
      *of[found - names] = column.data();
      settings_.push_back(column);
    }
  }

  void read_lanes(nb::handle lanes) {
    if (lanes.is_none()) return;
    LaneKernels& k = ensemble.lanes;
    k.width = get<int>(lanes, "width"), k.rhs = function<Kernel>(lanes, "rhs");
    k.fallback = function<Kernel>(lanes, "fallback"), k.events = function<Kernel>(lanes, "events");
    k.project = function<Kernel>(lanes, "project");
    k.project_fallback = function<Kernel>(lanes, "project_fallback");
    k.observe = function<Kernel>(lanes, "observe");
    engine = engine_of(k.width);
    require(engine != nullptr, "integrate_ensemble: this machine has no engine for so many lanes");
    require(k.rhs && (k.events || !plain.event_count) && (k.observe || !ensemble.observed) &&
                !k.fallback == !plain.fallback && !k.project == !plain.project &&
                !k.project_fallback == !plain.project_fallback && method != "Radau" && !plain.held.count,
            "integrate_ensemble: functions for lanes are missing");
  }
};

// A row of which nothing is known.
void clear(const Ensemble& e, std::int64_t row) {
  const Columns& c = e.columns;
  const std::int64_t n = e.common.n, events = e.common.event_count, m = e.observed, held = e.common.held.count;
  c.status[row] = static_cast<std::int64_t>(Status::interrupted), c.stopped_by[row] = -1;
  c.done[row] = c.single[row] = false;
  c.accepted[row] = c.rejected[row] = c.evaluations[row] = 0;
  c.end_time[row] = NAN;
  std::fill_n(c.end_state + row * n, n, NAN);
  for (std::int64_t* counts : {c.event_count, c.unresolved, c.undefined}) std::fill_n(counts + row * events, events, 0);
  std::fill_n(c.event_time + row * events, events, NAN);
  std::fill_n(c.event_state + row * events * n, events * n, NAN);
  for (double* extremes : {c.least, c.largest}) std::fill_n(extremes + row * m, m, NAN);
  for (double* ends : {c.held_start, c.held_end}) std::fill_n(ends + row * held, held, NAN);
  std::fill_n(c.held_event + row * events * held, events * held, NAN);
}

// Fills the row of a single run.
class Row final : public Record {
 public:
  Row(const Ensemble& e, std::int64_t row, const std::atomic<bool>& stop)
      : h_(e.common.held), c_(e.columns), terminal_(e.common.terminal), n_(e.common.n), row_(row),
        first_(row * e.common.event_count), end_(first_ + e.common.event_count), stop_(stop),
        now_(h_.start, h_.start + h_.count) {
    std::copy(now_.begin(), now_.end(), c_.held_start + row_ * h_.count);
    more_steps();
    least = c_.least + row * e.observed, largest = c_.largest + row * e.observed;
    for (std::int64_t at = first_; at < end_; ++at) {  // the lanes may have found some before
      c_.event_count[at] = c_.unresolved[at] = c_.undefined[at] = 0;
      c_.event_time[at] = NAN;
      std::fill_n(c_.event_state + at * n_, n_, NAN);
    }
  }
  void more_steps() override { next_step = steps_, steps_end = steps_ + sizeof steps_ / sizeof *steps_; }
  void output(double, const double*) override {}
  void event(int index, double t, const double* x) override {
    const std::int64_t at = first_ + index;
    if (terminal_[index] && stopped_by < 0) stopped_by = index;
    if (c_.event_count[at]++) return;
    c_.event_time[at] = t;
    std::copy(x, x + n_, c_.event_state + at * n_);
    std::copy(now_.begin(), now_.end(), c_.held_event + at * h_.count);
  }
  // Entries that change at the instant of an event are there what they are after it.
  void hold(double t, const double* values) override {
    now_.assign(values, values + h_.count);
    if (t <= 0) std::copy(now_.begin(), now_.end(), c_.held_start + row_ * h_.count);
    for (std::int64_t at = first_; at < end_; ++at)
      if (c_.event_time[at] == t) std::copy(now_.begin(), now_.end(), c_.held_event + at * h_.count);
  }
  void unresolved(int index, double) override { ++c_.unresolved[first_ + index]; }
  void undefined(int index, double) override { ++c_.undefined[first_ + index]; }
  void end(double t, const double* x) override {
    c_.end_time[row_] = t;
    std::copy(x, x + n_, c_.end_state + row_ * n_);
    std::copy(now_.begin(), now_.end(), c_.held_end + row_ * h_.count);
  }
  bool look(double, const double*, const Counts&, std::int64_t* attempts) override {
    *attempts = 1000;
    return stop_.load(std::memory_order_relaxed);
  }

  int stopped_by = -1;

 private:
  const HeldEntries& h_;
  const Columns& c_;
  const bool* const terminal_;
  const int n_;
  const std::int64_t row_, first_, end_;  // its events are those from first_ on, before end_
  const std::atomic<bool>& stop_;
  std::vector<double> now_;  // the held entries
  double steps_[64];  // the ends of steps, which nobody reads
};

// The threads' common work: which designs are left, and whether they have to stop.
class Crew {
 public:
  Crew(EnsembleReading& reading) : reading_(reading), ensemble_(reading.ensemble), watch_(reading.progress) {}

  // Runs all designs; false where that was interrupted. Without the GIL.
  void run() {
    std::vector<std::thread> threads;
    const std::int64_t most = (ensemble_.designs.count + block - 1) / block;
    left_ = static_cast<int>(std::min<std::int64_t>(reading_.threads, most));
    start(threads);
    std::unique_lock<std::mutex> lock(mutex_);
    while (!ended_.wait_for(lock, std::chrono::milliseconds(50), [this] { return left_ == 0; })) {
      lock.unlock();
      if (watch_.call(done_.load(std::memory_order_relaxed))) stop_ = true;
      lock.lock();
    }
    lock.unlock();
    for (std::thread& thread : threads) thread.join();
  }

  // Raises what a thread, a signal handler or `progress` raised. With the GIL.
  void raise() {
    watch_.raise();
    if (error_) std::rethrow_exception(error_);
  }

 private:
  static constexpr int block = 8;  // designs that a thread takes at once where they are single runs

  EnsembleReading& reading_;
  const Ensemble& ensemble_;
  Watch watch_;
  std::atomic<std::int64_t> next_{0}, done_{0};
  std::atomic<bool> stop_{false};
  std::mutex mutex_;
  std::condition_variable ended_;
  int left_ = 0;              // threads at work
  std::exception_ptr error_;  // the first that ended a thread

  // Where the system has no room for all threads, those that it starts do all the work; where for none, this one does.
  void start(std::vector<std::thread>& threads) {
    const int count = left_;
    threads.reserve(count);
    try {
      while (static_cast<int>(threads.size()) < count) threads.emplace_back([this] { work(); });
    } catch (const std::system_error&) {
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        left_ -= count - std::max(1, static_cast<int>(threads.size()));
      }
      if (threads.empty()) work();
    }
  }

  class Hand final : public Worker {
   public:
    explicit Hand(Crew& crew) : crew_(crew) {}
    int take(int most, std::int64_t* first) override {
      *first = crew_.next_.fetch_add(most, std::memory_order_relaxed);
      const std::int64_t left = crew_.ensemble_.designs.count - *first;
      return static_cast<int>(std::max<std::int64_t>(0, std::min<std::int64_t>(most, left)));
    }
    void single(std::int64_t design) override { crew_.single(design); }
    void report(int designs) override { crew_.done_.fetch_add(designs, std::memory_order_relaxed); }
    bool stopped() override { return crew_.stop_.load(std::memory_order_relaxed); }

   private:
    Crew& crew_;
  };

  void work() {
    try {
      Hand hand(*this);
      if (reading_.engine) {
        reading_.engine(reading_.method.c_str(), ensemble_, hand);
      } else {
        std::int64_t first = 0;
        for (int count; !hand.stopped() && (count = hand.take(block, &first)) > 0;)
          for (int i = 0; i < count && !hand.stopped(); ++i) single(first + i);
      }
    } catch (...) {
      stop_ = true;
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!error_) error_ = std::current_exception();
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    if (--left_ == 0) ended_.notify_one();
  }

  void single(std::int64_t row) {
    const Designs& d = ensemble_.designs;
    const Columns& c = ensemble_.columns;
    Problem p = ensemble_.common;
    const auto set = [row](const double* values, auto* to) {
      if (values) *to = static_cast<std::remove_pointer_t<decltype(to)>>(values[row]);
    };
    p.t0 = 0, p.t1 = d.t1[row], p.x0 = d.x0 + row * p.n, p.p = d.p + row * d.np;
    set(d.rtol, &p.rtol), set(d.atol, &p.atol), set(d.step, &p.step), set(d.first_step, &p.first_step);
    set(d.max_step, &p.max_step), set(d.max_evaluations, &p.max_evaluations);
    const std::vector<double> stops = stops_within(reading_.jumps, 0, p.t1, &p.latest);
    p.stops = stops.data(), p.stop_count = static_cast<int>(stops.size());
    clear(ensemble_, row);  // of a run that has left its lane
    Row record(ensemble_, row, stop_);
    Counts counts;
    const Status status = run_single(reading_.method.c_str(), p, record, counts);
    if (status == Status::interrupted) return;
    c.status[row] = static_cast<std::int64_t>(status);
    if (status == Status::event) c.stopped_by[row] = record.stopped_by;
    c.accepted[row] = counts.accepted, c.rejected[row] = counts.rejected, c.evaluations[row] = counts.evaluations;
    c.single[row] = c.done[row] = true;
    done_.fetch_add(1, std::memory_order_relaxed);
  }
};

// A new array that Python owns; added to `columns` by its name.
template <class T>
void add(nb::dict& columns, const char* name, std::vector<std::size_t> shape, T** data) {
  std::size_t size = 1;
  for (std::size_t length : shape) size *= length;
  *data = new T[size];
  nb::capsule owner(*data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
  columns[name] = nb::ndarray<nb::numpy, T>(*data, shape.size(), shape.data(), owner);
}

nb::dict columns_of(Ensemble& e) {
  nb::dict d;
  const auto rows = static_cast<std::size_t>(e.designs.count), n = static_cast<std::size_t>(e.common.n);
  const auto events = static_cast<std::size_t>(e.common.event_count), m = static_cast<std::size_t>(e.observed);
  Columns& c = e.columns;
  add(d, "done", {rows}, &c.done), add(d, "single", {rows}, &c.single);
  add(d, "status", {rows}, &c.status), add(d, "stopped_by", {rows}, &c.stopped_by);
  add(d, "accepted", {rows}, &c.accepted), add(d, "rejected", {rows}, &c.rejected);
  add(d, "evaluations", {rows}, &c.evaluations);
  add(d, "end_time", {rows}, &c.end_time), add(d, "end_state", {rows, n}, &c.end_state);
  add(d, "event_count", {rows, events}, &c.event_count);
  add(d, "unresolved", {rows, events}, &c.unresolved), add(d, "undefined", {rows, events}, &c.undefined);
  add(d, "event_time", {rows, events}, &c.event_time), add(d, "event_state", {rows, events, n}, &c.event_state);
  add(d, "least", {rows, m}, &c.least), add(d, "largest", {rows, m}, &c.largest);
  const auto held = static_cast<std::size_t>(e.common.held.count);
  add(d, "held_start", {rows, held}, &c.held_start), add(d, "held_end", {rows, held}, &c.held_end);
  add(d, "held_event", {rows, events, held}, &c.held_event);
  for (std::int64_t row = 0; row < e.designs.count; ++row) clear(e, row);
  return d;
}

nb::dict integrate_ensemble(nb::object record) {
  EnsembleReading reading(record);
  nb::dict columns = columns_of(reading.ensemble);
  Crew crew(reading);
  const auto begun = std::chrono::steady_clock::now();
  {
    nb::gil_scoped_release released;
    crew.run();
  }
  columns["seconds"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  crew.raise();
  for (std::int64_t row = 0; row < reading.ensemble.designs.count; ++row)
    if (!reading.ensemble.columns.done[row]) clear(reading.ensemble, row);
  return columns;
}

}  // namespace

void bind_ensemble(nb::module_& m) {
  using namespace nb::literals;
  m.def("has_lanes", [](int width) { return engine_of(width) != nullptr; }, "width"_a);
  m.def("integrate_ensemble", &integrate_ensemble, "problem"_a);
}

}  // namespace bellcrank
