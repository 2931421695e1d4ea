/* Four-bar with its spring, x = (crank, coupler, rocker, their rates), the coupler's angle relative to the crank; two
   multipliers at the joint that closes the loop, no stabilisation. Equations: A. Ghosal, NPTEL 2022, lecture 18, in the
   absolute angles a1 = crank, a2 = crank + coupler, a3 = rocker, in which M couples only crank and coupler:
   M a'' = f + J^T l, J a'' = b; three sincos, two divisions, the rocker's row divided by hand. */
#include <math.h>
#define EXPLICIT_ONLY
#define N 6
#define NQ 3
static const double L1 = 1.241, L2 = 1.2, L3 = 1.2, M1 = 20.15, M2 = 8.25, M3 = 8.25, R1 = 1.2, R2 = 0.6, R3 = 0.6,
                    I1 = 9.6, I2 = 0.06, I3 = 0.06, PRELOAD = 1.96, STIFFNESS = 0.1;
#define CRANK (I1 + M1 * R1 * R1 + M2 * L1 * L1)
#define COUPLER (I2 + M2 * R2 * R2)
#define COUPLING (M2 * L1 * R2)
#define ROCKER (I3 + M3 * R3 * R3)

static inline __attribute__((always_inline)) void rhs(const double *restrict x, double *restrict dx) {
  double s1, c1, s2, c2, s3, c3;
  sincos(x[0], &s1, &c1);
  sincos(x[0] + x[1], &s2, &c2);
  sincos(x[2], &s3, &c3);
  const double w1 = x[3], w2 = x[3] + x[4], w3 = x[5], q1 = w1 * w1, q2 = w2 * w2, q3 = w3 * w3;
  const double m12 = COUPLING * (c1 * c2 + s1 * s2), h = COUPLING * (s1 * c2 - c1 * s2);
  const double f1 = PRELOAD - STIFFNESS * x[0] - h * q2, f2 = h * q1;
  /* rows of J: x (-u1, -u2, u3), y (v1, v2, -v3) */
  const double u1 = L1 * s1, v1 = L1 * c1, u2 = L2 * s2, v2 = L2 * c2, u3 = L3 * s3, v3 = L3 * c3;
  const double bx = v1 * q1 + v2 * q2 - v3 * q3, by = u1 * q1 + u2 * q2 - u3 * q3;
  const double i = 1.0 / (CRANK * COUPLER - m12 * m12);
  const double g1 = (COUPLER * f1 - m12 * f2) * i, g2 = (CRANK * f2 - m12 * f1) * i;  /* M^-1 f */
  const double x1 = (m12 * u2 - COUPLER * u1) * i, x2 = (m12 * u1 - CRANK * u2) * i;  /* M^-1 J^T, columns x and y */
  const double y1 = (COUPLER * v1 - m12 * v2) * i, y2 = (CRANK * v2 - m12 * v1) * i;
  const double ux = u3 * (1.0 / ROCKER), uy = v3 * (-1.0 / ROCKER);
  const double sxx = u3 * ux - u1 * x1 - u2 * x2, sxy = u3 * uy - u1 * y1 - u2 * y2, syy = v1 * y1 + v2 * y2 - v3 * uy;
  const double rx = bx + u1 * g1 + u2 * g2, ry = by - v1 * g1 - v2 * g2;
  const double j = 1.0 / (sxx * syy - sxy * sxy);
  const double lx = (syy * rx - sxy * ry) * j, ly = (sxx * ry - sxy * rx) * j;
  const double a1 = g1 + x1 * lx + y1 * ly;
  dx[0] = x[3];
  dx[1] = x[4];
  dx[2] = x[5];
  dx[3] = a1;
  dx[4] = g2 + x2 * lx + y2 * ly - a1;
  dx[5] = ux * lx + uy * ly;
}
