// integrate(): reads the record of a problem, runs the engine for this machine without the GIL, wraps the result.
#include "integrate.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "problem.hpp"
#include "step_result.hpp"

namespace nb = nanobind;

namespace bellcrank {
namespace {

using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Cube = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

void require(bool holds, const char* text) {
  if (!holds) throw std::invalid_argument(text);
}

// An attribute of a Python record. Arrays of another type are converted, as arguments of a function are.
template <class T>
T get(nb::handle record, const char* name) {
  T value;
  if (!nb::try_cast(record.attr(name), value))
    throw nb::type_error((std::string("integrate: '") + name + "' has the wrong type").c_str());
  return value;
}

template <class Function>
Function function(nb::handle record, const char* name) {
  return reinterpret_cast<Function>(get<std::uintptr_t>(record, name));
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

// The record IntegrationProblem (simulation/integration_problem.py): what it refers to is kept alive here, and `plain`
// points to it for the engine.
struct Reading {
  Problem plain{};
  std::string method;
  nb::object progress, checkpoint;
  double checkpoint_interval;

  explicit Reading(nb::handle record) {
    read_span(record);
    read_kernels(record.attr("kernels"));
    read_layout(record.attr("layout"));
    read_control(record.attr("control"));
    read_events(record.attr("events"));
    for (nb::handle signal : record.attr("signals")) read_signal(signal);
    plain.signals = signals_.data(), plain.signal_count = static_cast<int>(signals_.size());
    stops_ = all_stops(plain.t0, plain.t1, get<Vector>(record, "stops"), signals_, &plain.latest);
    plain.stops = stops_.data(), plain.stop_count = static_cast<int>(stops_.size());
    progress = record.attr("progress");
    checkpoint = record.attr("checkpoint");
    checkpoint_interval = get<double>(record, "checkpoint_interval");
    require(checkpoint.is_none() || checkpoint_interval > 0, "integrate: checkpoints need a time between them");
  }
  Reading(const Reading&) = delete;

 private:
  Vector x0_, parameters_, times_, weights_;
  std::vector<std::pair<Vector, Cube>> pieces_;  // of the signals
  std::vector<Signal> signals_;
  std::vector<Unit> units_;
  std::vector<double> stops_;
  std::vector<int> direction_;
  std::unique_ptr<bool[]> terminal_;

  void read_span(nb::handle record) {
    plain.t0 = get<double>(record, "t0"), plain.t1 = get<double>(record, "t1");
    require(std::isfinite(plain.t0) && std::isfinite(plain.t1) && plain.t1 >= plain.t0,
            "integrate: t1 must be finite and not before t0");
    x0_ = get<Vector>(record, "x0"), parameters_ = get<Vector>(record, "parameters");
    plain.n = static_cast<int>(x0_.shape(0));
    plain.x0 = x0_.data(), plain.p = parameters_.data();
    times_ = get<Vector>(record, "times");
    plain.times = times_.data(), plain.time_count = times_.shape(0);
    plain.every_step = get<bool>(record, "every_step");
    for (std::size_t i = 0; i < plain.time_count; ++i)
      require(plain.times[i] >= (i ? plain.times[i - 1] : plain.t0), "integrate: output times must ascend from t0 on");
  }

  void read_kernels(nb::handle kernels) {
    plain.rhs = function<Kernel>(kernels, "rhs");
    plain.staged = get<bool>(kernels, "staged");
    plain.fallback = function<Kernel>(kernels, "fallback");
    plain.jacobian = function<Kernel>(kernels, "jacobian");
    plain.tangent = function<BatchKernel>(kernels, "tangent");
    plain.lanes = std::max(1, get<int>(kernels, "lanes"));
    plain.events = function<Kernel>(kernels, "events");
    plain.project = function<Kernel>(kernels, "project");
    plain.project_fallback = function<Kernel>(kernels, "project_fallback");
    plain.project_batch = function<BatchKernel>(kernels, "project_batch");
    require(plain.rhs != nullptr, "integrate: no right-hand side");
  }

  void read_layout(nb::handle layout) {
    plain.norm_size = get<int>(layout, "norm_size"), plain.nq = get<int>(layout, "nq");
    plain.nv = plain.norm_size - plain.nq;
    require(plain.n > 0 && plain.norm_size > 0 && plain.norm_size <= plain.n,
            "integrate: norm_size must be between 1 and the number of states");
    require(plain.nq >= 0 && plain.nq <= plain.norm_size, "integrate: nq must be between 0 and norm_size");
    for (auto [start, length] : get<std::vector<std::pair<int, int>>>(layout, "unit_parts")) {
      require(start >= 0 && length > 0 && start + length <= plain.n, "integrate: unit part outside the state");
      units_.push_back({start, length});
    }
    plain.units = units_.data(), plain.unit_count = static_cast<int>(units_.size());
    if (!layout.attr("weights").is_none()) {
      weights_ = get<Vector>(layout, "weights");
      require(static_cast<int>(weights_.shape(0)) == plain.nq, "integrate: one weight a position");
      plain.weights = weights_.data();
    }
  }

  void read_control(nb::handle control) {
    method = get<std::string>(control, "method");
    plain.rtol = get<double>(control, "rtol"), plain.atol = get<double>(control, "atol");
    plain.step = get<double>(control, "step"), plain.first_step = get<double>(control, "first_step");
    plain.max_step = get<double>(control, "max_step");
    plain.max_evaluations = get<std::int64_t>(control, "max_evaluations");
    require(method == "RK4" || method == "RK45" || method == "DOP853" || method == "Radau",
            "integrate: unknown method");
    require(plain.step > 0 || method != "RK4", "integrate: RK4 needs a step");
    require(plain.step > 0 || (plain.rtol >= 0 && plain.atol >= 0 && plain.rtol + plain.atol > 0),
            "integrate: rtol and atol must not be negative or both zero");
    require(plain.max_step > 0 && plain.first_step >= 0 && plain.step >= 0, "integrate: steps must be positive");
    require(method != "Radau" || plain.jacobian || plain.tangent, "integrate: Radau needs a Jacobian or a tangent");
  }

  void read_events(nb::handle events) {
    const auto terminal = get<std::vector<bool>>(events, "terminal");
    direction_ = get<std::vector<int>>(events, "direction");
    plain.event_samples = get<int>(events, "samples");
    require(terminal.size() == direction_.size() && (plain.events || terminal.empty()),
            "integrate: one terminal flag and one direction an event");
    require(plain.event_samples >= 2, "integrate: events need two samples a step or more");
    terminal_ = std::make_unique<bool[]>(terminal.size() + 1);
    std::copy(terminal.begin(), terminal.end(), terminal_.get());
    plain.terminal = terminal_.get(), plain.direction = direction_.data();
    plain.event_count = static_cast<int>(terminal.size());
  }

  void read_signal(nb::handle signal) {
    const Vector breaks = get<Vector>(signal, "breaks");
    const Cube c = get<Cube>(signal, "coefficients");
    const int derivatives = get<int>(signal, "derivatives");
    require(c.shape(0) > 0 && breaks.shape(0) == c.shape(0) + 1 && c.shape(1) > 0,
            "integrate: a signal has one break more than pieces, and at least one piece");
    require(derivatives >= 0 && derivatives <= 2, "integrate: signals give up to two derivatives");
    const int pieces = static_cast<int>(c.shape(0)), powers = static_cast<int>(c.shape(1));
    const int width = static_cast<int>(c.shape(2));
    signals_.push_back(
        {breaks.data(), c.data(), pieces, powers, width, derivatives, get<bool>(signal, "kinked")});
    plain.signal_entries += width * (derivatives + 1);
    pieces_.emplace_back(breaks, c);
  }
};

bool has_avx2() {
#ifdef BELLCRANK_AVX2
  static const bool answer = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return answer;
#else
  return false;
#endif
}

nb::object integrate(nb::object record) {
  Reading reading(record);
  const Problem& problem = reading.plain;
  auto made = std::make_unique<StepResult>(problem.n, problem.t0, problem.event_count, reading.progress,
                                           reading.checkpoint, reading.checkpoint_interval);
  StepResult& result = *made;
  if (!problem.every_step) {
    result.time.reserve(problem.time_count);
    result.state.reserve(problem.time_count * problem.n);
  }
  {
    nb::gil_scoped_release released;
#ifdef BELLCRANK_AVX2
    const auto run = has_avx2() ? avx2::run : baseline::run;
#else
    const auto run = baseline::run;
#endif
    const auto begun = result.begun = std::chrono::steady_clock::now();
    result.status = run(reading.method.c_str(), problem, result, result.counts);
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  }
  result.finish_steps();
  result.finish_events();
  result.watch.raise();
  return nb::cast(made.release(), nb::rv_policy::take_ownership);
}

// A view of a result's numbers, which keeps the result alive.
template <class T>
nb::object view(nb::handle owner, std::vector<T>& values, int columns = 0) {
  if (columns) return nb::cast(nb::ndarray<nb::numpy, T, nb::ndim<2>>(
      values.data(), {values.size() / columns, static_cast<std::size_t>(columns)}, owner));
  return nb::cast(nb::ndarray<nb::numpy, T, nb::ndim<1>>(values.data(), {values.size()}, owner));
}

// Adds the properties of counts, which results and checkpoints both have.
template <class Class>
Class& with_counts(Class& c) {
  using Owner = typename Class::Type;
  return c.def_prop_ro("accepted", [](const Owner& r) { return r.counts.accepted; })
      .def_prop_ro("rejected", [](const Owner& r) { return r.counts.rejected; })
      .def_prop_ro("evaluations", [](const Owner& r) { return r.counts.evaluations; })
      .def_prop_ro("jacobians", [](const Owner& r) { return r.counts.jacobians; })
      .def_prop_ro("factorisations", [](const Owner& r) { return r.counts.factorisations; });
}

}  // namespace

void bind_integrate(nb::module_& m) {
  using namespace nb::literals;
  auto result = nb::class_<StepResult>(m, "StepResult");
  with_counts(result)
      .def_prop_ro("time", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).time); })
      .def_prop_ro("state", [](nb::handle h) { auto& r = nb::cast<StepResult&>(h); return view(h, r.state, r.n); })
      .def_ro("end_time", &StepResult::end_time)
      .def_prop_ro("end_state", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).end_state); })
      .def_prop_ro("status", [](const StepResult& r) { return static_cast<int>(r.status); })
      .def_ro("seconds", &StepResult::seconds)
      .def_prop_ro("steps", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).steps); })
      .def_ro("longest_step", &StepResult::longest_step)
      .def_prop_ro("event_index", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).event_index); })
      .def_prop_ro("event_time", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).event_time); })
      .def_prop_ro("event_state", [](nb::handle h) { auto& r = nb::cast<StepResult&>(h); return view(h, r.event_state, r.n); })
      .def_prop_ro("event_counts", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).event_counts); })
      .def_prop_ro("unresolved_count", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).unresolved_count); })
      .def_prop_ro("unresolved_time", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).unresolved_time); })
      .def_prop_ro("undefined_count", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).undefined_count); })
      .def_prop_ro("undefined_time", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).undefined_time); });
  auto block = nb::class_<StepBlock>(m, "StepBlock");
  with_counts(block)
      .def_ro("time", &StepBlock::time)
      .def_ro("state", &StepBlock::state)
      .def_ro("end_time", &StepBlock::end_time)
      .def_ro("end_state", &StepBlock::end_state)
      .def_ro("seconds", &StepBlock::seconds)
      .def_ro("steps", &StepBlock::steps)
      .def_ro("longest_step", &StepBlock::longest_step)
      .def_ro("event_index", &StepBlock::event_index)
      .def_ro("event_time", &StepBlock::event_time)
      .def_ro("event_state", &StepBlock::event_state)
      .def_ro("event_counts", &StepBlock::event_counts)
      .def_ro("unresolved_count", &StepBlock::unresolved_count)
      .def_ro("unresolved_time", &StepBlock::unresolved_time)
      .def_ro("undefined_count", &StepBlock::undefined_count)
      .def_ro("undefined_time", &StepBlock::undefined_time);
  m.def("integrate", &integrate, "problem"_a);
}

}  // namespace bellcrank
