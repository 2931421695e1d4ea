// The equations for all lanes of a block at once: signals, right-hand side, event functions, observed quantities, unit
// vectors and projection. The formulas are those of right_hand_side.hpp; where the constraints of one lane lose rank, the
// fallback is evaluated for all and used in that lane alone.
#pragma once

#include "lane_block.hpp"
#include "right_hand_side.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

class LaneEquations {
 public:
  explicit LaneEquations(const Ensemble& e)
      : ensemble(e), problem(e.common), u_(problem.signal_entries), correction_(problem.nq + problem.nv),
        other_(problem.n) {}

  const Ensemble& ensemble;
  const Problem& problem;

  // x' (n) at (time, x) with a block's signals and parameters.
  BELLCRANK_INLINE void rhs(LaneBlock& block, Vec time, const Vec* x, Vec* rate) {
    call(ensemble.lanes.rhs, ensemble.lanes.fallback, problem.n, block, time, x, rate);
  }
  // The event functions (E).
  void events(LaneBlock& block, Vec time, const Vec* x, Vec* g) {
    call(ensemble.lanes.events, nullptr, problem.event_count, block, time, x, g);
  }
  // The observed quantities (m).
  void observe(LaneBlock& block, Vec time, const Vec* x, Vec* y) {
    call(ensemble.lanes.observe, nullptr, ensemble.observed, block, time, x, y);
  }

  // Normalises unit vectors, unless their length is 1 to the last digit.
  BELLCRANK_INLINE void normalise(Vec* x) const {
    if (problem.unit_count) make_unit(problem, x);
  }

  // Normalises states at the ends of steps, and projects those in the lanes of `wanted`.
  BELLCRANK_INLINE void normalise_and_project(LaneBlock& block, Vec time, Vec* x, Mask wanted) {
    normalise(x);
    if (problem.project) project(block, time, x, wanted);
  }

  // Chooses the pieces of kinked signals in a lane for the steps between two stops.
  void pin(LaneBlock& block, int lane, double from, double to) {
    LanePiece* piece = block.pieces();
    for (int g = 0; g < problem.signal_count; piece = after(piece, g++)) {
      const Signal& s = problem.signals[g];
      load(s, piece, lane, piece_of(s, s.kinked ? 0.5 * (from + to) : from, 0));
      if (s.kinked) piece->low[lane] = -INFINITY, piece->high[lane] = INFINITY;
    }
  }

 private:
  static constexpr int most_corrections = 8;

  Vectors u_, correction_, other_;

  // `size` entries of a function; of its fallback in lanes where its guard is not positive.
  BELLCRANK_INLINE void call(Kernel kernel, Kernel fallback, int size, LaneBlock& block, Vec time, const Vec* x,
                             Vec* result) {
    const Vec t = smaller(time, block.latest);
    if (problem.signal_count) signals(block, t);
    Vec guard = {};
    const double* const in[] = {first(&t), first(x), first(u_), first(block.p)};
    double* const out[] = {first(result), first(&guard)};
    std::int32_t status = kernel(in, out);
    const Mask lost = ~(guard > 0.0);
    if (fallback && bits(lost)) {
      double* const other[] = {first(other_)};
      status |= fallback(in, other);
      for (int i = 0; i < size; ++i) result[i] = lost ? other_[i] : result[i];
    }
    if (status != 0)
      for (int i = 0; i < size; ++i) result[i] = splat(NAN);
  }
  static const double* first(const Vec* v) { return reinterpret_cast<const double*>(v); }
  static double* first(Vec* v) { return reinterpret_cast<double*>(v); }

  // Newton's method on the constraints and their velocities, while it converges.
  __attribute__((noinline)) void project(LaneBlock& block, Vec time, Vec* x, Mask wanted) {
    const int entries = problem.nq + problem.nv;
    Vec before = splat(INFINITY);
    for (int i = 0; i < most_corrections && bits(wanted); ++i) {
      call(ensemble.lanes.project, ensemble.lanes.project_fallback, entries, block, time, x, correction_);
      const Vec now = correction_size<Vec>(problem, correction_);
      wanted &= now < 0.5 * before;
      for (int j = 0; j < entries; ++j) x[j] = wanted ? x[j] + correction_[j] : x[j];
      normalise(x);
      wanted &= now > Rhs::exact;
      before = now;
    }
  }

  // ---- signals

  LanePiece* after(LanePiece* piece, int g) const {
    return reinterpret_cast<LanePiece*>(&piece->number + LanePiece::size(problem.signals[g]));
  }

  // u at a time.
  __attribute__((noinline)) void signals(LaneBlock& block, Vec t) {
    LanePiece* piece = block.pieces();
    Vec* u = u_;
    for (int g = 0; g < problem.signal_count; piece = after(piece, g++)) {
      const Signal& s = problem.signals[g];
      each(bits(~((piece->low <= t) & (t < piece->high))), [&](int l) {
        load(s, piece, l, piece_of(s, t[l], static_cast<int>(piece->number[l])));
      });
      const Mask held = piece->held == piece->held;
      const Vec d = held ? piece->held : t - piece->origin;
      u = values_of(s, piece->coefficients(), d, held, u);
    }
  }

  static void load(const Signal& s, LanePiece* to, int lane, int piece) {
    const bool before = piece < 0, beyond = piece >= s.pieces;
    const int number = before ? 0 : beyond ? s.pieces - 1 : piece;
    const double begin = s.breaks[number], end = s.breaks[number + 1];
    to->number[lane] = piece;
    to->low[lane] = before ? -INFINITY : beyond ? std::nextafter(end, INFINITY) : begin;
    to->high[lane] = before ? begin : beyond ? INFINITY : end;
    to->origin[lane] = begin;
    to->held[lane] = before ? 0 : beyond ? end - begin : NAN;
    const double* c = s.coefficients + static_cast<std::size_t>(number) * s.powers * s.width;
    for (int i = 0; i < s.powers * s.width; ++i) to->coefficients()[i][lane] = c[i];
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
