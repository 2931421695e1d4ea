// PreparedProblem: reads the record of a problem once; each run calls the engine for this machine without the GIL and
// wraps the result.
#include "integrate.hpp"

#include <chrono>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "problem_reading.hpp"
#include "step_result.hpp"

namespace bellcrank {
namespace {

// The record IntegrationProblem (simulation/integration/integration_problem.py).
struct Reading : ProblemReading {
  explicit Reading(nb::handle record) {
    read_span(record);
    read(record, static_cast<int>(x0_.shape(0)));
    read_held(record.attr("held"));
    plain.observed = get<int>(record, "observed"), plain.observed_within = get<int>(record, "observed_within");
    plain.observe = plain.observed ? function<Kernel>(record, "observe") : nullptr;
    require(plain.observed >= plain.observed_within && plain.observed_within >= 0 && (!plain.observed || plain.observe),
            "integrate: observed quantities need a function");
    stops_ = stops_within(jumps, plain.t0, plain.t1, &plain.latest);
    plain.stops = stops_.data(), plain.stop_count = static_cast<int>(stops_.size());
  }

  std::size_t parameter_count() const { return parameters_.shape(0); }

 private:
  Vector x0_, parameters_, times_;
  std::vector<double> stops_;

  void read_span(nb::handle record) {
    plain.t0 = get<double>(record, "t0"), plain.t1 = get<double>(record, "t1");
    require(std::isfinite(plain.t0) && std::isfinite(plain.t1) && plain.t1 >= plain.t0,
            "integrate: t1 must be finite and not before t0");
    x0_ = get<Vector>(record, "x0"), parameters_ = get<Vector>(record, "parameters");
    plain.x0 = x0_.data(), plain.p = parameters_.data();
    times_ = get<Vector>(record, "times");
    plain.times = times_.data(), plain.time_count = times_.shape(0);
    plain.every_step = get<bool>(record, "every_step");
    for (std::size_t i = 0; i < plain.time_count; ++i)
      require(plain.times[i] >= (i ? plain.times[i - 1] : plain.t0), "integrate: output times must ascend from t0 on");
  }
};

// A problem that was read once and can be integrated again and again, from several threads too.
class PreparedProblem {
 public:
  explicit PreparedProblem(nb::object record) : reading_(record) {}

  // `progress` is called with the time, `checkpoint` with what was found; `interval`: seconds until its first call.
  // A start or parameters that are given replace those of the problem.
  // `updates`: functions of Python for the updates without a kernel.
  nb::object run(nb::object progress, nb::object checkpoint, double interval, nb::object x0, nb::object p,
                 nb::object updates) const {
    require(checkpoint.is_none() || interval > 0, "integrate: checkpoints need a time between them");
    Problem problem = reading_.plain;
    Vector start, parameters;
    if (!x0.is_none()) problem.x0 = given(x0, &start, static_cast<std::size_t>(problem.n));
    if (!p.is_none()) problem.p = given(p, &parameters, reading_.parameter_count());
    auto made = std::make_unique<StepResult>(problem.n, problem.t0, problem.event_count, std::move(progress),
                                             std::move(checkpoint), interval);
    StepResult& result = *made;
    result.held_count = problem.held.count, result.switch_count = problem.held.switch_count + 4 * problem.held.mode_count;
    result.updates = std::move(updates);
    result.least_values.resize(problem.observed), result.largest_values.resize(problem.observed);
    result.least = result.least_values.data(), result.largest = result.largest_values.data();
    if (!problem.every_step) {
      result.time.reserve(problem.time_count + 1);
      result.state.reserve((problem.time_count + 1) * problem.n);
    }
    {
      nb::gil_scoped_release released;
      const double compiled = reading_.derivatives->seconds();
      const auto begun = result.begun = std::chrono::steady_clock::now();
      result.status = run_single(reading_.method.c_str(), problem, result, result.counts);
      result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
      result.seconds -= reading_.derivatives->seconds() - compiled;
    }
    result.finish();
    result.watch.raise();
    return nb::cast(made.release(), nb::rv_policy::take_ownership);
  }

 private:
  Reading reading_;

  static const double* given(nb::handle array, Vector* held, std::size_t size) {
    if (!nb::try_cast(array, *held)) throw nb::type_error("integrate: expected a vector of doubles");
    require(held->shape(0) == size, "integrate: a start or parameters of another size");
    return held->data();
  }
};

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
      .def_prop_ro("factorisations", [](const Owner& r) { return r.counts.factorisations; })
      .def_prop_ro("stiff_steps", [](const Owner& r) { return r.counts.stiff_steps; })
      .def_prop_ro("stiff_since", [](const Owner& r) { return r.counts.stiff_since; })
      .def_prop_ro("implicit_steps", [](const Owner& r) { return r.counts.implicit_steps; })
      .def_prop_ro("implicit_evaluations", [](const Owner& r) { return r.counts.implicit_evaluations; })
      .def_ro("switches", &Owner::switches);
}

}  // namespace

void bind_integrate(nb::module_& m) {
  using namespace nb::literals;
  auto result = nb::class_<StepResult>(m, "StepResult");
  with_counts(result)
      .def_prop_ro("time", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).time); })
      .def_prop_ro("state", [](nb::handle h) { auto& r = nb::cast<StepResult&>(h); return view(h, r.state, r.n); })
      .def_ro("end_time", &StepResult::end_time)
      .def_ro("finite", &StepResult::finite)
      .def_ro("events_complete", &StepResult::events_complete)
      .def_prop_ro("end_state", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).end_state); })
      .def_prop_ro("status", [](const StepResult& r) { return static_cast<int>(r.status); })
      .def_ro("seconds", &StepResult::seconds)
      .def_prop_ro("steps", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).steps); })
      .def_ro("longest_step", &StepResult::longest_step)
      .def_prop_ro("event_index", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).event_index); })
      .def_prop_ro("event_time", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).event_time); })
      .def_prop_ro("event_state",
                   [](nb::handle h) { auto& r = nb::cast<StepResult&>(h); return view(h, r.event_state, r.n); })
      .def_prop_ro("least", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).least_values); })
      .def_prop_ro("largest", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).largest_values); })
      .def_prop_ro("held_time", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).held_time); })
      .def_prop_ro("held_values", [](nb::handle h) {
        auto& r = nb::cast<StepResult&>(h);
        return view(h, r.held_values, static_cast<int>(r.held_count));
      })
      .def_prop_ro("switch_time", [](nb::handle h) { return view(h, nb::cast<StepResult&>(h).switch_time); })
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
      .def_ro("held_time", &StepBlock::held_time)
      .def_ro("held_values", &StepBlock::held_values)
      .def_ro("switch_time", &StepBlock::switch_time)
      .def_ro("event_counts", &StepBlock::event_counts)
      .def_ro("unresolved_count", &StepBlock::unresolved_count)
      .def_ro("unresolved_time", &StepBlock::unresolved_time)
      .def_ro("undefined_count", &StepBlock::undefined_count)
      .def_ro("undefined_time", &StepBlock::undefined_time);
  nb::class_<PreparedProblem>(m, "PreparedProblem")
      .def(nb::init<nb::object>())
      .def("run", &PreparedProblem::run, "progress"_a = nb::none(), "checkpoint"_a = nb::none(), "interval"_a = 0.0,
           "x0"_a = nb::none(), "parameters"_a = nb::none(), "updates"_a = nb::list());
}

}  // namespace bellcrank
