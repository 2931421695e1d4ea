// propagate_sensitivities: reads the records, calls the engine for this machine without the GIL, and wraps the result.
#include "sensitivities.hpp"

#include <algorithm>
#include <chrono>
#include <vector>

#include "integrate.hpp"
#include "interrupt.hpp"
#include "new_array.hpp"
#include "problem_reading.hpp"

namespace bellcrank {
namespace {

// The record IntegrationProblem (simulation/integration/integration_problem.py) without its outputs.
struct RunReading : ProblemReading {
  explicit RunReading(nb::handle record) {
    plain.t0 = get<double>(record, "t0"), plain.t1 = get<double>(record, "t1");
    x0_ = get<Vector>(record, "x0"), parameters_ = get<Vector>(record, "parameters");
    plain.x0 = x0_.data(), plain.p = parameters_.data();
    read(record, static_cast<int>(x0_.shape(0)));
    stops = stops_within(jumps, plain.t0, plain.t1, &plain.latest);
    plain.stops = stops.data(), plain.stop_count = static_cast<int>(stops.size());
  }
  std::vector<double> stops;

 private:
  Vector x0_, parameters_;
};

// The record SensitivityProblem (simulation/sensitivities/sensitivity_integration.py).
struct SensitivityReading {
  SensitivityProblem plain{};
  std::size_t mark_count = 0;

  SensitivityReading(nb::handle record, const RunReading& run) : run_(run) {
    plain.run = run.plain;
    const int size = plain.run.nq + plain.run.nv;
    plain.rate = kernels(record, "rate"), plain.fallback = kernels(record, "fallback");
    plain.project = kernels(record, "project"), plain.project_fallback = kernels(record, "project_fallback");
    require(plain.rate.point && (!plain.project.point || plain.project_fallback.point), "sensitivities: no derivatives");
    plain.lanes = get<int>(record, "lanes");
    seeds_ = get<Matrix>(record, "seeds"), changes_ = get<Matrix>(record, "changes");
    plain.directions = static_cast<int>(seeds_.shape(0)), plain.parameters = static_cast<int>(changes_.shape(1));
    require(plain.lanes > 0 && plain.directions > 0 && static_cast<int>(seeds_.shape(1)) == size &&
                changes_.shape(0) == seeds_.shape(0),
            "sensitivities: seeds and changes of another size");
    plain.seeds = seeds_.data(), plain.changes = changes_.data();
    floors_ = get<Vector>(record, "floors");
    require(static_cast<int>(floors_.shape(0)) == plain.directions, "sensitivities: one floor a direction");
    plain.floors = floors_.data();
    plain.tolerance = get<double>(record, "tolerance"), plain.first_step = get<double>(record, "first_step");
    plain.given_steps = get<bool>(record, "given_steps");
    require(plain.tolerance > 0 && plain.first_step > 0, "sensitivities: tolerance and first step must be positive");
    times_ = get<Vector>(record, "times"), states_ = get<Matrix>(record, "states");
    require(states_.shape(0) == times_.shape(0) && static_cast<int>(states_.shape(1)) == plain.run.n,
            "sensitivities: one state a row");
    plain.times = times_.data(), plain.states = states_.data(), plain.time_count = times_.shape(0);
    read_bounds(get<Vector>(record, "steps"), get<Vector>(record, "marks"));
  }

 private:
  const RunReading& run_;
  Matrix seeds_, changes_, states_;
  Vector times_, floors_;
  std::vector<double> bounds_;
  std::unique_ptr<bool[]> marked_;

  static Directional kernels(nb::handle record, const char* name) {
    const nb::object found = record.attr(name);
    if (found.is_none()) return {};
    return {function<Kernel>(found, "point"), function<Kernel>(found, "along"), get<int>(found, "tape")};
  }

  // Ends of steps, marks and stops together; the first and the last end of a step bound them.
  void read_bounds(const Vector& steps, const Vector& marks) {
    require(steps.shape(0) > 1, "sensitivities: no steps");
    const double from = steps.data()[0], end = steps.data()[steps.shape(0) - 1];
    require(from == plain.run.t0 && end <= plain.run.t1, "sensitivities: steps outside the run");
    bounds_.assign(steps.data() + 1, steps.data() + steps.shape(0));
    bounds_.insert(bounds_.end(), marks.data(), marks.data() + marks.shape(0));
    for (double stop : run_.stops)
      if (stop < end) bounds_.push_back(stop);
    std::sort(bounds_.begin(), bounds_.end());
    require(std::isfinite(bounds_.back()) && bounds_.front() >= from && bounds_.back() <= end,
            "sensitivities: a mark outside the run");
    bounds_.erase(std::unique(bounds_.begin(), bounds_.end()), bounds_.end());
    marked_ = std::make_unique<bool[]>(bounds_.size());
    for (std::size_t k = 0; k < marks.shape(0); ++k)
      marked_[std::lower_bound(bounds_.begin(), bounds_.end(), marks.data()[k]) - bounds_.begin()] = true;
    mark_count = static_cast<std::size_t>(std::count(marked_.get(), marked_.get() + bounds_.size(), true));
    plain.bounds = bounds_.data(), plain.marked = marked_.get(), plain.bound_count = bounds_.size();
  }
};

// The sensitivities of rows (directions, rows, nq + nv), and of marks.
class SensitivityResult final : public SensitivityRecord {
 public:
  SensitivityResult(const SensitivityProblem& problem, std::size_t marks)
      : directions(problem.directions), size(problem.run.nq + problem.run.nv), row_count(problem.time_count),
        mark_count(marks), rows(directions * row_count * size, NAN), marked(directions * marks * size, NAN),
        watch(nb::none()) {}

  double* row(std::size_t index) override { return rows.data() + index * size; }
  double* mark(std::size_t index) override { return marked.data() + index * size; }
  std::size_t row_stride() const override { return row_count * size; }
  std::size_t mark_stride() const override { return mark_count * size; }
  bool interrupted() override { return watch.look(0, &pause_); }

  std::size_t directions, size, row_count, mark_count;
  std::vector<double> rows, marked;
  Watch watch;
  SensitivityCounts counts;
  Status status = Status::finished;
  double seconds = 0;

 private:
  std::int64_t pause_ = 1;
};

nb::object propagate_sensitivities(nb::object run, nb::object record) {
  const RunReading reading(run);
  const SensitivityReading given(record, reading);
  auto made = std::make_unique<SensitivityResult>(given.plain, given.mark_count);
  SensitivityResult& result = *made;
  {
    nb::gil_scoped_release released;
    const auto begun = std::chrono::steady_clock::now();
#ifdef BELLCRANK_AVX2
    if (has_avx2()) result.status = avx2::propagate(given.plain, result, result.counts);
    else
#endif
      result.status = baseline::propagate(given.plain, result, result.counts);
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  }
  result.watch.raise();
  return nb::cast(made.release(), nb::rv_policy::take_ownership);
}

nb::object cube(nb::handle owner, std::vector<double>& values, std::size_t directions, std::size_t rows,
                std::size_t size) {
  return nb::cast(nb::ndarray<nb::numpy, double, nb::ndim<3>>(values.data(), {directions, rows, size}, owner));
}

}  // namespace

void bind_sensitivities(nb::module_& m) {
  nb::class_<SensitivityResult>(m, "SensitivityResult")
      .def_prop_ro("rows",
                   [](nb::handle h) {
                     auto& r = nb::cast<SensitivityResult&>(h);
                     return cube(h, r.rows, r.directions, r.row_count, r.size);
                   })
      .def_prop_ro("marked",
                   [](nb::handle h) {
                     auto& r = nb::cast<SensitivityResult&>(h);
                     return cube(h, r.marked, r.directions, r.mark_count, r.size);
                   })
      .def_prop_ro("status", [](const SensitivityResult& r) { return static_cast<int>(r.status); })
      .def_prop_ro("steps", [](const SensitivityResult& r) { return r.counts.steps; })
      .def_prop_ro("rejected", [](const SensitivityResult& r) { return r.counts.rejected; })
      .def_prop_ro("evaluations", [](const SensitivityResult& r) { return r.counts.evaluations; })
      .def_ro("seconds", &SensitivityResult::seconds);
  m.def("propagate_sensitivities", &propagate_sensitivities);
}

}  // namespace bellcrank
