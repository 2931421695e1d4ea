// Limits along a path, as bounds of the path acceleration.
//
// Along a path q(s) let y be the path speed ds/dt, x = y² and u the path acceleration d²s/dt². A limited quantity
// (a joint torque, a torque at a motor's shaft, a joint acceleration) is
//
//   value = a u + b x + d y + c + Σ_j w_j σ(rate_j y / width_j),   σ(z) = z / √(z² + 1),
//
// with coefficients that depend on the place s alone: b from centrifugal and Coriolis terms, d from viscous friction,
// w from Coulomb friction smoothed over a width (J. Bobrow, S. Dubowsky, J. Gibson, Int. J. Robotics Research 4, 1985,
// without friction; friction is ours). For a given y each limit bounds u from above or from below, or, where a = 0, is
// a limit of y alone. Besides, the norm of a vector A u + B x (a frame's acceleration) is limited by a cone: with
// B = bend A + a part across A of the length `across`,
//
//   |A|² (u + bend x)² + across² x² <= limit²,
//
// which bounds u by -bend x ± √(limit² - across² x²) / |A|, and x by limit / across.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "parabola.hpp"

namespace bellcrank {

// Where a gear loses power, the value is the larger of two (`drive`: the load takes power; `back`: it gives power back)
// for a motor that turns forward and the smaller for one that turns backward.
struct LimitRow {
  int drive, back;  // quantities; back -1: there is one value
  int motor;        // column of motor_rate; -1 without gear or curve
  int curve;        // torque-speed curve where the limited torque drives the motor; -1: the constant
  int braking;      // the curve where it brakes it; read where there is a curve
  double sense;     // +1: value <= limit; -1: -value <= limit
  double limit;     // > 0; with a curve its largest torque, to which excess is related
};

struct Curve {
  std::vector<double> speed, torque;  // at the shaft, rad/s and N m
};

// Coefficients at n places: arrays (n, quantities), (n, quantities, joints), (n, joints), (n, motors), (n), (n, norms).
struct PathLimits {
  std::size_t places = 0, quantities = 0, joints = 0, motors = 0, norms = 0;
  const double *a = nullptr, *b = nullptr, *d = nullptr, *c = nullptr, *w = nullptr, *rate = nullptr;
  const double *motor_rate = nullptr, *fastest = nullptr, *width = nullptr, *negligible = nullptr;
  const double *along = nullptr, *bend = nullptr, *across = nullptr, *norm = nullptr;  // norm: limits (norms)
  std::vector<LimitRow> rows;
  std::vector<Curve> curves;

  // Whether a row has two quantities, so that limits may leave out u between others that they allow.
  bool may_split() const {
    return std::any_of(rows.begin(), rows.end(), [](const LimitRow& row) { return row.back >= 0; });
  }
};

constexpr std::size_t most_quantities = 512;
using Values = Parabola[most_quantities];

// The limited quantities and the limits of rows at a place. Where a motor turns back, the gear's losses change: there
// they are those on the side of another place.
class QuantitiesAtPlace {
 public:
  QuantitiesAtPlace(const PathLimits& limits, std::size_t place) : QuantitiesAtPlace(limits, place, place) {}
  QuantitiesAtPlace(const PathLimits& limits, std::size_t place, std::size_t side)
      : limits_(limits), place_(place), side_(side) {}

  // The coefficients of u.
  const double* slopes() const { return limits_.a + place_ * limits_.quantities; }

  // The parts of the quantities that do not depend on u.
  void values(double y, Range& range, Values& found) const {
    for (std::size_t k = 0; k < limits_.quantities; ++k) found[k] = value(k, y, range);
  }

  // By how much a row's motor turns along the path; 0 for a row without one.
  double turning(const LimitRow& row) const {
    if (row.motor < 0) return 0.0;
    const double here = limits_.motor_rate[place_ * limits_.motors + row.motor];
    const double beside = limits_.motor_rate[side_ * limits_.motors + row.motor];
    return std::abs(here) <= rounding * std::abs(beside) ? beside : here;
  }

  // The limit of a row.
  Parabola limit_at(const LimitRow& row, double y, Range& range) const {
    if (row.curve < 0) return {0, 0, row.limit};
    const double rate = limits_.motor_rate[place_ * limits_.motors + row.motor], turning = std::abs(rate);
    const Curve& curve = limits_.curves[row.sense * this->turning(row) < 0.0 ? row.braking : row.curve];
    const double speed = turning * y;
    const std::size_t last = curve.speed.size() - 1;
    if (turning == 0.0) return {0, 0, curve.torque[0]};
    if (speed > curve.speed[last]) {
      range.narrow(curve.speed[last] / turning, unlimited);
      return {0, 0, -1.0};  // no torque is allowed, in either direction
    }
    std::size_t k = 0;
    while (k + 1 < last && speed > curve.speed[k + 1]) ++k;
    const double slope = (curve.torque[k + 1] - curve.torque[k]) / (curve.speed[k + 1] - curve.speed[k]);
    range.narrow(curve.speed[k] / turning, curve.speed[k + 1] / turning);
    return {0, slope * turning, curve.torque[k] - slope * curve.speed[k]};
  }

 protected:
  const PathLimits& limits_;
  std::size_t place_, side_;

 private:
  Parabola value(std::size_t k, double y, Range& range) const {
    const std::size_t at = place_ * limits_.quantities + k;
    Parabola p{limits_.b[at], limits_.d[at], limits_.c[at]};
    const double* w = limits_.w + at * limits_.joints;
    for (std::size_t j = 0; j < limits_.joints; ++j) {
      if (w[j] == 0.0) continue;
      const double slope = limits_.rate[place_ * limits_.joints + j] / limits_.width[j];
      if (slope == 0.0) continue;
      const double z = slope * y, root = std::sqrt(z * z + 1.0);
      const double sigma = z / root, rise = slope / (root * root * root);
      p.p1 += w[j] * rise;
      p.p0 += w[j] * (sigma - rise * y);
      if (std::abs(z) < 20.0)  // the tangent holds nearby only
        range.narrow(0.5 * y, std::max(2.0 * y, 0.1 / std::abs(slope)));
    }
    return p;
  }
};

}  // namespace bellcrank
