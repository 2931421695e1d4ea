// The motion within a step of an explicit Runge-Kutta method: polynomials through its ends and stages, which need no
// evaluations, and the dense output; and where those replace it.
#pragma once

#include "runge_kutta_stages.hpp"

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

// The cubic through both ends and slopes of a step, less its start.
template <class V>
struct Cubic {
  V d, f, g;  // the difference of the ends, and what both slopes, times the step size, are more than that

  template <class T>
  BELLCRANK_INLINE V operator()(T s) const {
    const T r = 1.0 - s;
    return s * (d + r * (r * f - s * g));
  }
  BELLCRANK_INLINE V slope(double s) const { return d + (1 - 2 * s) * ((1 - s) * f - s * g) - s * (1 - s) * (f + g); }
};

// `Width`: OneRun or RunsInLanes. `N`: the number of vectors of a state; 0: any.
template <class Method, class Width, int N>
class StepPolynomials {
  using V = typename Width::Vector;
  using T = typename Width::Number;

 public:
  // The ends of a step of size h; its slopes, in rows that are `stride` vectors apart.
  struct Step {
    const V *old, *x, *k;
    std::size_t stride;
    T h;
  };

  explicit StepPolynomials(std::size_t n) : run_time_n_(n), cheap_(n * cheap_terms), dense_(n * dense_terms) {}

  // The polynomials that need no evaluations.
  BELLCRANK_INLINE void begin(const Step& step) {
    for (std::size_t i = 0; i < n(); ++i) {
      const V* k = step.k + i;
      if constexpr (Method::fsal) {
        V* c = dense_ + i * dense_terms;
        c[0] = term<0>(k, step), c[1] = term<1>(k, step), c[2] = term<2>(k, step), c[3] = term<3>(k, step);
      } else {
        V* c = cheap_ + i * cheap_terms;
        const V d = step.x[i] - step.old[i];
        c[0] = d, c[1] = step.h * k[0] - d, c[2] = step.h * k[last * step.stride] - d;
        if constexpr (Method::extra == 3) through_stages(k, step, c);
      }
    }
  }

  // x at the share s of the step by these: with DOP853 of degree 6, or 5 where not `finer`.
  BELLCRANK_INLINE void approximate(const Step& step, T s, V* x, bool finer = true) const {
    if constexpr (Method::fsal) return interpolate(step, s, x);
    const T r = 1.0 - s, v = s * s * r * r;
    for (std::size_t i = 0; i < n(); ++i) {
      const V* c = cheap_ + i * cheap_terms;
      V sum = cubic(i)(s);
      if constexpr (Method::extra == 3) sum += v * (finer ? c[3] + s * (c[4] + s * c[5]) : c[6] + s * c[7]);
      x[i] = step.old[i] + sum;
    }
  }

  // The dense output of DOP853, whose further slopes are in rows 13 to 15.
  BELLCRANK_INLINE void complete(const Step& step) {
    for (std::size_t i = 0; i < n(); ++i) put_terms(step, i);
  }

  // The same, or the polynomial through the stages where that is better. `scale`(i): 1 / the tolerance of the first
  // `count` vectors, which have `size` entries. Returns where it is finite.
  template <class Scale>
  BELLCRANK_INLINE auto complete(const Step& step, const Scale& scale, std::size_t count, int size) {
    DenseOutputTest<V> test;
    V unreal = {};
    for (std::size_t i = 0; i < n(); ++i) {
      put_terms(step, i);
      const V *c = cheap_ + i * cheap_terms, *d = dense_ + i * dense_terms;
      unreal += (d[3] + d[4] + d[5] + d[6]) * 0.0;
      if (i < count)
        test.add({d[3], d[4], d[5], d[6]}, HighTerms<V>::finer(c + 3), HighTerms<V>::coarser(c + 6), scale(i));
    }
    const auto kept = test.passes(Width::sum(test.far()), Width::sum(test.near()), size);
    for (std::size_t i = 0; any(!kept) && i < n(); ++i) {
      const HighTerms<V> better = HighTerms<V>::finer(cheap_ + i * cheap_terms + 3);
      V* d = dense_ + i * dense_terms;
      d[3] = kept ? d[3] : better.a, d[4] = kept ? d[4] : better.b;
      d[5] = kept ? d[5] : better.c, d[6] = kept ? d[6] : better.d;
    }
    return Width::sum(unreal) == 0.0;
  }

  // The dense output of RK4, of order 4: the cubic's slope is corrected at the abscissa where s^2 (1 - s)^2 is steepest by one
  // more evaluation there (bootstrapping: Hairer, Norsett, Wanner, Solving ODEs I, sec. II.6). Returns where it is finite.
  static constexpr double corrected = 0.2113248654051871177454256;
  BELLCRANK_INLINE auto correct(const Step& step, const V* slope) {
    V unreal = {};
    for (std::size_t i = 0; i < n(); ++i) {
      dense_[i] = 5.196152422706631880582339 * (step.h * slope[i] - cubic(i).slope(corrected));
      unreal += dense_[i] * 0.0;
    }
    return Width::sum(unreal) == 0.0;
  }

  // x at the share s of the step by the dense output.
  BELLCRANK_INLINE void interpolate(const Step& step, T s, V* x) const {
    const T r = 1.0 - s;
    for (std::size_t i = 0; i < n(); ++i) {
      const V* d = dense_ + i * dense_terms;
      V sum;
      if constexpr (Method::fsal) sum = (((d[3] * s + d[2]) * s + d[1]) * s + d[0]) * (s * step.h);
      else if constexpr (Method::extra == 3)
        sum = ((((((d[6] * s + d[5]) * r + d[4]) * s + d[3]) * r + d[2]) * s + d[1]) * r + d[0]) * s;
      else sum = cubic(i)(s) + d[0] * (s * s * r * r);
      x[i] = step.old[i] + sum;
    }
  }

 private:
  static constexpr int last = Method::stages;  // row of the slope at the step's end
  static constexpr int cheap_terms = Method::fsal ? 0 : Method::extra == 3 ? 8 : 3;
  static constexpr int dense_terms = Method::fsal ? 4 : Method::extra == 3 ? 7 : 1;

  const std::size_t run_time_n_;
  Room<V, N * cheap_terms> cheap_;  // of a vector: the cubic; what matches the slopes at three stages as well, and at two
  Room<V, N * dense_terms> dense_;

  std::size_t n() const { return N ? N : run_time_n_; }
  Cubic<V> cubic(std::size_t i) const {
    const V* c = cheap_ + i * cheap_terms;
    return {c[0], c[1], c[2]};
  }
  template <int Power>
  static V term(const V* k, const Step& step) {
    return weighted<Weights<DenseOf<Method, Power>>, Method::rows - 1>(k, step.stride);
  }
  BELLCRANK_INLINE void put_terms(const Step& step, std::size_t i) {
    const V* k = step.k + i;
    const V f = step.h * k[0], g = step.h * k[last * step.stride], d = step.x[i] - step.old[i];
    V* c = dense_ + i * dense_terms;
    c[0] = d, c[1] = f - d, c[2] = 2.0 * d - (g + f);
    c[3] = step.h * term<0>(k, step), c[4] = step.h * term<1>(k, step);
    c[5] = step.h * term<2>(k, step), c[6] = step.h * term<3>(k, step);
  }
  static void through_stages(const V* k, const Step& step, V* c) {
    constexpr StagePolynomialTerms<Method> terms;
    constexpr auto stage = StagePolynomialTerms<Method>::stage;
    const Cubic<V> cubic{c[0], c[1], c[2]};
    V missing[3];
    for (int j = 0; j < 3; ++j) missing[j] = step.h * k[stage[j] * step.stride] - cubic.slope(Method::c[stage[j]]);
    terms.finer(missing, c + 3), terms.coarser(missing, c + 6);
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
