/* What the methods share: error norm, first step and step factors, as SciPy's solve_ivp documents them (after Hairer,
   Norsett, Wanner, Solving Ordinary Differential Equations I, sec. II.4), and the loop's bookkeeping. */
#include <time.h>
#define EACH for (int i = 0; i < N; ++i)
#define EACH_OUTPUT for (int i = 0; i < NQ; ++i)

struct statistics {
  double seconds;
  long evaluations, accepted, rejected;
};

static inline double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}

static inline double size_of(const double *e, const double *scale) {
  double sum = 0.0;
  EACH { const double part = e[i] / scale[i]; sum += part * part; }
  return sqrt(sum / N);
}

/* The first step for an error estimate of the given order; one evaluation. */
static double first_step(const double *x, const double *f, double length, double order, double rtol, double atol) {
  double scale[N], y[N], g[N];
  EACH scale[i] = atol + fabs(x[i]) * rtol;
  const double d0 = size_of(x, scale), d1 = size_of(f, scale);
  const double h0 = fmin(d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1, length);
  EACH y[i] = x[i] + h0 * f[i];
  rhs(y, g);
  EACH g[i] -= f[i];
  const double d2 = size_of(g, scale) / h0;
  const double h1 = d1 <= 1e-15 && d2 <= 1e-15 ? fmax(1e-6, h0 * 1e-3) : pow(0.01 / fmax(d1, d2), 1.0 / (order + 1.0));
  return fmin(fmin(100.0 * h0, h1), length);
}

/* The factor of the next step; `again` says whether this one was rejected before. */
static inline double factor_of(double error, double exponent, int again) {
  if (error >= 1.0) return fmax(0.2, 0.9 * pow(error, exponent));
  const double factor = error == 0.0 ? 10.0 : fmin(10.0, 0.9 * pow(error, exponent));
  return again ? fmin(1.0, factor) : factor;
}
