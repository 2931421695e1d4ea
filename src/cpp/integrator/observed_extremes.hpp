// Least and largest values of observed quantities y(t, x, u, p) along a run.
//
// All are evaluated at the ends of steps. The first `observed_within` are also sampled within each step, at the places of
// event detection on the same cheap polynomial. Where these samples cannot rule out that an extremum lies beyond the
// least and largest values so far, the step is sampled again on the dense output, with states projected as those of
// outputs are, and each extremum is found by successive polynomials through five samples; where those do not fit, the
// interval is sampled more densely. So an extremum is always the value at a state that an output could have.
#pragma once

#include "event_sampling.hpp"
#include "extremum_polynomial.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <class Stepper>
class ObservedExtremes {
 public:
  ObservedExtremes(Rhs& rhs, Stepper& stepper, Record& record)
      : rhs_(rhs), p_(rhs.problem), stepper_(stepper), count_(p_.observe ? p_.observed : 0),
        within_(count_ ? p_.observed_within : 0), least_(record.least), largest_(record.largest),
        x_(count_ ? p_.n + 16 : 0), value_(count_), y_((parts + 1) * count_), exhausted_(within_), in_(x_, rhs),
        exactness_(larger(1e-14, p_.step > 0 ? 0 : 0.01 * p_.rtol)) {
    for (int j = 0; j < count_; ++j) least_[j] = INFINITY, largest_[j] = -INFINITY;
  }

  // The state at the start, and again after a jump of forces.
  void begin() {
    if (count_) take_end(stepper_.t, stepper_.state());
  }

  // The step just taken.
  void step() {
    if (count_) look(stepper_.t, stepper_.state(), 1);
  }

  // The step just taken, up to the event at which it ends.
  void part(double t, const double* x) {
    if (count_) look(t, x, length() > 0 ? (t - stepper_.t_old) / length() : 1);
  }

 private:
  static constexpr int deepest = 9;  // levels of intervals within intervals: a kink is found to 1e-9 of a step
  static constexpr int most_values = 300, patience = 8;  // of one quantity in a step; how many steps may need them all

  Rhs& rhs_;
  const Problem& p_;
  Stepper& stepper_;
  const int count_, within_;
  double *least_, *largest_;
  Buffer x_, value_, y_;  // y_: a row for each place; the first is the end of the step before
  Array<int> exhausted_;
  Inputs in_;
  const double exactness_;  // of an extremum, relative to the larger of both: far below the error of the run
  double end_ = 1;          // of the part of the step that counts, as a fraction of it
  int spent_ = 0;

  double length() const { return stepper_.t - stepper_.t_old; }

  void evaluate(double t, const double* x, double* values) {
    if (x != x_) std::memcpy(x_, x, p_.n * sizeof(double));
    in_.time = smaller(t, rhs_.latest);
    if (p_.signal_count) rhs_.signals(in_.time);
    if (p_.observe(in_.pointers, &values) != 0)
      for (int j = 0; j < count_; ++j) values[j] = NAN;
  }

  // Extremes that are not numbers stay so.
  void take(const double* values, int count) {
    for (int j = 0; j < count; ++j) {
      const double v = values[j];
      if (!(v >= least_[j]) && least_[j] == least_[j]) least_[j] = v;
      if (!(v <= largest_[j]) && largest_[j] == largest_[j]) largest_[j] = v;
    }
  }

  void take_end(double t, const double* x) {
    evaluate(t, x, y_ + parts * count_);
    take(y_ + parts * count_, count_);
  }

  void look(double t, const double* x, double end) {
    end_ = end;
    std::memcpy(y_, y_ + parts * count_, count_ * sizeof(double));
    take_end(t, x);
    if (!within_) return;
    for (int i = 1; i < parts; ++i) {
      stepper_.sketch(end_ * place[i], x_, i % 2 == 0);
      evaluate(stepper_.t_old + end_ * place[i] * length(), x_, y_ + i * count_);
    }
    bool clear = true;
    for (int j = 0; j < within_ && clear; ++j) clear = stays_within(j);
    if (!clear) search();
  }

  // Whether quantity j surely has no extremum in this step beyond those so far.
  bool stays_within(int j) const {
    if (least_[j] != least_[j] || largest_[j] != largest_[j]) return true;
    double v[parts + 1];
    for (int i = 0; i <= parts; ++i) v[i] = y_[i * count_ + j];
    const Shape shape(v);
    if (!(shape.miss < INFINITY)) return false;
    for (int i = 0; i < parts; ++i)
      if (may_exceed(shape, i, v, j, 2)) return false;
    return true;
  }

  bool may_exceed(const Shape& shape, int i, const double* v, int j, double caution) const {
    const double margin = negligible(j);
    return !shape.runs(i, v) && shape.may_leave(i, v, least_[j] - margin, largest_[j] + margin, caution);
  }

  double negligible(int j) const { return exactness_ * larger(std::fabs(least_[j]), std::fabs(largest_[j])); }

  // The value of quantity j, and of the others, at a state of the dense output.
  double along(int j, double s) {
    between(s, value_);
    ++spent_;
    return value_[j];
  }

  void between(double s, double* values) {
    const double t = stepper_.t_old + s * length();
    stepper_.sketch(s, x_);  // the dense output, where it could be prepared
    rhs_.settle(t, x_);
    evaluate(t, x_, values);
    take(values, within_);
  }

  void search() {
    stepper_.prepare();
    for (int i = 1; i < parts; ++i) between(end_ * place[i], y_ + i * count_);
    for (int j = 0; j < within_; ++j) {
      double v[parts + 1];
      for (int i = 0; i <= parts; ++i) v[i] = y_[i * count_ + j];
      spent_ = 0;
      search_interval(j, 0, end_, v, 0);
      exhausted_[j] += spent_ >= most_values;
    }
  }

  void search_interval(int j, double a, double b, const double* v, int depth) {
    const Shape shape(v);
    if (!(shape.miss < INFINITY)) return;
    for (int i = 0; i < parts; ++i) {
      if (!may_exceed(shape, i, v, j, 2)) continue;
      const double left = a + (b - a) * place[i], right = i + 1 == parts ? b : a + (b - a) * place[i + 1];
      if (shape.parabola(i)) climb(j, a, b, i, v);
      else if (depth + 1 < deepest && spent_ < most_values && exhausted_[j] < patience) again(j, left, v[i], right, v[i + 1], depth + 1);
    }
  }

  void again(int j, double a, double at_a, double b, double at_b, int depth) {
    double v[parts + 1];
    v[0] = at_a, v[parts] = at_b;
    for (int i = 1; i < parts; ++i) v[i] = along(j, a + (b - a) * place[i]);
    search_interval(j, a, b, v, depth);
  }

  // The extremum between samples i and i + 1 of an interval.
  void climb(int j, double a, double b, int i, const double* v) {
    ExtremumPolynomial polynomial(i, v);
    double s;
    for (int k = 0; k < 6 && polynomial.extremum(&s); ++k) {
      const double expected = polynomial(s), margin = negligible(j);
      if (expected >= least_[j] - margin && expected <= largest_[j] + margin) return;
      polynomial.add(s, along(j, a + (b - a) * s));
    }
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
