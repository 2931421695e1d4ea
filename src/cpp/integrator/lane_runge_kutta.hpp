// The explicit Runge-Kutta methods of runge_kutta_tableaus.hpp for one step in each lane of a block.
#pragma once

#include "lane_equations.hpp"
#include "runge_kutta_stages.hpp"
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
    const Vec *f = block.k, *g = block.k + (last - 1) * n_, *end = block.k + last * n_;
    Vec near[2] = {}, near_slopes[2] = {}, own[2] = {}, own_slopes[2] = {};
    for (int i = 0; i < moving(p); ++i) {
      const int part = i >= p.nq && p.nq > 0;
      const auto add = [part](Vec* sums, Vec value) { sums[part] += value * value; };
      add(near, block.x[i] - argument_[i]), add(near_slopes, end[i] - g[i]);
      add(own, block.x[i] - block.old[i]), add(own_slopes, end[i] - f[i]);
    }
    const auto rate_square = [&p](const Vec* states, const Vec* slopes) {
      const Vec rate = p.nq == 0 ? slopes[0] / states[0] : root(slopes[1] / states[0]);
      return states[0] > 0.0 ? rate : Vec{};
    };
    const Vec fast = rate_square(near, near_slopes), square = h * h * fast;
    return (square > Method::stability * Method::stability) |
           ((square > Method::accuracy * Method::accuracy) & (fast > 100.0 * rate_square(own, own_slopes)));
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

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
