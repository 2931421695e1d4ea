/* Bricard's ring of six rods in the one parameter of all its postures, x = (s, sdot), s = pi/2 at first: no multiplier, and
   no closure that could drift. Angles between rods in turn theta and phi, cos theta + cos phi + cos theta cos phi = 0
   (Y. Chen, Z. You, T. Tarnai, Int. J. Solids Struct. 42 (2005) 2287), so with p = (phi + theta) / 2, m = (phi - theta) / 2:
   sin(p/2) = sin(s) / sqrt 2, sin(m/2) = cos(s) / sqrt 2. I s'' + I'/2 s'^2 + V' = 0; one sincos, two roots, the rest along
   the rods: e the rod, a the hinge at its beginning, n = e x a. */
#include <math.h>
#define EXPLICIT_ONLY
#define N 2
#define NQ 1
#define V3 for (int k = 0; k < 3; ++k)
static const double ACROSS = 1.01 / 12.0, AXIAL = 0.02 / 12.0, G = 9.81;

static inline __attribute__((always_inline)) void cross(const double *a, const double *b, double *c) {
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

static inline __attribute__((always_inline)) void rhs(const double *restrict x, double *restrict dx) {
  double s, c;
  sincos(x[0], &s, &c);
  const double ss = 0.5 * s * s, cc = 0.5 * c * c, a2 = 1.0 - ss, b2 = 1.0 - cc, a = sqrt(a2), b = sqrt(b2);
  const double cp = 1.0 - 2.0 * ss, cm = 1.0 - 2.0 * cc, sp = M_SQRT2 * s * a, sm = M_SQRT2 * c * b;
  const double p1 = M_SQRT2 * c / a, m1 = -M_SQRT2 * s / b;  /* derivatives of p and m by s */
  const double p2 = -M_SQRT1_2 * s / (a2 * a), m2 = -M_SQRT1_2 * c / (b2 * b);
  const double C[2] = {cp * cm + sp * sm, cp * cm - sp * sm}, S[2] = {sp * cm - cp * sm, sp * cm + cp * sm};
  const double d1[2] = {p1 - m1, p1 + m1}, d2[2] = {p2 - m2, p2 + m2};
  double e[3] = {0.0, 0.0, -1.0}, f[3] = {1.0, 0.0, 0.0}, n[3] = {0.0, -1.0, 0.0};
  double w[3] = {0}, dw[3] = {0}, v[3] = {0}, dv[3] = {0}, inertia = 0.0, bias = 0.0, weight = 0.0;
#pragma GCC unroll 5
  for (int i = 0; i < 5; ++i) {
    const int j = i & 1;
    const double sign = j ? 1.0 : -1.0;
    double swing[3], u[3], du[3], turn[3];
    V3 {
      const double rod = e[k], hinge = sign * f[k];
      e[k] = C[j] * rod - S[j] * hinge;
      f[k] = sign * n[k];
      n[k] = -C[j] * hinge - S[j] * rod;
    }
    V3 w[k] -= d1[j] * f[k];
    cross(w, f, swing);
    V3 dw[k] -= d2[j] * f[k] + d1[j] * swing[k];
    cross(w, e, u);
    cross(w, u, turn);
    cross(dw, e, du);
    const double along = e[0] * w[0] + e[1] * w[1] + e[2] * w[2];
    V3 {
      du[k] += turn[k];
      const double middle = v[k] + 0.5 * u[k], momentum = ACROSS * w[k] - (ACROSS - AXIAL) * along * e[k];
      inertia += middle * middle + w[k] * momentum;
      bias += middle * (dv[k] + 0.5 * du[k]) + momentum * dw[k];
      if (k == 1) weight += middle;
      v[k] += u[k];
      dv[k] += du[k];
    }
  }
  dx[0] = x[1];
  dx[1] = -(G * weight + bias * x[1] * x[1]) / inertia;
}
