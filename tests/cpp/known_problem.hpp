// Initial value problems of plain functions, one with a known solution.
#pragma once

#include "problem.hpp"
#include "support.hpp"

namespace bellcrank {

// x' = rhs(t, x) from x0, which must outlive the problem; no events, outputs or constraints.
inline Problem plain_problem(Kernel rhs, const Numbers& x0, double t0, double t1) {
  Problem p{};
  p.rhs = rhs;
  p.n = p.norm_size = static_cast<int>(x0.size());
  p.lanes = 1;
  p.x0 = x0.data(), p.t0 = t0, p.t1 = t1;
  p.rtol = p.atol = 1e-10;
  p.max_step = p.latest = INFINITY;
  p.event_samples = 8;
  p.max_evaluations = 1000000;  // ends a run whose steps do not grow
  return p;
}

struct KnownDerivatives final : Derivatives {
  Kernel jacobian;
  explicit KnownDerivatives(Kernel kernel) : jacobian(kernel) {}
  DerivativeKernels kernels() override { return {jacobian, nullptr, 1}; }
};

// Kepler's ellipse of eccentricity 0.3, in position and velocity, and x' = -2 t x^2, which depends on time. The motion
// on the ellipse is (cos E - e, sqrt(1 - e^2) sin E) with Kepler's equation E - e sin E = t (H. Goldstein, Classical
// Mechanics, sec. 3.8), and x = 1 / (1 + t^2).
namespace known {

constexpr int n = 5;
constexpr double eccentricity = 0.3, begin = 0.4, end = 2.0;  // not from the apse: its symmetry would hide odd terms

inline std::int32_t slope(const double* const* in, double* const* out) {
  const double t = *in[0], *x = in[1], r = std::hypot(x[0], x[1]);
  double* f = out[0];
  f[0] = x[2], f[1] = x[3];
  f[2] = -x[0] / (r * r * r), f[3] = -x[1] / (r * r * r);
  f[4] = -2 * t * x[4] * x[4];
  return 0;
}

// The same at x + s k, as stages call it.
inline std::int32_t staged_slope(const double* const* in, double* const* out) {
  double x[n];
  for (int i = 0; i < n; ++i) x[i] = in[1][i] + *in[5] * in[4][i];
  const double* const there[] = {in[0], x};
  return slope(there, out);
}

inline std::int32_t jacobian(const double* const* in, double* const* out) {
  const double t = *in[0], *x = in[1], r2 = x[0] * x[0] + x[1] * x[1], r5 = r2 * r2 * std::sqrt(r2);
  double* j = out[0];  // column by column
  std::fill(j, j + n * n, 0.0);
  j[2 * n + 0] = j[3 * n + 1] = 1;
  j[0 * n + 2] = (3 * x[0] * x[0] - r2) / r5, j[1 * n + 3] = (3 * x[1] * x[1] - r2) / r5;
  j[1 * n + 2] = j[0 * n + 3] = 3 * x[0] * x[1] / r5;
  j[4 * n + 4] = -4 * t * x[4];
  return 0;
}

inline Numbers solution(double t) {
  const double e = eccentricity, minor = std::sqrt(1 - e * e);
  double anomaly = t;
  for (int k = 0; k < 50; ++k) anomaly -= (anomaly - e * std::sin(anomaly) - t) / (1 - e * std::cos(anomaly));
  const double c = std::cos(anomaly), s = std::sin(anomaly), rate = 1 / (1 - e * c);
  return {c - e, minor * s, -s * rate, minor * c * rate, 1 / (1 + t * t)};
}

inline KnownDerivatives derivatives{jacobian};
inline const Numbers start = solution(begin);

inline Problem problem() {
  Problem p = plain_problem(slope, start, begin, end);
  p.derivatives = &derivatives;
  return p;
}

}  // namespace known
}  // namespace bellcrank
