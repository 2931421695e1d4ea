/* Dormand and Prince's pair of orders 5 and 4 with its last stage reused, and Shampine's quartic between steps
   (coefficients: Dormand, Prince, J. Comp. Appl. Math. 6 (1980) 19; Shampine, Math. Comp. 46 (1986) 135). */
int rk45(const double *x0, double end, double rtol, double atol, double step, const double *times, long count,
         double *out, struct statistics *made) {
  const double begun = now();
  long evaluations = 2, accepted = 0, rejected = 0, next = 0;
  int again = 0;
  double t = 0.0, x[N], y[N], z[N], scale[N], k1[N], k2[N], k3[N], k4[N], k5[N], k6[N], k7[N];
  EACH x[i] = x0[i];
  rhs(x, k1);
  double h = step > 0.0 ? step : first_step(x, k1, end, 4.0, rtol, atol);
  for (; next < count && times[next] <= 0.0; ++next) EACH_OUTPUT out[next * NQ + i] = x[i];
  while (t < end) {
    if (h < 10.0 * (nextafter(t, INFINITY) - t)) return 2;
    double after = t + h;
    if (after > end) after = end, h = end - t;
    EACH y[i] = x[i] + h * ((1.0 / 5.0) * k1[i]);
    rhs(y, k2);
    EACH y[i] = x[i] + h * ((3.0 / 40.0) * k1[i] + (9.0 / 40.0) * k2[i]);
    rhs(y, k3);
    EACH y[i] = x[i] + h * ((44.0 / 45.0) * k1[i] - (56.0 / 15.0) * k2[i] + (32.0 / 9.0) * k3[i]);
    rhs(y, k4);
    EACH y[i] = x[i] + h * ((19372.0 / 6561.0) * k1[i] - (25360.0 / 2187.0) * k2[i] + (64448.0 / 6561.0) * k3[i] -
        (212.0 / 729.0) * k4[i]);
    rhs(y, k5);
    EACH y[i] = x[i] + h * ((9017.0 / 3168.0) * k1[i] - (355.0 / 33.0) * k2[i] + (46732.0 / 5247.0) * k3[i] + (49.0 /
        176.0) * k4[i] - (5103.0 / 18656.0) * k5[i]);
    rhs(y, k6);
    EACH z[i] = x[i] + h * ((35.0 / 384.0) * k1[i] + (500.0 / 1113.0) * k3[i] + (125.0 / 192.0) * k4[i] - (2187.0 /
        6784.0) * k5[i] + (11.0 / 84.0) * k6[i]);
    rhs(z, k7);
    evaluations += 6;
    EACH scale[i] = atol + fmax(fabs(x[i]), fabs(z[i])) * rtol;
    EACH y[i] = h * (-(71.0 / 57600.0) * k1[i] + (71.0 / 16695.0) * k3[i] - (71.0 / 1920.0) * k4[i] + (17253.0 /
        339200.0) * k5[i] - (22.0 / 525.0) * k6[i] + (1.0 / 40.0) * k7[i]);
    const double error = size_of(y, scale), factor = factor_of(error, -1.0 / 5.0, again);
    if (!(error < 1.0)) {
      if (isnan(error)) return 3;
      h *= factor, again = 1, ++rejected;
      continue;
    }
    if (next < count && times[next] <= after) {
      double q1[NQ], q2[NQ], q3[NQ], q4[NQ];
      EACH_OUTPUT {
        q1[i] = 1.0 * k1[i];
        q2[i] = -2.8535800653862835 * k1[i] + 4.023133379230305 * k3[i] - 3.7324019615885042 * k4[i] +
            2.5548038301849423 * k5[i] - 1.3744241142186024 * k6[i] + 1.3824689317781436 * k7[i];
        q3[i] = 3.0717434641059005 * k1[i] - 6.249321565289 * k3[i] + 10.068970589843675 * k4[i] - 6.399112377351017 *
            k5[i] + 3.272657752246729 * k6[i] - 3.764937863556287 * k7[i];
        q4[i] = -1.1270175653862835 * k1[i] + 2.675424484351598 * k3[i] - 5.685526961588504 * k4[i] +
            3.5219323679207912 * k5[i] - 1.7672812570757455 * k6[i] + 2.382468931778144 * k7[i];
      }
      for (; next < count && times[next] <= after; ++next) {
        const double d = times[next] - t, s = d / h;
        EACH_OUTPUT out[next * NQ + i] = x[i] + d * (q1[i] + s * (q2[i] + s * (q3[i] + s * q4[i])));
      }
    }
    t = after, h *= factor, again = 0, ++accepted;
    EACH x[i] = z[i];
    EACH k1[i] = k7[i];
  }
  *made = (struct statistics){now() - begun, evaluations - (step > 0.0), accepted, rejected};
  return next == count ? 0 : 1;
}
