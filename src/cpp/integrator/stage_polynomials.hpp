// A polynomial through the stages of a step: the motion within it, without the evaluations of a dense output; and where
// it replaces the dense output.
#pragma once

#include "runge_kutta_tableaus.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// Inverses of the matrices w_j'(c_i), w_j = s^2 (1 - s)^2 s^j, at the abscissae c_i of two or three stages: they turn the
// differences of slopes there into the coefficients of a polynomial. The stages are those of DOP853 with
// sum_j a_ij c_j^k = c_i^(k + 1) / (k + 1) up to k = 4, as far apart as possible.
template <class Method>
struct StagePolynomialTerms {
  static constexpr int stage[3] = {7, 10, 9};
  double two[2][2] = {}, three[3][3] = {};

  constexpr StagePolynomialTerms() {
    double a[3][3] = {};
    for (int i = 0; i < 3; ++i) {
      const double s = Method::c[stage[i]], r = 1 - s;
      double power = 1;
      for (int j = 0; j < 3; ++j, power *= s) a[i][j] = s * r * power * (2 * (1 - 2 * s) + j * r);
    }
    const double d = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    two[0][0] = a[1][1] / d, two[0][1] = -a[0][1] / d, two[1][0] = -a[1][0] / d, two[1][1] = a[0][0] / d;
    double all = 0;
    for (int j = 0; j < 3; ++j)
      all += a[0][j] * (a[1][(j + 1) % 3] * a[2][(j + 2) % 3] - a[1][(j + 2) % 3] * a[2][(j + 1) % 3]);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        three[j][i] = (a[(i + 1) % 3][(j + 1) % 3] * a[(i + 2) % 3][(j + 2) % 3] -
                       a[(i + 1) % 3][(j + 2) % 3] * a[(i + 2) % 3][(j + 1) % 3]) / all;
  }

  // The coefficients of powers of s, from what is missing of the slopes at the stages: of degree 6, and of degree 5.
  template <class V>
  constexpr void finer(const V* missing, V* c) const {
    for (int j = 0; j < 3; ++j) c[j] = three[j][0] * missing[0] + three[j][1] * missing[1] + three[j][2] * missing[2];
  }
  template <class V>
  constexpr void coarser(const V* missing, V* c) const {
    for (int j = 0; j < 2; ++j) c[j] = two[j][0] * missing[0] + two[j][1] * missing[1];
  }
};

// What a polynomial adds to the cubic through both ends and slopes of a step, by s^2 (1 - s)^2.
template <class V>
struct HighTerms {
  V a, b, c, d;  // coefficients of 1, s, s (1 - s), s^2 (1 - s): those of DOP853's dense output

  // Of polynomials through stages, from their coefficients of powers of s.
  static HighTerms finer(const V* powers) { return {powers[0], powers[1] + powers[2], -powers[2], V{}}; }
  static HighTerms coarser(const V* powers) { return {powers[0], powers[1], V{}, V{}}; }
  V operator()(double s) const { return a + s * (b + (1 - s) * (c + s * d)); }
};

// Whether DOP853's dense output can be used. It needs three more stages, which no error estimate watches. Where one of them
// meets a position at which constraints lose rank, its slope is wrong by far more than the tolerance, and so is the motion
// between the ends of the step, whose own error is small. So the dense output is compared with the polynomial of degree 6
// through stages that are under error control: where it differs from that by much more than this one from degree 5, and by
// much more than the tolerance, the polynomial through the stages is better.
template <class V>
class DenseOutputTest {
 public:
  // One entry of the state; scale: 1 / its tolerance.
  void add(const HighTerms<V>& dense, const HighTerms<V>& finer, const HighTerms<V>& coarser, V scale) {
    for (const double s : {0.4, 0.75}) {
      const double weight = s * s * (1 - s) * (1 - s);
      const V at_s = finer(s), far = weight * scale * (dense(s) - at_s), near = weight * scale * (at_s - coarser(s));
      far_ += far * far, near_ += near * near;
    }
  }
  V far() const { return far_; }
  V near() const { return near_; }

  // By the sums over all `size` entries; not where they are not numbers.
  template <class T>
  static auto passes(T far, T near, int size) {
    return (far <= most_ratio * most_ratio * near) | (far <= 2.0 * size * least * least);
  }

 private:
  static constexpr double most_ratio = 10, least = 100;  // least: tolerances
  V far_ = {}, near_ = {};
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
