// The right-hand side for the steppers: it evaluates signals, normalises unit vectors and projects onto constraints.
#pragma once

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <new>

#include "simd_lanes.hpp"
#include "problem.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

[[noreturn]] inline void out_of_memory() {
#ifdef __cpp_exceptions
  throw std::bad_alloc();
#else
  __builtin_trap();  // in a page
#endif
}

// Zeroed memory, aligned and padded for SIMD. Small arrays lie within the object itself, because a short run takes only as
// long as a few calls of the allocator.
template <class T>
class Array {
 public:
  explicit Array(std::size_t size) {
    const std::size_t bytes = (size * sizeof(T) / 64 + 1) * 64;
    data_ = reinterpret_cast<T*>(bytes <= sizeof own_ ? own_ : std::aligned_alloc(64, bytes));
    if (!data_) out_of_memory();
    std::memset(static_cast<void*>(data_), 0, bytes);
  }
  ~Array() {
    if (static_cast<void*>(data_) != own_) std::free(data_);
  }
  Array(const Array&) = delete;
  Array& operator=(const Array&) = delete;
  operator T*() { return data_; }
  operator const T*() const { return data_; }

 private:
  alignas(64) unsigned char own_[256];
  T* data_;
};
using Buffer = Array<double>;

// Memory that grows, for plain data.
template <class T>
class Growing {
 public:
  Growing() = default;
  ~Growing() { std::free(data_); }
  Growing(const Growing&) = delete;
  Growing& operator=(const Growing&) = delete;
  void reserve(std::size_t size) {
    if (size <= room_) return;
    const std::size_t room = size > 2 * room_ ? size + 16 : 2 * room_;
    void* data = std::realloc(data_, room * sizeof(T));
    if (!data) out_of_memory();
    data_ = static_cast<T*>(data), room_ = room;
  }
  operator T*() { return data_; }
  operator const T*() const { return data_; }

 private:
  T* data_ = nullptr;
  std::size_t room_ = 0;
};

inline double larger(double a, double b) { return a > b ? a : b; }
inline double smaller(double a, double b) { return a < b ? a : b; }
// From |t| to the next double.
inline double spacing(double t) {
  const double from = std::fabs(t);
  std::uint64_t bits;
  std::memcpy(&bits, &from, sizeof bits);
  ++bits;
  double next;
  std::memcpy(&next, &bits, sizeof next);
  return next - from;
}

class Rhs {
 public:
  explicit Rhs(const Problem& problem)
      : problem(problem), u_(problem.signal_entries), rest_(problem.n), correction_(problem.n),
        piece_(problem.signal_count) {
    if (problem.held.count) std::memcpy(held(), problem.held.start, problem.held.count * sizeof(double));
  }

  const Problem& problem;
  std::int64_t evaluations = 0;
  double latest = INFINITY;  // stages at a stop are evaluated just before it

  const double* u() const { return u_; }
  double* held() { return u_ + (problem.signal_entries - problem.held.count); }
  const double* rest() const { return rest_; }  // n zeros
  bool out_of_evaluations() const { return evaluations >= problem.max_evaluations; }

  // Fixes the interval of kinked signals for the steps between two stops.
  void pin(double from, double to) {
    for (int g = 0; g < problem.signal_count; ++g)
      if (problem.signals[g].kinked) piece_[g] = piece(problem.signals[g], 0.5 * (from + to), 0);
  }

  // u at time t, for kernels called elsewhere. Not inlined: most runs have no signals.
  __attribute__((noinline)) void signals(double t) {
    double* u = u_;
    for (int g = 0; g < problem.signal_count; ++g) {
      const Signal& s = problem.signals[g];
      if (!s.kinked) piece_[g] = piece(s, t, piece_[g]);
      u = polynomial(s, piece_[g], t, u);
    }
  }

  // One evaluation; the caller's pointers are {&time, x, u(), p}, and evaluations are counted by the step.
  template <class In>
  BELLCRANK_INLINE std::int32_t operator()(In& in, double t, double* const* out) {
    in.time = smaller(t, latest);
    if (problem.signal_count) signals(in.time);
    return problem.fallback ? guarded(in.pointers, out) : problem.rhs(in.pointers, out);
  }

  // Normalises unit vectors, unless their length is 1 to the last digit.
  BELLCRANK_INLINE void normalise(double* x) const {
    if (problem.unit_count) make_unit(x);
  }

  // Normalises and projects a state at the end of a step.
  BELLCRANK_INLINE void normalise_and_project(double t, double* x) {
    normalise(x);
    if (problem.project) project(t, x);
  }

  // The size of a correction: how far it moves the position, in rad and characteristic lengths. A correction of size d
  // leaves an error of size d^2: below `exact` that is rounding, below `safe` Newton's method certainly converges.
  static constexpr double exact = 1e-7, safe = 1e-3;
  BELLCRANK_INLINE double size(const double* correction) const {
    double sum = 0;
    const double* weights = problem.weights;
    for (int k = 0; k < problem.nq; ++k) sum += std::fabs(weights ? weights[k] * correction[k] : correction[k]);
    return sum;
  }
  // Takes back what a projection did to the velocity of a state between the ends of steps, where that is more than the
  // dense output's error explains: where constraints nearly lose rank, a small residual makes a large change of it. Fixed
  // steps have no tolerance.
  static constexpr double most_projected = 1e4;  // tolerances
  void keep_velocity(const double* from, double* x) const {
    bool near = true;
    for (int k = problem.nq; k < problem.nq + problem.nv && !(problem.step > 0); ++k)
      near &= std::fabs(x[k] - from[k]) <= most_projected * (problem.atol + problem.rtol * std::fabs(from[k]));
    if (!near) std::memcpy(x + problem.nq, from + problem.nq, problem.nv * sizeof(double));
  }
  BELLCRANK_INLINE void correct(double* x, const double* correction) const {
    for (int k = 0; k < problem.nq + problem.nv; ++k) x[k] += correction[k];
    normalise(x);
  }

 private:
  static constexpr int most_corrections = 8;

  // Constraints that are always redundant are tested only now and then; the fallback is used meanwhile.
  class GuardHistory {
   public:
    bool skips() { return skip_ > 0 && skip_--; }
    bool holds(double guard) {
      if (guard > 0) return failures_ = 0, true;
      if (++failures_ >= 8) skip_ = 31;
      return false;
    }

   private:
    int failures_ = 0, skip_ = 0;
  };

  Buffer u_, rest_, correction_;
  GuardHistory rhs_guards_, projection_guards_;
  Array<int> piece_;  // piece: -1 before the breaks, `pieces` after them

  // The plain function, or the fallback where its guard is not positive.
  std::int32_t guarded(const double* const* in, double* const* out) {
    if (rhs_guards_.skips()) return problem.fallback(in, out);
    double guard = 0;
    double* const both[] = {*out, &guard};
    const std::int32_t status = problem.rhs(in, both);
    return rhs_guards_.holds(guard) ? status : problem.fallback(in, out);
  }

  // Newton's method on the constraints and their velocities, while it converges.
  __attribute__((noinline)) void project(double t, double* x) {
    const double time = smaller(t, latest);
    if (problem.signal_count) signals(time);
    const double* const in[] = {&time, x, u_, problem.p};
    double guard = 0, before = INFINITY;
    double* const out[] = {correction_, &guard};
    for (int i = 0; i < most_corrections; ++i) {
      std::int32_t status = 0;
      if (projection_guards_.skips() || (status = problem.project(in, out), !projection_guards_.holds(guard)))
        status = problem.project_fallback(in, out);
      const double now = size(correction_);
      if (status != 0 || !(now < 0.5 * before)) break;
      correct(x, correction_);
      if (now <= exact) break;
      before = now;
    }
  }

  __attribute__((noinline)) void make_unit(double* x) const {
    for (int i = 0; i < problem.unit_count; ++i) {
      double* part = x + problem.units[i].start;
      double square = 0;
      for (int j = 0; j < problem.units[i].length; ++j) square += part[j] * part[j];
      if (std::fabs(square - 1) <= 4.5e-16 || !(square > 0)) continue;
      const double scale = 1 / std::sqrt(square);
      for (int j = 0; j < problem.units[i].length; ++j) part[j] *= scale;
    }
  }

  static int piece(const Signal& s, double t, int guess) {
    if (t < s.breaks[0]) return -1;
    if (t >= s.breaks[s.pieces]) return t > s.breaks[s.pieces] ? s.pieces : s.pieces - 1;
    if (guess >= 0 && guess < s.pieces && s.breaks[guess] <= t) {
      if (t < s.breaks[guess + 1]) return guess;
      if (guess + 2 <= s.pieces && t < s.breaks[guess + 2]) return guess + 1;
    }
    int low = 0, high = s.pieces;
    while (high - low > 1) {
      const int middle = (low + high) / 2;
      (t < s.breaks[middle] ? high : low) = middle;
    }
    return low;
  }

  static double* polynomial(const Signal& s, int piece, double t, double* u) {
    const bool held = piece < 0 || piece >= s.pieces;
    if (held) {
      t = piece < 0 ? s.breaks[0] : s.breaks[s.pieces];
      piece = piece < 0 ? 0 : s.pieces - 1;
    }
    const double d = t - s.breaks[piece];
    const double* c = s.coefficients + static_cast<std::size_t>(piece) * s.powers * s.width;
    const int w = s.width;
    for (int j = 0; j < w; ++j) {
      double value = 0, slope = 0, curve = 0;  // curve: half the second derivative
      for (int i = s.powers - 1; i >= 0; --i) {
        curve = curve * d + slope;
        slope = slope * d + value;
        value = value * d + c[i * w + j];
      }
      u[j] = value;
      if (s.derivatives > 0) u[w + j] = held ? 0 : slope;
      if (s.derivatives > 1) u[2 * w + j] = held ? 0 : 2 * curve;
    }
    return u + static_cast<std::ptrdiff_t>(w) * (s.derivatives + 1);
  }
};

// The pointers of a kernel call, prepared once. A staged kernel evaluates at x + scale k, so that the newest slope of a
// step reaches the next stage without being stored and loaded.
struct Inputs {
  double time = 0, scale = 0;
  const double* pointers[6];
  Inputs(const double* x, const Rhs& rhs) : pointers{&time, x, rhs.u(), rhs.problem.p, rhs.rest(), &scale} {}
  Inputs(const Inputs&) = delete;

  void at(const double* k, double s) {
    pointers[4] = k;
    scale = s;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
