// The linear systems (s I - h J) x = b of an implicit method for the state q, v, W of a mechanism, reduced to the
// velocities: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, sec. IV.8, "second order equations". The
// rows of q' = E(q) v couple each joint's coordinates with its own velocities alone, and no rate depends on W, so that
//
//   J = [A B 0; C D 0; F G 0],  A and B block diagonal,
//   (s - h D - h C N) v = b_v + h C P b_q,  q = P b_q + N v,  W = (b_W + h F q + h G v) / s,
//
// with P = (s - h A)^-1 and N = P h B block by block. C and D are full in general, because forces on one body accelerate
// all; the remaining system, about half as large, is solved by LU with partial pivoting.
#pragma once

#include "linear_solver.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

struct Complex {
  double re, im;
  Complex(double real = 0, double imaginary = 0) : re(real), im(imaginary) {}
};
BELLCRANK_INLINE Complex operator-(Complex a, Complex b) { return {a.re - b.re, a.im - b.im}; }
BELLCRANK_INLINE Complex operator+(Complex a, Complex b) { return {a.re + b.re, a.im + b.im}; }
BELLCRANK_INLINE Complex operator*(Complex a, Complex b) {
  return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}
BELLCRANK_INLINE Complex inverse(Complex a) {
  const double square = a.re * a.re + a.im * a.im;
  return {a.re / square, -a.im / square};
}
BELLCRANK_INLINE double inverse(double a) { return 1 / a; }
BELLCRANK_INLINE double extent(Complex a) { return std::fabs(a.re) + std::fabs(a.im); }
BELLCRANK_INLINE double extent(double a) { return std::fabs(a); }

// Views of real and of complex numbers, whose parts are stored apart.
struct RealView {
  using Number = double;
  using Lu = RealLu<0>;
  static constexpr int parts = 1;
  double* re;
  RealView(double* values, std::size_t) : re(values) {}
  static RealView of(Lu& lu) { return {lu.matrix(), 0}; }
  double get(std::size_t i) const { return re[i]; }
  void set(std::size_t i, double v) { re[i] = v; }
  // Adds factor * column to `count` entries from `i` on.
  BELLCRANK_INLINE void add(std::size_t i, double factor, const double* column, int count) {
    double* to = re + i;
    for (int k = 0; k < count; ++k) to[k] += factor * column[k];
  }
  static void solve(const Lu& lu, RealView b, RealView x) { lu.solve(b.re, x.re); }
};
struct ComplexView {
  using Number = Complex;
  using Lu = ComplexLu<0>;
  static constexpr int parts = 2;
  double *re, *im;
  ComplexView(double* values, std::size_t size) : re(values), im(values + size) {}
  ComplexView(double* real, double* imaginary) : re(real), im(imaginary) {}
  static ComplexView of(Lu& lu) { return {lu.matrix(), lu.imaginary_matrix()}; }
  Complex get(std::size_t i) const { return {re[i], im[i]}; }
  void set(std::size_t i, Complex v) { re[i] = v.re, im[i] = v.im; }
  BELLCRANK_INLINE void add(std::size_t i, Complex factor, const double* column, int count) {
    double *a = re + i, *b = im + i;
    for (int k = 0; k < count; ++k) a[k] += factor.re * column[k], b[k] += factor.im * column[k];
  }
  static void solve(const Lu& lu, ComplexView b, ComplexView x) { lu.solve(b.re, b.im, x.re, x.im); }
};

// The sizes of the blocks of a problem's joints.
struct JointSizes {
  int nq = 0, nv = 0, largest = 0, squares = 0, products = 0;
  explicit JointSizes(const Problem& p) {
    for (int k = 0; k < p.joint_count; ++k) {
      const JointBlock& joint = p.joints[k];
      nq += joint.nq, nv += joint.nv, squares += joint.nq * joint.nq, products += joint.nq * joint.nv;
      if (joint.nq > largest) largest = joint.nq;
    }
  }
};

template <class View>
class ReducedSolver {
  using Number = typename View::Number;

 public:
  explicit ReducedSolver(const Problem& p)
      : p_(p), sizes_(p), inverse_(sizes_.squares), slope_(sizes_.products), block_(sizes_.largest * sizes_.largest),
        right_(padded()), answer_(padded()), position_(sizes_.nq), lu_(sizes_.nv) {}

  // Factorises shift I - h J, column by column; J is used again when solving. False where it is singular.
  bool factorise(Number shift, double h, const double* jacobian) {
    shift_ = shift, h_ = h, jacobian_ = jacobian;
    View matrix = View::of(lu_), slope = slope_, inverse = inverse_;
    const int nv = sizes_.nv;
    for (int j = 0; j < nv; ++j) {
      const double* column = velocity_rows(sizes_.nq + j);
      for (int i = 0; i < nv; ++i) matrix.set(j * padded() + i, Number(-h * column[i]) + (i == j ? shift : Number(0)));
    }
    int square = 0, product = 0;
    for (int b = 0; b < p_.joint_count; ++b) {
      const JointBlock& joint = p_.joints[b];
      if (!invert(joint, square)) return false;
      for (int j = 0; j < joint.nv; ++j)
        for (int i = 0; i < joint.nq; ++i) {
          Number sum = 0;
          for (int k = 0; k < joint.nq; ++k)
            sum = sum + inverse.get(square + k * joint.nq + i) *
                            Number(h * entry(joint.q + k, sizes_.nq + joint.v + j));
          slope.set(product + j * joint.nq + i, sum);
          matrix.add((joint.v + j) * padded(), Number(-h) * sum, velocity_rows(joint.q + i), nv);
        }
      square += joint.nq * joint.nq, product += joint.nq * joint.nv;
    }
    return lu_.factorise();
  }

  // b and x must not overlap.
  void solve(const View& b, View x) {
    View right = right_, answer = answer_, position = position_, slope = slope_, inverses = inverse_;
    const int nq = sizes_.nq, nv = sizes_.nv;
    for (int i = 0; i < nv; ++i) right.set(i, b.get(nq + i));
    int square = 0, product = 0;
    for (int k = 0; k < p_.joint_count; square += p_.joints[k].nq * p_.joints[k].nq, ++k) {
      const JointBlock& joint = p_.joints[k];
      for (int i = 0; i < joint.nq; ++i) {
        Number sum = 0;
        for (int j = 0; j < joint.nq; ++j) sum = sum + inverses.get(square + j * joint.nq + i) * b.get(joint.q + j);
        position.set(joint.q + i, sum);
        right.add(0, Number(h_) * sum, velocity_rows(joint.q + i), nv);
      }
    }
    View::solve(lu_, right, answer);
    for (int k = 0; k < p_.joint_count; product += p_.joints[k].nq * p_.joints[k].nv, ++k) {
      const JointBlock& joint = p_.joints[k];
      for (int i = 0; i < joint.nq; ++i) {
        Number sum = position.get(joint.q + i);
        for (int j = 0; j < joint.nv; ++j) sum = sum + slope.get(product + j * joint.nq + i) * answer.get(joint.v + j);
        x.set(joint.q + i, sum);
      }
    }
    for (int i = 0; i < nv; ++i) x.set(nq + i, answer.get(i));
    const Number scale = inverse(shift_);
    for (int i = nq + nv; i < p_.n; ++i) {
      Number sum = b.get(i);
      for (int j = 0; j < nq + nv; ++j) sum = sum + Number(h_ * entry(i, j)) * x.get(j);
      x.set(i, scale * sum);
    }
  }

 private:
  // Numbers whose parts are stored apart.
  struct Numbers {
    std::size_t size;
    Buffer values;
    explicit Numbers(std::size_t count) : size(count), values(View::parts * count) {}
    operator View() { return {static_cast<double*>(values), size}; }
  };

  const Problem& p_;
  const JointSizes sizes_;
  Numbers inverse_, slope_, block_;  // P and N, and a block of s - h A; each block column by column
  Numbers right_, answer_, position_;
  typename View::Lu lu_;
  Number shift_ = 0;
  double h_ = 0;
  const double* jacobian_ = nullptr;

  std::size_t padded() const { return 4 * ((static_cast<std::size_t>(sizes_.nv) + 3) / 4); }
  double entry(int i, int j) const { return jacobian_[static_cast<std::size_t>(j) * p_.n + i]; }
  const double* velocity_rows(int column) const {
    return jacobian_ + static_cast<std::size_t>(column) * p_.n + sizes_.nq;
  }

  // P of a joint by Gauss-Jordan elimination with partial pivoting, into inverse_ from `first` on.
  bool invert(const JointBlock& joint, int first) {
    View a = block_, p = inverse_;
    const int m = joint.nq;
    for (int j = 0; j < m; ++j)
      for (int i = 0; i < m; ++i) {
        a.set(j * m + i, Number(-h_ * entry(joint.q + i, joint.q + j)) + (i == j ? shift_ : Number(0)));
        p.set(first + j * m + i, i == j ? 1.0 : 0.0);
      }
    for (int k = 0; k < m; ++k) {
      int best = k;
      for (int i = k + 1; i < m; ++i)
        if (extent(a.get(k * m + i)) > extent(a.get(k * m + best))) best = i;
      const double largest = extent(a.get(k * m + best));
      if (!(largest > 0) || !(largest < INFINITY)) return false;
      const Number scale = inverse(a.get(k * m + best));
      for (int j = 0; j < m; ++j) {
        exchange_and_scale(a, j * m + k, j * m + best, scale);
        exchange_and_scale(p, first + j * m + k, first + j * m + best, scale);
      }
      for (int i = 0; i < m; ++i) {
        if (i == k) continue;
        const Number factor = a.get(k * m + i);
        for (int j = 0; j < m; ++j) {
          a.set(j * m + i, a.get(j * m + i) - factor * a.get(j * m + k));
          p.set(first + j * m + i, p.get(first + j * m + i) - factor * p.get(first + j * m + k));
        }
      }
    }
    return true;
  }
  static void exchange_and_scale(View& v, int k, int best, Number scale) {
    const Number kept = v.get(k);
    v.set(k, scale * v.get(best));
    if (best != k) v.set(best, kept);
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
