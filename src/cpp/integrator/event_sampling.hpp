// Sampling of event functions: the places within an interval, and bounds on the function between the samples.
//
// The places are uneven, so that no oscillation looks smooth at all of them; on an even grid one with a whole number of
// periods between samples does. They were found by random search: 1 of 40,000 random oscillations with up to 500 periods
// an interval was taken for smooth, against 1 of 30 on an even grid.
#pragma once

#include "lane_vector.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

constexpr int parts = 8;
constexpr double place[parts + 1] = {0, 0.110279, 0.284733, 0.352567, 0.516369, 0.655138, 0.706202, 0.854639, 1};

// Divided differences of samples at `place`, as weights; with a Stride of 2 of every other sample. `miss` [k]: how far the
// sample from the cubic through its four neighbours, in the window of samples k to k + 4; where two samples or more of a
// window count, the largest of all. `bend` [i]: the second derivative at sample i + 1 times the square of the longer
// interval beside it, an eighth: the rise of the arc over its chord.
template <int Stride>
struct SampleWeights {
  static constexpr int count = parts / Stride;
  double miss[count - 3][5] = {}, bend[count - 1][3] = {};
  double front[4] = {}, back[4] = {};  // the same at the first sample and the last, by the cubic through four samples

  static constexpr double at(int i) { return place[Stride * i]; }

  constexpr SampleWeights() {
    for (int k = 0; k + 4 <= count; ++k) {
      double largest = 0;
      for (int i = k == 0 ? 1 : k + 2; i <= (k + 4 == count ? count - 1 : k + 2); ++i) {
        double product = 1;
        for (int j = k; j <= k + 4; ++j)
          if (j != i) product *= at(i) > at(j) ? at(i) - at(j) : at(j) - at(i);
        if (product > largest) largest = product;
      }
      for (int i = 0; i < 5; ++i) {
        double product = largest;
        for (int j = 0; j < 5; ++j)
          if (j != i) product /= at(k + i) - at(k + j);
        miss[k][i] = product;
      }
    }
    for (int i = 1; i < count; ++i) {
      const double a = at(i - 1), b = at(i), c = at(i + 1);
      const double longest = b - a > c - b ? b - a : c - b, scale = 0.25 * longest * longest;
      bend[i - 1][0] = scale / ((a - b) * (a - c));
      bend[i - 1][1] = scale / ((b - a) * (b - c));
      bend[i - 1][2] = scale / ((c - a) * (c - b));
    }
    at_end(0, 1, front), at_end(count, -1, back);
  }

 private:
  // The second derivative of a cubic is linear, and its difference of three samples is that at their mean place.
  constexpr void at_end(int end, int step, double* weights) {
    const double width = at(end + step) - at(end), scale = 0.25 * width * width;
    double mean[2] = {};
    for (int k = 0; k < 2; ++k)
      for (int i = k; i < k + 3; ++i) mean[k] += at(end + i * step) / 3;
    const double ratio = (at(end) - mean[0]) / (mean[1] - mean[0]);
    for (int k = 0; k < 2; ++k)
      for (int i = k; i < k + 3; ++i) {
        double product = scale * (k == 0 ? 1 - ratio : ratio);
        for (int j = k; j < k + 3; ++j)
          if (j != i) product /= at(end + i * step) - at(end + j * step);
        weights[i] += product;
      }
  }
};
template <int Stride>
inline constexpr SampleWeights<Stride> sample_weights;

// Bounds on a function between nine samples, or five. `T`: double, or a vector with a function in each lane; a comparison
// is then one a lane.
template <class T, int Stride = 1>
struct ShapeOf {
  static constexpr int count = parts / Stride;
  T miss;             // how far samples are from cubics through their neighbours, at most
  T bend[count + 1];  // how far the arc may lie off its chord, at each sample

  explicit ShapeOf(const T* v) {
    miss = T{};
    for (int k = 0; k + 4 <= count; ++k) {
      const double* w = sample_weights<Stride>.miss[k];
      const T d = absolute(w[0] * v[k] + w[1] * v[k + 1] + w[2] * v[k + 2] + w[3] * v[k + 3] + w[4] * v[k + 4]);
      miss = (d > miss) | (d != d) ? d : miss;
    }
    for (int i = 1; i < count; ++i) {
      const double* w = sample_weights<Stride>.bend[i - 1];
      bend[i] = absolute(w[0] * v[i - 1] + w[1] * v[i] + w[2] * v[i + 1]);
    }
    bend[0] = bend[1], bend[count] = bend[count - 1];
  }

  T arc(int i) const { return larger(bend[i], bend[i + 1]); }
  // Whether the function certainly keeps its sign between samples i and i + 1, which have the same sign. `safety_factor` is
  // larger where it is known to oscillate.
  auto has_no_zero(int i, const T* v, double safety_factor) const {
    return smaller(absolute(v[i]), absolute(v[i + 1])) > arc(i) + safety_factor * miss;
  }
  // Whether the function may lie below `least` or above `largest` between samples i and i + 1.
  auto may_leave(int i, const T* v, T least, T largest, double safety_factor) const {
    const T lower = smaller(v[i], v[i + 1]), upper = larger(v[i], v[i + 1]), room = arc(i) + safety_factor * miss;
    return (lower - room < least) | (upper + room > largest);
  }
  // Whether it is monotonic between samples i and i + 1.
  auto runs(int i, const T* v) const { return absolute(v[i + 1] - v[i]) > 4.0 * (arc(i) + miss); }
  // Whether it is approximately a parabola between samples i and i + 1.
  auto parabola(int i) const { return miss <= 0.1 * arc(i); }
};

inline double safety_factor(int depth) { return depth ? 4 : 2; }

// Whether a function surely has no zero between three samples of the same sign, at both ends and the middle of a step.
template <class T>
auto halves_have_no_zero(const T* v) {
  return smaller(absolute(v[0]), smaller(absolute(v[1]), absolute(v[2]))) > absolute(v[0] - 2.0 * v[1] + v[2]);
}

// Whether a function surely keeps its sign (1, -1, or 0 where it has none yet) in a step with nine samples, or a `few`: three.
template <class T>
auto keeps_sign(const T* v, T sign, bool few) {
  auto clear = v[0] * sign > 0.0;
  for (int i = 1; i <= (few ? 2 : parts); ++i) clear = clear & (v[i] * sign > 0.0);
  if (!any(clear)) return clear;
  if (few) {
    clear = clear & halves_have_no_zero(v);
  } else {
    const ShapeOf<T> shape(v);
    for (int i = 0; i < parts; ++i) clear = clear & shape.has_no_zero(i, v, safety_factor(0));
  }
  return clear;
}

// The same, where a bend that grows towards an end of the step must not be taken for a smaller one.
template <class T, int Stride = 1>
struct ShapeToEnds : ShapeOf<T, Stride> {
  explicit ShapeToEnds(const T* v) : ShapeOf<T, Stride>(v) {
    constexpr int count = ShapeOf<T, Stride>::count;
    const auto& w = sample_weights<Stride>;
    T front = {}, back = {};
    for (int i = 0; i < 4; ++i) front += w.front[i] * v[i], back += w.back[i] * v[count - i];
    this->bend[0] = larger(this->bend[0], absolute(front));
    this->bend[count] = larger(this->bend[count], absolute(back));
  }
  // Whether it is monotonic between samples i and i + 1, even if it has a corner there.
  auto is_monotonic(int i, const T* v) const { return absolute(v[i + 1] - v[i]) > 4.0 * this->arc(i) + 16.0 * this->miss; }
};

// Of one function.
struct Shape : ShapeOf<double> {
  using ShapeOf<double>::ShapeOf;

  // Whether the samples alternate more than a jump or kink can make them.
  static bool oscillates(const double* v) {
    int turns = 0;
    for (int i = 1; i < parts; ++i) turns += (v[i] - v[i - 1]) * (v[i + 1] - v[i]) < 0;
    return turns >= 3;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
