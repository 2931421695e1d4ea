/* Planar 2R arm hanging in a vertical plane, x = (q1, q2, v1, v2), no torques. Equations: A. Ghosal, NPTEL 2022, lecture 18,
   reduced by hand: M11 = A + B + 2 H c2, M12 = B + H c2, M22 = B, so det M = A B - H^2 c2^2; two sincos, one division. */
#include <math.h>
#define N 4
#define NQ 2
static const double L1 = 1.0, M1 = 12.456, M2 = 12.456, R1 = 0.773, R2 = 0.583, I1 = 1.042, I2 = 1.042, G = 9.81;
#define A (I1 + M1 * R1 * R1 + M2 * L1 * L1)
#define B (I2 + M2 * R2 * R2)
#define H (M2 * L1 * R2)
#define G1 ((M1 * R1 + M2 * L1) * G)
#define G2 (M2 * R2 * G)

static inline __attribute__((always_inline)) void rhs(const double *restrict x, double *restrict dx) {
  double s1, c1, s2, c2;
  sincos(x[0], &s1, &c1);
  sincos(x[1], &s2, &c2);
  const double v1 = x[2], v2 = x[3], hs = H * s2, hc = H * c2;
  const double m12 = B + hc;
  const double g2 = G2 * (c1 * c2 - s1 * s2);
  const double f2 = -hs * v1 * v1 - g2;
  const double f1 = hs * (v1 + v1 + v2) * v2 - G1 * c1 - g2;
  const double inverse = 1.0 / (A * B - hc * hc);
  dx[0] = v1;
  dx[1] = v2;
  dx[2] = (B * f1 - m12 * f2) * inverse;
  dx[3] = ((A + m12 + hc) * f2 - m12 * f1) * inverse;
}
