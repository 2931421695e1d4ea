// Forces of joints that dry friction or a stop holds, or lets go; and impulses of joints that reach a stop.
//
// With accelerations a = b + A τ and forces low <= τ <= high, A symmetric and positive semidefinite: a = 0 between the
// bounds, a >= 0 where τ = low, a <= 0 where τ = high. This is a linear complementarity problem with two bounds, solved by pivots of least
// index, which end for positive definite A: J. J. Júdice & F. M. Pires, Comput. Oper. Res. 21 (1994) 587-596; K. G. Murty,
// Linear Complementarity (1988), ch. 6. If rounding keeps them from ending, relaxation goes on from there.
//
// The force of a gear with losses by load depends on the acceleration beyond its limits (gear_losses.py): forwards it is
// base + min(0, p − c a), backwards base + max(0, r − c a), with p, c, r >= 0 or of either sign. It falls as a rises, so
// that the forces are unique; where p − c a < 0 (r − c a > 0) the load drives the motor.
//
// In closed linkages a joint may be held by others. The accelerations are unique then and the forces are not: those of the
// joints of largest index are 0 while the others bear the load.
#pragma once

#include <cmath>

#include "right_hand_side.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

class BoundedForces {
 public:
  static constexpr double small = 1e-10, dependent = 1e-12;  // of a joint's own response

  explicit BoundedForces(int most)
      : force(most), acceleration(most), matrix(static_cast<std::size_t>(most) * most), right(most), low(most), high(most),
        compliance(most), forward(most), backward(most), side_(most), inside_(most), free_(most), driven_(most),
        factor_(static_cast<std::size_t>(most) * most), x_(most) {}

  Buffer force, acceleration;  // the solution (n)
  Buffer matrix, right, low, high;  // A (n, n), b and the bounds (n), of which one may be infinite

  Buffer compliance, forward, backward;  // c, p and r (n), which `solve_gears` reads

  // Solves for `force` and `acceleration`.
  void solve(int n) {
    gears_ = false;
    for (int i = 0; i < n; ++i) side_[i] = low[i] == high[i];  // of a force that is given
    pivot(n);
  }
  // The same with gears; `ways[i]`, where not 0, is the direction in which joint i moves already.
  void solve_gears(int n, const int* ways) {
    gears_ = true;
    for (int i = 0; i < n; ++i) {
      take_side(i, ways[i] ? -ways[i] : low[i] == high[i]);
    }
    pivot(n);
  }

  // Whether joint i accelerates, by more than rounding, or another share of its terms, explains.
  bool moves(int i, int n, double share = small) const { return std::fabs(acceleration[i]) > share / small * rounding(i, n); }
  bool at_limit(int i) const { return side_[i] != 0; }
  bool at_most(int i) const { return side_[i] > 0; }  // its upper limit
  bool driven(int i) const { return driven_[i] != 0; }  // whether the load drives the motor, of gears that move
  // Whether the force of joint i, below its limit, keeps it at rest; otherwise others do.
  bool holds(int i) const { return free_[i] > 0; }
  // Whether joint i could move, by more than a share of its own response, while the joints that hold do not.
  bool can_move(int i, int n, double share = dependent) {
    double* row = x_;
    double value = a(i, i, n);
    for (int k = 0; k < kept_; ++k) {
      double sum = a(i, inside_[k], n);
      for (int m = 0; m < k; ++m) sum -= factor_[k * n + m] * row[m];
      row[k] = sum / factor_[k * n + k];
      value -= row[k] * row[k];
    }
    return value > share * a(i, i, n);
  }

 private:
  Array<int> side_, inside_, free_;  // 1 and -1: at a bound of the force; which hold, as a list and as marks
  Array<int> driven_;
  bool gears_ = false;
  int kept_ = 0;
  Buffer factor_, x_;

  double a(int i, int j, int n) const { return matrix[i * n + j]; }

  void pivot(int n) {
    for (int pivots = 0; pivots < 50 * (n + 1); ++pivots) {
      equilibrium(n);
      const int wrong = first_wrong(n);
      if (wrong < 0) return to_limits(n);
      if (wrong_gear(wrong)) {
        driven_[wrong] = !driven_[wrong];
        continue;
      }
      take_side(wrong, side_[wrong] ? 0 : force[wrong] > high[wrong] ? 1 : -1);
    }
    relax(n);
  }

  void take_side(int i, int side) {
    side_[i] = side;
    driven_[i] = gears_ && side && (side < 0 ? forward[i] < 0 : backward[i] > 0);
  }

  // Of a gear at a limit: how far the motor drives the load; and whether that is not the side that is taken.
  double drives(int i, double a) const {
    return side_[i] < 0 ? forward[i] - compliance[i] * a : compliance[i] * a - backward[i];
  }
  bool wrong_gear(int i) const {
    if (!gears_ || !side_[i]) return false;
    const double size = std::fabs(side_[i] < 0 ? forward[i] : backward[i]) + std::fabs(compliance[i] * acceleration[i]);
    const double left = drives(i, acceleration[i]);
    return driven_[i] ? left > small * size : left < -small * size;
  }
  // Whether the force at a limit depends on the acceleration; and the force there, or that without acceleration.
  bool yields(int i) const { return gears_ && side_[i] && driven_[i] && compliance[i] > 0; }
  double at_side(int i) const {
    const double bound = side_[i] > 0 ? high[i] : low[i];
    if (!gears_) return bound;
    const double more = side_[i] > 0 ? backward[i] : forward[i];
    const double base = bound - (side_[i] > 0 ? (more > 0 ? more : 0) : (more < 0 ? more : 0));
    return driven_[i] ? base + more : base;
  }

  double rounding(int i, int n) const {
    double size = std::fabs(right[i]);
    for (int j = 0; j < n; ++j) size += std::fabs(a(i, j, n) * force[j]);
    return small * size;
  }

  // Forces inside their bounds that give no acceleration, the others being at theirs.
  void equilibrium(int n) {
    for (int i = 0; i < n; ++i) force[i] = side_[i] && !yields(i) ? at_side(i) : 0, free_[i] = 0;
    kept_ = 0;
    for (int i = 0; i < n; ++i) {  // Cholesky, without the joints that those before them hold
      if (side_[i] && !yields(i)) continue;
      const int k = kept_;
      double sum = -right[i], pivot = a(i, i, n);
      if (yields(i)) sum += at_side(i) / compliance[i], pivot += 1 / compliance[i];
      for (int j = 0; j < n; ++j)
        if (side_[j] && !yields(j)) sum -= a(i, j, n) * force[j];
      for (int l = 0; l < k; ++l) {
        double value = a(i, inside_[l], n);
        for (int m = 0; m < l; ++m) value -= factor_[k * n + m] * factor_[l * n + m];
        value = factor_[k * n + l] = value / factor_[l * n + l];
        pivot -= value * value;
        sum -= value * x_[l];
      }
      if (!(pivot > dependent * a(i, i, n))) continue;
      factor_[k * n + k] = std::sqrt(pivot);
      x_[k] = sum / factor_[k * n + k];
      inside_[kept_++] = i, free_[i] = 1;
    }
    const int count = kept_;
    for (int k = count - 1; k >= 0; --k) {
      double sum = x_[k];
      for (int m = k + 1; m < count; ++m) sum -= factor_[m * n + k] * x_[m];
      x_[k] = sum / factor_[k * n + k];
      force[inside_[k]] = x_[k];
    }
    accelerate(n);
  }

  // Forces that rounding left below their limits are at them.
  void to_limits(int n) {
    bool changed = false;
    for (int i = 0; i < n; ++i)
      if (!side_[i] && reaches(i, n))
        take_side(i, std::fabs(force[i] - high[i]) < std::fabs(force[i] - low[i]) ? 1 : -1), changed = true;
    if (changed) equilibrium(n);
  }

  void accelerate(int n) {
    for (int i = 0; i < n; ++i) {
      double sum = right[i];
      for (int j = 0; j < n; ++j) sum += a(i, j, n) * force[j];
      acceleration[i] = sum;
    }
  }

  int first_wrong(int n) const {
    for (int i = 0; i < n; ++i)
      if (wrong_gear(i) || (low[i] != high[i] && (side_[i] ? side_[i] * acceleration[i] > rounding(i, n)
                   : force[i] > high[i] + small * std::fabs(high[i]) || force[i] < low[i] - small * std::fabs(low[i]))))
        return i;
    return -1;
  }

  // Whether a force is at a bound up to rounding, which is relative to the bound or, at a bound of 0, to the load.
  bool reaches(int i, int n) const {
    const double load = std::fabs(right[i]) / (a(i, i, n) + 1e-300);
    auto near = [&](double bound) {
      return std::fabs(bound) < INFINITY && std::fabs(force[i] - bound) <= 1e-9 * (bound != 0 ? std::fabs(bound) : load);
    };
    return near(low[i]) || near(high[i]);
  }

  void relax(int n) {
    for (int sweep = 0; sweep < 1000; ++sweep)
      for (int i = 0; i < n; ++i) {
        double sum = right[i];
        for (int j = 0; j < n; ++j) sum += a(i, j, n) * force[j];
        const double rest = sum - a(i, i, n) * force[i], next = -rest / (a(i, i, n) + 1e-300);
        if (low[i] != high[i]) side_[i] = next >= high[i] ? 1 : next <= low[i] ? -1 : 0;
        if (!side_[i]) {
          force[i] = next;
          continue;
        }
        if (gears_) driven_[i] = 0;
        force[i] = at_side(i);
        if (gears_ && drives(i, rest + a(i, i, n) * force[i]) < 0)
          driven_[i] = 1, force[i] = (at_side(i) - compliance[i] * rest) / (1 + compliance[i] * a(i, i, n));
      }
    for (int i = 0; i < n; ++i) free_[i] = !side_[i];
    accelerate(n);
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
