// One lane's step taken out of its block, for the rules of event detection and of observed extremes that have many cases:
// the integrator of single runs applies them.
#pragma once

#include "event_detection.hpp"
#include "explicit_runge_kutta.hpp"
#include "lane_block.hpp"
#include "observed_extremes.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// Events of a lane's run, into its row.
inline void write_event(const Columns& c, const Ensemble& e, std::int64_t row, int event, double t, const double* x) {
  const std::int64_t at = row * e.common.event_count + event;
  if (c.event_count[at]++) return;
  c.event_time[at] = t;
  std::memcpy(c.event_state + at * e.common.n, x, e.common.n * sizeof(double));
}

class LaneRecord final : public Record {
 public:
  LaneRecord(const Ensemble& e, std::int64_t row, double* least_values, double* largest_values) : e_(e), row_(row) {
    least = least_values, largest = largest_values;
  }
  void more_steps() override {}
  void output(double, const double*) override {}
  void event(int index, double t, const double* x) override { write_event(e_.columns, e_, row_, index, t, x); }
  void unresolved(int index, double) override { ++e_.columns.unresolved[row_ * e_.common.event_count + index]; }
  void undefined(int index, double) override { ++e_.columns.undefined[row_ * e_.common.event_count + index]; }
  void end(double, const double*) override {}
  bool look(double, const double*, const Counts&, std::int64_t*) override { return false; }

 private:
  const Ensemble& e_;
  const std::int64_t row_;
};

template <class Method>
class LaneSingleStep {
 public:
  // The step in a lane of a block, whose slopes are all there.
  LaneSingleStep(const Ensemble& e, LaneBlock& block, int lane)
      : e_(e), block_(block), lane_(lane), values_(block.n * (Method::stages + 4) + e.designs.np + 2 * e.observed),
        problem_(problem()), rhs_(problem_), stepper_(rhs_),
        record_(e, static_cast<std::int64_t>(block.design[lane]), values_, values_ + e.observed),
        events_(rhs_, stepper_), observed_(rhs_, stepper_, record_) {
    rhs_.latest = block.latest[lane];
    rhs_.pin(block.t_old[lane], block.bound[lane]);
    double *old = read(block.old, block.n), *x = read(block.x, block.n);
    stepper_.take_over(block.t_old[lane], block.t[lane], old, x, read(block.k, block.n * (Method::stages + 1)));
  }

  // The events of the step; in the block, what is kept of them.
  Found events() {
    const int count = e_.common.event_count;
    if (!events_.begin(stepper_.t_old, stepper_.old_state())) return Found::failed;
    for (int e = 0; e < count; ++e)
      events_.remember(e, {whole(block_.sign[e]), whole(block_.hint[e]), whole(block_.unresolved[e])});
    const Found found = events_.search(stepper_, record_);
    for (int e = 0; e < count; ++e) {
      const auto memory = events_.memory(e);
      block_.sign[e][lane_] = memory.sign, block_.hint[e][lane_] = memory.hint;
      block_.unresolved[e][lane_] = memory.unresolved;
    }
    count_evaluations();
    return found;
  }
  double end_time() const { return events_.end_time(); }
  const double* end_state() const { return events_.end_state(); }
  int end_event() const { return events_.end_event(); }

  // The extremes up to time t and state x (one vector an entry) within the step, into the block.
  void observe(double t, const Vec* x) {
    for (int j = 0; j < e_.observed; ++j)
      record_.least[j] = block_.least[j][lane_], record_.largest[j] = block_.largest[j][lane_];
    for (int j = 0; j < e_.observed_within; ++j)
      observed_.history(j) = {block_.noise[j][lane_], block_.calm[j][lane_], block_.exhausted[j][lane_], false};
    observed_.resume();
    observed_.part(t, read(x, block_.n));
    for (int j = 0; j < e_.observed; ++j)
      block_.least[j][lane_] = record_.least[j], block_.largest[j][lane_] = record_.largest[j];
    for (int j = 0; j < e_.observed_within; ++j) {
      const auto& h = observed_.history(j);
      block_.noise[j][lane_] = h.noise, block_.calm[j][lane_] = h.calm, block_.exhausted[j][lane_] = h.exhausted;
    }
    count_evaluations();
  }

 private:
  using Stepper = ExplicitRungeKutta<Method, 0>;

  const Ensemble& e_;
  LaneBlock& block_;
  const int lane_;
  Buffer values_;
  std::size_t used_ = 2 * e_.observed;  // of values_: the extremes, then what is read from the lane
  const Problem problem_;
  Rhs rhs_;
  Stepper stepper_;
  LaneRecord record_;
  Events events_;
  ObservedExtremes observed_;
  std::int64_t counted_ = 0;

  int whole(const Vec& numbers) const { return static_cast<int>(numbers[lane_]); }

  double* read(const Vec* from, int count) {
    double* const to = values_ + used_;
    for (int i = 0; i < count; ++i) to[i] = from[i][lane_];
    used_ += count;
    return to;
  }

  Problem problem() {
    Problem p = e_.common;
    p.t0 = 0, p.t1 = block_.t1[lane_];
    p.rtol = block_.rtol[lane_], p.atol = block_.atol[lane_], p.step = block_.step[lane_];
    p.x0 = read(block_.old, 0);
    p.p = read(block_.p, e_.designs.np);
    return p;
  }

  void count_evaluations() {
    block_.evaluations[lane_] += static_cast<double>(rhs_.evaluations - counted_);
    counted_ = rhs_.evaluations;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
