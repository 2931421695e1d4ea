// The integration loop: intervals between stops, the steps in them, and the outputs and events of each step.
#pragma once

#include "event_detection.hpp"
#include "held_entries.hpp"
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
        held_(rhs_, stepper_, record), observed_(rhs_, stepper_, record), outputs_(rhs_, record), between_(problem.n + 16) {}

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
  Held held_;
  ObservedExtremes observed_;
  Outputs outputs_;
  Buffer between_;  // an interpolated state, padded
  std::size_t next_output_ = 0;
  std::int64_t until_look_ = 1;
  double grid_index_ = 0, grid_end_ = p_.t0;
  bool begun_ = false;

  Status intervals() {
    const bool fixed = p_.step > 0;
    output_start();
    for (int i = 0; i <= p_.stop_count && stepper_.t < p_.t1;) {
      const double stop = i < p_.stop_count ? p_.stops[i] : p_.t1;
      rhs_.pin(stepper_.t, stop);
      rhs_.latest = INFINITY;
      if (held_.exist() && !held_.begin(stepper_.t, stepper_.state())) return held_failure();
      const double bound = held_.exist() ? held_.bound(stepper_.t, stop) : stop;
      rhs_.latest = bound < p_.t1 ? std::nextafter(bound, p_.t0) : p_.latest;
      if (!begin_step()) return Status::non_finite;
      observed_.begin();
      if (held_.exist() && held_.ends() && begun_) return Status::contact;
      if (!begun_) {
        if (!events_.begin(stepper_.t, stepper_.state())) return Status::non_finite;
        if (!fixed) stepper_.choose_step(bound);
        begun_ = true;
      }
      while (stepper_.t < bound) {
        const std::int64_t rejected = stepper_.rejected;
        const bool implicit = is_implicit();
        const Outcome outcome = fixed ? stepper_.fixed(within(grid(bound))) : stepper_.advance(within(bound));
        if (is_implicit() != implicit) record_.switched(stepper_.t_old, !implicit);
        if (outcome != Outcome::accepted) return status_of(outcome);
        const bool turns = held_.exist() && !held_.stays(stepper_);
        if (held_.failed()) return Status::non_finite;
        if (turns) {
          const Outcome again = retake();
          if (again != Outcome::accepted) return status_of(again);
          if (stepper_.t == stepper_.t_old) {  // it begins on the other side
            if (!turn()) return held_failure();
            if (held_.ends()) return Status::contact;
            continue;
          }
        }
        ++counts_.accepted;
        if (p_.event_count) {
          const Found found = events_.search(stepper_, record_, turns);
          if (found == Found::failed) return Status::non_finite;
          if (found == Found::terminal) return end_at_event();
        }
        observed_.step(stepper_);
        step(stepper_.t);
        output_step(stepper_.t);
        until_look_ -= 1 + stepper_.rejected - rejected + events_.effort / 8;
        if (until_look_ <= 0 && look()) return Status::interrupted;
        if (turns && !turn()) return held_failure();
        if (turns && held_.ends()) return Status::contact;
      }
      if (stepper_.t >= stop) ++i;
    }
    return Status::finished;
  }

  double within(double bound) const { return held_.exist() ? held_.step_bound(stepper_.t, bound) : bound; }

  // The last step again, up to the time at which a switch turns; where it begins there, the state before it.
  Outcome retake() {
    const double h = stepper_.next_step(), end = held_.turn_time();
    if (!stepper_.resume(stepper_.t_old, held_.old_state(), h)) return Outcome::non_finite;
    return end > stepper_.t ? stepper_.fixed(end) : Outcome::accepted;
  }

  // Goes on beyond a switch.
  bool turn() {
    if (!held_.turn(stepper_.t, stepper_.state()) || !begin_step()) return false;
    observed_.begin();
    return true;
  }

  // From the state that held entries leave.
  bool begin_step() {
    const double* rested = held_.exist() ? held_.rested() : nullptr;
    return rested ? stepper_.resume(stepper_.t, rested, stepper_.next_step()) : stepper_.begin();
  }

  Status held_failure() const {
    return held_.failed() ? Status::interrupted : held_.chatters() ? Status::chattering : Status::non_finite;
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
    else stepper_.approximate(s, between_);
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
