// The stage equations of Radau IIA, solved by simplified Newton iterations: E. Hairer, G. Wanner, Solving Ordinary
// Differential Equations II, sec. IV.8. In transformed stages they take one real and one complex factorisation; both and
// the Jacobian are reused while Newton's method converges. Equations are multiplied by the step size for scaling.
#pragma once

#include "step_size_control.hpp"
#include "stage_matrices.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

struct Newton {
  bool converged = false, bad = false;  // bad: a slope or correction was not finite
  int iterations = 0;
  double rate = 0;  // 0: not known
};

template <int Blocks>
class StageEquations {
 public:
  static constexpr int most_iterations = 6;

  explicit StageEquations(Rhs& rhs)
      : rhs_(rhs), p_(rhs.problem), kernels_(p_.derivatives->kernels()), n_(p_.n), blocks_((n_ + 3) / 4),
        rows_(n_ > kernels_.lanes ? n_ : kernels_.lanes),
        x_(lanes()), scale_(lanes()), tolerance_(lanes()), error_(lanes()), z_(3 * lanes()), w_(3 * lanes()),
        right_(3 * lanes()), change_(3 * lanes()), slopes_(3 * lanes()),
        jacobian_(static_cast<std::size_t>(rows_) * n_), seeds_(kernels_.jacobian ? 0 : static_cast<std::size_t>(rows_) * n_),
        matrices_(p_), in_(x_, rhs) {
    for (int i = 0; i < static_cast<int>(lanes()); ++i) tolerance_[i] = i < p_.norm_size ? p_.atol : INFINITY;
    if (!kernels_.jacobian)
      for (int i = 0; i < n_; ++i) seeds_[static_cast<std::size_t>(i) * (n_ + 1)] = 1;
  }

  std::int64_t jacobians = 0, factorisations = 0;
  bool jacobian_is_new = false;

  int blocks() const { return Blocks ? Blocks : blocks_; }
  std::size_t lanes() const { return 4 * static_cast<std::size_t>(blocks()); }
  double* stages() { return z_; }  // three stages less the start
  const double* jacobian() const { return jacobian_; }
  const double* last() const { return z_ + 2 * lanes(); }
  double* error() { return error_; }

  bool slope(const double* x, double time, double* f) {
    copy(x_, x);
    ++rhs_.evaluations;
    return rhs_(in_, time, &f) == 0 && finite(f, n_);
  }

  bool renew_jacobian(double time, const double* x) {
    copy(x_, x);
    in_.time = smaller(time, rhs_.latest);
    rhs_.signals(in_.time);
    double* out = jacobian_;
    std::int32_t status;
    if (kernels_.jacobian) {
      status = kernels_.jacobian(in_.pointers, &out);
    } else {
      const std::int64_t strides[5] = {0, 0, 0, 0, n_};
      in_.pointers[4] = seeds_;
      status = kernels_.tangent(in_.pointers, &out, strides, rows_);
      in_.pointers[4] = rhs_.rest();
    }
    ++jacobians;
    jacobian_is_new = true;
    factor_h_ = 0;
    return status == 0 && finite(jacobian_, static_cast<std::size_t>(n_) * n_);
  }

  // Factorises for this step size, unless that was done.
  bool factors(double h) {
    if (factor_h_ > 0 && std::fabs(factor_h_ - h) <= 1e-4 * h) return true;
    factor_h_ = 0;
    factorisations += 2;
    if (!matrices_.factorise(h, jacobian_)) return false;
    factor_h_ = h;
    return true;
  }

  // Scales of the error norm, from the tolerances and the larger of two states; entries outside it count nothing.
  void tolerances(const double* a, const double* b) {
    for (int i = 0; i < blocks(); ++i) {
      const Lanes size_a = magnitude(at(a + 4 * i)), size_b = magnitude(at(b + 4 * i));
      at(scale_ + 4 * i) = 1.0 / (at(tolerance_ + 4 * i) + p_.rtol * (size_a > size_b ? size_a : size_b));
    }
  }

  // Iterates to a fraction of the tolerance; gives up as soon as the rate shows that six iterations will not suffice.
  Newton iterate(double t, double h, const double* start) {
    const double tolerance = larger(10 * 2.220446049250313e-16 / p_.rtol, smaller(0.03, std::sqrt(p_.rtol)));
    Newton newton;
    double before = 0;
    transform();
    for (int k = 0; k < most_iterations; ++k) {
      newton.iterations = k + 1;
      if (evaluate(t, h, start) != 0) return newton.bad = true, newton;
      solve(h);
      const double size = correction();
      newton.bad = !(size < INFINITY);
      if (newton.bad) return newton;
      if (k > 0) {
        newton.rate = size / before;
        double left = size / (1 - newton.rate);
        for (int i = k; i < most_iterations; ++i) left *= newton.rate;
        if (newton.rate >= 1 || left > tolerance) return newton;
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

  // Iterates to rounding error, for steps of a given size.
  Newton iterate_fully(double t, double h, const double* start) {
    Newton newton;
    double before = INFINITY;
    transform();
    for (int k = 0; k < 50; ++k) {
      newton.iterations = k + 1;
      if (evaluate(t, h, start) != 0) return newton.bad = true, newton;
      if (k == 0) sizes(h, start);
      solve(h);
      const double size = correction();
      newton.bad = !(size < INFINITY);
      if (newton.bad || (size > 2 * before && size > 1e-10)) return newton;
      newton.converged = size <= 1e-15 || (size <= 1e-11 && size >= 0.5 * before);  // or as far as rounding allows
      apply();
      if (newton.converged) return newton;
      before = size;
    }
    return newton;
  }

  // Norm of the error estimate (mu - h J)^-1 (h f + sum_i e_i z_i), which it leaves in error().
  double estimate(double h, const double* f) {
    const std::size_t w = lanes();
    for (int b = 0; b < blocks(); ++b) {
      const double* z = z_ + 4 * b;
      at(right_ + 4 * b) =
          h * at(f + 4 * b) + (RadauIIA::e[0] * at(z) + RadauIIA::e[1] * at(z + w) + RadauIIA::e[2] * at(z + 2 * w));
    }
    matrices_.solve(right_, error_);
    return norm(error_, 1);
  }

 private:
  Rhs& rhs_;
  const Problem& p_;
  const DerivativeKernels kernels_;
  int n_, blocks_, rows_;
  Buffer x_, scale_, tolerance_, error_, z_, w_, right_, change_, slopes_, jacobian_, seeds_;
  StageMatrices<Blocks> matrices_;
  Inputs in_;
  double factor_h_ = 0;

  void copy(double* to, const double* from) const {
    for (int b = 0; b < blocks(); ++b) at(to + 4 * b) = at(from + 4 * b);
  }
  static bool finite(const double* v, std::size_t size) {
    double sum = 0;
    for (std::size_t i = 0; i < size; ++i) sum += v[i] * 0.0;
    return sum == 0;
  }

  // Root mean square of the first `rows` rows of v, divided by the scales.
  BELLCRANK_INLINE double norm(const double* v, int rows) const {
    Lanes sum = {};
    for (int b = 0; b < blocks(); ++b)
      for (int j = 0; j < rows; ++j) {
        const Lanes part = at(v + j * lanes() + 4 * b) * at(scale_ + 4 * b);
        sum += part * part;
      }
    return std::sqrt(total(sum) / (rows * p_.norm_size));
  }
  double correction() const { return norm(change_, 3); }

  void transform() { times(RadauIIA::inverse_T, z_, w_); }
  BELLCRANK_INLINE void times(const double (&matrix)[3][3], const double* from, double* to) const {
    const std::size_t w = lanes();
    for (int b = 0; b < blocks(); ++b) {
      const Lanes x = at(from + 4 * b), y = at(from + w + 4 * b), z = at(from + 2 * w + 4 * b);
      for (int j = 0; j < 3; ++j) at(to + j * w + 4 * b) = matrix[j][0] * x + matrix[j][1] * y + matrix[j][2] * z;
    }
  }

  std::int32_t evaluate(double t, double h, const double* start) {
    std::int32_t status = 0;
    const std::size_t w = lanes();
    for (int j = 0; j < 3; ++j) {
      for (int b = 0; b < blocks(); ++b) at(x_ + 4 * b) = at(start + 4 * b) + at(z_ + j * w + 4 * b);
      double* out = slopes_ + j * w;
      status |= rhs_(in_, t + RadauIIA::c[j] * h, &out);
    }
    rhs_.evaluations += 3;
    return status;
  }

  // One Newton correction of the transformed stages.
  void solve(double h) {
    constexpr double mu = RadauIIA::mu, re = RadauIIA::mu_real, im = -RadauIIA::mu_imaginary;
    constexpr auto& R = RadauIIA::inverse_T;
    const std::size_t w = lanes();
    for (int i = 0; i < blocks(); ++i) {
      const double *f = slopes_ + 4 * i, *v = w_ + 4 * i;
      double* r = right_ + 4 * i;
      const Lanes a = h * slope_lanes(f), b = h * slope_lanes(f + w), c = h * slope_lanes(f + 2 * w);
      const Lanes w0 = at(v), w1 = at(v + w), w2 = at(v + 2 * w);
      at(r) = R[0][0] * a + R[0][1] * b + R[0][2] * c - mu * w0;
      at(r + w) = R[1][0] * a + R[1][1] * b + R[1][2] * c - (re * w1 - im * w2);
      at(r + 2 * w) = R[2][0] * a + R[2][1] * b + R[2][2] * c - (re * w2 + im * w1);
    }
    matrices_.solve(right_, change_);
    matrices_.solve(right_ + w, right_ + 2 * w, change_ + w, change_ + 2 * w);
  }
  BELLCRANK_INLINE Lanes slope_lanes(const double* f) const { return Blocks ? fresh(f) : at(f); }

  void apply() {
    for (std::size_t i = 0; i < 3 * lanes(); i += 4) at(w_ + i) += at(change_ + i);
    times(RadauIIA::T, w_, z_);
  }

  // Scales relative to each entry or its change, and not below a thousandth of the largest.
  void sizes(double h, const double* start) {
    double largest = 1e-300;
    for (int i = 0; i < p_.norm_size; ++i) {
      scale_[i] = larger(std::fabs(start[i]), h * std::fabs(slopes_[2 * lanes() + i]));
      largest = larger(largest, scale_[i]);
    }
    for (std::size_t i = 0; i < lanes(); ++i)
      scale_[i] = static_cast<int>(i) < p_.norm_size ? 1 / larger(scale_[i], 1e-3 * largest) : 0;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
