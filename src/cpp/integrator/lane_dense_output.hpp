// The motion within the steps of a block, one step a lane: the polynomials of explicit_runge_kutta.hpp.
#pragma once

#include "lane_runge_kutta.hpp"
#include "stage_polynomials.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <class Method>
class LaneDenseOutput {
 public:
  LaneDenseOutput(LaneEquations& equations, LaneRungeKutta<Method>& method)
      : equations_(equations), method_(method), n_(equations.problem.n), cheap_(cheap_terms * n_),
        dense_(dense_terms * n_), between_(n_), rate_(n_) {}

  // The polynomials that need no evaluations, of the steps in a block.
  void begin(const LaneBlock& block) {
    const Vec h = block.t - block.t_old;
    if constexpr (Method::fsal) powers(block, h);
    else
      for (int i = 0; i < n_; ++i) cheap(block, i, h, cheap_ + cheap_terms * i);
  }

  // x at t_old + s (t - t_old) by these: with DOP853 of degree 6, or 5 where not `finer`.
  void approximate(const LaneBlock& block, Vec s, Vec* x, bool finer = true) const {
    if constexpr (Method::fsal) return interpolate(block, s, x);
    const Vec r = 1.0 - s, v = s * s * r * r;
    for (int i = 0; i < n_; ++i) {
      const Vec* c = cheap_ + cheap_terms * i;
      Vec sum = s * (c[0] + r * (r * c[1] - s * c[2]));
      if constexpr (Method::extra == 3) sum += v * (finer ? c[3] + s * (c[4] + s * c[5]) : c[6] + s * c[7]);
      x[i] = block.old[i] + sum;
    }
    equations_.normalise(x);
  }

  // Computes the dense output, which may cost evaluations; false in lanes where that fails.
  Mask prepare(LaneBlock& block, Mask wanted) {
    const Vec h = block.t - block.t_old;
    Mask sound = Mask{} == 0;
    if constexpr (Method::fsal) {
      return sound;
    } else if constexpr (Method::extra == 3) {
      method_.template stage<13>(block, h);
      method_.template stage<14>(block, h);
      method_.template stage<15>(block, h);
      DenseOutputTest<Vec> test;
      for (int i = 0; i < n_; ++i) {
        const Vec *k = block.k + i, *c = cheap_ + cheap_terms * i;
        Vec* d = dense_ + dense_terms * i;
        d[0] = c[0], d[1] = c[1], d[2] = -(c[1] + c[2]);
        d[3] = h * term<0>(k), d[4] = h * term<1>(k), d[5] = h * term<2>(k), d[6] = h * term<3>(k);
        sound &= finite(d[3] + d[4] + d[5] + d[6]);
        const Vec scale = 1.0 / (block.atol + block.rtol * absolute(block.x[i]));
        if (i < equations_.problem.norm_size)
          test.add({d[3], d[4], d[5], d[6]}, HighTerms<Vec>::finer(c + 3), HighTerms<Vec>::coarser(c + 6), scale);
      }
      const Mask kept = test.passes(test.far(), test.near(), equations_.problem.norm_size);
      if (bits(~kept)) use_stage_polynomial(~kept);
      block.evaluations += wanted ? splat(3) : Vec{};
    } else {  // the cubic's slope is corrected by one evaluation, as in explicit_runge_kutta.hpp
      const double s = 0.2113248654051871177454256;
      approximate(block, splat(s), between_);
      equations_.rhs(block, block.t_old + s * h, between_, rate_);
      for (int i = 0; i < n_; ++i) {
        const Vec* c = cheap_ + cheap_terms * i;
        dense_[i] = 5.196152422706631880582339 * (h * rate_[i] - cubic_slope(s, c));
        sound &= finite(dense_[i]);
      }
      block.evaluations += wanted ? splat(1) : Vec{};
    }
    return sound;
  }

  // x at t_old + s (t - t_old) by the dense output.
  void interpolate(const LaneBlock& block, Vec s, Vec* x) const {
    const Vec r = 1.0 - s, h = block.t - block.t_old;
    for (int i = 0; i < n_; ++i) {
      const Vec* d = dense_ + dense_terms * i;
      Vec sum;
      if constexpr (Method::fsal) {
        sum = (((d[3] * s + d[2]) * s + d[1]) * s + d[0]) * (s * h);
      } else if constexpr (Method::extra == 3) {
        sum = ((((((d[6] * s + d[5]) * r + d[4]) * s + d[3]) * r + d[2]) * s + d[1]) * r + d[0]) * s;
      } else {
        const Vec* c = cheap_ + cheap_terms * i;
        sum = s * (c[0] + r * (r * c[1] - s * c[2])) + d[0] * (s * s * r * r);
      }
      x[i] = block.old[i] + sum;
    }
    equations_.normalise(x);
  }

 private:
  // Puts the polynomial through the stages in place of the dense output in some lanes.
  void use_stage_polynomial(Mask lanes) {
    for (int i = 0; i < n_; ++i) {
      const HighTerms<Vec> better = HighTerms<Vec>::finer(cheap_ + cheap_terms * i + 3);
      Vec* d = dense_ + dense_terms * i + 3;
      d[0] = lanes ? better.a : d[0], d[1] = lanes ? better.b : d[1];
      d[2] = lanes ? better.c : d[2], d[3] = lanes ? better.d : d[3];
    }
  }

  static constexpr int last = Method::stages;
  static constexpr int cheap_terms = Method::extra == 3 ? 8 : 3;
  static constexpr int dense_terms = Method::fsal ? 4 : Method::extra == 3 ? 7 : 1;

  LaneEquations& equations_;
  LaneRungeKutta<Method>& method_;
  const int n_;
  Vectors cheap_, dense_, between_, rate_;

  template <int Power>
  Vec term(const Vec* k) const {
    return weighted_lanes<Weights<DenseOf<Method, Power>>, Method::rows - 1>(k, n_);
  }

  void powers(const LaneBlock& block, Vec) {
    if constexpr (Method::fsal)
      for (int i = 0; i < n_; ++i) {
        const Vec* k = block.k + i;
        Vec* d = dense_ + dense_terms * i;
        d[0] = term<0>(k), d[1] = term<1>(k), d[2] = term<2>(k), d[3] = term<3>(k);
      }
  }

  // The cubic through both ends and slopes: the difference d of the ends, and how far the slopes f and g are from it; then
  // what matches the slopes at three stages, and at two of them, as well.
  void cheap(const LaneBlock& block, int i, Vec h, Vec* c) const {
    const Vec d = block.x[i] - block.old[i];
    c[0] = d, c[1] = h * block.k[i] - d, c[2] = h * block.k[last * n_ + i] - d;
    if constexpr (Method::extra == 3) {
      constexpr StagePolynomialTerms<Method> terms;
      constexpr auto stage = StagePolynomialTerms<Method>::stage;
      Vec missing[3];
      for (int j = 0; j < 3; ++j)
        missing[j] = h * block.k[stage[j] * n_ + i] - cubic_slope(Method::c[stage[j]], c);
      terms.finer(missing, c + 3), terms.coarser(missing, c + 6);
    }
  }

  static Vec cubic_slope(double s, const Vec* c) {
    return c[0] + (1 - 2 * s) * ((1 - s) * c[1] - s * c[2]) - s * (1 - s) * (c[1] + c[2]);
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
