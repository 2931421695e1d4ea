// Dense linear systems, real and complex: LU with partial pivoting, L D U with unit diagonals in L and U. Columns are
// padded with zeros to whole SIMD lanes, so that each step of a substitution is one multiplication of whole lanes.
// `Blocks` fixes their number at compile time (0: any number); a solution then stays in registers. Real and imaginary
// parts are stored in separate arrays. Eigen has neither such columns nor such parts, and `_step` depends on no library.
#pragma once

#include <utility>

#include "simd_lanes.hpp"
#include "right_hand_side.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// Sizes, and the order in which rows became pivots.
template <int Blocks>
class Pivots {
 protected:
  explicit Pivots(int n) : n_(n), blocks_((n + 3) / 4), order_(stride()) {}

  int n_, blocks_;
  Array<int> order_;

  int blocks() const { return Blocks ? Blocks : blocks_; }
  std::size_t stride() const { return 4 * static_cast<std::size_t>(blocks()); }
  void start() {
    for (std::size_t i = 0; i < stride(); ++i) order_[i] = static_cast<int>(i);
  }
  static void swap(double& a, double& b) {
    const double kept = a;
    a = b;
    b = kept;
  }
  // Exchanges rows i and k of a.
  void exchange(double* a, int i, int k) const {
    for (int j = 0; j < n_; ++j) swap(a[j * stride() + i], a[j * stride() + k]);
  }
  void note(int i, int k) {
    const int kept = order_[i];
    order_[i] = order_[k];
    order_[k] = kept;
  }
  BELLCRANK_INLINE Lanes ordered(const double* b, int block) const {
    const int* o = order_ + 4 * block;
    return Lanes{b[o[0]], b[o[1]], b[o[2]], b[o[3]]};
  }

  // step(k) for the columns in order and against it, unrolled where their number is known.
  template <class Step>
  BELLCRANK_INLINE void upwards(const Step& step) const {
    if constexpr (Blocks > 0) unrolled(step, std::make_integer_sequence<int, 4 * Blocks>{}, 0, 1);
    else for (int k = 0; k < n_; ++k) step(k);
  }
  template <class Step>
  BELLCRANK_INLINE void downwards(const Step& step) const {
    if constexpr (Blocks > 0) unrolled(step, std::make_integer_sequence<int, 4 * Blocks - 1>{}, 4 * Blocks - 1, -1);
    else for (int k = n_ - 1; k > 0; --k) step(k);
  }

 private:
  template <class Step, int... K>
  BELLCRANK_INLINE void unrolled(const Step& step, std::integer_sequence<int, K...>, int from, int sign) const {
    ((from + sign * K < n_ ? step(from + sign * K) : void()), ...);
  }
};

template <int Blocks>
class RealLu : Pivots<Blocks> {
  using Base = Pivots<Blocks>;
  using Base::blocks, Base::n_, Base::stride;

 public:
  explicit RealLu(int n) : Base(n), lower_(n * stride()), upper_(n * stride()), inverse_(stride()) {}

  // Room for the matrix, column by column, each of whole lanes; factorise() overwrites it.
  double* matrix() { return lower_; }

  // Factorises shift I - h J; false where it is singular or not finite.
  bool factorise(double shift, double h, const double* jacobian) {
    double* a = lower_;
    const std::size_t w = stride();
    for (int j = 0; j < n_; ++j)
      for (int i = 0; i < n_; ++i) a[j * w + i] = (i == j ? shift : 0) - h * jacobian[j * n_ + i];
    return factorise();
  }
  // Not inlined: the compiler fuses products and sums within a function, and a result must not depend on its callers.
  __attribute__((noinline)) bool factorise() {
    Base::start();
    double* a = lower_;
    const std::size_t w = stride();
    for (int k = 0; k < n_; ++k) {
      double* column = a + k * w;
      int best = k;
      for (int i = k + 1; i < n_; ++i)
        if (std::fabs(column[i]) > std::fabs(column[best])) best = i;
      if (!(std::fabs(column[best]) > 0) || !(std::fabs(column[best]) < INFINITY)) return false;
      Base::exchange(a, k, best);
      Base::note(k, best);
      inverse_[k] = 1 / column[k];
      for (int i = 0; i < n_; ++i) {
        upper_[k * w + i] = i < k ? column[i] * inverse_[i] : 0;
        column[i] = i > k ? column[i] * inverse_[k] : 0;
      }
      for (int j = k + 1; j < n_; ++j) subtract(a + j * w, column, a[j * w + k], k);
    }
    return true;
  }

  // x = (shift I - h J)^-1 b; x and b must not overlap.
  BELLCRANK_INLINE void solve(const double* b, double* x) const {
    const std::size_t w = stride();
    Lanes registers[Blocks ? Blocks : 1];
    Lanes* v = Blocks ? registers : &at(x);
    for (int i = 0; i < blocks(); ++i) v[i] = Base::ordered(b, i);
    Base::upwards([&](int k) BELLCRANK_INLINED {
      const double value = v[k / 4][k % 4];
      for (int i = k / 4; i < blocks(); ++i) v[i] -= at(lower_ + k * w + 4 * i) * value;
    });
    for (int i = 0; i < blocks(); ++i) v[i] *= at(inverse_ + 4 * i);
    Base::downwards([&](int k) BELLCRANK_INLINED {
      const double value = v[k / 4][k % 4];
      for (int i = 0; i <= k / 4; ++i) v[i] -= at(upper_ + k * w + 4 * i) * value;
    });
    if (Blocks)
      for (int i = 0; i < blocks(); ++i) at(x + 4 * i) = v[i];
  }

 private:
  Buffer lower_, upper_, inverse_;

  void subtract(double* __restrict to, const double* __restrict column, double factor, int from) const {
    for (int i = from / 4; i < blocks(); ++i) at(to + 4 * i) -= at(column + 4 * i) * factor;
  }
};

template <int Blocks>
class ComplexLu : Pivots<Blocks> {
  using Base = Pivots<Blocks>;
  using Base::blocks, Base::n_, Base::stride;

 public:
  explicit ComplexLu(int n) : Base(n), lower_(n * stride()), upper_(n * stride()), inverse_(stride()) {}

  double* matrix() { return lower_.re; }
  double* imaginary_matrix() { return lower_.im; }

  // Factorises (re + i im) I - h J.
  bool factorise(double re, double im, double h, const double* jacobian) {
    double *a = lower_.re, *b = lower_.im;
    const std::size_t w = stride();
    for (int j = 0; j < n_; ++j)
      for (int i = 0; i < n_; ++i) {
        a[j * w + i] = (i == j ? re : 0) - h * jacobian[j * n_ + i];
        b[j * w + i] = i == j ? im : 0;
      }
    return factorise();
  }
  __attribute__((noinline)) bool factorise() {
    Base::start();
    double *a = lower_.re, *b = lower_.im;
    const std::size_t w = stride();
    for (int k = 0; k < n_; ++k) {
      double *p = a + k * w, *q = b + k * w;
      int best = k;
      double largest = -1;
      for (int i = k; i < n_; ++i) {
        const double size = std::fabs(p[i]) + std::fabs(q[i]);
        if (size > largest) largest = size, best = i;
      }
      if (!(largest > 0) || !(largest < INFINITY)) return false;
      Base::exchange(a, k, best);
      Base::exchange(b, k, best);
      Base::note(k, best);
      const double square = p[k] * p[k] + q[k] * q[k];
      inverse_.re[k] = p[k] / square;
      inverse_.im[k] = -q[k] / square;
      for (int i = 0; i < n_; ++i) {
        const int d = i < k ? i : k;
        const double product_re = p[i] * inverse_.re[d] - q[i] * inverse_.im[d];
        const double product_im = p[i] * inverse_.im[d] + q[i] * inverse_.re[d];
        upper_.re[k * w + i] = i < k ? product_re : 0;
        upper_.im[k * w + i] = i < k ? product_im : 0;
        p[i] = i > k ? product_re : 0;
        q[i] = i > k ? product_im : 0;
      }
      for (int j = k + 1; j < n_; ++j) {
        const double factor_re = a[j * w + k], factor_im = b[j * w + k];
        for (int i = k / 4; i < blocks(); ++i)
          subtract(at(a + j * w + 4 * i), at(b + j * w + 4 * i), at(p + 4 * i), at(q + 4 * i), factor_re, factor_im);
      }
    }
    return true;
  }

  BELLCRANK_INLINE void solve(const double* b_re, const double* b_im, double* x_re, double* x_im) const {
    const std::size_t w = stride();
    Lanes registers[Blocks ? 2 * Blocks : 1];
    Lanes *re = Blocks ? registers : &at(x_re), *im = Blocks ? registers + Blocks : &at(x_im);
    for (int i = 0; i < blocks(); ++i) re[i] = Base::ordered(b_re, i), im[i] = Base::ordered(b_im, i);
    Base::upwards([&](int k) BELLCRANK_INLINED {
      const double value_re = re[k / 4][k % 4], value_im = im[k / 4][k % 4];
      for (int i = k / 4; i < blocks(); ++i) {
        const std::size_t place = k * w + 4 * i;
        subtract(re[i], im[i], at(lower_.re + place), at(lower_.im + place), value_re, value_im);
      }
    });
    for (int i = 0; i < blocks(); ++i) {
      const Lanes d_re = at(inverse_.re + 4 * i), d_im = at(inverse_.im + 4 * i), kept = re[i];
      re[i] = kept * d_re - im[i] * d_im;
      im[i] = kept * d_im + im[i] * d_re;
    }
    Base::downwards([&](int k) BELLCRANK_INLINED {
      const double value_re = re[k / 4][k % 4], value_im = im[k / 4][k % 4];
      for (int i = 0; i <= k / 4; ++i) {
        const std::size_t place = k * w + 4 * i;
        subtract(re[i], im[i], at(upper_.re + place), at(upper_.im + place), value_re, value_im);
      }
    });
    if (Blocks)
      for (int i = 0; i < blocks(); ++i) at(x_re + 4 * i) = re[i], at(x_im + 4 * i) = im[i];
  }

 private:
  struct Pair {
    Buffer re, im;
    explicit Pair(std::size_t size) : re(size), im(size) {}
  };
  Pair lower_, upper_, inverse_;

  static BELLCRANK_INLINE void subtract(Lanes& to_re, Lanes& to_im, Lanes re, Lanes im, double factor_re,
                                        double factor_im) {
    to_re -= re * factor_re - im * factor_im;
    to_im -= re * factor_im + im * factor_re;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
