// Forces of joints that dry friction or a stop holds, or lets go; and impulses of joints that reach a stop.
//
// With accelerations a = b + A τ and forces low <= τ <= high, A symmetric and positive semidefinite: a = 0 between the
// bounds, a >= 0 where τ = low, a <= 0 where τ = high. This is a linear complementarity problem with two bounds, solved by pivots of least
// index, which end for positive definite A: J. J. Júdice & F. M. Pires, Comput. Oper. Res. 21 (1994) 587-596; K. G. Murty,
// Linear Complementarity (1988), ch. 6. If rounding keeps them from ending, relaxation goes on from there.
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
        side_(most), inside_(most), free_(most), factor_(static_cast<std::size_t>(most) * most), x_(most) {}

  Buffer force, acceleration;  // the solution (n)
  Buffer matrix, right, low, high;  // A (n, n), b and the bounds (n), of which one may be infinite

  // Solves for `force` and `acceleration`.
  void solve(int n) {
    for (int i = 0; i < n; ++i) side_[i] = low[i] == high[i];  // of a force that is given
    for (int pivots = 0; pivots < 50 * (n + 1); ++pivots) {
      equilibrium(n);
      const int wrong = first_wrong(n);
      if (wrong < 0) return to_limits(n);
      side_[wrong] = side_[wrong] ? 0 : force[wrong] > high[wrong] ? 1 : -1;
    }
    relax(n);
  }

  // Whether joint i accelerates, by more than rounding explains.
  bool moves(int i, int n) const { return std::fabs(acceleration[i]) > rounding(i, n); }
  bool at_limit(int i) const { return side_[i] != 0; }
  bool at_most(int i) const { return side_[i] > 0; }  // its upper limit
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
  int kept_ = 0;
  Buffer factor_, x_;

  double a(int i, int j, int n) const { return matrix[i * n + j]; }

  double rounding(int i, int n) const {
    double size = std::fabs(right[i]);
    for (int j = 0; j < n; ++j) size += std::fabs(a(i, j, n) * force[j]);
    return small * size;
  }

  // Forces inside their bounds that give no acceleration, the others being at theirs.
  void equilibrium(int n) {
    for (int i = 0; i < n; ++i) force[i] = side_[i] > 0 ? high[i] : side_[i] < 0 ? low[i] : 0, free_[i] = 0;
    kept_ = 0;
    for (int i = 0; i < n; ++i) {  // Cholesky, without the joints that those before them hold
      if (side_[i]) continue;
      const int k = kept_;
      double sum = -right[i], pivot = a(i, i, n);
      for (int j = 0; j < n; ++j)
        if (side_[j]) sum -= a(i, j, n) * force[j];
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
      if (!side_[i] && reaches(i, n)) side_[i] = std::fabs(force[i] - high[i]) < std::fabs(force[i] - low[i]) ? 1 : -1, changed = true;
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
      if (low[i] != high[i] && (side_[i] ? side_[i] * acceleration[i] > rounding(i, n)
                   : force[i] > high[i] + small * std::fabs(high[i]) || force[i] < low[i] - small * std::fabs(low[i])))
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
        const double next = force[i] - sum / (a(i, i, n) + 1e-300);
        force[i] = next > high[i] ? high[i] : next < low[i] ? low[i] : next;
      }
    for (int i = 0; i < n; ++i) side_[i] = force[i] >= high[i] ? 1 : force[i] <= low[i] ? -1 : 0, free_[i] = !side_[i];
    accelerate(n);
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
