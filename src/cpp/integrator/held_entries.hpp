// Entries of u that are constant between the instants of a run (problem.hpp): updates at given times, and switches, whose
// sides turn where their functions change sign. Within a step the equations are those of one side and so are smooth; a step
// in which a function changes its sign is taken again up to that time, and the run goes on from there on the other side.
#pragma once

#include "event_detection.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

class Held {
 public:
  Held(Rhs& rhs, LastStep& last, Record& record)
      : rhs_(rhs), p_(rhs.problem), h_(p_.held), record_(record), view_(functions(p_)), changes_(rhs, last, view_),
        terminal_(h_.switch_count), direction_(h_.switch_count), turned_(h_.switch_count), quick_(h_.switch_count),
        before_(h_.switch_count), old_(p_.n + 16), turn_time_(h_.switch_count), done_(h_.update_count) {
    for (int e = 0; e < h_.switch_count; ++e) terminal_[e] = true, turn_time_[e] = -INFINITY;
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
    if (!h_.switch_count) return true;
    for (int e = 0; e < h_.switch_count; ++e) before_[e] = changes_.memory(e);
    Silent silent;
    const Found found = changes_.search(stepper, silent);
    if (found == Found::failed) return failed_ = true;
    turn_ = found == Found::terminal ? changes_.end_event() : -1;
    end_ = found == Found::terminal ? changes_.end_time() : stepper.t_old;
    for (int e = 0; e < h_.switch_count && turn_ < 0; ++e)  // one that left zero for the other side
      if (changes_.memory(e).sign * side(e) < 0) turn_ = e;
    if (turn_ < 0) return true;
    if (end_ - stepper.t_old <= 2 * spacing(stepper.t_old)) end_ = stepper.t_old;
    std::memcpy(old_, stepper.old_state(), p_.n * sizeof(double));
    for (int e = 0; e < h_.switch_count; ++e) changes_.remember(e, before_[e]);
    return false;
  }
  double turn_time() const { return end_; }
  const double* old_state() const { return old_; }

  // Goes over to the other side of the switch that `stays` found, at time t and state x. False: not finite, or it goes to
  // and fro without end.
  bool turn(double t, const double* x) {
    at_instant(t);
    over(turn_, t);
    return settle(t, x, true) && !chatters();
  }
  bool chatters() const { return turn_ >= 0 && quick_[turn_] >= most_quick; }

 private:
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
  Array<bool> terminal_;
  Array<int> direction_, turned_, quick_;
  Array<Events::Memory> before_;
  Buffer old_, turn_time_;
  Array<std::int64_t> done_;  // updates so far
  int turn_ = -1;
  double end_ = 0, instant_ = -INFINITY;
  bool begun_ = false, failed_ = false;

  static Problem functions(const Problem& p) {
    Problem view = p;
    view.events = p.held.switches, view.event_count = p.held.switch_count, view.event_samples = 8;
    return view;
  }
  static double rounding(double t) { return 1e-12 * larger(1, std::fabs(t)); }
  double due(int k) const { return h_.updates[k].first + static_cast<double>(done_[k]) * h_.updates[k].period; }
  double& side(int e) { return rhs_.held()[e]; }

  bool update(int k, double t, const double* x) {
    double* values = rhs_.held() + h_.switch_count;
    const int count = h_.count - h_.switch_count;
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
    for (int e = 0; e < h_.switch_count; ++e) turned_[e] = 0;
  }

  // Turns the switches whose functions are on the other side; those that turned at this instant stay as they are.
  bool settle(double t, const double* x, bool changed) {
    for (bool again = h_.switch_count > 0; again;) {
      again = false;
      if (!changes_.begin(t, x)) return false;
      for (int e = 0; e < h_.switch_count; ++e)
        if (changes_.value(e) * side(e) < 0 && !turned_[e]) over(e, t), again = changed = true;
    }
    for (int e = 0; e < h_.switch_count; ++e) {
      const int now = changes_.value(e) == 0 ? 0 : side(e) > 0 ? 1 : -1;
      changes_.remember(e, {now, changes_.memory(e).hint, changes_.memory(e).unresolved});
    }
    if (changed) record_.hold(t, rhs_.held());
    return true;
  }

  void over(int e, double t) {
    side(e) = -side(e), turned_[e] = 1;
    quick_[e] = t - turn_time_[e] <= rounding(t) ? quick_[e] + 1 : 0;
    turn_time_[e] = t;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
