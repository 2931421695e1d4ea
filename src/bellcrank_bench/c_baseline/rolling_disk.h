/* Thin disk that rolls on a plane, x = (x, y, tilt, heading, spin, wx, wy, wz): the centre, the angles of the rotations
   about Z, X and Y, and the angular velocity in the axes after the first two. Equations: A. Ghosal, NPTEL 2022, lecture
   18, reduced by hand to moments about the contact point; two sincos, one division; the mass cancels. */
#include <math.h>
#define EXPLICIT_ONLY
#define N 8
#define NQ 5
static const double RADIUS = 0.1, G = 9.81;

static inline __attribute__((always_inline)) void rhs(const double *restrict x, double *restrict dx) {
  double s2, c2, s1, c1;
  sincos(x[2], &s2, &c2);
  sincos(x[3], &s1, &c1);
  const double wx = x[5], wy = x[6], wz = x[7], heading = wz / c2, turn = heading * s2;
  dx[0] = RADIUS * (wy * c1 + wx * s1 * c2);
  dx[1] = RADIUS * (wy * s1 - wx * c1 * c2);
  dx[2] = wx;
  dx[3] = heading;
  dx[4] = wy - turn;
  dx[5] = (1.2 * wy - 0.2 * turn) * wz + (0.8 * G / RADIUS) * s2;
  dx[6] = (-2.0 / 3.0) * wx * wz;
  dx[7] = wx * (turn - 2.0 * wy);
}
