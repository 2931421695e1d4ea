// A block: one step of one run in each lane, with all that its equations take, as structure of arrays. Blocks hold the
// runs that are stepped, those that are about to start, and steps that are kept to look for events in later; a lane of
// one block can be copied to a lane of another.
#pragma once

#include "ensemble.hpp"
#include "lane_vector.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// Of the run in each lane. Counts and numbers are whole, and exact as doubles.
struct LaneNumbers {
  Vec design;                // the row of the run
  Vec t_old, t, latest;      // the step; stages are evaluated up to `latest`, just before a jump
  Vec t1, bound;             // the end of the run; the next stop, or the end
  Vec rtol, atol, step, first_step, max_step, max_evaluations;
  Vec next;                  // the step size to try; with a fixed step the number of the next point of its grid
  Vec tried, bad;            // 1: the step was tried with another size; and that was not finite
  Vec evaluations, accepted, rejected;
  Vec untested, suspicions, unsuspicious;  // of stiffness_detection.hpp
  Vec eventful;              // 1: the step may have an event
};

// A signal's piece in each lane.
struct LanePiece {
  Vec number;        // -1 before the breaks
  Vec low, high;     // it holds for low <= t < high
  Vec origin, held;  // its beginning; NaN, or the signal is constant: its value at `held` after the beginning
  Vec* coefficients() { return &held + 1; }  // (powers, width)
  static int size(const Signal& s) { return 5 + s.powers * s.width; }
};

class LaneBlock : public LaneNumbers {
 public:
  LaneBlock(const Ensemble& e, int rows) : LaneNumbers{}, n(e.common.n), data_(total(e, rows)) {
    Vec* next = data_;
    p = take(next, e.designs.np);
    old = take(next, n);
    g = take(next, e.common.event_count), sign = take(next, e.common.event_count);
    hint = take(next, e.common.event_count), unresolved = take(next, e.common.event_count);
    y = take(next, e.observed), least = take(next, e.observed), largest = take(next, e.observed);
    noise = take(next, e.observed_within), calm = take(next, e.observed_within);
    exhausted = take(next, e.observed_within);
    pieces_ = next;
    for (int s = 0; s < e.common.signal_count; ++s) next += LanePiece::size(e.common.signals[s]);
    k = take(next, static_cast<std::size_t>(n) * rows);
    begun_ = static_cast<int>(k + n - data_);
    x = take(next, n);
    size_ = static_cast<int>(next - data_);
  }

  const int n;
  Vec *p, *old;          // parameters; state at t_old
  Vec *g, *sign, *hint, *unresolved;  // event functions at t_old, and what event_detection.hpp keeps of them
  Vec *y, *least, *largest;           // observed quantities at t_old, and their extremes
  Vec *noise, *calm, *exhausted;      // what observed_extremes.hpp keeps of those that are looked at within steps
  Vec* k;                // (rows, n): slopes of the stages; row 0 at t_old, row Method::stages at t
  Vec* x;                // state at t

  // The pieces of all signals, one after the other.
  LanePiece* pieces() { return reinterpret_cast<LanePiece*>(pieces_); }

  // Copies a lane of another block of the same ensemble: all of it, or only what a step begins with.
  void copy(int to, const LaneBlock& from, int lane) { copy(to, from, lane, size_); }
  void copy_start(int to, const LaneBlock& from, int lane) { copy(to, from, lane, begun_); }
  // The same, and the end of the step: its state, and its slope, which is in row `last`.
  void copy_ends(int to, const LaneBlock& from, int lane, int last) {
    copy_start(to, from, lane);
    copy_column(k + last * n, from.k + last * n, to, lane, n);
    copy_column(x, from.x, to, lane, n);
  }
  // What all steps of another block begin with.
  void copy_starts(const LaneBlock& from) {
    static_cast<LaneNumbers&>(*this) = from;
    for (int i = 0; i < begun_; ++i) data_[i] = from.data_[i];
  }

 private:
  Vectors data_;
  Vec* pieces_;
  int begun_, size_;

  static Vec* take(Vec*& next, std::size_t count) {
    Vec* const first = next;
    next += count;
    return first;
  }
  static std::size_t total(const Ensemble& e, int rows) {
    std::size_t sum = e.designs.np + 4 * e.common.event_count + 3 * (e.observed + e.observed_within);
    for (int s = 0; s < e.common.signal_count; ++s) sum += LanePiece::size(e.common.signals[s]);
    return sum + static_cast<std::size_t>(e.common.n) * (2 + rows);
  }
  void copy(int to, const LaneBlock& from, int lane, int count) {
    copy_column(&design, &from.design, to, lane, sizeof(LaneNumbers) / sizeof(Vec));
    copy_column(data_, from.data_, to, lane, count);
  }
  static void copy_column(Vec* to_vectors, const Vec* from_vectors, int to, int from, std::size_t count) {
    double* const a = reinterpret_cast<double*>(to_vectors) + to;
    const double* const b = reinterpret_cast<const double*>(from_vectors) + from;
    for (std::size_t i = 0; i < count; ++i) a[i * width] = b[i * width];
  }
};

// A run of a block's lane ends at time t and state x (n, one vector an entry).
inline void write_end(const Ensemble& e, Worker& worker, const LaneBlock& block, int lane, Status status, double t,
                      const Vec* x) {
  const Columns& c = e.columns;
  const std::int64_t row = static_cast<std::int64_t>(block.design[lane]);
  c.status[row] = static_cast<std::int64_t>(status);
  c.end_time[row] = t;
  for (int i = 0; i < block.n; ++i) c.end_state[row * block.n + i] = x[i][lane];
  c.accepted[row] = static_cast<std::int64_t>(block.accepted[lane]);
  c.rejected[row] = static_cast<std::int64_t>(block.rejected[lane]);
  c.evaluations[row] = static_cast<std::int64_t>(block.evaluations[lane]);
  for (int i = 0; i < e.observed; ++i) {
    c.least[row * e.observed + i] = block.least[i][lane];
    c.largest[row * e.observed + i] = block.largest[i][lane];
  }
  c.done[row] = true;
  worker.report(1);
}

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
