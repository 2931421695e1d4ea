// The right-hand side for the steppers: it evaluates signals, normalises unit vectors and projects onto constraints.
#pragma once

#include <cmath>
#include <cstring>

#include "lane_vector.hpp"
#include "problem.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// Normalises unit vectors, unless their length is 1 to the last digit. `T`: double, or a vector with a run in each lane, and then
// `M` is a mask.
template <class T>
__attribute__((noinline)) void make_unit(const Problem& p, T* x) {
  for (int i = 0; i < p.unit_count; ++i) {
    T* part = x + p.units[i].start;
    T square = {};
    for (int j = 0; j < p.units[i].length; ++j) square += part[j] * part[j];
    const auto changes = (absolute(square - 1.0) > 4.5e-16) & (square > 0.0);
    if (!any(changes)) continue;
    const T scale = changes ? 1.0 / root(square) : T{} + 1.0;
    for (int j = 0; j < p.units[i].length; ++j) part[j] *= scale;
  }
}

// The size of a correction: how far it moves the position, in rad and characteristic lengths. A correction of size d
// leaves an error of size d^2: below `exact` that is rounding, below `safe` Newton's method certainly converges.
template <class T>
BELLCRANK_INLINE T correction_size(const Problem& p, const T* correction) {
  T sum = {};
  for (int k = 0; k < p.nq; ++k) sum += absolute(p.weights ? p.weights[k] * correction[k] : correction[k]);
  return sum;
}

// Takes back what a projection did to the velocity of a state between the ends of steps, where that is more than the
// dense output's error explains: where constraints nearly lose rank, a small residual makes a large change of it. Fixed
// steps have no tolerance.
constexpr double most_projected = 1e4;  // tolerances
template <class T, class M>
void keep_velocity(const Problem& p, T atol, T rtol, M fixed, const T* from, T* x) {
  M far = {};
  for (int k = p.nq; k < p.nq + p.nv; ++k)
    far |= !(absolute(x[k] - from[k]) <= most_projected * (atol + rtol * absolute(from[k])));
  far &= !fixed;
  for (int k = p.nq; any(far) && k < p.nq + p.nv; ++k) x[k] = far ? from[k] : x[k];
}

// The piece of a signal at a time, perhaps `guess` or the next: -1 before the breaks, `pieces` after them.
inline int piece_of(const Signal& s, double t, int guess) {
  if (!(t >= s.breaks[0])) return -1;
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

// Values of a signal and its derivatives at a time d after the beginning of a piece with coefficients c; `held`: it is constant.
// Returns where the next signal's belong.
template <class T, class M>
T* values_of(const Signal& s, const T* c, T d, M held, T* u) {
  const int w = s.width;
  for (int j = 0; j < w; ++j) {
    T value = {}, slope = {}, curve = {};  // curve: half the second derivative
    for (int i = s.powers - 1; i >= 0; --i) {
      curve = curve * d + slope;
      slope = slope * d + value;
      value = value * d + c[i * w + j];
    }
    u[j] = value;
    if (s.derivatives > 0) u[w + j] = held ? T{} : slope;
    if (s.derivatives > 1) u[2 * w + j] = held ? T{} : 2.0 * curve;
  }
  return u + static_cast<std::ptrdiff_t>(w) * (s.derivatives + 1);
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
      if (problem.signals[g].kinked) piece_[g] = piece_of(problem.signals[g], 0.5 * (from + to), 0);
  }

  // u at time t, for kernels called elsewhere. Not inlined: most runs have no signals.
  __attribute__((noinline)) void signals(double t) {
    double* u = u_;
    for (int g = 0; g < problem.signal_count; ++g) {
      const Signal& s = problem.signals[g];
      if (!s.kinked) piece_[g] = piece_of(s, t, piece_[g]);
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
    if (problem.unit_count) make_unit(problem, x);
  }

  // Normalises and projects a state at the end of a step.
  BELLCRANK_INLINE void normalise_and_project(double t, double* x) {
    normalise(x);
    if (problem.project) project(t, x);
  }

  static constexpr double exact = 1e-7, safe = 1e-3;  // correction_size
  BELLCRANK_INLINE double size(const double* correction) const { return correction_size(problem, correction); }
  void keep_velocity(const double* from, double* x) const {
    bellcrank::BELLCRANK_ISA::keep_velocity(problem, problem.atol, problem.rtol, problem.step > 0, from, x);
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

  static double* polynomial(const Signal& s, int piece, double t, double* u) {
    const bool held = piece < 0 || piece >= s.pieces;
    if (held) {
      t = piece < 0 ? s.breaks[0] : s.breaks[s.pieces];
      piece = piece < 0 ? 0 : s.pieces - 1;
    }
    const double d = t - s.breaks[piece];
    const double* c = s.coefficients + static_cast<std::size_t>(piece) * s.powers * s.width;
    return values_of(s, c, d, held, u);
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
