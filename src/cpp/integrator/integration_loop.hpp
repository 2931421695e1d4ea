// The integration loop: intervals between stops, the steps in them, and the outputs and events of each step.
#pragma once

#include "event_detection.hpp"
#include "observed_extremes.hpp"
#include "outputs.hpp"
#include "step_size_control.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <class Stepper>
class IntegrationLoop {
 public:
  IntegrationLoop(const Problem& problem, Record& record, Counts& counts)
      : p_(problem), record_(record), counts_(counts), rhs_(problem), stepper_(rhs_), events_(rhs_, stepper_),
        observed_(rhs_, stepper_, record), outputs_(rhs_, record), between_(problem.n + 16) {}

  Status operator()() {
    const Status status = intervals();
    outputs_.flush();
    if (status != Status::event) record_.end(stepper_.t, stepper_.state());
    count();
    return status;
  }

 private:
  const Problem& p_;
  Record& record_;
  Counts& counts_;
  Rhs rhs_;
  Stepper stepper_;
  Events events_;
  ObservedExtremes observed_;
  Outputs outputs_;
  Buffer between_;  // an interpolated state, padded
  std::size_t next_output_ = 0;
  std::int64_t until_look_ = 1;
  double grid_index_ = 0, grid_end_ = p_.t0;

  Status intervals() {
    const bool fixed = p_.step > 0;
    output_start();
    for (int i = 0; i <= p_.stop_count && stepper_.t < p_.t1; ++i) {
      const double bound = i < p_.stop_count ? p_.stops[i] : p_.t1;
      rhs_.pin(stepper_.t, bound);
      rhs_.latest = i < p_.stop_count ? std::nextafter(bound, p_.t0) : p_.latest;
      if (!stepper_.begin()) return Status::non_finite;
      observed_.begin();
      if (i == 0) {
        if (!events_.begin(stepper_.t, stepper_.state())) return Status::non_finite;
        if (!fixed) stepper_.choose_step(bound);
      }
      while (stepper_.t < bound) {
        const std::int64_t rejected = stepper_.rejected;
        const bool implicit = is_implicit();
        const Outcome outcome = fixed ? stepper_.fixed(grid(bound)) : stepper_.advance(bound);
        if (is_implicit() != implicit) record_.switched(stepper_.t_old, !implicit);
        if (outcome != Outcome::accepted) return status_of(outcome);
        ++counts_.accepted;
        if (p_.event_count) {
          const Found found = events_.search(stepper_, record_);
          if (found == Found::failed) return Status::non_finite;
          if (found == Found::terminal) return end_at_event();
        }
        observed_.step(stepper_);
        step(stepper_.t);
        output_step(stepper_.t);
        until_look_ -= 1 + stepper_.rejected - rejected + events_.effort / 8;
        if (until_look_ <= 0 && look()) return Status::interrupted;
      }
    }
    return Status::finished;
  }

  bool is_implicit() const {
    if constexpr (Stepper::switches) return stepper_.implicit();
    return false;
  }

  void count() {
    stepper_.add_counts(counts_);
    counts_.evaluations = rhs_.evaluations;
  }

  bool look() {
    count();
    return record_.look(stepper_.t, stepper_.state(), counts_, &until_look_);
  }

  // End of the next step of fixed size: a point of the grid, or the bound where that comes first or lies on it.
  double grid(double bound) {
    if (grid_end_ <= stepper_.t + 1e-6 * p_.step) grid_end_ = p_.t0 + ++grid_index_ * p_.step;
    return grid_end_ > bound - 1e-6 * p_.step ? bound : grid_end_;
  }

  // Written inline: a virtual call would cost as much as a stage of a small system.
  void step(double t) {
    if (record_.next_step == record_.steps_end) record_.more_steps();
    *record_.next_step++ = t;
  }

  Status end_at_event() {
    const double end = events_.end_time();
    observed_.part(end, events_.end_state());
    step(end);
    if (!p_.every_step) output_step(end);
    record_.end(end, events_.end_state());
    return Status::event;
  }

  void output_start() {
    if (p_.every_step) return outputs_.take(stepper_.t, stepper_.state());
    while (next_output_ < p_.time_count && p_.times[next_output_] <= stepper_.t)
      outputs_.take(p_.times[next_output_++], stepper_.state());
  }

  // Outputs at the requested times up to `end`; at the ends of the step (to rounding) the state there.
  void output_step(double end) {
    if (p_.every_step) return outputs_.take(end, stepper_.state());
    if (next_output_ == p_.time_count || p_.times[next_output_] > end) return;
    const double ulp = 4 * spacing(stepper_.t);
    while (next_output_ < p_.time_count && p_.times[next_output_] <= end) {
      const double time = p_.times[next_output_++];
      if (stepper_.t - time <= ulp) {
        outputs_.take(time, stepper_.state());
      } else if (time - stepper_.t_old <= ulp) {
        outputs_.take(time, stepper_.old_state());
      } else {
        state_at((time - stepper_.t_old) / (stepper_.t - stepper_.t_old));
        outputs_.take_between(time, between_);
      }
    }
  }

  void state_at(double s) {
    if (stepper_.prepare()) stepper_.interpolate(s, between_);
    else stepper_.sketch(s, between_);
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
