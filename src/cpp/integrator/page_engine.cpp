// The explicit integrator as WebAssembly, for pages that compute a run again (docs/tools/page_engine.py compiles it).
// A page writes the description of a scene once, as numbers (simulation/live_simulation.py), and then values of its
// settings; `page_run` finds the start, integrates and evaluates what the page shows.
#define BELLCRANK_ISA page

#include <cstdint>
#include <cstdlib>
#include <new>
#include <vector>

#include "explicit_runge_kutta.hpp"
#include "integration_loop.hpp"
#include "row_sizes.hpp"
#include "start_search.hpp"
#include "stops.hpp"

#define BELLCRANK_EXPORT(name) __attribute__((export_name(#name))) name

extern "C" __attribute__((import_module("env"), import_name("late"))) int late();  // whether the page waits no longer

// Those of the libraries write messages to a console, which would be most of the module.
void* operator new(std::size_t size) {
  void* found = std::malloc(size);
  return found ? found : (__builtin_trap(), nullptr);
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void std::__libcpp_verbose_abort(const char*, ...) noexcept { __builtin_trap(); }

namespace bellcrank {
namespace {

enum KernelPlace {
  RHS, FALLBACK, PROJECT, PROJECT_FALLBACK, EVENTS, LINEARISED, ROWS, INERTIA, COSINES, ALIGNED, START, SHOWN, KERNELS
};
constexpr double TURNED_OVER = 9;  // a status that is not the integrator's (simulation/integration/statistics.py)
Kernel kernels[KERNELS];
int outputs_of[KERNELS];  // sizes of the results of those that are called for many samples

// A kernel for one sample as one for many.
template <int Place, int Inputs>
std::int32_t many(const double* const* in, double* const* out, const std::int64_t* strides, std::int64_t rows) {
  for (std::int64_t i = 0; i < rows; ++i) {
    const double* at[Inputs];
    for (int k = 0; k < Inputs; ++k) at[k] = in[k] + i * strides[k];
    double* to[] = {out[0] + i * outputs_of[Place]};
    if (const std::int32_t status = kernels[Place](at, to)) return status;
  }
  return 0;
}

// The numbers of a description, one after the other; a list begins with its length.
class Description {
 public:
  explicit Description(const double* at) : at_(at) {}
  double number() { return *at_++; }
  int whole() { return static_cast<int>(*at_++); }
  const double* numbers(int count) { return at_ += count, at_ - count; }
  template <class T>
  std::vector<T> list() {
    const int count = whole();
    const double* from = numbers(count);
    std::vector<T> found(count);
    for (int i = 0; i < count; ++i) found[i] = static_cast<T>(from[i]);
    return found;
  }

 private:
  const double* at_;
};

// What the engine finds.
struct Found final : Record {
  int n;
  std::vector<double> time, state, event_time, event_state, steps;
  std::vector<double> event_index;
  double end_time = 0;

  explicit Found(int n) : n(n), room_(4096) { next_step = room_.data(), steps_end = next_step + room_.size(); }
  void more_steps() override { next_step = room_.data(); }
  void output(double t, const double* x) override {
    time.push_back(t);
    state.insert(state.end(), x, x + n);
  }
  void event(int index, double t, const double* x) override {
    if (event_time.size() >= most_events) return;
    event_index.push_back(index), event_time.push_back(t);
    event_state.insert(event_state.end(), x, x + n);
  }
  void unresolved(int, double) override { ++doubtful; }
  void undefined(int, double) override { ++doubtful; }
  void end(double t, const double* x) override {
    end_time = t;
    if (time.empty() || time.back() < t) output(t, x);
  }
  bool look(double, const double*, const Counts&, std::int64_t* attempts) override {
    *attempts = 200;
    return late();
  }

  static constexpr std::size_t most_events = 1000;
  int doubtful = 0;  // steps in which events may have been missed

 private:
  std::vector<double> room_;
};

// Why there is no run: the first are StartCode.
enum Refusal { CONSISTENT, UNDEFINED, UNSATISFIED, TURNED_AROUND, VIOLATED, IRREGULAR, OPEN_CONTACT, FLAT_DISK };

struct Scene {
  Problem problem{};
  StartModel start{};
  RowModel rows{};
  bool constrained, parametric;
  int settings, own, shown, signal_entries;
  int kinetic, potential, work;   // places of energies in what is shown
  double weight;                  // of all links, N
  double share;                   // the regularisation of constraints
  std::vector<double> constants;  // units of the rows and L, where these depend on no parameter
  std::vector<char> held_q, held_v;
  std::vector<int> holds;         // by setting: the degree of freedom whose velocity a change of it holds, or -1
  std::vector<int> gains;         // the settings that are Baumgarte's gains
  bool projected;
  std::vector<int> direction, kind;  // of events: 1 contact lost, 2 a disk that lies flat
  std::vector<char> terminal;
  std::vector<Unit> units;
  std::vector<Signal> signals;
  std::vector<double> jumps, stops, weights;
  std::vector<char> far_positions;
  const double *u0, *stored;

  explicit Scene(Description d) {
    Problem& p = problem;
    p.nq = d.whole(), p.nv = d.whole(), p.n = d.whole(), p.norm_size = d.whole();
    own = d.whole(), settings = d.whole(), shown = d.whole(), signal_entries = d.whole();
    kinetic = d.whole(), potential = d.whole(), work = d.whole(), weight = d.number();
    u0 = d.numbers(signal_entries), stored = d.numbers(settings);
    p.t1 = d.number(), p.rtol = d.number(), p.atol = d.number(), p.first_step = d.number(), p.max_step = d.number();
    p.max_evaluations = static_cast<std::int64_t>(d.number());
    const std::vector<int> parts = d.list<int>();
    for (std::size_t k = 0; k < parts.size(); k += 2) units.push_back({parts[k], parts[k + 1]});
    far_positions = d.list<char>();
    for (int count = d.whole(); count > 0; --count) {
      Signal s{};
      s.pieces = d.whole(), s.powers = d.whole(), s.width = d.whole(), s.derivatives = d.whole(), s.kinked = d.whole();
      s.breaks = d.numbers(s.pieces + 1), s.coefficients = d.numbers(s.pieces * s.powers * s.width);
      signals.push_back(s);
      if (s.kinked) jumps.insert(jumps.end(), s.breaks, s.breaks + s.pieces + 1);
    }
    for (double t : d.list<double>()) jumps.push_back(t);
    std::sort(jumps.begin(), jumps.end());
    stops = stops_within(jumps, 0, p.t1, &p.latest);
    terminal = d.list<char>(), direction = d.list<int>(), kind = d.list<int>(), p.event_samples = d.whole();
    held_q = d.list<char>(), held_v = d.list<char>(), holds = d.list<int>(), gains = d.list<int>();
    projected = d.whole();
    constrained = d.whole();
    parametric = d.whole(), share = d.number();
    read_start(d);
    if (constrained) read_rows(d);
    p.rhs = kernels[RHS], p.fallback = kernels[FALLBACK], p.events = kernels[EVENTS];
    p.lanes = 1, p.units = units.data(), p.unit_count = static_cast<int>(units.size());
    p.signals = signals.data(), p.signal_count = static_cast<int>(signals.size()), p.signal_entries = signal_entries;
    p.stops = stops.data(), p.stop_count = static_cast<int>(stops.size());
    p.terminal = reinterpret_cast<const bool*>(terminal.data()), p.direction = direction.data();
    p.event_count = static_cast<int>(terminal.size());
    p.held.work_row = -1;
  }

 private:
  void read_start(Description& d) {
    StartModel& m = start;
    m.nq = problem.nq, m.nv = problem.nv, m.size = problem.n, m.u = u0, m.linearised = kernels[LINEARISED];
    m.heights = d.whole(), m.rows = d.whole();
    m.entry_row = d.list<int>(), m.entry_column = d.list<int>();
    m.far = d.list<bool>();
    m.cosines = kernels[COSINES], m.aligned = kernels[ALIGNED], m.cosine_count = d.whole();
    m.aligned_of = d.list<int>(), m.aligned_count = static_cast<int>(m.aligned_of.size()), m.sine = d.list<bool>();
    for (int count = d.whole(); count > 0; --count) {
      StartJoint joint{};
      joint.kind = static_cast<JointKind>(d.whole()), joint.q = d.whole(), joint.v = d.whole();
      joint.position_in_parent = d.whole(), joint.velocity_in_parent = d.whole();
      m.joints.push_back(joint);
    }
  }

  void read_rows(Description& d) {
    constants = d.list<double>();
    if (!parametric) return;
    RowModel& m = rows;
    m.nq = problem.nq, m.nv = problem.nv;
    m.unit_kind = d.list<int>(), m.rows = static_cast<int>(m.unit_kind.size());
    m.constraint = d.list<int>(), m.rigid = d.list<bool>(), m.constraints = static_cast<int>(m.rigid.size());
    m.sampled = many<ROWS, 4>, m.sample_size = outputs_of[ROWS] = d.whole();
    m.sample_count = d.whole(), m.signals = signal_entries;
    m.q = d.numbers(m.sample_count * m.nq), m.moves = d.numbers(m.sample_count * m.nq);
    m.t = d.numbers(m.sample_count), m.u = d.numbers(m.sample_count * m.signals);
    m.entry_row = d.list<int>(), m.entry_column = d.list<int>(), m.lever = d.list<bool>();
    m.far_coordinates = d.whole();
    m.inertia = many<INERTIA, 3>, outputs_of[INERTIA] = m.nv;
    m.inertia_posture = d.list<int>(), m.inertia_count = static_cast<int>(m.inertia_posture.size());
    m.directions = d.numbers(m.inertia_count * m.nv);
    m.factorised = d.whole(), m.far = start.far, m.kept = d.list<int>(), m.longest = d.number();
    m.length_parameters = d.list<int>(), m.powers = d.list<double>(), m.least_power = d.whole();
  }
};

class Run {
 public:
  explicit Run(Scene& scene) : s_(scene), found_(scene.problem.n), x_(scene.problem.n + 16) {}

  void operator()(const double* settings, const std::vector<double>& times, double* result) {
    Problem& p = s_.problem;
    const int refused = find_start(settings);
    result[0] = refused, result[1] = place_, result[2] = value_;
    if (refused) return;
    const bool projects = s_.projected && !changed(settings, s_.gains);
    p.project = s_.constrained && projects ? kernels[PROJECT] : nullptr;
    p.project_fallback = p.project ? kernels[PROJECT_FALLBACK] : nullptr;
    p.weights = s_.weights.empty() ? nullptr : s_.weights.data();
    p.x0 = x_.data(), p.p = p_.data(), p.times = times.data(), p.time_count = times.size();
    Counts counts;
    const auto ended = page::IntegrationLoop<page::ExplicitRungeKutta<Dop853, 0>>(p, found_, counts)();
    const double status = turned_over() ? TURNED_OVER : static_cast<double>(ended);
    evaluate(SHOWN, s_.shown, found_.time, found_.state, shown_);
    evaluate(SHOWN, s_.shown, found_.event_time, found_.event_state, events_);
    const double numbers[] = {status, found_.end_time, static_cast<double>(counts.accepted),
                              static_cast<double>(counts.rejected), static_cast<double>(counts.evaluations),
                              static_cast<double>(counts.stiff_steps), static_cast<double>(found_.doubtful),
                              static_cast<double>(found_.time.size()), address(found_.time), address(found_.state),
                              address(shown_), static_cast<double>(found_.event_time.size()), address(found_.event_time),
                              address(found_.event_index), address(events_), energy_drift()};
    std::copy(std::begin(numbers), std::end(numbers), result + 3);
  }

 private:
  Scene& s_;
  Found found_;
  std::vector<double> x_, p_, shown_, events_;
  int place_ = 0;
  double value_ = 0;

  // As Trajectory.energy_drift (simulation/trajectory/trajectory.py).
  double energy_drift() const {
    double gap = 0, moved = 0, size = 0;
    for (std::size_t i = 0; i < found_.time.size(); ++i) {
      const double *first = shown_.data(), *row = first + i * s_.shown;
      const double t = row[s_.kinetic], v = row[s_.potential] - first[s_.potential], w = row[s_.work] - first[s_.work];
      gap = std::fmax(gap, std::fabs(t - first[s_.kinetic] + v - w));
      moved = std::fmax(moved, t + std::fabs(v) + std::fabs(w));
      size = std::fmax(size, std::fabs(t) + std::fabs(row[s_.potential]));
    }
    return moved <= 1e-12 * (size + s_.weight) ? 0 : gap / moved;
  }

  static double address(const std::vector<double>& values) { return static_cast<double>(reinterpret_cast<std::uintptr_t>(values.data())); }

  bool changed(const double* settings, const std::vector<int>& which) const {
    for (int k : which)
      if (settings[k] != s_.stored[k]) return true;
    return false;
  }

  // p and x at the start, or why there is none.
  int find_start(const double* settings) {
    const Problem& p = s_.problem;
    const int nq = p.nq, nv = p.nv;
    p_.assign(s_.own + 1, 0.0);
    std::vector<double> v(nv + 1);
    const double* in[] = {settings};
    double* out[] = {x_.data(), v.data(), p_.data()};
    kernels[START](in, out);
    p_.resize(s_.own);
    std::vector<double> unit = s_.constants;
    double length = 1;
    if (s_.constrained) {
      if (s_.parametric) {
        const std::size_t kept = s_.rows.kept.size();
        std::vector<double> sizes(3 * kept + 1);
        if (!RowSizes(s_.rows)(p_.data(), sizes.data())) return IRREGULAR;
        unit.assign(sizes.begin() + 2 * kept, sizes.end());
        p_.insert(p_.end(), sizes.begin(), sizes.end());
      }
      p_.push_back(s_.share);
      length = unit.back();
      s_.weights.clear();
      for (char far : s_.far_positions) s_.weights.push_back(far ? 1 / length : 1);
    }
    StartSearch search(s_.start);
    const StartDesign design{p_.data(), unit.data(), length};
    if (s_.constrained) {
      const StartVerdict posture = search.posture(design, flags(s_.held_q), x_.data());
      if (posture.code != StartCode::consistent) return refusal(posture);
    }
    search.velocity_in_body(x_.data(), v.data());
    if (s_.constrained) {
      std::vector<char> held = s_.held_v;
      for (int k = 0; k < s_.settings; ++k)
        if (s_.holds[k] >= 0 && settings[k] != s_.stored[k]) held[s_.holds[k]] = true;
      const StartVerdict rates = search.velocity(design, flags(held), x_.data(), v.data());
      if (rates.code != StartCode::consistent) return refusal(rates);
    }
    std::copy(v.begin(), v.begin() + nv, x_.begin() + nq);
    std::fill(x_.begin() + nq + nv, x_.end(), 0.0);
    return open_contact();
  }

  static const bool* flags(const std::vector<char>& values) { return reinterpret_cast<const bool*>(values.data()); }

  int refusal(const StartVerdict& verdict) {
    place_ = verdict.index, value_ = verdict.value;
    return static_cast<int>(verdict.code);
  }

  // Events whose functions must be positive at the start.
  int open_contact() {
    if (!s_.problem.event_count) return CONSISTENT;
    std::vector<double> values(s_.problem.event_count);
    const double t = 0;
    const double* in[] = {&t, x_.data(), s_.u0, p_.data()};
    double* out[] = {values.data()};
    kernels[EVENTS](in, out);
    for (int k = 0; k < s_.problem.event_count; ++k) {
      place_ = k, value_ = values[k];
      if (s_.kind[k] == 1 && values[k] < 0) return OPEN_CONTACT;
      if (s_.kind[k] == 2 && !(values[k] > 0)) return FLAT_DISK;
    }
    return CONSISTENT;
  }

  // As until_turned_over (simulation/integration/integration.py): the rows before one in which a weld or hinge is turned by more than
  // a quarter turn; whether there is one.
  bool turned_over() {
    const int count = s_.start.cosine_count;
    if (!count) return false;
    std::vector<double> cosines;
    evaluate(COSINES, count, found_.time, found_.state, cosines);
    const auto bad = std::find_if(cosines.begin(), cosines.end(), [](double cosine) { return !(cosine > 0); });
    if (bad == cosines.end()) return false;
    const std::size_t rows = std::max<std::size_t>((bad - cosines.begin()) / count, 1);
    found_.time.resize(rows), found_.state.resize(rows * s_.problem.n);
    found_.end_time = found_.time.back();
    while (!found_.event_time.empty() && found_.event_time.back() > found_.end_time)
      found_.event_time.pop_back(), found_.event_index.pop_back();
    return true;
  }

  // Values, `count` each, of a function of the states at times.
  void evaluate(KernelPlace place, int count, const std::vector<double>& time, const std::vector<double>& state,
                std::vector<double>& values) {
    page::Rhs rhs(s_.problem);
    values.assign(time.size() * count, 0.0);
    for (std::size_t i = 0; i < time.size(); ++i) {
      if (s_.problem.signal_count) rhs.pin(time[i], time[i]), rhs.signals(time[i]);
      const double* in[] = {&time[i], &state[i * s_.problem.n], rhs.u(), p_.data()};
      double* out[] = {&values[i * count]};
      kernels[place](in, out);
    }
  }
};

std::vector<double> description, settings, times;
Scene* scene = nullptr;
Run* run = nullptr;
double result[19];

extern "C" {

double* BELLCRANK_EXPORT(page_room)(int count) { return description.assign(count, 0.0), description.data(); }
void* BELLCRANK_EXPORT(page_memory)(int bytes) { return std::malloc(bytes); }
Kernel* BELLCRANK_EXPORT(page_kernels)() { return kernels; }
double* BELLCRANK_EXPORT(page_times)(int count) { return times.assign(count, 0.0), times.data(); }

// Reads the description; returns the place of the settings.
double* BELLCRANK_EXPORT(page_read)() {
  delete scene;
  scene = new Scene(Description(description.data()));
  settings.assign(scene->stored, scene->stored + scene->settings);
  return settings.data();
}

// Computes the run of the settings; returns the place of the figures, which live_worker.js names.
double* BELLCRANK_EXPORT(page_run)() {
  delete run;
  run = new Run(*scene);
  (*run)(settings.data(), times, result);
  return result;
}

}  // extern "C"
}  // namespace
}  // namespace bellcrank
