// Damped least squares for small dense matrices.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace bellcrank {

// The x that minimises |A x - b|² + mu |x|², mu > 0, from the smaller of its two normal equations:
// (AᵀA + mu I) x = Aᵀ b, or x = Aᵀ y with (A Aᵀ + mu I) y = b (Nocedal and Wright, Numerical Optimization, 10.3).
class DampedLeastSquares {
 public:
  // The matrix to fill, a(row, column), before `form`.
  void resize(int rows, int columns) {
    m_ = rows, n_ = columns;
    a_.assign(static_cast<std::size_t>(rows) * columns, 0.0);
  }
  double& a(int row, int column) { return a_[static_cast<std::size_t>(row) * n_ + column]; }

  // Computes A Aᵀ or AᵀA and Aᵀ b; returns the largest entry of the diagonal.
  double form(const double* b) {
    right_.assign(b, b + m_);
    gradient_.assign(n_, 0.0);
    for (int i = 0; i < m_; ++i)
      for (int j = 0; j < n_; ++j) gradient_[j] += a(i, j) * right_[i];
    const int size = std::min(m_, n_);
    normal_.assign(static_cast<std::size_t>(size) * size, 0.0);
    if (m_ <= n_) {
      for (int i = 0; i < m_; ++i)
        for (int k = 0; k <= i; ++k)
          for (int j = 0; j < n_; ++j) normal(i, k) += a(i, j) * a(k, j);
    } else {
      for (int i = 0; i < m_; ++i)
        for (int j = 0; j < n_; ++j)
          if (a(i, j) != 0)
            for (int k = 0; k <= j; ++k) normal(j, k) += a(i, j) * a(i, k);
    }
    double largest = 0;
    for (int i = 0; i < size; ++i) largest = std::max(largest, normal(i, i));
    return largest;
  }

  const std::vector<double>& gradient() const { return gradient_; }  // Aᵀ b (columns)

  // x (columns) for this mu; false where the factorisation breaks down.
  bool solve(double mu, double* x) {
    const int size = std::min(m_, n_);
    factor_ = normal_;
    for (int i = 0; i < size; ++i) factor(i, i) += mu;
    for (int i = 0; i < size; ++i)
      for (int k = 0; k <= i; ++k) {
        double sum = factor(i, k);
        for (int j = 0; j < k; ++j) sum -= factor(i, j) * factor(k, j);
        if (k < i)
          factor(i, k) = sum / factor(k, k);
        else if (sum > 0)
          factor(i, i) = std::sqrt(sum);
        else
          return false;
      }
    y_ = m_ <= n_ ? right_ : gradient_;
    for (int i = 0; i < size; ++i) {
      for (int k = 0; k < i; ++k) y_[i] -= factor(i, k) * y_[k];
      y_[i] /= factor(i, i);
    }
    for (int i = size - 1; i >= 0; --i) {
      for (int k = i + 1; k < size; ++k) y_[i] -= factor(k, i) * y_[k];
      y_[i] /= factor(i, i);
    }
    if (m_ > n_) {
      std::copy(y_.begin(), y_.end(), x);
      return true;
    }
    std::fill(x, x + n_, 0.0);
    for (int i = 0; i < m_; ++i)
      for (int j = 0; j < n_; ++j) x[j] += a(i, j) * y_[i];
    return true;
  }

 private:
  int m_ = 0, n_ = 0;
  std::vector<double> a_, right_, gradient_, normal_, factor_, y_;

  double& normal(int i, int k) { return normal_[static_cast<std::size_t>(i) * std::min(m_, n_) + k]; }
  double& factor(int i, int k) { return factor_[static_cast<std::size_t>(i) * std::min(m_, n_) + k]; }
};

}  // namespace bellcrank
