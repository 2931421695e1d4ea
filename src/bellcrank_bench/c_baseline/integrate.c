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
