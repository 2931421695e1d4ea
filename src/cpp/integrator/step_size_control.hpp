// Step size control: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, sec. II.4, with the
// constants of SciPy's solve_ivp, so that both take the same steps.
#pragma once

#include "right_hand_side.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

constexpr double safety = 0.9, least_factor = 0.2, largest_factor = 10;

enum class Outcome { accepted, too_small, non_finite, out_of_evaluations };

inline Status status_of(Outcome outcome) {
  return outcome == Outcome::too_small    ? Status::step_too_small
         : outcome == Outcome::non_finite ? Status::non_finite
                                          : Status::evaluations_spent;
}

// safety error^(-1 / (order of the estimate + 1)), from the square of the error. `T`: double, or a vector with a run in each
// lane, and then `M` is a mask.
template <class Method, class T>
BELLCRANK_INLINE T size_factor(T error_square) {
  const T within = smaller(larger(error_square, T{} + 1e-290), T{} + 1e290);
  return safety * power(within, -0.5 / (Method::estimator + 1));
}

// The size to try after an accepted step of size h, whose factor this is: not more than h where it was tried `again`; not less
// than was `proposed` where a bound made it shorter, because a stop does not limit the next step.
template <class T, class M>
BELLCRANK_INLINE T size_after(T h, T factor, M again, M at_bound, T proposed) {
  T longer = smaller(T{} + largest_factor, factor);
  longer = again ? smaller(T{} + 1.0, longer) : longer;
  const T next = h * longer;
  return at_bound & !again ? larger(next, proposed) : next;
}

// The size to try instead after a rejected step; `bad`: it was not finite.
template <class T, class M>
BELLCRANK_INLINE T size_instead(T h, T factor, M bad) {
  return h * (bad ? T{} + least_factor : larger(T{} + least_factor, factor));
}

// Root mean square of v / (atol + rtol |x|) over the entries that count.
template <class T>
T scaled_norm(const Problem& p, T atol, T rtol, const T* v, const T* x) {
  T sum = {};
  for (int i = 0; i < p.norm_size; ++i) {
    const T r = v[i] / (atol + rtol * absolute(x[i]));
    sum += r * r;
  }
  return root(sum / static_cast<double>(p.norm_size ? p.norm_size : 1));
}

// A first step from the sizes of x, of its slope f, and of the slope's change over a tiny Euler step: `slope`(h, x, result)
// evaluates after a time h. `span` and `left`: the time to the end of the run and to the next bound.
template <class T, class Slope>
T first_step(const Problem& p, T atol, T rtol, const T* x, const T* f, T span, T left, T max_step, int estimator,
             const Slope& slope) {
  const T d0 = scaled_norm(p, atol, rtol, x, x), d1 = scaled_norm(p, atol, rtol, f, x);
  T h0 = (d0 < 1e-5) | (d1 < 1e-5) ? T{} + 1e-6 : 0.01 * d0 / d1;
  h0 = smaller(h0, smaller(span, left));
  Array<T> moved(p.n), change(p.n);
  for (int i = 0; i < p.n; ++i) moved[i] = x[i] + h0 * f[i];
  slope(h0, moved, change);
  for (int i = 0; i < p.n; ++i) change[i] -= f[i];
  const T d2 = scaled_norm<T>(p, atol, rtol, change, x) / h0;
  const T within = smaller(larger(0.01 / larger(d1, d2), T{} + 1e-290), T{} + 1e290);
  const T h1 = (d1 <= 1e-15) & (d2 <= 1e-15) ? larger(T{} + 1e-6, h0 * 1e-3) : power(within, 1.0 / (estimator + 1));
  return d2 < INFINITY ? smaller(smaller(100.0 * h0, h1), smaller(span, max_step)) : smaller(h0, max_step);
}

// Of one run.
inline double first_step(Rhs& rhs, double t, const double* x, const double* f, double bound, int estimator) {
  const Problem& p = rhs.problem;
  const auto slope = [&](double h, const double* moved, double* result) {
    Inputs in(moved, rhs);
    rhs(in, t + h, &result);
    ++rhs.evaluations;
  };
  return first_step<double>(p, p.atol, p.rtol, x, f, p.t1 - t, bound - t, p.max_step, estimator, slope);
}

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
