/* The classical fourth-order method with fixed steps; between steps a cubic through both ends' values and slopes. */
int rk4(const double *x0, double end, double rtol, double atol, double step, const double *times, long count,
        double *out, struct statistics *made) {
  const double begun = now();
  const long steps = (long)ceil(end / step - 1e-9);
  double x[N], y[N], z[N], k1[N], k2[N], k3[N], k4[N], k5[N];
  long next = 0;
  (void)rtol, (void)atol;
  EACH x[i] = x0[i];
  rhs(x, k1);
  for (; next < count && times[next] <= 0.0; ++next) EACH_OUTPUT out[next * NQ + i] = x[i];
  for (long n = 0; n < steps; ++n) {
    const double t = n * step, after = n + 1 == steps ? end : (n + 1) * step, h = after - t;
    EACH y[i] = x[i] + 0.5 * h * k1[i];
    rhs(y, k2);
    EACH y[i] = x[i] + 0.5 * h * k2[i];
    rhs(y, k3);
    EACH y[i] = x[i] + h * k3[i];
    rhs(y, k4);
    EACH z[i] = x[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    rhs(z, k5);
    for (; next < count && times[next] <= after; ++next) {
      const double s = (times[next] - t) / h;
      EACH_OUTPUT {
        const double rise = z[i] - x[i];
        const double bend = (1.0 - 2.0 * s) * rise + h * ((s - 1.0) * k1[i] + s * k5[i]);
        out[next * NQ + i] = x[i] + s * (rise + (s - 1.0) * bend);
      }
    }
    EACH x[i] = z[i];
    EACH k1[i] = k5[i];
  }
  *made = (struct statistics){now() - begun, 4 * steps + 1, steps, 0};
  return next == count ? 0 : 1;
}
