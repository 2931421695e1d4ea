// The extremum of a smooth function between two samples, by the polynomial through those samples that are near.
#pragma once

#include "event_sampling.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

constexpr int near = 6;  // samples at `place` that make a polynomial
// The first of those around the interval from sample i to i + 1.
constexpr int first_near(int i) { return i < 2 ? 0 : i > parts - 3 ? parts + 1 - near : i - 2; }

// The slope of this polynomial at the beginning and the end of each interval, as weights of the samples: derivatives of
// Lagrange's polynomials.
struct SlopeWeights {
  double weight[parts][2][near] = {};

  constexpr SlopeWeights() {
    for (int i = 0; i < parts; ++i)
      for (int side = 0; side < 2; ++side)
        for (int j = 0, first = first_near(i); j < near; ++j) {
          const int own = i + side - first;
          double over = 1, under = 1, sum = 0;
          for (int m = 0; m < near; ++m) {
            if (m != own) sum += 1 / (place[first + own] - place[first + m]);
            if (m != j) under *= place[first + j] - place[first + m];
            if (m != j && m != own) over *= place[first + own] - place[first + m];
          }
          weight[i][side][j] = j == own ? sum : over / under;
        }
  }
};
inline constexpr SlopeWeights slope_weights;

// Whether the polynomial has an extremum between samples i and i + 1.
template <class T>
auto turns_within(int i, const T* v) {
  T slope[2] = {};
  for (int side = 0; side < 2; ++side)
    for (int j = 0; j < near; ++j) slope[side] += slope_weights.weight[i][side][j] * v[first_near(i) + j];
  return slope[0] * slope[1] < 0.0;
}

// Newton's form of the polynomial through values at any places. I. Newton; e.g. J. Stoer, R. Bulirsch, Introduction to
// Numerical Analysis, sec. 2.1.3. `T`: double, or a vector with a function in each lane.
template <class T>
class ExtremumPolynomial {
 public:
  void add(T s, T value) {
    for (int k = 0; k < count_; ++k) value = (value - term_[k]) / (s - node_[k]);
    node_[count_] = s, term_[count_++] = value;
  }

  T operator()(T s) const {
    T value = term_[count_ - 1];
    for (int k = count_ - 2; k >= 0; --k) value = term_[k] + (s - node_[k]) * value;
    return value;
  }

  // Where the slope vanishes between a and b, by Newton's method within a shrinking bracket; false where the slope has the
  // same sign at both.
  auto extremum(T a, T b, T* where) const {
    T curve;
    const T at_a = slope(a, &curve), at_b = slope(b, &curve);
    const auto found = ((at_a < 0.0) & (at_b > 0.0)) | ((at_a > 0.0) & (at_b < 0.0));
    T s = a - at_a * (b - a) / (at_b - at_a);
    auto open = found;
    for (int k = 0; k < 30 && any(open); ++k) {
      const T at_s = slope(s, &curve);
      const auto left = (at_s > 0.0) == (at_a > 0.0);
      a = left ? s : a, b = left ? b : s;
      T next = s - at_s / curve;
      next = (next > a) & (next < b) ? next : 0.5 * (a + b);
      const auto more = absolute(next - s) > 1e-9;
      s = open ? next : s;
      open = open & more;
    }
    *where = s;
    return found;
  }

 private:
  static constexpr int most = 12;
  T node_[most], term_[most];
  int count_ = 0;

  T slope(T s, T* curve) const {
    T value = term_[count_ - 1], first = T{}, second = T{};  // second: half the second derivative
    for (int k = count_ - 2; k >= 0; --k) {
      const T d = s - node_[k];
      second = second * d + first;
      first = first * d + value;
      value = value * d + term_[k];
    }
    *curve = 2.0 * second;
    return first;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
