// Event detection: where a function g(t, x, u, p) changes sign.
//
// Each step is sampled at nine places (three where g is expensive). Where the samples cannot rule out further crossings,
// the interval between two of them is sampled again, and so on, until each interval has at most one crossing. If that
// takes more than `most_evaluations` in a step, the record notes that crossings may have been missed; if g is not a
// number, it notes that as well. A root of g on the dense output is then corrected by steps of the same method that end
// at the event, so that its time and state are as accurate as those of any step.
#pragma once

#include "event_sampling.hpp"
#include "last_step.hpp"
#include "zero_search.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

enum class Found { nothing, terminal, failed };

inline int sign(double v) { return v > 0 ? 1 : v < 0 ? -1 : 0; }

// Whether there may be more crossings between samples i and i + 1 than their signs show. Where samples or their
// differences are not finite, only the signs are used.
inline bool doubtful(const Shape& shape, int i, const double* v, int depth) {
  if (!(shape.miss < INFINITY) || (v[i] == 0 && v[i + 1] == 0 && shape.miss == 0)) return false;
  if (sign(v[i]) != sign(v[i + 1])) return !shape.runs(i, v);
  return !shape.has_no_zero(i, v, safety_factor(depth)) && (depth < 2 || !shape.parabola(i));
}

class Events {
 public:
  Events(Rhs& rhs, LastStep& last) : Events(rhs, last, rhs.problem) {}
  // Those of another problem, which differs in its event functions only.
  Events(Rhs& rhs, LastStep& last, const Problem& problem)
      : rhs_(rhs), p_(problem), last_(last), samples(p_.event_samples == 2 ? 2 : parts),
        count_(p_.event_count), x_(p_.n + 16), value_(count_), g_((samples + 1) * count_), sign_(count_),
        hint_(count_), unresolved_(count_), in_(x_, rhs) {}

  bool begin(double t, const double* x) {
    if (!count_) return true;
    if (!evaluate(t, x, g_ + samples * count_)) return false;
    for (int e = 0; e < count_; ++e) sign_[e] = sign(g_[samples * count_ + e]);
    return true;
  }

  // What is kept of an event function from step to step, for a run that goes on elsewhere.
  struct Memory {
    int sign, hint, unresolved;
  };
  Memory memory(int e) const { return {sign_[e], hint_[e], unresolved_[e]}; }
  // The side on which a function that was zero before the last step was first seen in it; 0 where it stayed zero.
  int leaves(int e) const {
    int seen = 0;
    for (int i = 1; i <= samples && !seen; ++i) seen = sign(g(i, e));
    return seen;
  }
  // The share of the last step at which a function that was zero before it, and is first seen on a side, comes to that
  // side from the other one; 0 where it left zero for that side at once.
  double comes_back(int e, int seen) {
    double bad = 0, good = 0;
    for (int i = 1; i <= samples && !bad; ++i)
      if (sign(g(i, e)) == seen) bad = at(i);
    for (double s = bad / 4; s > closest && !good; s /= 4)
      if (sign(along(e, s)) == -seen) good = s;
      else bad = s;
    if (!good) return 0;
    for (int k = 0; k < 50; ++k) {
      const double middle = 0.5 * (good + bad);
      (sign(along(e, middle)) == -seen ? good : bad) = middle;
    }
    return bad;
  }
  double value(int e) const { return g_[samples * count_ + e]; }  // at the end of the last step
  void remember(int e, Memory m) { sign_[e] = m.sign, hint_[e] = m.hint, unresolved_[e] = m.unresolved; }

  // The events of the step just taken by `stepper`, which is that of the constructor. `turns`: the run goes on from
  // another state or on another side of a switch, so that a function that has come to zero may go back.
  template <class Stepper>
  Found search(Stepper& stepper, Record& record, bool turns = false) {
    effort = 0, turns_ = turns;
    std::memcpy(g_, g_ + samples * count_, count_ * sizeof(double));
    if (!evaluate(stepper.t, stepper.state(), g_ + samples * count_)) return Found::failed;
    if (!sample_between(stepper)) return Found::failed;
    bool clear = true;
    for (int e = 0; e < count_ && clear; ++e) clear = has_no_zero(e) && !touches(e);
    return clear ? Found::nothing : search_closely(record);
  }

  std::int64_t effort = 0;  // evaluations of g beyond the usual in the last step

  double end_time() const { return crossings_[terminal_].time; }
  const double* end_state() const { return states_ + crossings_[terminal_].state * p_.n; }
  int end_event() const { return crossings_[terminal_].event; }

 private:
  struct Crossing {
    double time;
    int event;
    std::size_t state;
  };

  static constexpr double closest = 1e-7;  // of a step: nearer to its start a function that was zero is not looked at
  static constexpr double touching = 1e-12;  // of the largest value in a step: rounding
  static constexpr double leaving = 1e-12;   // of the same: rounding of the interpolant, where a function leaves zero slowly
  static constexpr int deepest = 6;  // levels of intervals within intervals: down to 1e-6 of a step
  static constexpr std::int64_t most_evaluations = 200000, few_evaluations = 2000;
  static constexpr int patience = 50;  // unresolved steps of an event after which few_evaluations are spent on it

  Rhs& rhs_;
  const Problem& p_;
  LastStep& last_;
  const int samples;  // of a step, its end among them
  int count_;
  Buffer x_, value_, g_;     // g_: samples + 1 rows; the last is the step's end
  Array<int> sign_, hint_, unresolved_;  // sign_: of the last value that was not zero; 0 until zero has been left
  Inputs in_;
  int found_ = 0, terminal_ = 0, now_ = 0;
  int oscillating_ = 0, forced_ = 0;  // the level at which g oscillates; the level down to which all is sampled again
  std::int64_t values_used_ = 0, limit_ = 0;
  Growing<Crossing> crossings_;
  Growing<double> states_;
  bool turns_ = false, failed_ = false, missed_ = false, done_ = false;
  double rounding_ = 0;  // of the values of the event scanned
  double blank_ = INFINITY;  // the first time in this step at which the event scanned is not a number

  double length() const { return last_.t - last_.t_old; }
  double g(int sample, int e) const { return g_[sample * count_ + e]; }

  bool evaluate(double t, const double* x, double* values) {
    if (x != x_) std::memcpy(x_, x, p_.n * sizeof(double));
    in_.time = smaller(t, rhs_.latest);
    if (p_.signal_count) rhs_.signals(in_.time);
    return p_.events(in_.pointers, &values) == 0;
  }

  // One event function on the step's interpolant.
  double along(int e, double s) {
    last_.approximate(s, x_);
    if (!evaluate(last_.t_old + s * length(), x_, value_)) failed_ = true;
    return value_[e];
  }

  // Samples a finer and a coarser polynomial in turns, so that their error looks like an oscillation.
  template <class Stepper>
  bool sample_between(Stepper& stepper) {
    for (int i = 1; i < samples; ++i) {
      stepper.approximate(at(i), x_, i % 2 == 0);
      if (!evaluate(stepper.t_old + length() * at(i), x_, g_ + i * count_)) return false;
    }
    return true;
  }

  __attribute__((noinline)) Found search_closely(Record& record) {
    if (last_.prepare() && !sample_between(last_)) return Found::failed;
    found_ = 0;
    for (int e = 0; e < count_; ++e) scan(e, record);
    return failed_ ? Found::failed : report(record);
  }

  // Tracks the sign; a value of exactly zero is a crossing and has no sign. Zero is left by more than rounding.
  bool pass(int& sign_now, double v) const {
    const int before = sign_now, now = sign(v);
    if (v != v || (before == 0 && std::fabs(v) <= rounding_)) return false;
    sign_now = now;
    return before != 0 && now != before;
  }

  double at(int i) const { return samples == 2 ? 0.5 * i : place[i]; }

  // Whether one event surely has no crossing in this step, by its samples.
  bool has_no_zero(int e) const {
    double v[parts + 1];
    for (int i = 0; i <= samples; ++i) v[i] = g(i, e);
    return hint_[e] <= 0 && keeps_sign(v, static_cast<double>(sign_[e]), samples == 2);
  }

  double largest(int e) const {
    double most = 0;
    for (int i = 0; i <= samples; ++i) most = larger(most, std::fabs(g(i, e)));
    return most;
  }

  // Whether an event function is zero, up to rounding, where the step ends at a contact or a switch.
  bool touches(int e) const {
    if (!turns_) return false;
    const double end = g(samples, e), before = g(samples - 1, e), left = (1 - at(samples - 1)) * length();
    return std::fabs(end) <= touching * largest(e) || std::fabs(end) * left <= 8 * spacing(last_.t) * std::fabs(before - end);
  }

  // All crossings of one event in this step.
  void scan(int e, Record& record) {
    values_used_ = 0, oscillating_ = 0, forced_ = hint_[e];
    limit_ = unresolved_[e] < patience ? most_evaluations : few_evaluations;
    missed_ = done_ = false, now_ = sign_[e], blank_ = INFINITY, rounding_ = leaving * largest(e);
    double v[parts + 1];
    for (int i = 0; i <= samples; ++i) blank(v[i] = g(i, e), at(i));
    if (samples == parts) {
      scan_interval(e, 0, 1, v, 0);
    } else if (sign(v[0]) == now_ && sign(v[1]) == now_ && sign(v[2]) == now_ && halves_have_no_zero(v)) {
    } else {
      again(e, 0, v[0], 0.5, v[1], 1);
      if (!done_) again(e, 0.5, v[1], 1, v[2], 1);
    }
    if (!done_ && touches(e)) {
      if (now_ != 0 && now_ == sign(v[samples - 1])) crossing(e, now_, at(samples - 1), v[samples - 1], 1, 0);
      now_ = 0;
    }
    sign_[e] = now_;
    effort += values_used_;
    hint_[e] = oscillating_;
    if (missed_) ++unresolved_[e], record.unresolved(e, last_.t_old);
    if (blank_ < INFINITY) record.undefined(e, blank_);
  }

  void blank(double value, double s) {
    if (value != value) blank_ = smaller(blank_, last_.t_old + s * length());
  }

  // The crossings between a and b, from samples at `place` between them. Where g oscillates here, later intervals of this
  // step and of the next are sampled as densely: an oscillation may look smooth in some interval by chance.
  void scan_interval(int e, double a, double b, const double* v, int depth) {
    const Shape shape(v);
    bool unclear[parts];
    int count = 0;
    for (int i = 0; i < parts; ++i) count += unclear[i] = doubtful(shape, i, v, depth);
    if (2 * count > parts && Shape::oscillates(v) && depth + 1 < deepest) {
      oscillating_ = depth + 1 > oscillating_ ? depth + 1 : oscillating_;
      forced_ = depth + 1 > forced_ ? depth + 1 : forced_;
    }
    for (int i = 0; i < parts && !done_; ++i) {
      const double left = a + (b - a) * place[i], right = i + 1 == parts ? b : a + (b - a) * place[i + 1];
      if (unclear[i] && values_used_ >= limit_) missed_ = true;
      if (depth < deepest && values_used_ < limit_ && (unclear[i] || depth < forced_))
        again(e, left, v[i], right, v[i + 1], depth + 1);
      else
        part(e, left, v[i], right, v[i + 1], !shape.has_no_zero(i, v, safety_factor(depth)));
    }
  }

  void again(int e, double a, double at_a, double b, double at_b, int depth) {
    double v[parts + 1];
    v[0] = at_a, v[parts] = at_b;
    for (int i = 1; i < parts; ++i) blank(v[i] = along(e, a + (b - a) * place[i]), a + (b - a) * place[i]);
    values_used_ += parts - 1;
    scan_interval(e, a, b, v, depth);
  }

  // An interval with at most one crossing, or with two around an extremum where it `may_dip`.
  void part(int e, double a, double at_a, double b, double at_b, bool may_dip) {
    const int before = now_;
    if (pass(now_, at_b)) crossing(e, before, a, at_a, b, at_b);
    else if (may_dip && before != 0 && sign(at_a) == before && sign(at_b) == before) dip(e, a, at_a, b, at_b);
  }

  // Golden-section search for the other sign between a and b, and the two crossings beside it.
  void dip(int e, double left, double at_left, double right, double at_right) {
    const int side = sign(at_left);
    double a = left, b = right;
    const double ratio = 0.6180339887498949;
    double c = b - ratio * (b - a), d = a + ratio * (b - a), at_c = side * along(e, c), at_d = side * along(e, d);
    for (int k = 0; k < 40 && at_c > 0 && at_d > 0; ++k) {
      if (at_c < at_d) {
        b = d, d = c, at_d = at_c;
        at_c = side * along(e, c = b - ratio * (b - a));
      } else {
        a = c, c = d, at_c = at_d;
        at_d = side * along(e, d = a + ratio * (b - a));
      }
    }
    if (at_c > 0 && at_d > 0) return;
    const bool first = at_c <= 0;
    const double m = first ? c : d, value = side * (first ? at_c : at_d);
    crossing(e, side, left, at_left, m, value);
    if (value != 0 && !done_) crossing(e, -side, m, value, right, at_right);
  }

  // One crossing between a and b, coming from the side `before`.
  void crossing(int e, int before, double a, double at_a, double b, double at_b) {
    if (p_.direction[e] != 0 && p_.direction[e] == before) return;
    const bool bracketed = sign(at_a) == before;
    double s = b;
    if (at_b != 0) s = bracketed ? root(e, a, at_a, b, at_b) : a;
    crossings_.reserve(found_ + 1);
    states_.reserve(static_cast<std::size_t>(found_ + 1) * p_.n);
    Crossing& c = crossings_[found_];
    c.event = e;
    c.state = found_++;
    double* x = states_ + c.state * p_.n;
    c.time = bracketed && level(e, s) ? earliest(e, before, a, s, x) : refined(e, s, b - a, x);
    done_ = p_.terminal[e];  // later crossings do not matter
  }

  // Whether g is zero at s and just before it: it stays at zero, as max(x, 0) does.
  bool level(int e, double s) {
    const double step = 8 * least();
    return s > step && along(e, s - step) == 0 && along(e, s) == 0;
  }

  // Bisection for the first time at which g has left its side, over steps that end there. The dense output, which gave a
  // and b, is less accurate than these steps, so the interval is widened until it contains the time.
  double earliest(int e, int before, double a, double b, double* x) {
    const double start = last_.t_old, h = length();
    const std::size_t bytes = p_.n * sizeof(double);
    double room = larger(b - a, 1e-12);
    while (b < 1 && stays(e, before, b)) a = b, b = smaller(1, b + room), room *= 4;
    while (a > 0 && !stays(e, before, a)) b = a, a = larger(0, a - room), room *= 4;
    if (last_.redo(b * h, x_)) std::memcpy(x, x_, bytes);
    while (b - a > least()) {
      const double s = 0.5 * (a + b);
      if (stays(e, before, s)) a = s;
      else b = s, std::memcpy(x, x_, bytes);
    }
    return start + b * h;
  }

  // Whether g is on the side `before` after a step to s, whose state is then x_; true where that is not finite.
  bool stays(int e, int before, double s) {
    if (!last_.redo(s * length(), x_)) return true;
    if (!evaluate(last_.t_old + s * length(), x_, value_)) failed_ = true;
    return sign(value_[e]) == before;
  }

  double least() const { return rounding_of_time(last_.t, length()); }

  double root(int e, double a, double at_a, double b, double at_b) {
    double value;
    return bracketed_root([&](double s) { return along(e, s); }, a, at_a, b, at_b, least(), true, &value);
  }

  // Corrects a root on the dense output; leaves the state at the event.
  double refined(int e, double s, double interval, double* x) {
    const double start = last_.t_old, h = length(), ulp = spacing(last_.t);
    const std::size_t bytes = p_.n * sizeof(double);
    if ((1 - s) * h <= ulp) return std::memcpy(x, last_.state(), bytes), last_.t;
    if (s * h <= ulp) return std::memcpy(x, last_.old_state(), bytes), start;
    const auto repeat = [&](double now, bool, double* value) {
      if (!last_.redo(now, x_)) return false;
      std::memcpy(x, x_, bytes);
      if (!evaluate(start + now, x_, value_)) failed_ = true;
      return *value = value_[e], true;
    };
    double time;
    if (!corrected_root([&](double share) { return along(e, share); }, repeat, start, last_.t, s, interval, true, &time))
      return time;
    if (last_.redo(s * h, x_)) std::memcpy(x, x_, bytes);
    else last_.approximate(s, x_), rhs_.normalise_and_project(start + s * h, x_), std::memcpy(x, x_, bytes);
    return start + s * h;
  }

  // Crossings in the order of time, up to the first terminal one and those at the same instant.
  Found report(Record& record) {
    for (int i = 1; i < found_; ++i)
      for (int j = i; j > 0 && crossings_[j].time < crossings_[j - 1].time; --j) {
        const Crossing kept = crossings_[j];
        crossings_[j] = crossings_[j - 1];
        crossings_[j - 1] = kept;
      }
    terminal_ = 0;
    while (terminal_ < found_ && !p_.terminal[crossings_[terminal_].event]) ++terminal_;
    const bool ends = terminal_ < found_;
    for (int i = 0; i < found_; ++i) {
      const Crossing& c = crossings_[i];
      if (ends && c.time > end_time() + 4 * spacing(end_time())) break;
      record.event(c.event, c.time, states_ + c.state * p_.n);
    }
    return ends ? Found::terminal : Found::nothing;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
