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

// Root mean square of v / (atol + rtol |x|) over the entries that count.
inline double scaled_norm(const Problem& p, const double* v, const double* x) {
  double sum = 0;
  for (int i = 0; i < p.norm_size; ++i) {
    const double r = v[i] / (p.atol + p.rtol * std::fabs(x[i]));
    sum += r * r;
  }
  return std::sqrt(sum / (p.norm_size ? p.norm_size : 1));
}

// A first step from the sizes of x, of its slope f, and of the slope's change over a tiny Euler step.
inline double first_step(Rhs& rhs, double t, const double* x, const double* f, double bound, int estimator) {
  const Problem& p = rhs.problem;
  const double span = p.t1 - t;
  const double d0 = scaled_norm(p, x, x), d1 = scaled_norm(p, f, x);
  double h0 = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
  h0 = smaller(h0, smaller(span, bound - t));
  Buffer moved(p.n), slope(p.n);
  for (int i = 0; i < p.n; ++i) moved[i] = x[i] + h0 * f[i];
  Inputs in(moved, rhs);
  double* out = slope;
  rhs(in, t + h0, &out);
  ++rhs.evaluations;
  for (int i = 0; i < p.n; ++i) slope[i] -= f[i];
  const double d2 = scaled_norm(p, slope, x) / h0;
  if (!(d2 < INFINITY)) return smaller(h0, p.max_step);
  const double h1 =
      d1 <= 1e-15 && d2 <= 1e-15 ? larger(1e-6, h0 * 1e-3) : std::pow(0.01 / larger(d1, d2), 1.0 / (estimator + 1));
  return smaller(smaller(100 * h0, h1), smaller(span, p.max_step));
}

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
