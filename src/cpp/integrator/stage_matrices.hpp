// The two matrices of the transformed stages of Radau IIA, (mu - h J) and (mu_re - i mu_im - h J): solved whole, or reduced
// to the velocities where that is less work.
#pragma once

#include "reduced_linear_solver.hpp"
#include "runge_kutta_tableaus.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// Whole matrices of up to 12 rows stay in registers; larger ones take a number of rows that is known at run time.
template <int Blocks>
class StageMatrices {
 public:
  explicit StageMatrices(const Problem& p) : real_(p.n), complex_(p.n) {}
  bool factorise(double h, const double* jacobian) {
    return real_.factorise(RadauIIA::mu, h, jacobian) &&
           complex_.factorise(RadauIIA::mu_real, -RadauIIA::mu_imaginary, h, jacobian);
  }
  BELLCRANK_INLINE void solve(const double* b, double* x) { real_.solve(b, x); }
  BELLCRANK_INLINE void solve(const double* b_re, const double* b_im, double* x_re, double* x_im) {
    complex_.solve(b_re, b_im, x_re, x_im);
  }

 private:
  RealLu<Blocks> real_;
  ComplexLu<Blocks> complex_;
};

class ReducedStageMatrices {
 public:
  explicit ReducedStageMatrices(const Problem& p) : real_(p), complex_(p) {}
  bool factorise(double h, const double* jacobian) {
    return real_.factorise(RadauIIA::mu, h, jacobian) &&
           complex_.factorise({RadauIIA::mu_real, -RadauIIA::mu_imaginary}, h, jacobian);
  }
  void solve(const double* b, double* x) { real_.solve({const_cast<double*>(b), 0}, {x, 0}); }
  void solve(const double* b_re, const double* b_im, double* x_re, double* x_im) {
    complex_.solve({const_cast<double*>(b_re), const_cast<double*>(b_im)}, {x_re, x_im});
  }

 private:
  ReducedSolver<RealView> real_;
  ReducedSolver<ComplexView> complex_;
};

template <>
class StageMatrices<0> {
 public:
  explicit StageMatrices(const Problem& p)
      : reduced_(p.joints ? new ReducedStageMatrices(p) : nullptr), real_(reduced_ ? 0 : p.n),
        complex_(reduced_ ? 0 : p.n) {}
  ~StageMatrices() { delete reduced_; }
  StageMatrices(const StageMatrices&) = delete;
  StageMatrices& operator=(const StageMatrices&) = delete;
  bool factorise(double h, const double* jacobian) {
    if (reduced_) return reduced_->factorise(h, jacobian);
    return real_.factorise(RadauIIA::mu, h, jacobian) &&
           complex_.factorise(RadauIIA::mu_real, -RadauIIA::mu_imaginary, h, jacobian);
  }
  void solve(const double* b, double* x) { reduced_ ? reduced_->solve(b, x) : real_.solve(b, x); }
  void solve(const double* b_re, const double* b_im, double* x_re, double* x_im) {
    reduced_ ? reduced_->solve(b_re, b_im, x_re, x_im) : complex_.solve(b_re, b_im, x_re, x_im);
  }

 private:
  ReducedStageMatrices* const reduced_;
  RealLu<0> real_;
  ComplexLu<0> complex_;
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
