// Events: where a function g(t, x, u, p) changes sign. Each step is sampled at eight places (fewer where asked), so that two crossings in a
// long step are found, and where g turns back towards zero between samples its extremum is looked at too. A root of g
// on the dense output is then corrected by steps of the same method that end at the event: its time and state are as
// exact as those of any step.
#pragma once

#include "control.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

enum class Found { nothing, terminal, failed };

template <class Stepper>
class Events {
 public:
  Events(Rhs& rhs, Stepper& stepper)
      : rhs_(rhs), p_(rhs.problem), stepper_(stepper), samples(p_.event_samples), count_(p_.event_count), x_(p_.n + 16), value_(count_),
        g_((samples + 1) * count_), sign_(count_), in_(x_, rhs), capacity_(count_ * (samples + 4)),
        crossings_(capacity_), states_(static_cast<std::size_t>(capacity_) * p_.n) {}

  bool begin(double t, const double* x) {
    if (!count_) return true;
    if (!evaluate(t, x, g_ + samples * count_)) return false;
    for (int e = 0; e < count_; ++e) sign_[e] = sign(g_[samples * count_ + e]);
    return true;
  }

  // The events of the step just taken.
  Found search(Record& record) {
    if (!sample(false)) return Found::failed;
    bool interesting = false;
    for (int e = 0; e < count_ && !interesting; ++e) interesting = scan(e, nullptr);
    if (!interesting) return keep_signs(), Found::nothing;
    if (stepper_.prepare() && !sample(true)) return Found::failed;
    found_ = 0;
    for (int e = 0; e < count_; ++e) scan(e, this);
    keep_signs();
    if (failed_) return Found::failed;
    return report(record);
  }

  double end_time() const { return crossings_[terminal_].time; }
  const double* end_state() const { return states_ + crossings_[terminal_].state * p_.n; }

 private:
  struct Crossing {
    double time;
    int event;
    std::size_t state;
  };

  Rhs& rhs_;
  const Problem& p_;
  Stepper& stepper_;
  const int samples;  // of a step, its end among them
  int count_;
  Buffer x_, value_, g_;  // g_: samples + 1 rows; the last is the step's end
  Array<int> sign_;       // of the last value that was not zero; 0 until zero has been left
  Inputs in_;
  int capacity_, found_ = 0, terminal_ = 0;
  Array<Crossing> crossings_;
  Buffer states_;
  bool failed_ = false;

  static int sign(double v) { return v > 0 ? 1 : v < 0 ? -1 : 0; }
  double length() const { return stepper_.t - stepper_.t_old; }
  double g(int sample, int e) const { return g_[sample * count_ + e]; }

  bool evaluate(double t, const double* x, double* values) {
    if (x != x_) std::memcpy(x_, x, p_.n * sizeof(double));
    in_.time = smaller(t, rhs_.latest);
    if (p_.signal_count) rhs_.signals(in_.time);
    return p_.events(in_.pointers, &values) == 0;
  }

  // One event function on the step's interpolant.
  double along(int e, double s) {
    stepper_.sketch(s, x_);
    if (!evaluate(stepper_.t_old + s * length(), x_, value_)) failed_ = true;
    return value_[e];
  }

  bool sample(bool again) {
    if (!again) {
      std::memcpy(g_, g_ + samples * count_, count_ * sizeof(double));
      if (!evaluate(stepper_.t, stepper_.state(), g_ + samples * count_)) return false;
    }
    for (int i = 1; i < samples; ++i) {
      stepper_.sketch(i / double(samples), x_);
      if (!evaluate(stepper_.t_old + length() * i / samples, x_, g_ + i * count_)) return false;
    }
    return true;
  }

  void keep_signs() {
    for (int e = 0; e < count_; ++e)
      for (int i = 1; i <= samples; ++i) pass(sign_[e], g(i, e));
  }
  // Follows the sign; a value of exactly zero is a crossing and has no sign.
  static bool pass(int& sign_now, double v) {
    const int before = sign_now, now = sign(v);
    if (v != v) return false;
    sign_now = now;
    return before != 0 && now != before;
  }

  // Whether one event's samples need a closer look; with `keep`, its crossings are refined and kept.
  bool scan(int e, Events* keep) {
    int now = sign_[e];
    bool any = false;
    for (int i = 1; i <= samples; ++i) {
      const int before = now;
      if (pass(now, g(i, e))) {
        any = true;
        if (keep) crossing(e, before, (i - 1.0) / samples, g(i - 1, e), i / double(samples), g(i, e));
      }
      if (i < samples && turns(e, i)) {
        any = true;
        if (keep) dip(e, i);
      }
    }
    return any;
  }

  // Whether the parabola through three samples of one sign turns between them near zero.
  bool turns(int e, int i) const {
    const double a = g(i - 1, e), b = g(i, e), c = g(i + 1, e);
    const int side = sign(b);
    if (side == 0 || sign(a) != side || sign(c) != side) return false;
    const double slope = 0.5 * (c - a), curve = a - 2 * b + c;
    if (!(curve * side > 0)) return false;
    const double at = -slope / curve;
    if (at < (i == 1 ? -1 : -0.5) || at > (i == samples - 1 ? 1 : 0.5)) return false;
    const double lowest = side * (b - 0.5 * slope * slope / curve);
    return lowest < 0.25 * (std::fabs(slope) + std::fabs(curve));
  }

  // Golden-section search for the other sign around sample i, and the two crossings beside it.
  void dip(int e, int i) {
    const int side = sign(g(i, e));
    double a = (i - 1.0) / samples, b = (i + 1.0) / samples;
    const double left = a, right = b, ratio = 0.6180339887498949;
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
    const bool at_left = at_c <= 0;
    const double m = at_left ? c : d, value = side * (at_left ? at_c : at_d);
    crossing(e, side, left, g(i - 1, e), m, value);
    if (value != 0) crossing(e, -side, m, value, right, g(i + 1, e));
  }

  // One crossing between a and b, coming from the side `before`.
  void crossing(int e, int before, double a, double at_a, double b, double at_b) {
    if (found_ == capacity_ || (p_.direction[e] != 0 && p_.direction[e] == before)) return;
    const bool bracketed = sign(at_a) == before;
    double s = b;
    if (at_b != 0) s = bracketed ? root(e, a, at_a, b, at_b) : a;
    Crossing& c = crossings_[found_];
    c.event = e;
    c.state = found_++;
    double* x = states_ + c.state * p_.n;
    c.time = bracketed && level(e, s) ? earliest(e, before, a, s, x) : refined(e, s, x);
  }

  // Whether g is zero at s and was so before: it rests there, as max(x, 0) does.
  bool level(int e, double s) {
    const double step = 8 * least();
    return s > step && along(e, s - step) == 0 && along(e, s) == 0;
  }

  // Bisection for the first time at which g has left its side, over steps that end there; g has at b.
  double earliest(int e, int before, double a, double b, double* x) {
    const double start = stepper_.t_old, h = length();
    const std::size_t bytes = p_.n * sizeof(double);
    if (stepper_.redo(b * h, x_)) std::memcpy(x, x_, bytes);
    while (b - a > least()) {
      const double s = 0.5 * (a + b);
      if (!stepper_.redo(s * h, x_)) break;
      if (!evaluate(start + s * h, x_, value_)) failed_ = true;
      if (sign(value_[e]) == before) a = s;
      else b = s, std::memcpy(x, x_, bytes);
    }
    return start + b * h;
  }

  // Rounding of the time, as a fraction of the step.
  double least() const { return larger(2 * spacing(stepper_.t) / length(), 1e-16); }

  // A bracketed root: T. R. Chandrupatla, Adv. Eng. Software 28 (1997) 145-149.
  double root(int e, double a, double at_a, double b, double at_b) {
    const double rounding = least();
    double c = a, at_c = at_a, fraction = 0.5;
    for (int k = 0; k < 100; ++k) {
      const double s = a + fraction * (b - a), at_s = along(e, s);
      if (at_s == 0 || at_s != at_s) return s;
      if (sign(at_s) == sign(at_a)) c = a, at_c = at_a;
      else c = b, at_c = at_b, b = a, at_b = at_a;
      a = s, at_a = at_s;
      const double tolerance = rounding / std::fabs(b - a);
      if (tolerance > 0.5) break;
      const double xi = (a - b) / (c - b), phi = (at_a - at_b) / (at_c - at_b);
      fraction = 0.5;
      if (phi * phi < xi && (1 - phi) * (1 - phi) < 1 - xi)
        fraction = at_a / (at_b - at_a) * at_c / (at_b - at_c) +
                   (c - a) / (b - a) * at_a / (at_c - at_a) * at_b / (at_c - at_b);
      fraction = smaller(1 - tolerance, larger(tolerance, fraction));
    }
    return std::fabs(at_a) < std::fabs(at_b) ? a : b;
  }

  // Corrects a root on the dense output by secant iterations over steps that end there; leaves the state at the event.
  double refined(int e, double s, double* x) {
    const double start = stepper_.t_old, h = length(), ulp = spacing(stepper_.t);
    const std::size_t bytes = p_.n * sizeof(double);
    if ((1 - s) * h <= ulp) return std::memcpy(x, stepper_.state(), bytes), stepper_.t;
    if (s * h <= ulp) return std::memcpy(x, stepper_.old_state(), bytes), start;
    const double width = smaller(1e-3, smaller(s, 1 - s));
    double slope = (along(e, s + width) - along(e, s - width)) / (2 * width * h);
    double now = s * h, before = 0, at_before = 0;
    for (int k = 0; k < 8; ++k) {
      if (!stepper_.redo(now, x_)) break;
      std::memcpy(x, x_, bytes);
      if (!evaluate(start + now, x_, value_)) failed_ = true;
      const double at_now = value_[e];
      if (k > 0 && at_now != at_before) slope = (at_now - at_before) / (now - before);
      const double next = now - at_now / slope;
      if (at_now == 0 || std::fabs(next - now) <= 0.5 * ulp) return start + now;
      if (!(std::fabs(next - s * h) < 0.1 * h) || next <= 0 || next >= h) break;
      before = now, at_before = at_now;
      now = next;
    }
    if (std::fabs(now - before) <= 4 * ulp) return start + now;  // as close as rounding lets it
    if (stepper_.redo(s * h, x_)) std::memcpy(x, x_, bytes);
    else stepper_.sketch(s, x_), rhs_.settle(start + s * h, x_), std::memcpy(x, x_, bytes);
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
