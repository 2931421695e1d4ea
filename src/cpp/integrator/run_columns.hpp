// The columns of an ensemble's result, and the record that fills one row of them from a run of the scalar engine.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "problem.hpp"

namespace bellcrank {

// Where each column begins; one row a run (simulation/ensemble_problem.py, EnsembleResult). E event functions, n states,
// m observed quantities.
struct RunColumns {
  int n, event_count, observed;
  double *end_time, *end_state;                            // (N), (N, n)
  std::int64_t *events, *stopped_by, *unresolved, *undefined;  // (N, E), (N), (N, E), (N, E)
  double *event_time, *event_state;                        // (N, E), (N, E, n)
  double *least, *largest;                                 // (N, m)
};

// What the scalar engine finds in one run.
class RunRecord final : public Record {
 public:
  RunRecord(const RunColumns& columns, std::size_t row, const bool* terminal, const std::atomic<bool>& interrupted)
      : columns_(columns), row_(row), terminal_(terminal), interrupted_(interrupted) {
    const std::size_t first = row * columns.event_count;
    for (int e = 0; e < columns.event_count; ++e) {
      columns.events[first + e] = columns.unresolved[first + e] = columns.undefined[first + e] = 0;
      columns.event_time[first + e] = NAN;
      std::fill_n(columns.event_state + (first + e) * columns.n, columns.n, NAN);
    }
    columns.stopped_by[row] = -1;
    least = columns.least + row * columns.observed;
    largest = columns.largest + row * columns.observed;
    more_steps();
  }

  void more_steps() override { next_step = steps_, steps_end = steps_ + room; }
  void output(double, const double*) override {}
  void event(int index, double t, const double* x) override {
    const std::size_t at = row_ * columns_.event_count + index;
    if (columns_.events[at]++ == 0) {
      columns_.event_time[at] = t;
      std::copy_n(x, columns_.n, columns_.event_state + at * columns_.n);
    }
    if (terminal_[index] && columns_.stopped_by[row_] < 0) columns_.stopped_by[row_] = index;
  }
  void unresolved(int index, double) override { ++columns_.unresolved[row_ * columns_.event_count + index]; }
  void undefined(int index, double) override { ++columns_.undefined[row_ * columns_.event_count + index]; }
  void end(double t, const double* x) override {
    columns_.end_time[row_] = t;
    std::copy_n(x, columns_.n, columns_.end_state + row_ * columns_.n);
  }
  bool look(double, const double*, const Counts&, std::int64_t* attempts) override {
    *attempts = between_looks;
    return interrupted_.load(std::memory_order_relaxed);
  }

 private:
  static constexpr int room = 256;                     // ends of steps, which nobody wants
  static constexpr std::int64_t between_looks = 1000;  // steps: a few ms of the largest systems

  const RunColumns columns_;
  const std::size_t row_;
  const bool* terminal_;
  const std::atomic<bool>& interrupted_;
  double steps_[room];
};

}  // namespace bellcrank
