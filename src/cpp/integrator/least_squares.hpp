// Least squares of minimum norm for small dense matrices of any rank. Eigen's complete orthogonal decomposition has no
// second opinion where its pivots leave the rank in doubt; and `_step` depends on no library.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace bellcrank {

// The least x with the least |A x - b|; singular values below `rcond` times the largest count as 0.
//
// A complete orthogonal decomposition (Golub and Van Loan, Matrix Computations, 5.4.2 and 5.5) where its pivots leave no
// doubt about the rank; one-sided Jacobi rotations (8.6.3), which give the singular values, where they do.
class LeastSquares {
 public:
  // The matrix to fill, a(row, column), before each `solve`, which destroys it.
  void resize(int rows, int columns) {
    m_ = rows, n_ = columns;
    a_.assign(static_cast<std::size_t>(rows) * columns, 0.0);
  }
  double& a(int row, int column) { return a_[static_cast<std::size_t>(column) * m_ + row]; }

  void solve(const double* b, double* x, double rcond) {
    const double size = power_of_two(a_.data(), a_.size()), much = power_of_two(b, m_);
    right_.assign(b, b + m_);
    for (double& entry : right_) entry /= much;
    c_ = right_;
    if (size != 1)
      for (double& entry : a_) entry /= size;
    kept_ = a_;
    if (!by_pivots(x)) by_rotations(x, rcond);
    if (much != size)
      for (int j = 0; j < n_; ++j) x[j] *= much / size;
  }

 private:
  static constexpr double FULL = 1e-7, NONE = 1e-13;  // pivots relative to the first: clearly above rcond, clearly rounding
  static constexpr double LARGEST = 1e100, SMALLEST = 1e-100;  // squares of entries between them are finite
  static constexpr int SWEEPS = 60;
  int m_ = 0, n_ = 0;
  std::vector<double> a_, kept_, right_, c_, tau_, v_, tail_;
  std::vector<int> order_;

  double* column(int j) { return a_.data() + static_cast<std::size_t>(j) * m_; }

  static double power_of_two(const double* entries, std::size_t count) {
    double largest = 0;
    for (std::size_t i = 0; i < count; ++i) largest = std::max(largest, std::fabs(entries[i]));
    if (largest == 0 || (SMALLEST <= largest && largest <= LARGEST)) return 1;
    int exponent;
    std::frexp(largest, &exponent);
    return std::ldexp(1.0, std::max(exponent, -1000) - 1);
  }

  static double dot(const double* x, const double* y, int count) {
    double sum = 0;
    for (int i = 0; i < count; ++i) sum += x[i] * y[i];
    return sum;
  }

  // The reflection I - tau v vT, v = (1, tail), that takes (alpha, tail) to (beta, 0); alpha becomes beta.
  static double reflection(double& alpha, double* tail, int count) {
    const double square = dot(tail, tail, count);
    if (square == 0) return 0;
    const double beta = -std::copysign(std::sqrt(alpha * alpha + square), alpha);
    const double tau = (beta - alpha) / beta, scale = 1 / (alpha - beta);
    for (int i = 0; i < count; ++i) tail[i] *= scale;
    alpha = beta;
    return tau;
  }

  // A P = Q [T 0] Z: false where the pivots do not say clearly what the rank is.
  bool by_pivots(double* x) {
    const int most = std::min(m_, n_);
    order_.resize(n_);
    for (int j = 0; j < n_; ++j) order_[j] = j;
    int rank = 0;
    double first = 0;
    for (; rank < most; ++rank) {
      const int k = rank, below = m_ - k - 1;
      int best = k;
      double largest = -1;
      for (int j = k; j < n_; ++j) {
        const double square = dot(column(j) + k, column(j) + k, m_ - k);
        if (square > largest) largest = square, best = j;
      }
      const double pivot = std::sqrt(largest);
      if (k == 0) first = pivot;
      if (pivot <= NONE * first) break;
      if (pivot < FULL * first) return false;
      if (best != k) {
        std::swap_ranges(column(k), column(k) + m_, column(best));
        std::swap(order_[k], order_[best]);
      }
      double* head = column(k) + k;
      const double tau = reflection(*head, head + 1, below);
      if (tau == 0) continue;
      for (int j = k + 1; j < n_; ++j) reflect(column(j) + k, head + 1, tau, below);
      reflect(c_.data() + k, head + 1, tau, below);
    }
    shorten(rank);
    for (int i = rank - 1; i >= 0; --i) {  // T y = c
      double sum = c_[i];
      for (int j = i + 1; j < rank; ++j) sum -= column(j)[i] * v_[j];
      v_[i] = sum / column(i)[i];
    }
    for (int i = 0; i < rank && rank < n_; ++i) {  // Zᵀ (y, 0)
      double sum = v_[i];
      for (int j = rank; j < n_; ++j) sum += column(j)[i] * v_[j];
      sum *= tau_[i];
      v_[i] -= sum;
      for (int j = rank; j < n_; ++j) v_[j] -= sum * column(j)[i];
    }
    for (int j = 0; j < n_; ++j) x[order_[j]] = v_[j];
    return true;
  }

  static void reflect(double* y, const double* tail, double tau, int count) {
    const double sum = tau * (y[0] + dot(tail, y + 1, count));
    y[0] -= sum;
    for (int i = 0; i < count; ++i) y[i + 1] -= sum * tail[i];
  }

  // [R S] = [T 0] Z for the upper `rank` rows; the reflections of Z stay in the columns from `rank` on.
  void shorten(int rank) {
    v_.assign(n_, 0.0);
    tau_.assign(rank, 0.0);
    const int count = n_ - rank;
    tail_.resize(count);
    for (int i = rank - 1; i >= 0 && count > 0; --i) {
      for (int j = 0; j < count; ++j) tail_[j] = column(rank + j)[i];
      const double tau = tau_[i] = reflection(column(i)[i], tail_.data(), count);
      for (int j = 0; j < count; ++j) column(rank + j)[i] = tail_[j];
      for (int row = 0; row < i && tau != 0; ++row) {
        double sum = column(i)[row];
        for (int j = 0; j < count; ++j) sum += column(rank + j)[row] * tail_[j];
        sum *= tau;
        column(i)[row] -= sum;
        for (int j = 0; j < count; ++j) column(rank + j)[row] -= sum * tail_[j];
      }
    }
  }

  // The columns of A, or of Aᵀ where these are fewer, are rotated until they are orthogonal, W = A V or Aᵀ V: their
  // lengths are the singular values.
  void by_rotations(double* x, double rcond) {
    const bool wide = m_ < n_;
    const int tall = wide ? n_ : m_, few = wide ? m_ : n_;
    std::vector<double> w(static_cast<std::size_t>(tall) * few), v(static_cast<std::size_t>(few) * few, 0.0);
    for (int j = 0; j < few; ++j) {
      v[static_cast<std::size_t>(j) * few + j] = 1;
      for (int i = 0; i < tall; ++i)
        w[static_cast<std::size_t>(j) * tall + i] = kept_[static_cast<std::size_t>(wide ? i : j) * m_ + (wide ? j : i)];
    }
    bool turned = true;
    for (int sweep = 0; turned && sweep < SWEEPS; ++sweep) {
      turned = false;
      for (int j = 0; j < few; ++j)
        for (int k = j + 1; k < few; ++k) turned |= orthogonalise(w.data(), v.data(), tall, few, j, k);
    }
    std::vector<double> square(few);
    for (int j = 0; j < few; ++j) square[j] = dot(&w[j * tall], &w[j * tall], tall);
    const double largest = few ? std::sqrt(*std::max_element(square.begin(), square.end())) : 0;
    std::fill(x, x + n_, 0.0);
    for (int j = 0; j < few; ++j) {
      if (!(std::sqrt(square[j]) > rcond * largest)) continue;
      const double* left = (wide ? v.data() : w.data()) + static_cast<std::size_t>(j) * m_;
      const double* right = (wide ? w.data() : v.data()) + static_cast<std::size_t>(j) * n_;
      const double part = dot(left, right_.data(), m_) / square[j];
      for (int i = 0; i < n_; ++i) x[i] += part * right[i];
    }
  }

  // Rotates columns j and k of w, and of v, so that those of w are orthogonal; false where they are.
  static bool orthogonalise(double* w, double* v, int tall, int few, int j, int k) {
    double *a = w + static_cast<std::size_t>(j) * tall, *b = w + static_cast<std::size_t>(k) * tall;
    const double aa = dot(a, a, tall), bb = dot(b, b, tall), ab = dot(a, b, tall);
    if (!(std::fabs(ab) > 1e-15 * std::sqrt(aa * bb))) return false;
    const double zeta = (bb - aa) / (2 * ab);
    const double t = std::copysign(1 / (std::fabs(zeta) + std::hypot(1.0, zeta)), zeta);
    const double cosine = 1 / std::sqrt(1 + t * t), sine = cosine * t;
    rotate(a, b, cosine, sine, tall);
    rotate(v + static_cast<std::size_t>(j) * few, v + static_cast<std::size_t>(k) * few, cosine, sine, few);
    return true;
  }

  static void rotate(double* a, double* b, double cosine, double sine, int count) {
    for (int i = 0; i < count; ++i) {
      const double kept = a[i];
      a[i] = cosine * kept - sine * b[i];
      b[i] = sine * kept + cosine * b[i];
    }
  }
};

}  // namespace bellcrank
