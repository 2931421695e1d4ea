/* Mass on a spring that turns about a fixed point, x = (theta, r, thetadot, rdot), theta from hanging. Equations:
   A. Ghosal, NPTEL 2022, lecture 18: r'' = r w^2 + g cos theta - (k / m)(r - l),
   theta'' = -(2 r' w + g sin theta) / r; one sincos, one division. */
#include <math.h>
#define N 4
#define NQ 2
static const double MASS = 2.0, STIFFNESS = 15.0, FREE_LENGTH = 5.0, G = 9.81;

static inline __attribute__((always_inline)) void rhs(const double *restrict x, double *restrict dx) {
  double s, c;
  sincos(x[0], &s, &c);
  const double r = x[1], w = x[2], v = x[3];
  dx[0] = w;
  dx[1] = v;
  dx[2] = -((v + v) * w + G * s) / r;
  dx[3] = r * w * w + G * c - (STIFFNESS / MASS) * (r - FREE_LENGTH);
}

/* d rhs / dx. */
static inline void jacobian(const double *restrict x, double J[N][N]) {
  double s, c;
  sincos(x[0], &s, &c);
  const double r = x[1], w = x[2], v = x[3], inverse = 1.0 / r;
  const double rows[N][N] = {
      {0, 0, 1, 0},
      {0, 0, 0, 1},
      {-G * c * inverse, (2.0 * v * w + G * s) * inverse * inverse, -2.0 * v * inverse, -2.0 * w * inverse},
      {-G * s, w * w - STIFFNESS / MASS, 2.0 * r * w, 0}};
  for (int i = 0; i < N; ++i) for (int j = 0; j < N; ++j) J[i][j] = rows[i][j];
}
