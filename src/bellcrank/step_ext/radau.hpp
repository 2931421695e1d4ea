// Radau IIA of order 5: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, sec. IV.8. Simplified Newton
// iterations on the transformed stages need one real and one complex factorisation; both and the Jacobian are kept
// while they serve.
#pragma once

#include "control.hpp"
#include "linear.hpp"
#include "tableaus.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

class Radau {
 public:
  explicit Radau(Rhs& rhs)
      : rhs_(rhs), p_(rhs.problem), n_(p_.n), rows_(n_ > p_.lanes ? n_ : p_.lanes), x_(n_), old_(n_), f_(n_),
        stage_(n_), scale_(n_), error_(n_), base_(n_), q_(3 * n_), z_(3 * n_), w_(3 * n_), dw_(3 * n_), slopes_(3 * n_),
        jacobian_(static_cast<std::size_t>(rows_) * n_), seeds_(p_.jacobian ? 0 : static_cast<std::size_t>(rows_) * n_),
        real_(n_), complex_(n_), in_(stage_, rhs) {
    std::memcpy(x_, p_.x0, n_ * sizeof(double));
    rhs_.normalise(x_);
    t = t_old = p_.t0;
    if (!p_.jacobian)
      for (int i = 0; i < n_; ++i) seeds_[static_cast<std::size_t>(i) * (n_ + 1)] = 1;
  }

  double t, t_old;
  std::int64_t rejected = 0;
  void add_counts(Counts& counts) const {
    counts.rejected = rejected;
    counts.jacobians = jacobians_;
    counts.factorisations = factorisations_;
  }
  const double* state() const { return x_; }
  const double* old_state() const { return old_; }

  bool begin() {
    if (!slope(x_, t, f_)) return false;
    dense_h_ = 0;  // what lies before a stop says nothing of what follows
    return renew_jacobian(t, x_);
  }

  void choose_step(double bound) {
    next_ = p_.first_step > 0 ? p_.first_step : first_step(rhs_, t, x_, f_, bound, RadauIIA::estimator);
  }

  Outcome advance(double bound) {
    begin_step();
    const double least = 10 * spacing(t_old);
    double h = next_;
    if (h > p_.max_step || h < least) {
      h = h < least ? least : p_.max_step;
      last_h_ = 0;
    }
    const double planned = h;
    bool again = false, bad = false;
    for (;; ++rejected) {
      if (h < least) return give_up(bad ? Outcome::non_finite : Outcome::too_small);
      if (rhs_.spent()) return give_up(Outcome::spent);
      double end = t_old + h;
      if (end > bound) end = bound;
      h = end - t_old;
      tolerances(old_, old_);
      Newton newton{};
      for (;;) {
        extrapolate(h);
        newton = factors(h) ? iterate(h) : Newton{};
        if (newton.converged || jacobian_is_new_) break;
        if (!renew_jacobian(t_old, old_)) break;
      }
      bad = newton.bad;
      if (!newton.converged) {
        h *= 0.5;
        continue;
      }
      const double* last = z_ + 2 * n_;
      for (int i = 0; i < n_; ++i) x_[i] = old_[i] + last[i];
      tolerances(old_, x_);
      double error = estimate(h, f_);
      if (again && error > 1) {  // damp the stiff parts of the estimate once more
        for (int i = 0; i < n_; ++i) stage_[i] = old_[i] + error_[i];
        double* out = slopes_;
        ++rhs_.evaluations;
        error = rhs_(in_, t_old, &out) == 0 ? estimate(h, slopes_) : NAN;
      }
      const double careful = safety * (2 * most_iterations + 1) / (2 * most_iterations + newton.iterations);
      const double factor = careful * predicted(h, error);
      rhs_.settle(end, x_);
      if (error <= 1 && slope(x_, end, slopes_)) {
        accept(end, h, error, planned, factor, newton, end == bound && !again);
        return Outcome::accepted;
      }
      bad = !(error > 1 && error < INFINITY);
      h *= bad ? least_factor : larger(least_factor, factor);
      again = true;
    }
  }

  Outcome fixed(double end) {
    begin_step();
    if (rhs_.spent()) return give_up(Outcome::spent);
    const double h = end - t_old;
    Newton newton{};
    for (;;) {
      extrapolate(h);
      newton = factors(h) ? iterate_fully(h) : Newton{};
      if (newton.converged || jacobian_is_new_) break;
      if (!renew_jacobian(t_old, old_)) break;
    }
    if (!newton.converged) return give_up(newton.bad ? Outcome::non_finite : Outcome::too_small);
    for (int i = 0; i < n_; ++i) x_[i] = old_[i] + z_[2 * n_ + i];
    rhs_.settle(end, x_);
    if (!slope(x_, end, slopes_)) return give_up(Outcome::non_finite);
    keep_dense(h);
    std::memcpy(f_, slopes_, n_ * sizeof(double));
    jacobian_is_new_ = false;
    t = end;
    if (newton.iterations > 10 && !renew_jacobian(t, x_)) return give_up(Outcome::non_finite);
    return Outcome::accepted;
  }

  bool prepare() { return true; }
  void sketch(double s, double* x) { interpolate(s, x); }
  void interpolate(double s, double* x) {
    for (int i = 0; i < n_; ++i) x[i] = base_[i] + polynomial(s, i);
    rhs_.settle(dense_t_ + s * dense_h_, x);
  }

  // The step once more with another size, from the same start and with the same Jacobian.
  bool redo(double h, double* x) {
    extrapolate(h, 0);
    if (!factors(h) || !iterate_fully(h, base_).converged) return false;
    for (int i = 0; i < n_; ++i) x[i] = base_[i] + z_[2 * n_ + i];
    rhs_.settle(t_old + h, x);
    return true;
  }

 private:
  static constexpr int most_iterations = 6;
  struct Newton {
    bool converged = false, bad = false;
    int iterations = 0;
    double rate = 0;  // 0: not known
  };

  Rhs& rhs_;
  const Problem& p_;
  int n_, rows_;
  // base_, q_: the start of the last step and its collocation polynomial; z_, w_: stage values less the start
  Buffer x_, old_, f_, stage_, scale_, error_, base_, q_, z_, w_, dw_, slopes_, jacobian_, seeds_;
  RealLu real_;
  ComplexLu complex_;
  Inputs in_;
  double next_ = 0, last_h_ = 0, last_error_ = 0, factor_h_ = 0, dense_t_ = 0, dense_h_ = 0;
  bool jacobian_is_new_ = false;
  std::int64_t jacobians_ = 0, factorisations_ = 0;

  void begin_step() {
    t_old = t;
    std::memcpy(old_, x_, n_ * sizeof(double));
  }
  Outcome give_up(Outcome outcome) {
    std::memcpy(x_, old_, n_ * sizeof(double));
    t = t_old;
    return outcome;
  }

  bool slope(const double* x, double time, double* f) {
    if (x != stage_) std::memcpy(stage_, x, n_ * sizeof(double));
    ++rhs_.evaluations;
    return rhs_(in_, time, &f) == 0 && finite(f, n_);
  }
  static bool finite(const double* v, std::size_t size) {
    double sum = 0;
    for (std::size_t i = 0; i < size; ++i) sum += v[i] * 0.0;
    return sum == 0;
  }

  bool renew_jacobian(double time, const double* x) {
    std::memcpy(stage_, x, n_ * sizeof(double));
    in_.time = smaller(time, rhs_.latest);
    rhs_.signals(in_.time);
    double* out = jacobian_;
    std::int32_t status;
    if (p_.jacobian) {
      status = p_.jacobian(in_.pointers, &out);
    } else {
      const std::int64_t strides[5] = {0, 0, 0, 0, n_};
      in_.pointers[4] = seeds_;
      status = p_.tangent(in_.pointers, &out, strides, rows_);
    }
    ++jacobians_;
    jacobian_is_new_ = true;
    factor_h_ = 0;
    return status == 0 && finite(jacobian_, static_cast<std::size_t>(n_) * n_);
  }

  // Factorises for this step size, unless that was done.
  bool factors(double h) {
    if (std::fabs(factor_h_ - h) <= 1e-4 * h) return true;
    factor_h_ = 0;
    factorisations_ += 2;
    if (!real_.factorise(RadauIIA::mu / h, jacobian_)) return false;
    if (!complex_.factorise(RadauIIA::mu_real / h, -RadauIIA::mu_imaginary / h, jacobian_)) return false;
    factor_h_ = h;
    return true;
  }

  void tolerances(const double* a, const double* b) {
    for (int i = 0; i < n_; ++i) scale_[i] = 1 / (p_.atol + p_.rtol * larger(std::fabs(a[i]), std::fabs(b[i])));
  }
  double norm(const double* v) const {
    double sum = 0;
    for (int i = 0; i < p_.norm_size; ++i) sum += v[i] * scale_[i] * v[i] * scale_[i];
    return std::sqrt(sum / p_.norm_size);
  }

  double polynomial(double s, int i) const {
    return s * (q_[i] + s * (q_[n_ + i] + s * q_[2 * n_ + i]));
  }
  void keep_dense(double h) {
    std::memcpy(base_, old_, n_ * sizeof(double));
    for (int power = 0; power < 3; ++power)
      for (int i = 0; i < n_; ++i) {
        double sum = 0;
        for (int j = 0; j < 3; ++j) sum += z_[j * n_ + i] * RadauIIA::dense[j][power];
        q_[power * n_ + i] = sum;
      }
    dense_t_ = t_old;
    dense_h_ = h;
  }

  // First guess of the stages from the last step's polynomial, less the start of this one.
  void extrapolate(double h) {
    if (dense_h_ == 0) return std::memset(z_, 0, 3 * n_ * sizeof(double)), transform();
    for (int j = 0; j < 3; ++j) {
      const double s = (t_old + RadauIIA::c[j] * h - dense_t_) / dense_h_;
      for (int i = 0; i < n_; ++i) z_[j * n_ + i] = base_[i] + polynomial(s, i) - old_[i];
    }
    transform();
  }
  // The same within the last step, less its own start.
  void extrapolate(double h, int) {
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < n_; ++i) z_[j * n_ + i] = polynomial(RadauIIA::c[j] * h / dense_h_, i);
    transform();
  }
  void transform() {
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < n_; ++i) {
        const double* row = RadauIIA::inverse_T[j];
        w_[j * n_ + i] = row[0] * z_[i] + row[1] * z_[n_ + i] + row[2] * z_[2 * n_ + i];
      }
  }

  // One Newton correction of the stages; false where the right-hand side is not finite.
  bool correct(double h, const double* start) {
    std::int32_t status = 0;
    for (int j = 0; j < 3; ++j) {
      for (int i = 0; i < n_; ++i) stage_[i] = start[i] + z_[j * n_ + i];
      double* out = slopes_ + j * n_;
      status |= rhs_(in_, t_old + RadauIIA::c[j] * h, &out);
    }
    rhs_.evaluations += 3;
    if (status != 0 || !finite(slopes_, 3 * n_)) return false;
    const double mu = RadauIIA::mu / h, re = RadauIIA::mu_real / h, im = -RadauIIA::mu_imaginary / h;
    const auto& R = RadauIIA::inverse_T;
    for (int i = 0; i < n_; ++i) {
      const double a = slopes_[i], b = slopes_[n_ + i], c = slopes_[2 * n_ + i];
      const double w1 = w_[n_ + i], w2 = w_[2 * n_ + i];
      dw_[i] = R[0][0] * a + R[0][1] * b + R[0][2] * c - mu * w_[i];
      dw_[n_ + i] = R[1][0] * a + R[1][1] * b + R[1][2] * c - (re * w1 - im * w2);
      dw_[2 * n_ + i] = R[2][0] * a + R[2][1] * b + R[2][2] * c - (re * w2 + im * w1);
    }
    real_.solve(dw_);
    complex_.solve(dw_ + n_, dw_ + 2 * n_);
    return finite(dw_, 3 * n_);
  }
  double correction() const {
    double sum = 0;
    for (int j = 0; j < 3; ++j) {
      const double part = norm(dw_ + j * n_);
      sum += part * part;
    }
    return std::sqrt(sum / 3);
  }
  void apply() {
    for (int i = 0; i < 3 * n_; ++i) w_[i] += dw_[i];
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < n_; ++i) {
        const double* row = RadauIIA::T[j];
        z_[j * n_ + i] = row[0] * w_[i] + row[1] * w_[n_ + i] + row[2] * w_[2 * n_ + i];
      }
  }

  // Iterations to a fraction of the tolerance, given up as soon as the rate foretells that six will not do.
  Newton iterate(double h) {
    const double tolerance = larger(10 * 2.220446049250313e-16 / p_.rtol, smaller(0.03, std::sqrt(p_.rtol)));
    Newton newton;
    double before = 0;
    for (int k = 0; k < most_iterations; ++k) {
      newton.iterations = k + 1;
      newton.bad = !correct(h, old_);
      if (newton.bad) return newton;
      const double size = correction();
      if (k > 0) {
        newton.rate = size / before;
        if (newton.rate >= 1 ||
            std::pow(newton.rate, most_iterations - k) / (1 - newton.rate) * size > tolerance)
          return newton;
      }
      apply();
      if (size == 0 || (k > 0 && newton.rate / (1 - newton.rate) * size < tolerance)) {
        newton.converged = true;
        return newton;
      }
      before = size;
    }
    return newton;
  }

  // Iterations to rounding, for steps whose size is given.
  Newton iterate_fully(double h) { return iterate_fully(h, old_); }
  Newton iterate_fully(double h, const double* start) {
    Newton newton;
    double before = INFINITY;
    for (int k = 0; k < 50; ++k) {
      newton.iterations = k + 1;
      newton.bad = !correct(h, start);
      if (newton.bad) return newton;
      if (k == 0) sizes(h, start);
      const double size = correction();
      if (size > 2 * before && size > 1e-10) return newton;
      newton.converged = size <= 1e-15 || (size <= 1e-11 && size >= 0.5 * before);  // or as far as rounding lets it
      apply();
      if (newton.converged) return newton;
      before = size;
    }
    return newton;
  }

  // Relative to each entry or its change, and not below a thousandth of the largest.
  void sizes(double h, const double* start) {
    double largest = 1e-300;
    for (int i = 0; i < n_; ++i) {
      scale_[i] = larger(std::fabs(start[i]), h * std::fabs(slopes_[2 * n_ + i]));
      if (i < p_.norm_size) largest = larger(largest, scale_[i]);
    }
    for (int i = 0; i < n_; ++i) scale_[i] = 1 / larger(scale_[i], 1e-3 * largest);
  }

  // Norm of the error estimate (mu / h - J)^-1 (f + sum_i e_i z_i / h), which it leaves in error_.
  double estimate(double h, const double* f) {
    for (int i = 0; i < n_; ++i)
      error_[i] = f[i] + (RadauIIA::e[0] * z_[i] + RadauIIA::e[1] * z_[n_ + i] + RadauIIA::e[2] * z_[2 * n_ + i]) / h;
    real_.solve(error_);
    return norm(error_);
  }

  // The controller that extrapolates the error from the last step and this one.
  double predicted(double h, double error) const {
    if (error == 0) return INFINITY;
    const double trend = last_h_ > 0 ? h / last_h_ * std::pow(last_error_ / error, 0.25) : 1;
    return smaller(1, trend) * std::pow(error, -0.25);
  }

  void accept(double end, double h, double error, double planned, double factor, const Newton& newton, bool clipped) {
    keep_dense(h);
    std::memcpy(f_, slopes_, n_ * sizeof(double));
    t = end;
    const bool renew = newton.iterations > 2 && newton.rate > 1e-3;
    factor = smaller(largest_factor, factor);
    if (!renew && factor < 1.2) factor = 1;
    if (renew && t < p_.t1) renew_jacobian(t, x_);  // not finite: the next step fails, halves, and says so
    else jacobian_is_new_ = false;
    last_h_ = h;
    last_error_ = error;
    next_ = h * factor;
    if (clipped) next_ = larger(next_, planned);
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
