// Dense linear systems, real and complex: LU with partial pivoting, columns contiguous so that every inner loop is a
// vector update. Complex numbers are kept as separate real and imaginary arrays for the same reason.
#pragma once

#include "rhs.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

class RealLu {
 public:
  explicit RealLu(int n) : n_(n), a_(static_cast<std::size_t>(n) * n), pivot_(n) {}

  // Factorises shift I - J; false where it is singular or not finite.
  bool factorise(double shift, const double* jacobian) {
    const std::size_t n = n_;
    for (std::size_t i = 0; i < n * n; ++i) a_[i] = -jacobian[i];
    for (std::size_t i = 0; i < n; ++i) a_[i * (n + 1)] += shift;
    for (std::size_t k = 0; k < n; ++k) {
      double* column = a_ + k * n;
      std::size_t best = k;
      for (std::size_t i = k + 1; i < n; ++i)
        if (std::fabs(column[i]) > std::fabs(column[best])) best = i;
      if (!(std::fabs(column[best]) > 0) || !(std::fabs(column[best]) < INFINITY)) return false;
      pivot_[k] = static_cast<int>(best);
      if (best != k)
        for (std::size_t j = 0; j < n; ++j) swap(a_[k + j * n], a_[best + j * n]);
      const double inverse = 1 / column[k];
      for (std::size_t i = k + 1; i < n; ++i) column[i] *= inverse;
      for (std::size_t j = k + 1; j < n; ++j) subtract(a_ + j * n, column, a_[k + j * n], k + 1);
    }
    return true;
  }

  void solve(double* b) const {
    for (int k = 0; k < n_; ++k) swap(b[k], b[pivot_[k]]);
    for (int k = 0; k < n_; ++k) subtract(b, a_ + static_cast<std::size_t>(k) * n_, b[k], k + 1);
    for (int k = n_ - 1; k >= 0; --k) {
      const double* column = a_ + static_cast<std::size_t>(k) * n_;
      const double value = b[k] /= column[k];
      for (int i = 0; i < k; ++i) b[i] -= column[i] * value;
    }
  }

 private:
  int n_;
  Buffer a_;
  Array<int> pivot_;

  static void swap(double& a, double& b) {
    const double kept = a;
    a = b;
    b = kept;
  }
  void subtract(double* __restrict to, const double* __restrict column, double factor, std::size_t from) const {
    for (std::size_t i = from; i < static_cast<std::size_t>(n_); ++i) to[i] -= column[i] * factor;
  }
};

class ComplexLu {
 public:
  explicit ComplexLu(int n)
      : n_(n), re_(static_cast<std::size_t>(n) * n), im_(static_cast<std::size_t>(n) * n), pivot_(n) {}

  bool factorise(double shift_re, double shift_im, const double* jacobian) {
    const std::size_t n = n_;
    for (std::size_t i = 0; i < n * n; ++i) re_[i] = -jacobian[i], im_[i] = 0;
    for (std::size_t i = 0; i < n; ++i) re_[i * (n + 1)] += shift_re, im_[i * (n + 1)] += shift_im;
    for (std::size_t k = 0; k < n; ++k) {
      double *re = re_ + k * n, *im = im_ + k * n;
      std::size_t best = k;
      double largest = -1;
      for (std::size_t i = k; i < n; ++i) {
        const double size = std::fabs(re[i]) + std::fabs(im[i]);
        if (size > largest) largest = size, best = i;
      }
      if (!(largest > 0) || !(largest < INFINITY)) return false;
      pivot_[k] = static_cast<int>(best);
      if (best != k)
        for (std::size_t j = 0; j < n; ++j) {
          swap(re_[k + j * n], re_[best + j * n]);
          swap(im_[k + j * n], im_[best + j * n]);
        }
      const double square = re[k] * re[k] + im[k] * im[k];
      const double inverse_re = re[k] / square, inverse_im = -im[k] / square;
      for (std::size_t i = k + 1; i < n; ++i) {
        const double value = re[i];
        re[i] = value * inverse_re - im[i] * inverse_im;
        im[i] = value * inverse_im + im[i] * inverse_re;
      }
      for (std::size_t j = k + 1; j < n; ++j)
        subtract(re_ + j * n, im_ + j * n, re, im, re_[k + j * n], im_[k + j * n], k + 1, n);
    }
    return true;
  }

  void solve(double* b_re, double* b_im) const {
    for (int k = 0; k < n_; ++k) {
      swap(b_re[k], b_re[pivot_[k]]);
      swap(b_im[k], b_im[pivot_[k]]);
    }
    for (int k = 0; k < n_; ++k) {
      const std::size_t start = static_cast<std::size_t>(k) * n_;
      subtract(b_re, b_im, re_ + start, im_ + start, b_re[k], b_im[k], k + 1, n_);
    }
    for (int k = n_ - 1; k >= 0; --k) {
      const std::size_t start = static_cast<std::size_t>(k) * n_;
      const double d_re = re_[start + k], d_im = im_[start + k], square = d_re * d_re + d_im * d_im;
      const double value = (b_re[k] * d_re + b_im[k] * d_im) / square;
      b_im[k] = (b_im[k] * d_re - b_re[k] * d_im) / square;
      b_re[k] = value;
      subtract(b_re, b_im, re_ + start, im_ + start, b_re[k], b_im[k], 0, k);
    }
  }

 private:
  int n_;
  Buffer re_, im_;
  Array<int> pivot_;

  static void swap(double& a, double& b) {
    const double kept = a;
    a = b;
    b = kept;
  }
  static void subtract(double* __restrict to_re, double* __restrict to_im, const double* __restrict re,
                       const double* __restrict im, double factor_re, double factor_im, std::size_t from,
                       std::size_t end) {
    for (std::size_t i = from; i < end; ++i) {
      to_re[i] -= re[i] * factor_re - im[i] * factor_im;
      to_im[i] -= re[i] * factor_im + im[i] * factor_re;
    }
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
