// The limits at a place of a path: bounds of the path acceleration u at a path speed y, and by how much a motion exceeds
// them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "acceleration_bounds.hpp"
#include "path_limits.hpp"

namespace bellcrank {

class LimitsAtPlace : private QuantitiesAtPlace {
 public:
  using QuantitiesAtPlace::QuantitiesAtPlace;

  double fastest() const { return limits_.fastest[place_]; }

  // The bounds of u, which lie in no hole. With `narrowed` the range is the one of speeds at which the same u are left
  // out by the same limits.
  Bounds bounds(double y, bool narrowed = false) const {
    Holes holes;
    Bounds found = bounds_with_holes(y, holes, narrowed);
    leave_holes(found, holes, y, narrowed);
    return found;
  }

  // The bounds of the u below the hole of a row, or above it; none are left where the row has no hole.
  Bounds beside_hole(double y, int row, bool below) const {
    Holes holes;
    Bounds found = bounds_with_holes(y, holes, false);
    const Hole* const end = holes.all + holes.count;
    const Hole* const hole = std::find_if(static_cast<const Hole*>(holes.all), end, [&](const Hole& one) { return one.row == row; });
    if (hole == end) {
      found.least.value = unlimited, found.most.value = -unlimited;
      return found;
    }
    if (below && hole->low < found.most.value) found.most = hole->at_low();
    if (!below && hole->high > found.least.value) found.least = hole->at_high();
    leave_holes(found, holes, y, false);
    return found;
  }

  // The row of the hole in which u lies; -1: in none.
  int hole_with(double y, double u) const {
    Holes holes;
    bounds_with_holes(y, holes, false);
    const Hole* const end = holes.all + holes.count;
    const Hole* const hole = std::find_if(static_cast<const Hole*>(holes.all), end, [&](const Hole& one) { return one.low < u && u < one.high; });
    return hole == end ? -1 : hole->row;
  }

  // The bounds, and the u between them, or beyond them, that are not allowed.
  Bounds bounds_with_holes(double y, Holes& holes, bool narrowed) const {
    Bounds found;
    const double* a = slopes();
    Values value;
    values(y, found, value);
    for (std::size_t r = 0; r < limits_.rows.size(); ++r) {
      const LimitRow& row = limits_.rows[r];
      if (row.motor < 0) {
        add_constant(found, row, a[row.drive], value[row.drive], y, r);
        continue;
      }
      const Parabola limit = limit_at(row, y, found);
      const double turned = turning(row);
      if (row.back < 0 || turned == 0.0) {
        add(found, bound(row, row.drive, a, value, limit, y, r));
      } else if (row.sense * turned > 0.0) {
        add(found, bound(row, row.drive, a, value, limit, y, r));
        add(found, bound(row, row.back, a, value, limit, y, r));
      } else {
        add_looser(found, holes, bound(row, row.drive, a, value, limit, y, r), bound(row, row.back, a, value, limit, y, r),
                   y, narrowed);
      }
    }
    for (std::size_t k = 0; k < limits_.norms; ++k) add_norm(found, k, y);
    return found;
  }

  // Whether there may be holes at some speed.
  bool may_split() const { return limits_.may_split(); }

  // The worst share by which u exceeds a limit at a speed y; 0: at a limit, negative: within all.
  double excess(double y, double u) const {
    Range ignored;
    const double* a = slopes();
    Values value;
    values(y, ignored, value);
    double worst = -unlimited;
    for (const LimitRow& row : limits_.rows) {
      const double limit = limit_at(row, y, ignored)(y);
      const auto over = [&](int k) { return row.sense * (a[k] * u + value[k](y)) - limit; };
      const double turned = turning(row);
      double own = over(row.drive);
      if (row.back >= 0 && row.sense * turned > 0.0) own = std::max(own, over(row.back));
      if (row.back >= 0 && row.sense * turned < 0.0) own = std::min(own, over(row.back));
      worst = std::max(worst, own / row.limit);
    }
    for (std::size_t k = 0; k < limits_.norms; ++k) {
      const std::size_t at = place_ * limits_.norms + k;
      const double x = y * y, along = limits_.along[at] * (u + limits_.bend[at] * x), across = limits_.across[at] * x;
      worst = std::max(worst, std::hypot(along, across) / limits_.norm[k] - 1.0);
    }
    return worst;
  }

  // The shares by which u at a speed y > 0 exceeds the limits, with their derivatives by u and y, and the limits at y
  // over the largest ones: two entries a row, the second one for what the load gives back where both have to be kept;
  // where it is not needed its share is -1. Of two of which one has to be kept the looser one is taken. The entries of
  // norms follow: the square over that of the limit.
  void linearised(double y, double u, double* share, double* by_u, double* by_y, double* limited) const {
    Range ignored;
    const double* a = slopes();
    Values value;
    values(y, ignored, value);
    for (std::size_t r = 0; r < limits_.rows.size(); ++r) {
      const LimitRow& row = limits_.rows[r];
      const Parabola limit = limit_at(row, y, ignored);
      const auto write = [&](std::size_t at, int k) {
        share[at] = (row.sense * (a[k] * u + value[k](y)) - limit(y)) / row.limit;
        by_u[at] = row.sense * a[k] / row.limit;
        by_y[at] = (row.sense * value[k].slope(y) - limit.slope(y)) / row.limit;
        limited[at] = limit(y) / row.limit;
      };
      const std::size_t first = 2 * r, second = first + 1;
      const double turned = turning(row);
      write(first, row.drive);
      share[second] = -1, by_u[second] = by_y[second] = limited[second] = 0;
      if (row.back < 0 || turned == 0.0) continue;
      if (row.sense * turned > 0.0) {
        write(second, row.back);
      } else {
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
    double y = from;
    for (int turn = 0; turn < 10000 && y < to; ++turn) {
      Range range;
      Values value;
      values(y, range, value);
      double next = to;
      int by = -1;
      for (std::size_t r = 0; r < limits_.rows.size(); ++r) {
        const LimitRow& row = limits_.rows[r];
        const Parabola limit = limit_at(row, y, range);
        for (const int k : {row.drive, row.back}) {
          if (k < 0) continue;
          const Parabola rest{limit.p2 - row.sense * value[k].p2, limit.p1 - row.sense * value[k].p1,
                              limit.p0 - row.sense * value[k].p0};
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


 private:
  SidedBound bound(const LimitRow& row, int k, const double* a, const Values& value, const Parabola& limit, double y,
              std::size_t r) const {
    const double slope = row.sense * a[k];
    Parabola rest{limit.p2 - row.sense * value[k].p2, limit.p1 - row.sense * value[k].p1,
                  limit.p0 - row.sense * value[k].p0};
    const int number = static_cast<int>(r);
    if (std::abs(slope) <= limits_.negligible[k]) return {Side::speed, {rest(y), rest, number, k}};
    const double inverse = 1.0 / slope;
    rest = {rest.p2 * inverse, rest.p1 * inverse, rest.p0 * inverse};
    return {slope > 0 ? Side::most : Side::least, {rest(y), rest, number, k}};
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
      add(found, {Side::speed, {limit * (1.0 - share), {-across, 0, limit}, row, quantity}});
    if (along == 0.0) return;
    const double root = std::sqrt(std::max((1.0 - share) * (1.0 + share), least_root * least_root));
    const double half = limit * root / along, slope = across * share / (along * root);  // of half over x, negative
    const double most = -bend * x + half, least = -bend * x - half;
    add(found, {Side::most, {most, {-bend - slope, 0, half + slope * x}, row, quantity}});
    add(found, {Side::least, {least, {-bend + slope, 0, -half - slope * x}, row, quantity}});
  }

  static constexpr double least_root = 1e-8;  // near the largest x, where the bounds meet at an infinite slope
};

}  // namespace bellcrank
