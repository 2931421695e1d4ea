// The extremum of a smooth function between two samples, by the polynomial through those samples that are near.
#pragma once

#include "event_sampling.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// Whether samples at `place` turn at sample i or i + 1, or may do so before the first or after the last: as they must
// where a smooth function has an extremum between these two.
inline bool turns_beside(int i, const double* v) {
  const auto turns = [v](int k) { return k == 0 || k == parts || (v[k] - v[k - 1]) * (v[k + 1] - v[k]) <= 0; };
  return turns(i) || turns(i + 1);
}

// Divided differences of six samples at `place` from one on, as weights of the samples.
struct NewtonWeights {
  static constexpr int most = 6;
  double weight[parts - most + 2][most][most] = {};

  constexpr NewtonWeights() {
    for (int first = 0; first + most <= parts + 1; ++first)
      for (int k = 0; k < most; ++k)
        for (int i = 0; i <= k; ++i) {
          double product = 1;
          for (int j = 0; j <= k; ++j)
            if (j != i) product *= place[first + i] - place[first + j];
          weight[first][k][i] = 1 / product;
        }
  }
};
inline constexpr NewtonWeights newton_weights;

// Newton's form of the polynomial through samples at `place` around the interval i, on a step from 0 to 1; values
// elsewhere can be added. I. Newton; e.g. J. Stoer, R. Bulirsch, Introduction to Numerical Analysis, sec. 2.1.3.
class ExtremumPolynomial {
 public:
  ExtremumPolynomial(int i, const double* v) : left_(place[i]), right_(place[i + 1]) {
    const int first = i < 2 ? 0 : i > parts - 3 ? parts - 5 : i - 2;
    for (int k = 0; k < NewtonWeights::most; ++k) {
      double sum = 0;
      for (int j = 0; j <= k; ++j) sum += newton_weights.weight[first][k][j] * v[first + j];
      node_[k] = place[first + k], term_[k] = sum;
    }
    count_ = NewtonWeights::most;
  }

  void add(double s, double value) {
    for (int k = 0; k < count_; ++k) value = (value - term_[k]) / (s - node_[k]);
    node_[count_] = s, term_[count_++] = value;
  }

  double operator()(double s) const {
    double value = term_[count_ - 1];
    for (int k = count_ - 2; k >= 0; --k) value = term_[k] + (s - node_[k]) * value;
    return value;
  }

  // Where the slope vanishes in the interval, by Newton's method within a shrinking bracket; false where the slope has
  // the same sign at both ends.
  bool extremum(double* where) const {
    double a = left_, b = right_, curve;
    const double at_a = slope(a, &curve), at_b = slope(b, &curve);
    if (!(at_a < 0 && at_b > 0) && !(at_a > 0 && at_b < 0)) return false;
    double s = a - at_a * (b - a) / (at_b - at_a);
    for (int k = 0; k < 30; ++k) {
      const double at_s = slope(s, &curve);
      (at_s > 0) == (at_a > 0) ? a = s : b = s;
      double next = s - at_s / curve;
      if (!(next > a && next < b)) next = 0.5 * (a + b);
      const bool done = std::fabs(next - s) <= 1e-9;
      s = next;
      if (done) break;
    }
    *where = s;
    return true;
  }

 private:
  static constexpr int most = 12;
  double left_, right_, node_[most], term_[most];
  int count_ = 0;

  double slope(double s, double* curve) const {
    double value = term_[count_ - 1], first = 0, second = 0;  // second: half the second derivative
    for (int k = count_ - 2; k >= 0; --k) {
      const double d = s - node_[k];
      second = second * d + first;
      first = first * d + value;
      value = value * d + term_[k];
    }
    *curve = 2 * second;
    return first;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
