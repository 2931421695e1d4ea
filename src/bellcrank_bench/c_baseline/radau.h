/* Radau IIA of order 5 with simplified Newton iterations on transformed stages and the scene's Jacobian by hand
   (method, transformation, control: Hairer, Wanner, Solving Ordinary Differential Equations II, sec. IV.8; details as
   in SciPy). */
#define SQRT6 2.449489742783178

/* LU factors with partial pivoting, in place; a row's reciprocal pivot on the diagonal. */
static inline void factorise(double a[N][N], int pivot[N]) {
  for (int k = 0; k < N; ++k) {
    int best = k;
    for (int i = k + 1; i < N; ++i) if (fabs(a[i][k]) > fabs(a[best][k])) best = i;
    pivot[k] = best;
    if (best != k) EACH { const double kept = a[k][i]; a[k][i] = a[best][i], a[best][i] = kept; }
    a[k][k] = 1.0 / a[k][k];
    for (int i = k + 1; i < N; ++i) {
      a[i][k] *= a[k][k];
      for (int j = k + 1; j < N; ++j) a[i][j] -= a[i][k] * a[k][j];
    }
  }
}

static inline void solve(double a[N][N], const int pivot[N], double *b) {
  for (int k = 0; k < N; ++k) {
    const double kept = b[pivot[k]];
    b[pivot[k]] = b[k], b[k] = kept;
  }
  for (int i = 1; i < N; ++i) for (int j = 0; j < i; ++j) b[i] -= a[i][j] * b[j];
  for (int i = N - 1; i >= 0; --i) {
    for (int j = i + 1; j < N; ++j) b[i] -= a[i][j] * b[j];
    b[i] *= a[i][i];
  }
}

/* The same for complex matrices, re + i im. */
static inline void factorise_complex(double re[N][N], double im[N][N], int pivot[N]) {
  for (int k = 0; k < N; ++k) {
    int best = k;
    for (int i = k + 1; i < N; ++i)
      if (fabs(re[i][k]) + fabs(im[i][k]) > fabs(re[best][k]) + fabs(im[best][k])) best = i;
    pivot[k] = best;
    if (best != k) EACH {
      const double r = re[k][i], m = im[k][i];
      re[k][i] = re[best][i], im[k][i] = im[best][i], re[best][i] = r, im[best][i] = m;
    }
    const double inverse = 1.0 / (re[k][k] * re[k][k] + im[k][k] * im[k][k]);
    const double r = re[k][k] * inverse, m = -im[k][k] * inverse;
    re[k][k] = r, im[k][k] = m;
    for (int i = k + 1; i < N; ++i) {
      const double fr = re[i][k] * r - im[i][k] * m, fm = re[i][k] * m + im[i][k] * r;
      re[i][k] = fr, im[i][k] = fm;
      for (int j = k + 1; j < N; ++j) {
        re[i][j] -= fr * re[k][j] - fm * im[k][j];
        im[i][j] -= fr * im[k][j] + fm * re[k][j];
      }
    }
  }
}

static inline void solve_complex(double re[N][N], double im[N][N], const int pivot[N], double *br, double *bm) {
  for (int k = 0; k < N; ++k) {
    const int p = pivot[k];
    const double r = br[p], m = bm[p];
    br[p] = br[k], bm[p] = bm[k], br[k] = r, bm[k] = m;
  }
  for (int i = 1; i < N; ++i) for (int j = 0; j < i; ++j) {
    br[i] -= re[i][j] * br[j] - im[i][j] * bm[j];
    bm[i] -= re[i][j] * bm[j] + im[i][j] * br[j];
  }
  for (int i = N - 1; i >= 0; --i) {
    for (int j = i + 1; j < N; ++j) {
      br[i] -= re[i][j] * br[j] - im[i][j] * bm[j];
      bm[i] -= re[i][j] * bm[j] + im[i][j] * br[j];
    }
    const double r = br[i] * re[i][i] - bm[i] * im[i][i];
    bm[i] = br[i] * im[i][i] + bm[i] * re[i][i], br[i] = r;
  }
}

/* The factor of the next step from this error and the last one (Gustafsson). */
static inline double predicted(double h, double h_before, double error, double error_before) {
  if (error == 0.0) return INFINITY;
  const double trend = error_before <= 0.0 ? 1.0 : h / h_before * pow(error_before / error, 0.25);
  return fmin(1.0, trend) * pow(error, -0.25);
}

int radau(const double *x0, double end, double rtol, double atol, double step, const double *times, long count,
          double *out, struct statistics *made) {
  static const double C1 = (4 - SQRT6) / 10, C2 = (4 + SQRT6) / 10;
  static const double REAL = 3.637834252744496, RE = 2.6810828736277523, IM = -3.050430199247411;
  static const double T[2][2] = {{0.09443876248897524, -0.14125529502095421},
                                 {0.25021312296533332, 0.20412935229379994}};
  static const double T13 = 0.03002919410514742, T23 = -0.38294211275726192;
  static const double TI[3][3] = {{4.17871859155190428, 0.32768282076106237, 0.52337644549944951},
                                  {-4.17871859155190428, -0.32768282076106237, 0.47662355450055044},
                                  {0.50287263494578682, -2.57192694985560522, 0.59603920482822492}};
  const double begun = now();
  const double newton = fmax(10 * 2.220446049250313e-16 / rtol, fmin(0.03, sqrt(rtol)));
  long evaluations = 2, accepted = 0, rejected = 0, next = 0;
  double t = 0.0, x[N], f[N], scale[N], J[N][N], A[N][N], CR[N][N], CI[N][N];
  double Z[3][N], W[3][N], F[3][N], q[3][N] = {{0.0}};
  double h_before = 0.0, error_before = 0.0, length = 0.0;
  int P[N], PC[N], fresh = 1, factored = 0;
  EACH x[i] = x0[i];
  rhs(x, f);
  double h = step > 0.0 ? step : first_step(x, f, end, 3.0, rtol, atol);
  jacobian(x, J);
  for (; next < count && times[next] <= 0.0; ++next) EACH_OUTPUT out[next * NQ + i] = x[i];
  while (t < end) {
    const double proposed = h;
    double after, error, rate = 0.0, y[N], g[N], safety;
    int iterations = 0, again = 0;
    for (;;) {
      if (!(h >= 10.0 * (nextafter(t, INFINITY) - t))) return 2;
      after = t + h;
      if (after > end) after = end, h = end - t, factored = 0;
      const double nodes[3] = {C1, C2, 1.0};
      for (int k = 0; k < 3; ++k) {
        if (length == 0.0) {
          EACH Z[k][i] = 0.0;
        } else { /* the last step's cubic, extrapolated, less its value here */
          const double s = 1.0 + nodes[k] * h / length;
          EACH Z[k][i] = s * (q[0][i] + s * (q[1][i] + s * q[2][i])) - (q[0][i] + q[1][i] + q[2][i]);
        }
      }
      EACH scale[i] = atol + fabs(x[i]) * rtol;
      int converged = 0;
      for (;;) {
        if (!factored) {
          for (int i = 0; i < N; ++i) for (int j = 0; j < N; ++j) A[i][j] = CR[i][j] = -J[i][j], CI[i][j] = 0.0;
          EACH A[i][i] += REAL / h, CR[i][i] += RE / h, CI[i][i] = IM / h;
          factorise(A, P);
          factorise_complex(CR, CI, PC);
          factored = 1;
        }
        double start[3][N], norm_before = -1.0;
        for (int k = 0; k < 3; ++k) EACH start[k][i] = Z[k][i];
        for (int k = 0; k < 3; ++k) EACH W[k][i] = TI[k][0] * Z[0][i] + TI[k][1] * Z[1][i] + TI[k][2] * Z[2][i];
        rate = -1.0;
        for (iterations = 1; iterations <= 6; ++iterations) {
          double a[N], br[N], bm[N], sum = 0.0;
          for (int k = 0; k < 3; ++k) {
            EACH g[i] = x[i] + Z[k][i];
            rhs(g, F[k]);
          }
          evaluations += 3;
          EACH {
            a[i] = F[0][i] * TI[0][0] + F[1][i] * TI[0][1] + F[2][i] * TI[0][2] - REAL / h * W[0][i];
            br[i] = F[0][i] * TI[1][0] + F[1][i] * TI[1][1] + F[2][i] * TI[1][2] - (RE * W[1][i] - IM * W[2][i]) / h;
            bm[i] = F[0][i] * TI[2][0] + F[1][i] * TI[2][1] + F[2][i] * TI[2][2] - (RE * W[2][i] + IM * W[1][i]) / h;
          }
          solve(A, P, a);
          solve_complex(CR, CI, PC, br, bm);
          EACH sum += (a[i] * a[i] + br[i] * br[i] + bm[i] * bm[i]) / (scale[i] * scale[i]);
          const double norm = sqrt(sum / (3 * N));
          if (isnan(norm)) break;
          if (norm_before > 0.0) {
            rate = norm / norm_before;
            if (rate >= 1.0 || pow(rate, 7 - iterations) / (1.0 - rate) * norm > newton) break;
          }
          EACH {
            W[0][i] += a[i], W[1][i] += br[i], W[2][i] += bm[i];
            Z[0][i] = T[0][0] * W[0][i] + T[0][1] * W[1][i] + T13 * W[2][i];
            Z[1][i] = T[1][0] * W[0][i] + T[1][1] * W[1][i] + T23 * W[2][i];
            Z[2][i] = W[0][i] + W[1][i];
          }
          if (norm == 0.0 || (rate >= 0.0 && rate / (1.0 - rate) * norm < newton)) { converged = 1; break; }
          norm_before = norm;
        }
        if (converged || fresh) break;
        jacobian(x, J), fresh = 1, factored = 0;
        for (int k = 0; k < 3; ++k) EACH Z[k][i] = start[k][i];
      }
      if (!iterations || iterations > 6) iterations = 6;
      if (!converged) {
        h *= 0.5, factored = 0;
        continue;
      }
      double ze[N], e[N];
      EACH {
        y[i] = x[i] + Z[2][i];
        ze[i] = ((-13 - 7 * SQRT6) / 3 * Z[0][i] + (-13 + 7 * SQRT6) / 3 * Z[1][i] - Z[2][i] / 3) / h;
        e[i] = f[i] + ze[i];
        scale[i] = atol + fmax(fabs(x[i]), fabs(y[i])) * rtol;
      }
      solve(A, P, e);
      error = size_of(e, scale);
      safety = 0.9 * 13.0 / (12.0 + iterations);
      if (again && error > 1.0) {
        EACH g[i] = x[i] + e[i];
        rhs(g, e), ++evaluations;
        EACH e[i] += ze[i];
        solve(A, P, e);
        error = size_of(e, scale);
      }
      if (isnan(error)) return 3;
      if (error <= 1.0) break;
      h *= fmax(0.2, safety * predicted(h, h_before, error, error_before)), factored = 0, again = 1, ++rejected;
    }
    const int renew = iterations > 2 && rate > 1e-3;
    double factor = fmin(10.0, safety * predicted(h, h_before, error, error_before));
    if (!renew && factor < 1.2) factor = 1.0; else factored = 0;
    EACH {
      q[0][i] = (13 + 7 * SQRT6) / 3 * Z[0][i] + (13 - 7 * SQRT6) / 3 * Z[1][i] + Z[2][i] / 3;
      q[1][i] = -(23 + 22 * SQRT6) / 3 * Z[0][i] + (-23 + 22 * SQRT6) / 3 * Z[1][i] - 8.0 / 3 * Z[2][i];
      q[2][i] = (10.0 / 3 + 5 * SQRT6) * Z[0][i] + (10.0 / 3 - 5 * SQRT6) * Z[1][i] + 10.0 / 3 * Z[2][i];
    }
    for (; next < count && times[next] <= after; ++next) {
      const double s = (times[next] - t) / h;
      EACH_OUTPUT out[next * NQ + i] = x[i] + s * (q[0][i] + s * (q[1][i] + s * q[2][i]));
    }
    rhs(y, f), ++evaluations;
    EACH x[i] = y[i];
    fresh = renew;
    if (renew) jacobian(x, J);
    h_before = proposed, error_before = error, length = h, t = after, h *= factor, ++accepted;
  }
  *made = (struct statistics){now() - begun, evaluations - (step > 0.0), accepted, rejected};
  return next == count ? 0 : 1;
}
