// Stiffness detection for explicit methods: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, sec. IV.2,
// as in their codes dop853 and dopri5. The last stage and the end of a step are evaluated at the same time at nearby
// arguments, so that the difference d of the arguments and that of the slopes estimate h |lambda| of the fastest part.
// Steps in which it lies beyond the limit of stability are counted: 15 of them, not interrupted by 6 others one after
// another, say that the problem is stiff.
//
// Two things are added. States of a mechanism are positions q and velocities v, whose units differ: the fast part
// obeys dq' = dv and dv' = lambda^2 dq, so that |lambda|^2 = |d(v')| / |dq| whatever its phase. And an undamped fast part
// is kept near the size of the tolerance at steps well within the limit of stability; such steps count where lambda is
// many times the rate at which the solution itself changes, which the same formula gives with the ends of the step.
#pragma once

#include "right_hand_side.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// Whether the equations are taken as of first order: there are no positions, or states beside positions and velocities.
inline bool first_order(const Problem& p) { return p.nq == 0 || p.mixed; }

// Sums of squares of the entries of positions and velocities; of all entries in both of equations of first order. `T`: double,
// or a vector with a run in each lane.
template <class T = double>
struct SquareSums {
  T positions = {}, velocities = {};
  void add(int i, T value, const Problem& p) {
    (i < p.nq || first_order(p) ? positions : velocities) += value * value;
  }
};

// The number of positions and velocities, at the beginning of the state.
inline int moving(const Problem& p) {
  if (!p.joint_count) return p.norm_size;
  const JointBlock& last = p.joints[p.joint_count - 1];
  return p.nq + last.v + last.nv;
}

// |lambda|^2 from the differences of two states and of their slopes; 0 where the states are equal.
template <class T>
T rate_square(const Problem& p, const SquareSums<T>& states, const SquareSums<T>& slopes) {
  const T rate = first_order(p) ? slopes.positions / states.positions : root(slopes.velocities / states.positions);
  return states.positions > 0.0 ? rate : T{};
}

// Whether a step of size h is held short by a part that is not seen in the solution. `fast` and `own` are lambda^2 of
// the fastest part and of the solution.
template <class Method, class T>
auto held_short(T h, T fast, T own) {
  const T square = h * h * fast;
  return (square > Method::stability * Method::stability) |
         ((square > Method::accuracy * Method::accuracy) & (fast > 100.0 * own));
}

// The same by the ends of the step, and the argument and slope of its last stage.
template <class T>
struct StepSample {
  const T *state, *slope;
};
template <class Method, class T>
auto step_held_short(const Problem& p, T h, StepSample<T> start, StepSample<T> stage, StepSample<T> end) {
  SquareSums<T> near, near_slopes, own, own_slopes;
  for (int i = 0; i < moving(p); ++i) {
    near.add(i, end.state[i] - stage.state[i], p), near_slopes.add(i, end.slope[i] - stage.slope[i], p);
    own.add(i, end.state[i] - start.state[i], p), own_slopes.add(i, end.slope[i] - start.slope[i], p);
  }
  return held_short<Method>(h, rate_square(p, near, near_slopes), rate_square(p, own, own_slopes));
}

// Of method "auto" (stiffness_switching.hpp): a shorter series, because its mistakes cost little, and evaluations to the end
// of a run from which on they are too many.
constexpr int quick_series = 6;
constexpr double costly = 20000;

class StiffnessDetector {
 public:
  // Steps between tests, but each of the first `early` is tested; tests that make a series, and others that end it.
  static constexpr int interval = 8, early = 16, series = 15, most_calm = 6;

  // Whether the step just accepted is to be tested.
  bool due() {
    ++tried_;
    if (suspicions_ == 0 && tried_ > early && --until_ > 0) return false;
    until_ = interval;
    return true;
  }
  void note(bool suspicious, double t) {
    if (suspicious) {
      calm_ = 0;
      if (++suspicions_ == 1) began_ = t;
      if (suspicions_ == enough_ && !(since_ <= t)) since_ = began_;
      if (suspicions_ >= enough_) steps_ += suspicions_ == enough_ ? enough_ : 1;
    } else if (suspicions_ > 0 && ++calm_ == most_calm) {
      suspicions_ = 0;
    }
  }
  bool stiff() const { return suspicions_ >= enough_; }
  int suspicions() const { return suspicions_; }
  std::int64_t steps() const { return steps_; }  // that were found stiff
  double since() const { return since_; }        // when the first of them began; NaN: none

  explicit StiffnessDetector(int enough = series) : enough_(enough) {}
  // Begins anew, for a series of `enough` steps.
  void restart(int enough) { suspicions_ = calm_ = 0, until_ = interval, enough_ = enough; }

 private:
  std::int64_t tried_ = 0;
  int until_ = interval, suspicions_ = 0, calm_ = 0, enough_;
  std::int64_t steps_ = 0;
  double began_ = NAN, since_ = NAN;
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
