/* One shared library a scene:
   cc -O3 -march=native -fno-math-errno -DSCENE='"planar_2r_swing.h"' -shared -fPIC integrate.c -lm */
#define _GNU_SOURCE
#include SCENE
#include "control.h"
#include "rk4.h"
#include "rk45.h"
#include "dop853.h"
#ifndef EXPLICIT_ONLY
#include "radau.h"
#endif

/* Nanoseconds a right-hand side, each call waiting for the one before as in a stepper. */
double rhs_ns(const double *x0, long calls) {
  double x[N], dx[N];
  EACH x[i] = x0[i];
  const double begun = now();
  for (long n = 0; n < calls; ++n) {
    rhs(x, dx);
    EACH x[i] += 1e-9 * dx[i];
  }
  const double seconds = now() - begun;
  volatile double kept = x[0];
  (void)kept;
  return seconds / calls * 1e9;
}

/* DOP853 for many starts (runs, N), one after another; out: where they end (runs, NQ). The statistics are sums. */
int dop853_many(const double *x0, long runs, double end, double tolerance, double *out, struct statistics *made) {
  const double begun = now();
  struct statistics one, sum = {0.0, 0, 0, 0};
  for (long n = 0; n < runs; ++n) {
    const int status = dop853(x0 + n * N, end, tolerance, tolerance, 0.0, &end, 1, out + n * NQ, &one);
    if (status) return status;
    sum.evaluations += one.evaluations, sum.accepted += one.accepted, sum.rejected += one.rejected;
  }
  sum.seconds = now() - begun;
  *made = sum;
  return 0;
}
