// Reads the parts that the records IntegrationProblem and EnsembleProblem have in common.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <array>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "problem.hpp"
#include "stops.hpp"

namespace bellcrank {

namespace nb = nanobind;

using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Matrix = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Cube = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

inline void require(bool holds, const char* text) {
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


// The derivatives of a record Kernels, whose functions may be compiled when they are first asked for.
class DerivativeSource final : public Derivatives {
 public:
  explicit DerivativeSource(nb::handle kernels) : make_(kernels.attr("derivatives")) {
    if (make_.is_none()) read(kernels);
  }
  bool exist() const { return !make_.is_none() || found_.jacobian || found_.tangent; }

  // How long it took to make them.
  double seconds() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return seconds_;
  }

  // From any thread, without the GIL. Throws what Python raises.
  DerivativeKernels kernels() override {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!found_.jacobian && !found_.tangent) {
      nb::gil_scoped_acquire gil;
      const auto begun = std::chrono::steady_clock::now();
      const nb::object made = make_();
      read(made);
      seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
      require(found_.jacobian || found_.tangent, "integrate: no derivatives were made");
    }
    return found_;
  }

 private:
  const nb::object make_;  // () -> Kernels, or None
  DerivativeKernels found_{};
  double seconds_ = 0;
  mutable std::mutex mutex_;

  void read(nb::handle kernels) {
    found_.jacobian = function<Kernel>(kernels, "jacobian");
    found_.tangent = function<BatchKernel>(kernels, "tangent");
    found_.lanes = std::max(1, get<int>(kernels, "lanes"));
  }
};

// The times at which stages end, whatever the run's end: stops, and breaks of kinked signals; sorted.
inline std::vector<double> all_jumps(const Vector& stops, const std::vector<Signal>& signals) {
  std::vector<double> found(stops.data(), stops.data() + stops.shape(0));
  for (const Signal& s : signals)
    if (s.kinked) found.insert(found.end(), s.breaks, s.breaks + s.pieces + 1);
  std::sort(found.begin(), found.end());
  return found;
}

// What the record refers to is kept alive here, and `plain` points to it for the engine.
struct ProblemReading {
  Problem plain{};
  std::unique_ptr<DerivativeSource> derivatives;
  std::string method;
  std::vector<double> jumps;

  ProblemReading() = default;
  ProblemReading(const ProblemReading&) = delete;

 protected:
  // Reads all but the span, for states of `n` entries; `stepped`: fixed steps are given elsewhere.
  void read(nb::handle record, int n, bool stepped = false) {
    plain.n = n;
    read_kernels(record.attr("kernels"));
    read_layout(record.attr("layout"));
    read_control(record.attr("control"), stepped);
    read_events(record.attr("events"));
    for (nb::handle signal : record.attr("signals")) read_signal(signal);
    plain.signals = signals_.data(), plain.signal_count = static_cast<int>(signals_.size());
    jumps = all_jumps(get<Vector>(record, "stops"), signals_);
  }

  // After `read`: the entries of u that the run finds, None for none.
  void read_held(nb::handle held) {
    if (held.is_none()) return;
    held_start_ = get<Vector>(held, "start");
    plain.held.count = static_cast<int>(held_start_.shape(0)), plain.held.start = held_start_.data();
    plain.held.switch_count = get<int>(held, "switch_count");
    plain.held.switches = function<Kernel>(held, "switches");
    mode_kinds_ = get<std::vector<int>>(held, "mode_kinds"), mode_places_ = get<std::vector<int>>(held, "mode_places");
    mode_ends_ = get<std::vector<int>>(held, "mode_ends"), mode_sides_ = get<std::vector<int>>(held, "mode_sides");
    plain.held.mode_sides = mode_sides_.data();
    plain.held.mode_kinds = mode_kinds_.data(), plain.held.mode_places = mode_places_.data();
    plain.held.mode_ends = mode_ends_.data();
    plain.held.work_row = get<int>(held, "work_row"), plain.held.response_rows = get<int>(held, "response_rows");
    mode_rows_ = get<std::vector<int>>(held, "mode_rows");
    plain.held.mode_rows = mode_rows_.data(), plain.held.mode_count = static_cast<int>(mode_rows_.size());
    plain.held.turn = function<Kernel>(held, "mode_turn");
    const int turning = plain.held.switch_count + 4 * plain.held.mode_count;
    require(plain.held.switch_count >= 0 && turning <= plain.held.count && (plain.held.switches || !turning) &&
                (plain.held.turn || !plain.held.mode_count),
            "integrate: a held entry for each switch and mode, and their functions");
    require(plain.held.response_rows >= 0 && plain.nq + plain.held.response_rows <= plain.n,
            "integrate: forces of modes accelerate entries of x");
    require(mode_kinds_.size() == mode_rows_.size() && mode_places_.size() == mode_rows_.size() &&
                mode_ends_.size() == mode_rows_.size() && mode_sides_.size() == mode_rows_.size() &&
                plain.held.work_row < plain.n,
            "integrate: a kind and a position for each mode");
    for (std::size_t j = 0; j < mode_rows_.size(); ++j)
      require((mode_rows_[j] >= plain.nq && mode_rows_[j] < plain.nq + plain.held.response_rows) ||
                  (mode_rows_[j] == -1 && mode_kinds_[j] == 0),
              "integrate: modes are of velocities in x");
    for (std::size_t j = 0; j < mode_rows_.size(); ++j)
      require(mode_kinds_[j] == 4 ? mode_sides_[j] >= 0 && mode_sides_[j] < plain.held.switch_count : mode_sides_[j] == -1,
              "integrate: the side of a gear is a switch");
    for (const int place : mode_places_) require(place >= 0 && place < plain.n, "integrate: stops are of entries of x");
    for (auto [kernel, first, period] :
         get<std::vector<std::tuple<std::uintptr_t, double, double>>>(held, "updates")) {
      require(period > 0 && std::isfinite(first), "integrate: updates need a period");
      updates_.push_back({reinterpret_cast<Kernel>(kernel), first, period});
    }
    plain.held.updates = updates_.data(), plain.held.update_count = static_cast<int>(updates_.size());
    plain.signal_entries += plain.held.count;
  }

 private:
  Vector weights_;
  std::vector<std::pair<Vector, Cube>> pieces_;  // of the signals
  std::vector<Signal> signals_;
  std::vector<Unit> units_;
  std::vector<JointBlock> joints_;
  std::vector<int> direction_;
  std::unique_ptr<bool[]> terminal_;
  Vector held_start_;
  std::vector<Update> updates_;
  std::vector<int> mode_rows_, mode_kinds_, mode_places_, mode_ends_, mode_sides_;

  void read_kernels(nb::handle kernels) {
    plain.rhs = function<Kernel>(kernels, "rhs");
    plain.staged = get<bool>(kernels, "staged");
    plain.fallback = function<Kernel>(kernels, "fallback");
    plain.lanes = std::max(1, get<int>(kernels, "lanes"));
    derivatives = std::make_unique<DerivativeSource>(kernels);
    plain.derivatives = derivatives->exist() ? derivatives.get() : nullptr;
    plain.events = function<Kernel>(kernels, "events");
    plain.project = function<Kernel>(kernels, "project");
    plain.project_fallback = function<Kernel>(kernels, "project_fallback");
    plain.project_batch = function<BatchKernel>(kernels, "project_batch");
    require(plain.rhs != nullptr, "integrate: no right-hand side");
  }

  void read_layout(nb::handle layout) {
    plain.norm_size = get<int>(layout, "norm_size"), plain.nq = get<int>(layout, "nq");
    plain.nv = plain.norm_size - plain.nq, plain.mixed = get<bool>(layout, "mixed");
    require(plain.n > 0 && plain.norm_size > 0 && plain.norm_size <= plain.n,
            "integrate: norm_size must be between 1 and the number of states");
    require(plain.nq >= 0 && plain.nq <= plain.norm_size, "integrate: nq must be between 0 and norm_size");
    for (auto [start, length] : get<std::vector<std::pair<int, int>>>(layout, "unit_parts")) {
      require(start >= 0 && length > 0 && start + length <= plain.n, "integrate: unit part outside the state");
      units_.push_back({start, length});
    }
    for (auto [q, nq, v, nv] : get<std::vector<std::array<int, 4>>>(layout, "joints")) {
      require(nq > 0 && nv > 0 && q >= 0 && v >= 0 && q + nq <= plain.nq && plain.nq + v + nv <= plain.n,
              "integrate: the coordinates of a joint outside the state");
      joints_.push_back({q, nq, v, nv});
    }
    plain.joints = joints_.empty() ? nullptr : joints_.data(), plain.joint_count = static_cast<int>(joints_.size());
    plain.units = units_.data(), plain.unit_count = static_cast<int>(units_.size());
    if (!layout.attr("weights").is_none()) {
      weights_ = get<Vector>(layout, "weights");
      require(static_cast<int>(weights_.shape(0)) == plain.nq, "integrate: one weight a position");
      plain.weights = weights_.data();
    }
  }

  void read_control(nb::handle control, bool stepped) {
    method = get<std::string>(control, "method");
    plain.rtol = get<double>(control, "rtol"), plain.atol = get<double>(control, "atol");
    plain.step = get<double>(control, "step"), plain.first_step = get<double>(control, "first_step");
    plain.max_step = get<double>(control, "max_step");
    plain.max_evaluations = get<std::int64_t>(control, "max_evaluations");
    require(method == "RK4" || method == "RK45" || method == "DOP853" || method == "Radau" ||
                method == automatic,
            "integrate: unknown method");
    require(stepped || plain.step > 0 || method != "RK4", "integrate: RK4 needs a step");
    require(stepped || plain.step > 0 || (plain.rtol >= 0 && plain.atol >= 0 && plain.rtol + plain.atol > 0),
            "integrate: rtol and atol must not be negative or both zero");
    require(plain.max_step > 0 && plain.first_step >= 0 && plain.step >= 0, "integrate: steps must be positive");
    require((method != "Radau" && method != automatic) || plain.derivatives,
            "integrate: Radau needs a Jacobian or a tangent");
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

inline bool has_avx2() {
#ifdef BELLCRANK_AVX2
  static const bool answer = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return answer;
#else
  return false;
#endif
}

// The engine of single runs for this machine.
inline Status run_single(const char* method, const Problem& problem, Record& record, Counts& counts) {
#ifdef BELLCRANK_AVX2
  if (has_avx2()) return avx2::run(method, problem, record, counts);
#endif
  return baseline::run(method, problem, record, counts);
}

}  // namespace bellcrank
