// Entries of u that are constant between the instants of a run (problem.hpp): updates at given times, switches, whose
// sides turn where their functions change sign, and modes of joints with dry friction, which are found anew where a stuck
// joint's force reaches its limit or a sliding joint comes to rest. Within a step the equations are those of one side and
// so are smooth; a step in which a function changes its sign is taken again up to that time, and the run goes on from there
// on the other side.
#pragma once

#include <utility>

#include "event_detection.hpp"
#include "friction_modes.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

class Held {
 public:
  Held(Rhs& rhs, LastStep& last, Record& record)
      : rhs_(rhs), p_(rhs.problem), h_(p_.held), record_(record), view_(functions(p_)), changes_(rhs, last, view_),
        count_(h_.switch_count + h_.mode_count), terminal_(count_), direction_(count_), turned_(count_), quick_(count_),
        before_(count_), old_(p_.n + 16), turn_time_(count_), done_(h_.update_count), modes_(h_.mode_count),
        found_(h_.mode_count * (h_.mode_count + 4)), fastest_(h_.mode_count), resting_(h_.mode_count), state_(p_.n + 16) {
    for (int e = 0; e < count_; ++e) terminal_[e] = true, turn_time_[e] = -INFINITY;
    view_.terminal = terminal_, view_.direction = direction_;
  }

  bool exist() const { return h_.count > 0; }
  bool failed() const { return failed_; }  // an update did

  // The end of the steps from t on: `stop`, or the next update where that is earlier.
  double bound(double t, double stop) const {
    double next = stop;
    for (int k = 0; k < h_.update_count; ++k) next = smaller(next, due(k));
    return stop - next <= rounding(t) ? stop : next;
  }

  // At the start of the steps from t on: what updates are due, and the sides that follow. False: not finite.
  bool begin(double t, const double* x) {
    bool changed = !begun_;
    if (!begun_ && !first_modes(t, x)) return false;
    begun_ = true;
    for (int k = 0; k < h_.update_count; ++k)
      while (due(k) <= t + rounding(t)) {
        if (!update(k, t, x)) return false;
        changed = true, ++done_[k];
      }
    at_instant(t);
    return settle(t, x, changed);
  }

  // Whether the step just taken stays on all sides. If not, it has to be taken again up to `turn_time`, and then `turn`.
  template <class Stepper>
  bool stays(Stepper& stepper) {
    if (!count_) return true;
    for (int j = 0; j < h_.mode_count; ++j)
      fastest_[j] = larger(fastest_[j], std::fabs(stepper.state()[h_.mode_rows[j]]));
    for (int e = 0; e < count_; ++e) before_[e] = changes_.memory(e);
    Silent silent;
    const Found found = changes_.search(stepper, silent);
    if (found == Found::failed) return failed_ = true;
    turn_ = found == Found::terminal ? changes_.end_event() : -1;
    end_ = found == Found::terminal ? changes_.end_time() : stepper.t_old;
    for (int e = 0; e < count_ && turn_ < 0; ++e)  // one that left zero for the other side
      if (changes_.memory(e).sign * side(e) < 0) turn_ = e;
    if (turn_ < 0) return true;
    if (end_ - stepper.t_old <= 2 * spacing(stepper.t_old)) end_ = stepper.t_old;
    std::memcpy(old_, stepper.old_state(), p_.n * sizeof(double));
    for (int e = 0; e < count_; ++e) changes_.remember(e, before_[e]);
    return false;
  }
  double turn_time() const { return end_; }
  const double* old_state() const { return old_; }

  // Goes over to the other side of the switch that `stays` found, at time t and state x. False: not finite, or it goes to
  // and fro without end.
  bool turn(double t, const double* x) {
    at_instant(t);
    return over(turn_, t, x) && settle(t, x, true) && !chatters();
  }
  // The state from which the run goes on after `begin` and `turn`, where it is not the one before: joints are at rest.
  const double* rested() { return std::exchange(rested_, false) ? static_cast<const double*>(state_) : nullptr; }
  bool chatters() const { return turn_ >= 0 && quick_[turn_] >= most_quick; }

 private:
  static constexpr double same_instant = 1e-9;  // of its largest speed: a joint that comes to rest with another one
  static constexpr int most_quick = 20;  // turns of a switch one after another, each as soon as rounding allows

  // What `changes_` finds is asked for directly.
  struct Silent final : Record {
    void more_steps() override {}
    void output(double, const double*) override {}
    void event(int, double, const double*) override {}
    void unresolved(int, double) override {}
    void undefined(int, double) override {}
    void end(double, const double*) override {}
    bool look(double, const double*, const Counts&, std::int64_t*) override { return false; }
  };

  Rhs& rhs_;
  const Problem& p_;
  const HeldEntries& h_;
  Record& record_;
  Problem view_;  // whose event functions are those of the switches
  Events changes_;
  const int count_;  // switches and modes
  Array<bool> terminal_;
  Array<int> direction_, turned_, quick_;
  Array<Events::Memory> before_;
  Buffer old_, turn_time_;
  Array<std::int64_t> done_;  // updates so far
  int turn_ = -1;
  double end_ = 0, instant_ = -INFINITY;
  bool begun_ = false, failed_ = false, rested_ = false;
  FrictionModes modes_;
  Buffer found_, fastest_;  // what the kernel found; the largest speed of each joint since it was at rest
  Array<int> resting_;
  Buffer state_;

  static Problem functions(const Problem& p) {
    Problem view = p;
    view.events = p.held.switches, view.event_count = p.held.switch_count + p.held.mode_count, view.event_samples = 8;
    return view;
  }
  static double rounding(double t) { return 1e-12 * larger(1, std::fabs(t)); }
  double due(int k) const { return h_.updates[k].first + static_cast<double>(done_[k]) * h_.updates[k].period; }
  double side(int e) { return e < h_.switch_count ? rhs_.held()[e] : 1.0; }
  struct Mode {  // of a joint: the direction of its force, reversed; whether it moves; whether its force follows from rest
    double direction, moves, holds;
  };
  Mode& mode(int j) { return reinterpret_cast<Mode*>(rhs_.held() + h_.switch_count)[j]; }

  bool update(int k, double t, const double* x) {
    const int skipped = h_.switch_count + 3 * h_.mode_count;
    double* values = rhs_.held() + skipped;
    const int count = h_.count - skipped;
    if (!h_.updates[k].kernel) return record_.update(k, t, x, values) || !(failed_ = true);
    if (p_.signal_count) rhs_.signals(t);
    Buffer found(count);
    const double* const in[] = {&t, x, rhs_.u(), p_.p};
    double* const out[] = {found};
    if (h_.updates[k].kernel(in, out) != 0) return false;
    double sum = 0;
    for (int i = 0; i < count; ++i) sum += found[i] * 0.0;
    if (sum != 0) return false;
    std::memcpy(values, found, count * sizeof(double));
    return true;
  }

  // Switches that turn together, such as those of x and -x, turn once at an instant, whatever the rounding of their
  // functions there.
  void at_instant(double t) {
    if (t - instant_ <= rounding(t)) return;
    instant_ = t;
    for (int e = 0; e < count_; ++e) turned_[e] = 0;
  }

  // Turns the switches whose functions are on the other side; those that turned at this instant stay as they are.
  bool settle(double t, const double* x, bool changed) {
    for (bool again = count_ > 0; again;) {
      again = false;
      if (rested_) x = state_;
      if (!changes_.begin(t, x)) return false;
      for (int e = 0; e < count_ && !again; ++e)
        if (changes_.value(e) * side(e) < 0 && !turned_[e]) {
          if (!over(e, t, x)) return false;
          again = changed = true;
        }
    }
    for (int e = 0; e < count_; ++e) {
      const int now = changes_.value(e) == 0 ? 0 : side(e) > 0 ? 1 : -1;
      changes_.remember(e, {now, changes_.memory(e).hint, changes_.memory(e).unresolved});
    }
    if (changed) record_.hold(t, rhs_.held());
    return true;
  }

  bool over(int e, double t, const double* x) {
    quick_[e] = t - turn_time_[e] <= rounding(t) ? quick_[e] + 1 : 0;
    turn_time_[e] = t;
    turned_[e] = 1;
    if (e >= h_.switch_count) return find_modes(e - h_.switch_count, t, x);
    rhs_.held()[e] = -rhs_.held()[e];
    return true;
  }

  // At the start of a run: joints that move slide, the others stick or begin to slide.
  bool first_modes(double t, const double* x) {
    bool rest = false;
    for (int j = 0; j < h_.mode_count; ++j) {
      const int direction = sign(x[h_.mode_rows[j]]);
      mode(j) = {1.0 * direction, direction ? 1.0 : 0.0, direction ? 0.0 : 1.0};
      rest |= !direction;
    }
    return !rest || find_modes(-1, t, x);
  }

  // The modes of the joints that are at rest: those that are stuck, `cause`, and those that come to rest with it.
  bool find_modes(int cause, double t, const double* x) {
    const int n = h_.mode_count;
    if (p_.signal_count) rhs_.signals(t);
    const double* const in[] = {&t, x, rhs_.u(), p_.p};
    double* const out[] = {found_};
    if (h_.turn(in, out) != 0) return false;
    const double *velocity = found_, *free = velocity + n, *response = free + n, *limit = response + n * n,
                 *sliding = limit + n;
    int count = 0;
    for (int j = 0; j < n; ++j)
      if (!mode(j).moves || j == cause || std::fabs(velocity[j]) <= same_instant * fastest_[j]) resting_[count++] = j;
    double sum = 0;
    for (int k = 0; k < count; ++k) {
      const int j = resting_[k];
      double value = free[j];
      for (int l = 0; l < count; ++l) {
        modes_.matrix[k * count + l] = response[j * n + resting_[l]];
        value -= response[j * n + resting_[l]] * sliding[resting_[l]];
      }
      modes_.right[k] = value, modes_.limit[k] = limit[j];
      sum += value * 0.0;
    }
    if (sum != 0) return false;
    modes_.solve(count);
    std::memcpy(state_, x, p_.n * sizeof(double));
    const bool gives_way = cause >= 0 && !mode(cause).moves;  // its force has reached its limit
    for (int k = 0; k < count; ++k) {
      const int j = resting_[k];
      const double direction = modes_.force[k] > 0 ? -1 : 1;
      if (!modes_.at_limit(k)) mode(j) = {0, 0, modes_.holds(k) ? 1.0 : 0.0};
      else if (!modes_.can_move(k, count)) mode(j) = {direction, 0, 0};
      else if (gives_way || modes_.moves(k, count)) mode(j) = {direction, 1, 0};
      else mode(j) = {0, 0, 1};
      state_[h_.mode_rows[j]] = 0, fastest_[j] = 0;
      turned_[h_.switch_count + j] = 1;
    }
    rested_ = true;
    return true;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
