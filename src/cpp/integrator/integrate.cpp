// integrate(): checks and gathers the arguments, runs the engine for this machine without the GIL, wraps the result.
#include "integrate.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "checkpoints.hpp"
#include "interrupt.hpp"
#include "problem.hpp"
#include "runge_kutta_tableaus.hpp"

namespace nb = nanobind;

namespace bellcrank {
namespace {

using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Cube = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using SignalArguments = std::tuple<Vector, Cube, int, bool>;

void require(bool holds, const char* text) {
  if (!holds) throw std::invalid_argument(text);
}

// A copy of the entries from `from` on, which become `from`.
template <class T>
nb::object copied(const T* values, std::size_t end, std::size_t* from, std::size_t columns = 0) {
  const std::size_t count = end - *from;
  auto memory = std::make_unique<T[]>(count);
  std::copy(values + *from, values + end, memory.get());
  *from = end;
  T* data = memory.release();
  nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
  if (columns) return nb::cast(nb::ndarray<nb::numpy, T, nb::ndim<2>>(data, {count / columns, columns}, owner));
  return nb::cast(nb::ndarray<nb::numpy, T, nb::ndim<1>>(data, {count}, owner));
}

class Result final : public Record {
 public:
  Result(int n, double t0, int event_count, nb::object progress, nb::object block, double block_seconds)
      : n(n), watch(std::move(progress)), blocks(std::move(block), block_seconds), event_counts(event_count),
        last_events(event_count), unresolved_count(event_count), undefined_count(event_count),
        unresolved_time(event_count), undefined_time(event_count), last_step(t0) {
    steps.push_back(t0);
    more_steps();
  }

  void more_steps() override {
    if (next_step) take_steps();
    const std::size_t used = steps.size();
    steps.resize(used + std::min(std::max(used, room), 2 * most_steps + 1 - used));
    fresh = used;
    next_step = steps.data() + used;
    steps_end = steps.data() + steps.size();
  }
  // Takes the steps in that were written since, and keeps their last end whatever is thinned.
  void finish_steps() {
    const double last = next_step == steps.data() + fresh ? last_step : next_step[-1];
    take_steps();
    if (steps.back() != last) steps.push_back(last);
  }
  void output(double t, const double* x) override {
    time.push_back(t);
    state.insert(state.end(), x, x + n);
  }
  // Of more than `most_events` in all, each event function keeps its first `least_events` and its last.
  void event(int index, double t, const double* x) override {
    const std::int64_t nth = event_counts[index]++;
    Last& last = last_events[index];
    if (event_index.size() < most_events || nth < least_events) {
      last.pending = false;
      keep_event(index, t, x);
    } else {
      last.pending = true, last.time = t;
      last.state.assign(x, x + n);
    }
  }
  void finish_events() {
    std::vector<int> left;
    for (int e = 0; e < static_cast<int>(last_events.size()); ++e)
      if (last_events[e].pending) left.push_back(e);
    std::stable_sort(left.begin(), left.end(), [&](int a, int b) { return last_events[a].time < last_events[b].time; });
    for (int e : left) {  // among those that some event functions kept to the end, in the order of time
      const Last& last = last_events[e];
      const auto at = std::upper_bound(event_time.begin(), event_time.end(), last.time) - event_time.begin();
      event_index.insert(event_index.begin() + at, e);
      event_time.insert(event_time.begin() + at, last.time);
      event_state.insert(event_state.begin() + at * n, last.state.begin(), last.state.end());
    }
  }
  void unresolved(int index, double t) override {
    if (!unresolved_count[index]++) unresolved_time[index] = t;
  }
  void undefined(int index, double t) override {
    if (!undefined_count[index]++) undefined_time[index] = t;
  }
  void end(double t, const double* x) override {
    end_time = t;
    end_state.assign(x, x + n);
  }
  bool look(double t, const double* x, const Counts& now, std::int64_t* attempts) override {
    if (watch.look(t, attempts)) return true;
    if (!blocks.due()) return false;
    nb::gil_scoped_acquire gil;
    return !blocks.hand_over(block(t, x, now)) && watch.failed();
  }

  static constexpr std::size_t room = 1024, most_steps = 100'000, most_events = 100'000;
  static constexpr std::int64_t least_events = 100;
  int n;
  std::vector<double> time, state, end_state, steps, event_time, event_state;
  std::vector<int> event_index;
  double end_time = 0, seconds = 0, longest_step = 0;
  std::chrono::steady_clock::time_point begun;
  Status status = Status::finished;
  Counts counts;
  Watch watch;
  Blocks blocks;
  std::vector<std::int64_t> event_counts;

 private:
  struct Last {
    bool pending = false;
    double time = 0;
    std::vector<double> state;
  };
  std::vector<Last> last_events;

 public:
  std::vector<std::int64_t> unresolved_count, undefined_count;
  std::vector<double> unresolved_time, undefined_time;  // of the first, by event function

 private:
  std::size_t fresh = 0;      // where the steps begin that were written since the last look
  std::int64_t number = 1;    // of the first of these; the start is step 0
  std::int64_t stride = 1;    // steps whose number is a multiple of it, a power of two, are kept
  double last_step;

  struct Marks {
    std::size_t time = 0, state = 0, event_index = 0, event_time = 0, event_state = 0;
  } given;  // to Python already

  // What was found since the last block; steps, which are thinned as they become more, and counts are all so far.
  nb::object block(double t, const double* x, const Counts& now) {
    nb::dict found;
    const auto add = [&](const char* name, const auto& values, std::size_t* from, std::size_t columns = 0) {
      found[name] = copied(values.data(), values.size(), from, columns);
    };
    const auto whole = [&](const char* name, const auto& values) {
      std::size_t none = 0;
      add(name, values, &none);
    };
    add("time", time, &given.time);
    add("state", state, &given.state, n);
    add("event_index", event_index, &given.event_index);
    add("event_time", event_time, &given.event_time);
    add("event_state", event_state, &given.event_state, n);
    more_steps();
    std::vector<double> ends(steps.begin(), steps.begin() + fresh);
    if (ends.back() != last_step) ends.push_back(last_step);
    whole("steps", ends);
    whole("event_counts", event_counts);
    whole("unresolved_count", unresolved_count);
    whole("unresolved_time", unresolved_time);
    whole("undefined_count", undefined_count);
    whole("undefined_time", undefined_time);
    whole("end_state", std::vector<double>(x, x + n));
    found["end_time"] = t;
    found["seconds"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    found["longest_step"] = longest_step;
    found["counts"] = nb::make_tuple(now.accepted, now.rejected, now.evaluations, now.jacobians, now.factorisations);
    return found;
  }

  void keep_event(int index, double t, const double* x) {
    event_index.push_back(index);
    event_time.push_back(t);
    event_state.insert(event_state.end(), x, x + n);
  }
  // The longest of the new steps, and of their ends those that are kept: of more than `most_steps` every other one.
  void take_steps() {
    std::size_t kept = fresh;
    for (const double* end = steps.data() + fresh; end != next_step; ++end, ++number) {
      longest_step = std::max(longest_step, *end - last_step);
      last_step = *end;
      if ((number & (stride - 1)) == 0) steps[kept++] = *end;
    }
    for (; kept > most_steps + 1; kept = (kept + 1) / 2, stride *= 2)
      for (std::size_t i = 0; 2 * i < kept; ++i) steps[i] = steps[2 * i];
    steps.resize(kept);
  }
};

template <class T>
nb::object view(nb::handle owner, std::vector<T>& values, int columns = 0) {
  if (columns) return nb::cast(nb::ndarray<nb::numpy, T, nb::ndim<2>>(
      values.data(), {values.size() / columns, static_cast<std::size_t>(columns)}, owner));
  return nb::cast(nb::ndarray<nb::numpy, T, nb::ndim<1>>(values.data(), {values.size()}, owner));
}

// Stops and breaks of kinked signals inside the run, sorted; those closer than rounding are one. `latest` becomes the
// time just before the first that is t1 itself, to rounding, so that the last step sees the side before it.
std::vector<double> all_stops(double t0, double t1, const Vector& stops, const std::vector<Signal>& signals,
                              double* latest) {
  std::vector<double> found(stops.data(), stops.data() + stops.shape(0));
  for (const Signal& s : signals)
    if (s.kinked) found.insert(found.end(), s.breaks, s.breaks + s.pieces + 1);
  std::sort(found.begin(), found.end());
  std::vector<double> kept;
  const double least = 1e-14 * std::max(std::fabs(t0), std::fabs(t1));
  *latest = HUGE_VAL;
  for (double t : found) {
    if (std::fabs(t - t1) <= least) *latest = std::min(*latest, std::nextafter(std::min(t, t1), t0));
    if (t > t0 + least && t < t1 - least && (kept.empty() || t > kept.back() + least)) kept.push_back(t);
  }
  return kept;
}

bool has_avx2() {
#ifdef BELLCRANK_AVX2
  static const bool answer = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return answer;
#else
  return false;
#endif
}

nb::object integrate(std::uintptr_t rhs, const std::string& method, double t0, double t1, Vector x0, Vector p,
                     int norm_size, double rtol, double atol, double step, double first_step, double max_step,
                     Vector times, bool every_step, const std::vector<std::tuple<int, int>>& unit,
                     const std::vector<SignalArguments>& signals, Vector stops, std::uintptr_t events,
                     const std::vector<bool>& terminal, const std::vector<int>& direction, std::uintptr_t jacobian,
                     std::uintptr_t tangent, int lanes, std::int64_t max_evaluations, nb::object progress,
                     nb::object block, double block_seconds,
                     bool staged, std::uintptr_t fallback, std::uintptr_t project,
                     std::uintptr_t project_fallback, std::uintptr_t project_batch, int nq, int event_samples,
                     std::optional<Vector> weights) {
  const int n = static_cast<int>(x0.shape(0));
  require(rhs != 0, "integrate: no right-hand side");
  require(method == "RK4" || method == "RK45" || method == "DOP853" || method == "Radau", "integrate: unknown method");
  require(std::isfinite(t0) && std::isfinite(t1) && t1 >= t0, "integrate: t1 must be finite and not before t0");
  require(!weights || static_cast<int>(weights->shape(0)) == nq, "integrate: one weight a coordinate");
  require(block.is_none() || block_seconds > 0, "integrate: blocks need a time between them");
  require(event_samples >= 2, "integrate: events need two samples a step or more");
  require(n > 0 && norm_size > 0 && norm_size <= n, "integrate: norm_size must be between 1 and the number of states");
  require(step > 0 || method != "RK4", "integrate: RK4 needs a step");
  require(step > 0 || (rtol >= 0 && atol >= 0 && rtol + atol > 0),
          "integrate: rtol and atol must not be negative or both zero");
  require(max_step > 0 && first_step >= 0 && step >= 0, "integrate: steps must be positive");
  require(method != "Radau" || jacobian != 0 || tangent != 0, "integrate: Radau needs a Jacobian or a tangent");
  require(terminal.size() == direction.size() && (events != 0 || terminal.empty()),
          "integrate: one terminal flag and one direction an event");
  std::vector<Unit> units;
  for (auto [start, length] : unit) {
    require(start >= 0 && length > 0 && start + length <= n, "integrate: unit part outside the state");
    units.push_back({start, length});
  }
  std::vector<Signal> groups;
  int entries = 0;
  for (const auto& [breaks, coefficients, derivatives, kinked] : signals) {
    require(coefficients.shape(0) > 0 && breaks.shape(0) == coefficients.shape(0) + 1 && coefficients.shape(1) > 0,
            "integrate: a signal has one break more than pieces, and at least one piece");
    require(derivatives >= 0 && derivatives <= 2, "integrate: signals give up to two derivatives");
    groups.push_back({breaks.data(), coefficients.data(), static_cast<int>(coefficients.shape(0)),
                      static_cast<int>(coefficients.shape(1)), static_cast<int>(coefficients.shape(2)), derivatives,
                      kinked});
    entries += groups.back().width * (derivatives + 1);
  }
  for (std::size_t i = 0; i < times.shape(0); ++i)
    require(times.data()[i] >= (i ? times.data()[i - 1] : t0), "integrate: output times must ascend from t0 on");
  double latest;
  const std::vector<double> bounds = all_stops(t0, t1, stops, groups, &latest);
  const auto flags = std::make_unique<bool[]>(terminal.size() + 1);
  std::copy(terminal.begin(), terminal.end(), flags.get());

  Problem problem{};
  problem.rhs = reinterpret_cast<Kernel>(rhs);
  problem.staged = staged;
  problem.fallback = reinterpret_cast<Kernel>(fallback);
  problem.project = reinterpret_cast<Kernel>(project);
  problem.project_fallback = reinterpret_cast<Kernel>(project_fallback);
  problem.project_batch = reinterpret_cast<BatchKernel>(project_batch);
  problem.nq = nq, problem.nv = norm_size - nq;
  problem.weights = weights ? weights->data() : nullptr;
  problem.jacobian = reinterpret_cast<Kernel>(jacobian);
  problem.events = reinterpret_cast<Kernel>(events);
  problem.tangent = reinterpret_cast<BatchKernel>(tangent);
  problem.n = n, problem.norm_size = norm_size, problem.lanes = std::max(1, lanes);
  problem.t0 = t0, problem.t1 = t1;
  problem.x0 = x0.data(), problem.p = p.data();
  problem.rtol = rtol, problem.atol = atol, problem.step = step, problem.first_step = first_step;
  problem.max_step = max_step;
  problem.times = times.data(), problem.time_count = times.shape(0), problem.every_step = every_step;
  problem.units = units.data(), problem.unit_count = static_cast<int>(units.size());
  problem.signals = groups.data(), problem.signal_count = static_cast<int>(groups.size());
  problem.signal_entries = entries;
  problem.stops = bounds.data(), problem.stop_count = static_cast<int>(bounds.size());
  problem.latest = latest;
  problem.terminal = flags.get(), problem.direction = direction.data();
  problem.event_count = static_cast<int>(terminal.size()), problem.event_samples = event_samples;
  problem.max_evaluations = max_evaluations;

  auto made =
      std::make_unique<Result>(n, t0, problem.event_count, std::move(progress), std::move(block), block_seconds);
  Result& result = *made;
  if (!every_step) {
    result.time.reserve(times.shape(0));
    result.state.reserve(times.shape(0) * n);
  }
  {
    nb::gil_scoped_release released;
#ifdef BELLCRANK_AVX2
    const auto run = has_avx2() ? avx2::run : baseline::run;
#else
    const auto run = baseline::run;
#endif
    const auto begun = result.begun = std::chrono::steady_clock::now();
    result.status = run(method.c_str(), problem, result, result.counts);
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  }
  result.finish_steps();
  result.finish_events();
  result.watch.raise();
  return nb::cast(made.release(), nb::rv_policy::take_ownership);
}

template <std::size_t Rows, std::size_t Columns>
nb::list matrix(const double (&a)[Rows][Columns], std::size_t rows, std::size_t columns) {
  nb::list list;
  for (std::size_t i = 0; i < rows; ++i) {
    nb::list row;
    for (std::size_t j = 0; j < columns; ++j) row.append(a[i][j]);
    list.append(row);
  }
  return list;
}

// The order, A, b and c of a method: the row of A after the stages holds the weights b.
template <class Method>
nb::dict table() {
  constexpr std::size_t stages = Method::stages;
  nb::dict dict;
  nb::list c;
  for (std::size_t i = 0; i < stages; ++i) c.append(Method::c[i]);
  dict["order"] = static_cast<int>(Method::order);
  dict["a"] = matrix(Method::a, stages, stages);
  dict["b"] = nb::list(matrix(Method::a, stages + 1, stages)[stages]);
  dict["c"] = c;
  return dict;
}

nb::dict tableau(const std::string& name) {
  if (name == Rk4::name) return table<Rk4>();
  if (name == DormandPrince::name) return table<DormandPrince>();
  if (name == Dop853::name) return table<Dop853>();
  require(name == RadauIIA::name, "tableau: unknown method");
  nb::dict dict = table<RadauIIA>();
  dict["transformation"] = matrix(RadauIIA::T, 3, 3);
  dict["inverse_transformation"] = matrix(RadauIIA::inverse_T, 3, 3);
  dict["eigenvalues"] = nb::make_tuple(RadauIIA::mu, RadauIIA::mu_real, RadauIIA::mu_imaginary);
  return dict;
}

nb::dict methods() {
  nb::dict dict;
  for (const char* name : {Rk4::name, DormandPrince::name, Dop853::name, RadauIIA::name})
    dict[name] = tableau(name)["order"];
  return dict;
}

}  // namespace

void bind_integrate(nb::module_& m) {
  nb::class_<Result>(m, "StepResult")
      .def_prop_ro("time", [](nb::handle h) { return view(h, nb::cast<Result&>(h).time); })
      .def_prop_ro("state", [](nb::handle h) { auto& r = nb::cast<Result&>(h); return view(h, r.state, r.n); })
      .def_ro("end_time", &Result::end_time)
      .def_prop_ro("end_state", [](nb::handle h) { return view(h, nb::cast<Result&>(h).end_state); })
      .def_prop_ro("status", [](const Result& r) { return static_cast<int>(r.status); })
      .def_prop_ro("accepted", [](const Result& r) { return r.counts.accepted; })
      .def_prop_ro("rejected", [](const Result& r) { return r.counts.rejected; })
      .def_prop_ro("evaluations", [](const Result& r) { return r.counts.evaluations; })
      .def_prop_ro("jacobians", [](const Result& r) { return r.counts.jacobians; })
      .def_prop_ro("factorisations", [](const Result& r) { return r.counts.factorisations; })
      .def_ro("seconds", &Result::seconds)
      .def_prop_ro("steps", [](nb::handle h) { return view(h, nb::cast<Result&>(h).steps); })
      .def_prop_ro("event_index", [](nb::handle h) { return view(h, nb::cast<Result&>(h).event_index); })
      .def_prop_ro("event_time", [](nb::handle h) { return view(h, nb::cast<Result&>(h).event_time); })
      .def_ro("longest_step", &Result::longest_step)
      .def_prop_ro("event_counts", [](nb::handle h) { return view(h, nb::cast<Result&>(h).event_counts); })
      .def_prop_ro("unresolved_count", [](nb::handle h) { return view(h, nb::cast<Result&>(h).unresolved_count); })
      .def_prop_ro("undefined_count", [](nb::handle h) { return view(h, nb::cast<Result&>(h).undefined_count); })
      .def_prop_ro("undefined_time", [](nb::handle h) { return view(h, nb::cast<Result&>(h).undefined_time); })
      .def_prop_ro("unresolved_time", [](nb::handle h) { return view(h, nb::cast<Result&>(h).unresolved_time); })
      .def_prop_ro("event_state",
                   [](nb::handle h) { auto& r = nb::cast<Result&>(h); return view(h, r.event_state, r.n); });
  using namespace nb::literals;
  m.def("methods", &methods);
  m.def("tableau", &tableau, "method"_a);
  m.def("integrate", &integrate, "rhs"_a, "method"_a, "t0"_a, "t1"_a, "x0"_a, "p"_a, nb::kw_only(), "norm_size"_a,
        "rtol"_a, "atol"_a, "step"_a = 0.0, "first_step"_a = 0.0, "max_step"_a = HUGE_VAL, "times"_a, "every_step"_a,
        "unit"_a, "signals"_a, "stops"_a, "events"_a, "terminal"_a, "direction"_a, "jacobian"_a, "tangent"_a,
        "lanes"_a, "max_evaluations"_a, "progress"_a.none(), "block"_a.none() = nb::none(),
        "block_seconds"_a = 0.0, "staged"_a = false, "fallback"_a = 0,
        "project"_a = 0, "project_fallback"_a = 0, "project_batch"_a = 0, "nq"_a = 0, "event_samples"_a = 8,
        "weights"_a.none() = nb::none());
}

}  // namespace bellcrank
