// A parabola in the path speed y, by which limits are written near a speed.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace bellcrank {

constexpr double unlimited = std::numeric_limits<double>::infinity();
constexpr double rounding = 1e-12;  // relative: bounds that differ by less meet

// p2 y² + p1 y + p0, the same as the bound itself near a y, and for y in [low, high] up to the curvature of σ.
struct Parabola {
  double p2, p1, p0;  // not set by default: arrays of them are made for each speed
  double operator()(double y) const { return (p2 * y + p1) * y + p0; }
  double slope(double y) const { return 2 * p2 * y + p1; }

  // The smallest root above y at which the value becomes negative; infinite without one.
  double next_root(double y) const {
    double best = unlimited;
    const auto consider = [&](double root) {
      if (root > y * (1 + 1e-12) && root < best && 2 * p2 * root + p1 < 0) best = root;
    };
    if (p2 == 0) {
      if (p1 != 0) consider(-p0 / p1);
    } else if (const double square = p1 * p1 - 4 * p2 * p0; square >= 0) {
      const double q = -0.5 * (p1 + std::copysign(std::sqrt(square), p1));
      consider(q / p2);
      if (q != 0) consider(p0 / q);
    }
    return best;
  }
};

inline Parabola difference(const Parabola& a, const Parabola& b) { return {a.p2 - b.p2, a.p1 - b.p1, a.p0 - b.p0}; }

// The y between which parabolas hold.
struct Range {
  double low = 0, high = unlimited;

  void narrow(double from, double to) { low = std::max(low, from), high = std::min(high, to); }

  // To the speeds around y up to which a parabola does not change its sign; to y alone at a root.
  void narrow_to_sign(const Parabola& p, double y) {
    const auto consider = [&](double root) {
      if (root <= y * (1 + 1e-14)) low = std::max(low, std::min(root, y));
      if (root >= y * (1 - 1e-14)) high = std::min(high, std::max(root, y));
    };
    if (p.p2 == 0) {
      if (p.p1 != 0) consider(-p.p0 / p.p1);
    } else if (const double square = p.p1 * p.p1 - 4 * p.p2 * p.p0; square >= 0) {
      const double q = -0.5 * (p.p1 + std::copysign(std::sqrt(square), p.p1));
      consider(q / p.p2);
      if (q != 0) consider(p.p0 / q);
    }
  }
};

}  // namespace bellcrank
