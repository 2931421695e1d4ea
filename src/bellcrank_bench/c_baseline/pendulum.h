/* Point mass on a massless rod, x = (theta, thetadot), theta from hanging: theta'' = -(g / l) sin theta. */
#include <math.h>
#define N 2
#define NQ 1
static const double G = 9.81, LENGTH = 1.0;

static inline __attribute__((always_inline)) void rhs(const double *restrict x, double *restrict dx) {
  dx[0] = x[1];
  dx[1] = -(G / LENGTH) * sin(x[0]);
}

/* d rhs / dx. */
static inline void jacobian(const double *restrict x, double J[N][N]) {
  J[0][0] = 0.0, J[0][1] = 1.0;
  J[1][0] = -(G / LENGTH) * cos(x[0]), J[1][1] = 0.0;
}
