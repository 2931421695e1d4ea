/* Planar 2R arm hanging in a vertical plane, x = (q1, q2, v1, v2), no torques. Equations: A. Ghosal, NPTEL 2022,
   lecture 18, reduced by hand: M11 = A + B + 2 C c2, M12 = B + C c2, M22 = B, so det M = A B - C^2 c2^2
   (A: INNER, B: OUTER, C: COUPLING); two sincos, one division. */
#include <math.h>
#define N 4
#define NQ 2
static const double L1 = 1.0, M1 = 12.456, M2 = 12.456, R1 = 0.773, R2 = 0.583, I1 = 1.042, I2 = 1.042, G = 9.81;
#define INNER (I1 + M1 * R1 * R1 + M2 * L1 * L1)
#define OUTER (I2 + M2 * R2 * R2)
#define COUPLING (M2 * L1 * R2)
#define WEIGHT_1 ((M1 * R1 + M2 * L1) * G)
#define WEIGHT_2 (M2 * R2 * G)

static inline __attribute__((always_inline)) void rhs(const double *restrict x, double *restrict dx) {
  double s1, c1, s2, c2;
  sincos(x[0], &s1, &c1);
  sincos(x[1], &s2, &c2);
  const double v1 = x[2], v2 = x[3], hs = COUPLING * s2, hc = COUPLING * c2;
  const double m12 = OUTER + hc;
  const double g2 = WEIGHT_2 * (c1 * c2 - s1 * s2);
  const double f2 = -hs * v1 * v1 - g2;
  const double f1 = hs * (v1 + v1 + v2) * v2 - WEIGHT_1 * c1 - g2;
  const double inverse = 1.0 / (INNER * OUTER - hc * hc);
  dx[0] = v1;
  dx[1] = v2;
  dx[2] = (OUTER * f1 - m12 * f2) * inverse;
  dx[3] = ((INNER + m12 + hc) * f2 - m12 * f1) * inverse;
}

/* d rhs / dx: M da = df - dM a, by the same two equations. */
static inline void jacobian(const double *restrict x, double J[N][N]) {
  double s1, c1, s2, c2, dx[N];
  sincos(x[0], &s1, &c1);
  sincos(x[1], &s2, &c2);
  rhs(x, dx);
  const double v1 = x[2], v2 = x[3], hs = COUPLING * s2, hc = COUPLING * c2, m12 = OUTER + hc;
  const double g2 = WEIGHT_2 * (s1 * c2 + c1 * s2);
  const double inverse = 1.0 / (INNER * OUTER - hc * hc);
  const double f1[N] = {WEIGHT_1 * s1 + g2, hc * (v1 + v1 + v2) * v2 + g2 + hs * (2.0 * dx[2] + dx[3]), 2.0 * hs * v2,
                        2.0 * hs * (v1 + v2)};
  const double f2[N] = {g2, -hc * v1 * v1 + g2 + hs * dx[2], -2.0 * hs * v1, 0.0};
  for (int i = 0; i < N; ++i) {
    J[0][i] = i == 2, J[1][i] = i == 3;
    J[2][i] = (OUTER * f1[i] - m12 * f2[i]) * inverse;
    J[3][i] = ((INNER + m12 + hc) * f2[i] - m12 * f1[i]) * inverse;
  }
}
