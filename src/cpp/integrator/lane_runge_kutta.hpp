// The explicit Runge-Kutta methods of runge_kutta_tableaus.hpp for one step in each lane of a block, and the motion within it.
#pragma once

#include "dense_output.hpp"
#include "lane_equations.hpp"
#include "stiffness_detection.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <class Method>
class LaneRungeKutta {
 public:
  static constexpr int last = Method::stages;  // row of the slope at the end of a step
  static constexpr int rows = Method::rows;

  explicit LaneRungeKutta(LaneEquations& equations) : equations_(equations), n_(equations.problem.n), argument_(n_) {}

  // A step of size h from (t_old, old) with the slope in row 0: fills rows 1 to stages - 1 and the new state x, which is
  // not projected yet.
  void stages(LaneBlock& block, Vec h, Vec* x) {
    switch (n_) {
      case 1: return stages_of<1>(block, h, x);
      case 2: return stages_of<2>(block, h, x);
      case 3: return stages_of<3>(block, h, x);
      case 4: return stages_of<4>(block, h, x);
      case 5: return stages_of<5>(block, h, x);
      case 6: return stages_of<6>(block, h, x);
      case 7: return stages_of<7>(block, h, x);
      case 8: return stages_of<8>(block, h, x);
      default: return stages_of<0>(block, h, x);
    }
  }

  // Stage S >= 1 alone, such as those of a dense output. N: the number of states; 0: any.
  template <int S, int N = 0>
  BELLCRANK_INLINE void stage(LaneBlock& block, Vec h) {
    sum<S, N>(block, h, argument_);
    equations_.rhs(block, block.t_old + Method::c[S] * h, argument_, block.k + S * (N ? N : n_));
  }

  // The slope at the end of a step, into row `last`.
  void slope(LaneBlock& block, Vec time, const Vec* x) { equations_.rhs(block, time, x, block.k + last * n_); }

  // Square of the error norm of a step of size h.
  Vec error_square(const LaneBlock& block, Vec h) const {
    const int size = equations_.problem.norm_size;
    ErrorSums<Method, Vec> sums;
    for (int i = 0; i < size; ++i)
      sums.add(block.k + i, n_, 1.0 / (block.atol + block.rtol * larger(absolute(block.old[i]), absolute(block.x[i]))));
    return norm_square<Method>(h, sums.fifth, sums.third, size);
  }

  // Lanes in which a step of size h is held short by a part that is not seen in the solution (stiffness_detection.hpp).
  Mask held_short(const LaneBlock& block, Vec h) {
    const Problem& p = equations_.problem;
    sum<last - 1, 0>(block, h, argument_);
    return step_held_short<Method, Vec>(p, h, {block.old, block.k}, {argument_, block.k + (last - 1) * n_},
                                        {block.x, block.k + last * n_});
  }

  // Repeats accepted steps with other sizes, so that the states at t_old + h are ends of steps; they are projected in the
  // lanes of `wanted`. Rows 1 to stages - 1 of the block are written anew. False where that fails.
  Mask redo(LaneBlock& block, Vec h, Vec* x, Mask wanted) {
    stages(block, h, x);
    equations_.normalise_and_project(block, block.t_old + h, x, wanted);
    Mask sound = Mask{} == 0;
    for (int i = 0; i < n_; ++i) sound &= finite(x[i]);
    return sound;
  }

 private:
  LaneEquations& equations_;
  const int n_;
  Vectors argument_;

  template <int N>
  void stages_of(LaneBlock& block, Vec h, Vec* x) {
    all<N>(block, h, std::make_integer_sequence<int, Method::stages - 1>{});
    sum<last, N>(block, h, x);
  }

  template <int S, int N>
  BELLCRANK_INLINE void sum(const LaneBlock& block, Vec h, Vec* to) const {
    stage_argument<Method, S>(block.old, block.k, N ? N : n_, h, to);
  }

  template <int N, int... S>
  BELLCRANK_INLINE void all(LaneBlock& block, Vec h, std::integer_sequence<int, S...>) {
    (stage<S + 1, N>(block, h), ...);
  }
};

// The motion within the steps of a block.
template <class Method>
class LaneDenseOutput {
 public:
  LaneDenseOutput(LaneEquations& equations, LaneRungeKutta<Method>& method)
      : equations_(equations), method_(method), n_(equations.problem.n), polynomials_(n_), between_(n_), rate_(n_) {}

  // The polynomials that need no evaluations, of the steps in a block.
  void begin(const LaneBlock& block) { polynomials_.begin(step(block)); }

  // x at t_old + s (t - t_old) by these: with DOP853 of degree 6, or 5 where not `finer`.
  void approximate(const LaneBlock& block, Vec s, Vec* x, bool finer = true) const {
    polynomials_.approximate(step(block), s, x, finer);
    equations_.normalise(x);
  }

  // Computes the dense output, which may cost evaluations; false in lanes where that fails.
  Mask prepare(LaneBlock& block, Mask wanted) {
    const Vec h = block.t - block.t_old;
    if constexpr (Method::fsal) return Mask{} == 0;
    block.evaluations += wanted ? splat(Method::extra) : Vec{};
    if constexpr (Method::extra == 3) {
      method_.template stage<13>(block, h);
      method_.template stage<14>(block, h);
      method_.template stage<15>(block, h);
      const int size = equations_.problem.norm_size;
      const auto scale = [&](std::size_t i) { return 1.0 / (block.atol + block.rtol * absolute(block.x[i])); };
      return polynomials_.complete(step(block), scale, size, size);
    } else {
      approximate(block, splat(Polynomials::corrected), between_);
      equations_.rhs(block, block.t_old + Polynomials::corrected * h, between_, rate_);
      return polynomials_.correct(step(block), rate_);
    }
  }

  // x at t_old + s (t - t_old) by the dense output.
  void interpolate(const LaneBlock& block, Vec s, Vec* x) const {
    polynomials_.interpolate(step(block), s, x);
    equations_.normalise(x);
  }

 private:
  using Polynomials = StepPolynomials<Method, RunsInLanes, 0>;

  LaneEquations& equations_;
  LaneRungeKutta<Method>& method_;
  const std::size_t n_;
  Polynomials polynomials_;
  Vectors between_, rate_;

  typename Polynomials::Step step(const LaneBlock& b) const { return {b.old, b.x, b.k, n_, b.t - b.t_old}; }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
