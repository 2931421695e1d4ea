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

#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

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
  double creep = 0;  // up to this y the load counts as taking power, as it does at standstill
  std::vector<LimitRow> rows;
  std::vector<Curve> curves;
};

constexpr double unlimited = std::numeric_limits<double>::infinity();

// p2 y² + p1 y + p0, the same as the bound itself near a y, and for y in [low, high] up to the curvature of σ.
struct Parabola {
  double p2, p1, p0;  // not set by default: arrays of them are made for each speed
  double operator()(double y) const { return (p2 * y + p1) * y + p0; }
  double slope(double y) const { return 2 * p2 * y + p1; }

  // The smallest root above y at which the value becomes negative; infinite without one.
  double next_root(double y) const {
    double best = std::numeric_limits<double>::infinity();
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

struct Bound {
  double value;
  Parabola shape;
  int row, quantity = -1;
};

// The bounds of u at a place and a speed: least <= u <= most, and the worst limit that does not depend on u.
struct Bounds {
  Bound least{-unlimited, {}, -1}, most{unlimited, {}, -1};
  Bound speed{unlimited, {}, -1};  // value >= 0 where the limits without u are kept
  double low = 0, high = unlimited;  // the y between which the shapes hold

  bool hole = false;  // some u between the bounds are left out although they are allowed

  double gap() const { return most.value - least.value; }
};

class LimitsAtPlace {
 public:
  LimitsAtPlace(const PathLimits& limits, std::size_t place) : limits_(limits), place_(place) {}

  double fastest() const { return limits_.fastest[place_]; }

  Bounds bounds(double y) const {
    Bounds found;
    const std::size_t count = limits_.quantities;
    const double* a = limits_.a + place_ * count;
    Parabola values[most_quantities];
    for (std::size_t k = 0; k < count; ++k) values[k] = value(k, y, found);
    for (std::size_t r = 0; r < limits_.rows.size(); ++r) {
      const LimitRow& row = limits_.rows[r];
      if (row.motor < 0) {
        add_constant(found, row, a[row.drive], values[row.drive], y, r);
        continue;
      }
      const Parabola limit = limit_at(row, y, found);
      const double turning = limits_.motor_rate[place_ * limits_.motors + row.motor];
      if (row.back < 0 || turning == 0.0 || (y <= limits_.creep && row.sense * turning < 0.0)) {
        add(found, bound(row, row.drive, a, values, limit, y, r));
      } else if (row.sense * turning > 0.0) {
        add(found, bound(row, row.drive, a, values, limit, y, r));
        add(found, bound(row, row.back, a, values, limit, y, r));
      } else {
        add_looser(found, bound(row, row.drive, a, values, limit, y, r), bound(row, row.back, a, values, limit, y, r));
      }
    }
    for (std::size_t k = 0; k < limits_.norms; ++k) add_norm(found, k, y);
    return found;
  }

  // The worst share by which u exceeds a limit at a speed y; 0: at a limit, negative: within all.
  double excess(double y, double u) const {
    Bounds ignored;
    const std::size_t count = limits_.quantities;
    const double* a = limits_.a + place_ * count;
    Parabola values[most_quantities];
    for (std::size_t k = 0; k < count; ++k) values[k] = value(k, y, ignored);
    double worst = -unlimited;
    for (const LimitRow& row : limits_.rows) {
      const double limit = limit_at(row, y, ignored)(y);
      const auto over = [&](int k) { return row.sense * (a[k] * u + values[k](y)) - limit; };
      const double turning = row.motor < 0 ? 0.0 : limits_.motor_rate[place_ * limits_.motors + row.motor];
      double own = over(row.drive);
      if (row.back >= 0 && row.sense * turning > 0.0) own = std::max(own, over(row.back));
      if (row.back >= 0 && row.sense * turning < 0.0 && y > limits_.creep) own = std::min(own, over(row.back));
      worst = std::max(worst, own / row.limit);
    }
    for (std::size_t k = 0; k < limits_.norms; ++k) {
      const std::size_t at = place_ * limits_.norms + k;
      const double x = y * y, along = limits_.along[at] * (u + limits_.bend[at] * x), across = limits_.across[at] * x;
      worst = std::max(worst, std::hypot(along, across) / limits_.norm[k] - 1.0);
    }
    return worst;
  }

  // The shares by which u at a speed y > 0 exceeds the limits, with their derivatives by u and y, and the limits at y over
  // the largest ones: two entries a row, the
  // second one for what the load gives back where both have to be kept; where it is not needed its share is -1. Of two
  // of which one has to be kept the looser one is taken. The entries of norms follow: the square over that of the limit.
  void linearised(double y, double u, double* share, double* by_u, double* by_y, double* limited) const {
    Bounds ignored;
    const std::size_t count = limits_.quantities;
    const double* a = limits_.a + place_ * count;
    Parabola values[most_quantities];
    for (std::size_t k = 0; k < count; ++k) values[k] = value(k, y, ignored);
    for (std::size_t r = 0; r < limits_.rows.size(); ++r) {
      const LimitRow& row = limits_.rows[r];
      const Parabola limit = limit_at(row, y, ignored);
      const auto write = [&](std::size_t at, int k) {
        share[at] = (row.sense * (a[k] * u + values[k](y)) - limit(y)) / row.limit;
        by_u[at] = row.sense * a[k] / row.limit;
        by_y[at] = (row.sense * values[k].slope(y) - limit.slope(y)) / row.limit;
        limited[at] = limit(y) / row.limit;
      };
      const std::size_t first = 2 * r, second = first + 1;
      const double turning = row.motor < 0 ? 0.0 : limits_.motor_rate[place_ * limits_.motors + row.motor];
      write(first, row.drive);
      share[second] = -1, by_u[second] = by_y[second] = limited[second] = 0;
      if (row.back < 0 || turning == 0.0) continue;
      if (row.sense * turning > 0.0) {
        write(second, row.back);
      } else if (y > limits_.creep) {
        write(second, row.back);
        const std::size_t looser = share[second] < share[first] ? second : first;
        share[first] = share[looser], by_u[first] = by_u[looser], by_y[first] = by_y[looser];
        share[second] = -1, by_u[second] = by_y[second] = 0;
      }
    }
    for (std::size_t k = 0; k < limits_.norms; ++k) {
      const std::size_t from = place_ * limits_.norms + k, at = 2 * limits_.rows.size() + k;
      const double scale = 1.0 / (limits_.norm[k] * limits_.norm[k]), x = y * y, bend = limits_.bend[from];
      const double along = limits_.along[from] * limits_.along[from] * (u + bend * x);
      const double across = limits_.across[from] * limits_.across[from] * x;
      limited[at] = scale * (along * (u + bend * x) + across * x);
      share[at] = limited[at] - 1.0;
      by_u[at] = 2.0 * scale * along, by_y[at] = 4.0 * scale * y * (along * bend + across);
      limited[at] *= 2.0;
    }
  }

  // The smallest y in (from, to] beyond which a limit is exceeded with u = 0, and its row; `to` and -1 without one.
  std::pair<double, int> first_exceeded(double from, double to) const {
    const std::size_t count = limits_.quantities;
    double y = from;
    for (int turn = 0; turn < 10000 && y < to; ++turn) {
      Bounds range;
      Parabola values[most_quantities];
      for (std::size_t k = 0; k < count; ++k) values[k] = value(k, y, range);
      double next = to;
      int by = -1;
      for (std::size_t r = 0; r < limits_.rows.size(); ++r) {
        const LimitRow& row = limits_.rows[r];
        const Parabola limit = limit_at(row, y, range);
        for (const int k : {row.drive, row.back}) {
          if (k < 0) continue;
          const Parabola rest{limit.p2 - row.sense * values[k].p2, limit.p1 - row.sense * values[k].p1,
                              limit.p0 - row.sense * values[k].p0};
          const double root = rest.next_root(y);
          if (root < next) next = root, by = static_cast<int>(r);
        }
      }
      if (range.high < next) {  // the shapes hold up to here
        y = std::max(range.high, y * (1 + 1e-15));
        if (excess(y * (1 + 1e-13), 0.0) > 1e-12) return {y, by};
        y *= 1 + 1e-13;
        continue;
      }
      y = next;
      if (by >= 0 && excess(y * (1 + 1e-9), 0.0) > 0.0) return {y, by};
      y *= 1 + 1e-9;
    }
    return {to, -1};
  }

  static constexpr std::size_t most_quantities = 512;

 private:
  enum class Kind { most, least, speed };
  struct Sided {
    Kind kind;
    Bound bound;
  };

  // The part of a quantity that does not depend on u.
  Parabola value(std::size_t k, double y, Bounds& found) const {
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
      if (std::abs(z) < 20.0) {  // the tangent holds nearby only
        found.low = std::max(found.low, 0.5 * y);
        found.high = std::min(found.high, std::max(2.0 * y, 0.1 / std::abs(slope)));
      }
    }
    return p;
  }

  Parabola limit_at(const LimitRow& row, double y, Bounds& found) const {
    if (row.curve < 0) return {0, 0, row.limit};
    const double rate = limits_.motor_rate[place_ * limits_.motors + row.motor], turning = std::abs(rate);
    const Curve& curve = limits_.curves[row.sense * rate < 0.0 ? row.braking : row.curve];
    const double speed = turning * y;
    const std::size_t last = curve.speed.size() - 1;
    if (turning == 0.0) return {0, 0, curve.torque[0]};
    if (speed > curve.speed[last]) {
      found.low = std::max(found.low, curve.speed[last] / turning);
      return {0, 0, -1.0};  // no torque is allowed, in either direction
    }
    std::size_t k = 0;
    while (k + 1 < last && speed > curve.speed[k + 1]) ++k;
    const double slope = (curve.torque[k + 1] - curve.torque[k]) / (curve.speed[k + 1] - curve.speed[k]);
    found.low = std::max(found.low, curve.speed[k] / turning);
    found.high = std::min(found.high, curve.speed[k + 1] / turning);
    return {0, slope * turning, curve.torque[k] - slope * curve.speed[k]};
  }

  Sided bound(const LimitRow& row, int k, const double* a, const Parabola* values, const Parabola& limit, double y,
              std::size_t r) const {
    const double slope = row.sense * a[k];
    Parabola rest{limit.p2 - row.sense * values[k].p2, limit.p1 - row.sense * values[k].p1,
                  limit.p0 - row.sense * values[k].p0};
    const int number = static_cast<int>(r);
    if (std::abs(slope) <= limits_.negligible[k]) return {Kind::speed, {rest(y), rest, number, k}};
    const double inverse = 1.0 / slope;
    rest = {rest.p2 * inverse, rest.p1 * inverse, rest.p0 * inverse};
    return {slope > 0 ? Kind::most : Kind::least, {rest(y), rest, number, k}};
  }

  // The same for a constant limit of one quantity; the shape is written only for a bound that is tighter.
  void add_constant(Bounds& found, const LimitRow& row, double a, const Parabola& value, double y, std::size_t r) const {
    const double slope = row.sense * a, rest = row.limit - row.sense * value(y);
    const bool by_speed = std::abs(slope) <= limits_.negligible[row.drive];
    const double inverse = by_speed ? 1.0 : 1.0 / slope, u = rest * inverse;
    Bound& own = by_speed ? found.speed : slope > 0 ? found.most : found.least;
    if (by_speed || slope > 0 ? u >= own.value : u <= own.value) return;
    own.value = u, own.row = static_cast<int>(r), own.quantity = row.drive;
    const double scale = row.sense * inverse;
    own.shape = {-scale * value.p2, -scale * value.p1, row.limit * inverse - scale * value.p0};
  }

  // The bounds of u by the limit of a norm, which are concave in x; their shapes are tangents in x. The row is counted
  // on from the other rows.
  void add_norm(Bounds& found, std::size_t k, double y) const {
    const std::size_t at = place_ * limits_.norms + k;
    const int row = static_cast<int>(limits_.rows.size() + k), quantity = static_cast<int>(limits_.quantities + k);
    const double limit = limits_.norm[k], along = limits_.along[at], bend = limits_.bend[at], across = limits_.across[at];
    const double x = y * y, share = across * x / limit;
    if (along == 0.0 || share > 1.0)
      add(found, {Kind::speed, {limit * (1.0 - share), {-across, 0, limit}, row, quantity}});
    if (along == 0.0) return;
    const double root = std::sqrt(std::max((1.0 - share) * (1.0 + share), least_root * least_root));
    const double half = limit * root / along, slope = across * share / (along * root);  // of half over x, negative
    const double most = -bend * x + half, least = -bend * x - half;
    add(found, {Kind::most, {most, {-bend - slope, 0, half + slope * x}, row, quantity}});
    add(found, {Kind::least, {least, {-bend + slope, 0, -half - slope * x}, row, quantity}});
  }

  static constexpr double least_root = 1e-8;  // near the largest x, where the bounds meet at an infinite slope

  static void add(Bounds& found, const Sided& one) {
    if (one.kind == Kind::most && one.bound.value < found.most.value) found.most = one.bound;
    if (one.kind == Kind::least && one.bound.value > found.least.value) found.least = one.bound;
    if (one.kind == Kind::speed && one.bound.value < found.speed.value) found.speed = one.bound;
  }

  // One of two limits has to be kept. Where they bound u from different sides the set of u may have a hole: then the
  // one that holds where the load takes power is kept, which is on the safe side.
  static void add_looser(Bounds& found, const Sided& drive, const Sided& back) {
    if (drive.kind != back.kind) {
      if (drive.kind == Kind::speed && drive.bound.value >= 0.0) return;
      if (back.kind == Kind::speed && back.bound.value >= 0.0) return;
      if (drive.kind == Kind::speed || back.kind == Kind::speed)
        return add(found, back.kind == Kind::speed ? drive : back);
      const Sided &least = drive.kind == Kind::least ? drive : back, &most = drive.kind == Kind::least ? back : drive;
      if (least.bound.value <= most.bound.value) return;
      found.hole = true;
      return add(found, drive);
    }
    const bool larger = drive.bound.value > back.bound.value;
    add(found, (drive.kind == Kind::least) == larger ? back : drive);
  }

  const PathLimits& limits_;
  std::size_t place_;
};

}  // namespace bellcrank
