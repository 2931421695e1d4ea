// Sampling of event functions: the places within an interval, and bounds on the function between the samples.
//
// The places are uneven, so that no oscillation looks smooth at all of them; on an even grid one with a whole number of
// periods between samples does. They were found by random search: 1 of 40,000 random oscillations with up to 500 periods
// an interval was taken for smooth, against 1 of 30 on an even grid.
#pragma once

#include "right_hand_side.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

constexpr int parts = 8;
constexpr double place[parts + 1] = {0, 0.110279, 0.284733, 0.352567, 0.516369, 0.655138, 0.706202, 0.854639, 1};

// Divided differences of samples at `place`, as weights. `miss` [k]: how far the sample from the cubic through its four
// neighbours, in the window of samples k to k + 4; where two samples of a window count, the larger of both. `bend` [i]:
// the second derivative at sample i + 1 times the square of the longer interval beside it, an eighth: the rise of the
// arc over its chord.
struct SampleWeights {
  double miss[parts - 3][5] = {}, bend[parts - 1][3] = {};

  constexpr SampleWeights() {
    for (int k = 0; k + 4 <= parts; ++k) {
      double largest = 0;
      for (int i = k == 0 ? 1 : k + 2; i <= (k + 4 == parts ? parts - 1 : k + 2); ++i) {
        double product = 1;
        for (int j = k; j <= k + 4; ++j)
          if (j != i) product *= place[i] > place[j] ? place[i] - place[j] : place[j] - place[i];
        if (product > largest) largest = product;
      }
      for (int i = 0; i < 5; ++i) {
        double product = largest;
        for (int j = 0; j < 5; ++j)
          if (j != i) product /= place[k + i] - place[k + j];
        miss[k][i] = product;
      }
    }
    for (int i = 1; i < parts; ++i) {
      const double a = place[i - 1], b = place[i], c = place[i + 1];
      const double longest = b - a > c - b ? b - a : c - b, scale = 0.25 * longest * longest;
      bend[i - 1][0] = scale / ((a - b) * (a - c));
      bend[i - 1][1] = scale / ((b - a) * (b - c));
      bend[i - 1][2] = scale / ((c - a) * (c - b));
    }
  }
};
inline constexpr SampleWeights sample_weights;

// Bounds on a function between nine samples.
struct Shape {
  double miss;                // how far samples are from cubics through their neighbours, at most
  double bend[parts + 1];     // how far the arc may lie off its chord, at each sample

  explicit Shape(const double* v) {
    miss = 0;
    for (int k = 0; k + 4 <= parts; ++k) {
      const double* w = sample_weights.miss[k];
      const double d = std::fabs(w[0] * v[k] + w[1] * v[k + 1] + w[2] * v[k + 2] + w[3] * v[k + 3] + w[4] * v[k + 4]);
      miss = d > miss || d != d ? d : miss;
    }
    for (int i = 1; i < parts; ++i) {
      const double* w = sample_weights.bend[i - 1];
      bend[i] = std::fabs(w[0] * v[i - 1] + w[1] * v[i] + w[2] * v[i + 1]);
    }
    bend[0] = bend[1], bend[parts] = bend[parts - 1];
  }

  double arc(int i) const { return larger(bend[i], bend[i + 1]); }
  // Whether the function certainly keeps its sign between samples i and i + 1, which have the same sign. `caution` is
  // larger where it is known to oscillate.
  bool keeps_off(int i, const double* v, double caution) const {
    return smaller(std::fabs(v[i]), std::fabs(v[i + 1])) > arc(i) + caution * miss;
  }
  // Whether the function may lie below `least` or above `largest` between samples i and i + 1.
  bool may_leave(int i, const double* v, double least, double largest, double caution) const {
    const double lower = smaller(v[i], v[i + 1]), upper = larger(v[i], v[i + 1]), room = arc(i) + caution * miss;
    return lower - room < least || upper + room > largest;
  }
  // Whether the samples alternate more than a jump or kink can make them.
  static bool oscillates(const double* v) {
    int turns = 0;
    for (int i = 1; i < parts; ++i) turns += (v[i] - v[i - 1]) * (v[i + 1] - v[i]) < 0;
    return turns >= 3;
  }
  // Whether it is monotonic between samples i and i + 1.
  bool runs(int i, const double* v) const { return std::fabs(v[i + 1] - v[i]) > 4 * (arc(i) + miss); }
  // Whether it is approximately a parabola between samples i and i + 1.
  bool parabola(int i) const { return miss <= 0.1 * arc(i); }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
