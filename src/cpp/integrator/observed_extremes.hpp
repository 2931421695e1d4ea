// Least and largest values of observed quantities y(t, x, u, p) along a run.
//
// All are evaluated at the ends of steps. The first `observed_within` are also sampled within each step, at every other
// place of event detection on the same cheap polynomial. Where these samples cannot rule out that an extremum lies beyond the
// least and largest values so far, the step is sampled again on the dense output, with states projected as those of
// outputs are, and each extremum is found by successive polynomials through the samples near it; where those do not fit,
// the interval is sampled more densely. So an extremum is always the value at a state that an output could have.
#pragma once

#include "event_sampling.hpp"
#include "extremum_polynomial.hpp"
#include "last_step.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// The error that tolerances allow in a quantity.
template <class T>
T allowed_error(T atol, T rtol, T least, T largest) {
  return atol + rtol * larger(absolute(least), absolute(largest));
}

// What is known of a quantity from the steps before (`T`: double, or a vector with a run in each lane). One that is constant
// but for the error of the cheap polynomial, such as the energy of a conservative system, leaves the extremes in every step
// there, and not on the dense output: where that was found twice, such steps are no longer sampled again.
template <class T>
struct ObservedHistory {
  T noise = {};               // the error of the cheap polynomial in such steps
  T calm = {};                // such steps one after another in which the dense output kept to the extremes
  T exhausted = {};           // steps in which all samples allowed were used
  decltype(T{} > T{}) constant = {};  // in the last step that was sampled again

  static constexpr int patience = 8;
  auto explains(T span) const { return (calm >= 2.0) & (span <= 4.0 * noise); }
  // A step was sampled again: what the cheap polynomial gave at `place`, `span` apart, and what the dense output.
  void learn(const T* cheap, const T* v, T span, T least, T largest, T allowed) {
    T gap = {}, beyond = {};
    for (int i = 1; i < parts; ++i) {
      gap = larger(gap, absolute(cheap[i] - v[i]));
      beyond = larger(beyond, larger(least - v[i], v[i] - largest));
    }
    const auto flat = span <= 4.0 * gap, kept = beyond <= 10.0 * allowed;
    constant = flat & kept;
    noise = flat ? (kept ? larger(noise, gap) : T{}) : noise;
    calm = flat ? (kept ? calm + 1.0 : T{}) : calm;
  }
};

// The samples of quantity j among rows of `count` quantities, and how far apart they lie.
template <int Stride, class T>
BELLCRANK_INLINE T samples_of(const T* rows, int count, int j, T* v) {
  T least = T{} + INFINITY, largest = T{} - INFINITY;
  for (int i = 0; i <= parts / Stride; ++i) {
    v[i] = rows[i * Stride * count + j];
    least = smaller(v[i], least), largest = larger(v[i], largest);
  }
  return largest - least;
}

// Takes a value in; extremes that are not numbers stay so.
template <class T>
BELLCRANK_INLINE void take_in(T v, T& least, T& largest) {
  least = (!(v >= least)) & (least == least) ? v : least;
  largest = (!(v <= largest)) & (largest == largest) ? v : largest;
}

// Whether a quantity may leave its extremes between samples i and i + 1.
template <class AnyShape, class T>
BELLCRANK_INLINE auto may_exceed(const AnyShape& shape, int i, const T* v, T least, T largest, T allowed) {
  const T margin = 0.1 * allowed;
  return (!shape.is_monotonic(i, v)) & shape.may_leave(i, v, least - margin, largest + margin, 4);
}

// Whether a quantity surely has no extremum in a step beyond those so far, by every other sample.
template <class T>
BELLCRANK_INLINE auto stays_between(const T* v, T span, T least, T largest, T allowed, const ObservedHistory<T>& history) {
  const ShapeToEnds<T, 2> shape(v);
  const auto unknown = least != least;
  const auto certain = unknown | history.explains(span);
  auto may = !certain;
  if (any(may)) {
    decltype(may) leaves = {};
    for (int i = 0; i < parts / 2; ++i) leaves = leaves | may_exceed(shape, i, v, least, largest, allowed);
    may = may & leaves;
  }
  return unknown | ((!may) & (shape.miss < INFINITY));
}

// The extremum between samples at `left` and `right`, by successive polynomials: `along`(s, active) samples anew, and takes
// the sample into the extremes so far, which are `extremes`(&least, &largest), and returns the error allowed.
template <class T, class M, class Extremes, class Along>
void climb(ExtremumPolynomial<T>& polynomial, T left, T right, M active, const Extremes& extremes, const Along& along) {
  for (int k = 0; k < 6; ++k) {
    T s, least, largest;
    active &= polynomial.extremum(left, right, &s);
    const T expected = polynomial(s), margin = 0.1 * extremes(&least, &largest);
    active &= (expected < least - margin) | (expected > largest + margin);
    if (!any(active)) return;
    polynomial.add(s, along(s, active));
  }
}

class ObservedExtremes {
 public:
  ObservedExtremes(Rhs& rhs, LastStep& last, Record& record)
      : rhs_(rhs), p_(rhs.problem), last_(last), count_(p_.observe ? p_.observed : 0),
        within_(count_ ? p_.observed_within : 0), least_(record.least), largest_(record.largest),
        x_(count_ ? p_.n + 16 : 0), plain_(within_ ? p_.n : 0), value_(count_), y_((parts + 1) * count_),
        cheap_(within_ ? (parts + 1) * count_ : 0),
        history_(within_), in_(x_, rhs) {
    for (int j = 0; j < count_; ++j) least_[j] = INFINITY, largest_[j] = -INFINITY;
  }

  // The state at the start, and again after a jump of forces.
  void begin() {
    if (count_) take_end(last_.t, last_.state());
  }

  // The step just taken by `stepper`, which is that of the constructor.
  template <class Stepper>
  void step(Stepper& stepper) {
    if (count_) look(stepper, stepper.t, stepper.state(), 1);
  }

  // The step just taken, up to the event at which it ends.
  void part(double t, const double* x) {
    if (count_) look(last_, t, x, length() > 0 ? (t - last_.t_old) / length() : 1);
  }

  // A run that was begun elsewhere goes on with the step that the stepper has taken over.
  void resume() { evaluate(last_.t_old, last_.old_state(), y_ + parts * count_); }
  ObservedHistory<double>& history(int j) { return history_[j]; }

 private:
  static constexpr int deepest = 9;        // levels of intervals within intervals
  static constexpr int most_values = 300;  // of one quantity in a step, beyond the usual

  Rhs& rhs_;
  const Problem& p_;
  LastStep& last_;
  const int count_, within_;
  double *least_, *largest_;
  Buffer x_, plain_;  // plain_: a state before it is projected
  Buffer value_, y_, cheap_;  // rows y_: at each place, the first at the step's start; cheap_: of the cheap polynomial
  Array<ObservedHistory<double>> history_;
  Inputs in_;
  double end_ = 1;  // of the part of the step that counts, as a fraction of it
  int values_used_ = 0;

  double length() const { return last_.t - last_.t_old; }

  void evaluate(double t, const double* x, double* values) {
    if (x != x_) std::memcpy(x_, x, p_.n * sizeof(double));
    in_.time = smaller(t, rhs_.latest);
    if (p_.signal_count) rhs_.signals(in_.time);
    if (p_.observe(in_.pointers, &values) != 0)
      for (int j = 0; j < count_; ++j) values[j] = NAN;
  }

  void take(const double* values, int count) {
    for (int j = 0; j < count; ++j) take_in(values[j], least_[j], largest_[j]);
  }

  void take_end(double t, const double* x) {
    evaluate(t, x, y_ + parts * count_);
    take(y_ + parts * count_, count_);
  }

  template <class Stepper>
  void look(Stepper& stepper, double t, const double* x, double end) {
    end_ = end;
    std::memcpy(y_, y_ + parts * count_, count_ * sizeof(double));
    take_end(t, x);
    if (!within_) return;
    approximate(stepper, 2, 2);
    bool clear = true;
    for (int j = 0; j < within_ && clear; ++j) clear = stays_within(j);
    if (!clear) search();
  }

  // Samples on the cheap polynomial, at every `stride`-th place from `first` on.
  template <class Stepper>
  void approximate(Stepper& stepper, int first, int stride) {
    for (int i = first; i < parts; i += stride) {
      stepper.approximate(end_ * place[i], x_, i % 2 == 0);
      evaluate(stepper.t_old + end_ * place[i] * length(), x_, y_ + i * count_);
    }
  }

  double tolerance(int j) const { return allowed_error(p_.atol, p_.rtol, least_[j], largest_[j]); }

  // Whether quantity j surely has no extremum in this step beyond those so far.
  bool stays_within(int j) const {
    double v[parts + 1];
    const double span = samples_of<2, double>(y_, count_, j, v);
    return stays_between(v, span, least_[j], largest_[j], tolerance(j), history_[j]);
  }

  // The value of quantity j at a state of the dense output; the others are taken as well.
  double along(int j, double s) {
    between(s, value_);
    take(value_, within_);
    ++values_used_;
    return value_[j];
  }

  void between(double s, double* values) {
    const double t = last_.t_old + s * length();
    last_.approximate(s, x_);  // the dense output, where it could be prepared
    std::memcpy(plain_, x_, p_.n * sizeof(double));
    rhs_.normalise_and_project(t, x_);
    rhs_.keep_velocity(plain_, x_);
    evaluate(t, x_, values);
  }

  __attribute__((noinline)) void search() {
    approximate(last_, 1, 2);
    last_.prepare();
    std::memcpy(cheap_, y_, (parts + 1) * count_ * sizeof(double));
    for (int i = 1; i < parts; ++i) between(end_ * place[i], y_ + i * count_);
    for (int j = 0; j < within_; ++j) learn(j);
    for (int i = 1; i < parts; ++i) take(y_ + i * count_, within_);
    for (int j = 0; j < within_; ++j) {
      if (history_[j].constant) continue;
      double v[parts + 1];
      samples_of<1, double>(y_, count_, j, v);
      values_used_ = 0;
      search_interval(j, 0, end_, v, 0);
      history_[j].exhausted += values_used_ >= most_values;
    }
  }

  void learn(int j) {
    double cheap[parts + 1], v[parts + 1];
    const double span = samples_of<1, double>(cheap_, count_, j, cheap);
    samples_of<1, double>(y_, count_, j, v);
    history_[j].learn(cheap, v, span, least_[j], largest_[j], tolerance(j));
  }

  void search_interval(int j, double a, double b, const double* v, int depth) {
    const ShapeToEnds<double> shape(v);
    if (!(shape.miss < INFINITY)) return;
    bool done[parts] = {};
    for (;;) {  // what may exceed the extremes most comes first: what is found there rules others out
      int i = -1;
      double most = 0;
      for (int k = 0; k < parts; ++k) {
        if (done[k] || !may_exceed(shape, k, v, least_[j], largest_[j], tolerance(j))) continue;
        const double excess = larger(larger(v[k], v[k + 1]) - largest_[j], least_[j] - smaller(v[k], v[k + 1]));
        if (i < 0 || excess + shape.arc(k) > most) i = k, most = excess + shape.arc(k);
      }
      if (i < 0) return;
      done[i] = true;
      const double left = a + (b - a) * place[i], right = i + 1 == parts ? b : a + (b - a) * place[i + 1];
      const bool smooth = shape.parabola(i) || shape.miss <= tolerance(j);
      if (smooth && turns_within(i, v)) climb_between(j, a, b, i, v);
      else if (!smooth && depth + 1 < deepest && values_used_ < most_values && history_[j].exhausted < ObservedHistory<double>::patience)
        again(j, left, v[i], right, v[i + 1], depth + 1);
    }
  }

  void again(int j, double a, double at_a, double b, double at_b, int depth) {
    double v[parts + 1];
    v[0] = at_a, v[parts] = at_b;
    for (int i = 1; i < parts; ++i) v[i] = along(j, a + (b - a) * place[i]);
    search_interval(j, a, b, v, depth);
  }

  // The extremum between samples i and i + 1 of an interval.
  void climb_between(int j, double a, double b, int i, const double* v) {
    ExtremumPolynomial<double> polynomial;
    const int first = first_near(i);
    for (int k = first; k < first + near; ++k) polynomial.add(place[k], v[k]);
    const auto extremes = [&](double* least, double* largest) {
      *least = least_[j], *largest = largest_[j];
      return tolerance(j);
    };
    climb(polynomial, place[i], place[i + 1], true, extremes, [&](double s, bool) { return along(j, a + (b - a) * s); });
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
