// The fastest motion along a path to high order: the bounds of the path acceleration are integrated as differential
// equations, dx/ds = 2 least(s, x) from the end to the start and dx/ds = 2 most(s, x) from the start to the end. Friction
// makes the bounds depend on the root of x, which is not smooth at rest; over r with s = S sin²(π r / 2) it is, at both
// ends. The steps, in r, are those of the
// classical Runge-Kutta method of order 4 with Kutta's method of order 3 on the same stages for the error (E. Hairer,
// S. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.1). Places are the n ends of cells and
// between them their middles. Cells whose error is too large, and those in which the motion changes from one bound to
// another, have an `error` above 1: whoever calls halves them and calls again.
#pragma once

#include "reachability.hpp"

namespace bellcrank {

struct Tolerances {
  double speed;   // relative, of x
  double excess;  // share of a limit
};

class RefinedPass {
 public:
  // Cells end at r (n); s and ds = ds/dr are given at the 2 n - 1 places.
  // `narrow` (n - 1) marks cells that are not halved further: 1 cells that get the mean acceleration, 2 those next to
  // rest.
  RefinedPass(const PathLimits& limits, const double* r, const double* s, const double* ds, std::size_t n,
              const unsigned char* narrow, Tolerances tolerances)
      : limits_(limits), r_(r), s_(s), ds_(ds), n_(n), narrow_(narrow), tolerances_(tolerances), top_(2 * n - 1), x_(n), kind_(n - 1),
        error_(n - 1) {}

  Fastest run(double begin, double end) {
    Fastest f;
    f.y.assign(n_, 0), f.slowest.assign(n_, 0), f.fastest.assign(n_, 0);
    f.u_begin.assign(n_ - 1, 0), f.u_end.assign(n_ - 1, 0), f.active.assign(n_ - 1, none), f.kind.assign(n_ - 1, 0);
    f.error.assign(n_ - 1, 0);
    for (std::size_t p = 0; p < top_.size(); ++p) {
      const double y = largest_allowed(LimitsAtPlace(limits_, p), Goal{}, f.cause);
      if (std::isnan(y) && p % 2 == 0) return f.failed = static_cast<int>(p / 2), f;
      top_[p] = std::isnan(y) ? -1.0 : y * y;
      largest_ = std::max(largest_, top_[p]);
    }
    if (end * end > top_.back() * (1 + rounding)) return f.failed = static_cast<int>(n_ - 1), f;
    x_[n_ - 1] = end * end;
    for (std::size_t i = n_ - 1; i-- > 0;)
      if (!backward(i, f)) return f.failed = static_cast<int>(i), f;
    if (begin * begin > x_[0] * (1 + rounding)) return f.failed = 0, f.failed_at_start = true, f;
    forward(begin, f);
    return f;
  }

 private:
  double length(std::size_t i) const { return s_[2 * i + 2] - s_[2 * i]; }
  double step(std::size_t i) const { return length(i) > 0 ? r_[i + 1] - r_[i] : 0.0; }

  Bounds bounds(std::size_t place, double x) const {
    return LimitsAtPlace(limits_, place).bounds(std::sqrt(std::max(0.0, x)));
  }

  // dx/dr along the least or the most acceleration.
  double slope(std::size_t place, double x, bool most, bool& sound) const {
    const Bounds b = bounds(place, x);
    sound = sound && b.gap() >= -1e-9 * (std::abs(b.most.value) + std::abs(b.least.value));
    return 2 * (most ? b.most.value : b.least.value) * ds_[place];
  }

  struct Step {
    double x, error, middle;
    bool sound;  // there are allowed accelerations at all stages
  };

  // One step over cell i, from its begin with the most or from its end with the least acceleration.
  Step advance(std::size_t i, double from, bool most) const {
    const std::size_t first = most ? 2 * i : 2 * i + 2, last = most ? 2 * i + 2 : 2 * i;
    const double h = most ? step(i) : -step(i);
    bool sound = true;
    const auto f = [&](std::size_t place, double x) { return slope(place, x, most, sound); };
    const double k1 = f(first, from), k2 = f(2 * i + 1, from + h / 2 * k1), k3 = f(2 * i + 1, from + h / 2 * k2);
    const double k4 = f(last, from + h * k3), third = f(last, from + h * (2 * k2 - k1));
    const double x = from + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    const double lower = from + h / 6 * (k1 + 4 * k2 + third);
    const double middle = (from + x) / 2 + h / 8 * (k1 - f(last, x));
    return {x, std::abs(x - lower), middle, sound && std::isfinite(x) && std::isfinite(middle) && x >= 0};
  }

  // The error of the whole time, relative, that an error of x at one end of a cell of which x0 and x1 are known causes
  // in it, with a time that is too short for the whole: over the tolerance.
  double relative(double difference, double x0, double x1, std::size_t i) const {
    const double time = 2 * length(i) / (std::sqrt(x0) + std::sqrt(x1));
    const double whole = (s_[2 * n_ - 2] - s_[0]) / std::sqrt(largest_);
    return difference / std::max(x0, x1) * time / (whole * tolerances_.speed);
  }

  bool backward(std::size_t i, Fastest& f) {
    const double next = x_[i + 1];
    if (step(i) == 0) {
      x_[i] = std::min(next, top_[2 * i]), kind_[i] = Cell::riding, error_[i] = 0;
      return x_[i] >= 0;
    }
    const Step one = advance(i, next, false);
    if (one.sound && one.x <= top_[2 * i] && one.middle <= top_[2 * i + 1] * (1 + 1e-9)) {
      x_[i] = one.x, kind_[i] = Cell::backward, error_[i] = relative(one.error, x_[i], next, i);
      return true;
    }
    const double y = largest_allowed(LimitsAtPlace(limits_, 2 * i), {0, std::sqrt(next), length(i)}, f.cause);
    if (std::isnan(y)) return false;
    // A cell from the largest speed to a lower one is halved until the place where the speed begins to fall is found.
    x_[i] = y * y, kind_[i] = Cell::riding;
    const bool meets = one.sound && next < top_[2 * i + 2] * (1 - 1e-6) && x_[i] >= top_[2 * i] * (1 - 1e-9);
    error_[i] = meets ? 2.0 : 0.0;
    return true;
  }

  bool at_speed_limit(std::size_t place, double x) const {
    const double y = limits_.fastest[place];
    return x >= y * y * (1 - 1e-9);
  }

  void forward(double begin, Fastest& f) {
    std::vector<double> found(n_);
    found[0] = std::min(begin * begin, x_[0]);
    for (std::size_t i = 0; i + 1 < n_; ++i) {
      const double h = step(i), own = found[i];
      const bool on_top = own >= x_[i] * (1 - 1e-13);
      if (h == 0) {
        found[i + 1] = std::min(own, x_[i + 1]), f.kind[i] = Cell::riding;
        continue;
      }
      Step one = advance(i, own, true);
      const bool first_order = narrow_[i] == 1 || !one.sound;
      if (first_order) {  // next to a place where a limit does not depend on u, the bounds vary too fast for the method
        one.x = std::max(0.0, own + 2 * length(i) * bounds(2 * i, own).most.value), one.middle = 0;
      }
      const bool leaves = one.x > x_[i + 1];
      if (leaves && on_top) {
        found[i + 1] = x_[i + 1], f.kind[i] = kind_[i], f.error[i] = error_[i];
      } else if (leaves) {
        found[i + 1] = x_[i + 1], f.kind[i] = Cell::crossing, f.error[i] = 2;
      } else {
        found[i + 1] = std::max(0.0, one.x), f.kind[i] = Cell::forward, f.error[i] = relative(one.error, own, found[i + 1], i);
        if (first_order || one.middle > top_[2 * i + 1] * (1 + 1e-9)) f.error[i] = 2;
      }
      accelerations(i, own, found[i + 1], f);
    }
    for (std::size_t i = 0; i + 2 < n_; ++i) {  // where the motion changes its bound
      const int a = f.kind[i], b = f.kind[i + 1];
      if (a != b && step(i) > 0 && step(i + 1) > 0 && a != Cell::crossing && b != Cell::crossing)
        for (const std::size_t k : {i, i + 1}) f.error[k] = narrow_[k] ? 0.0 : std::max(f.error[k], 2.0);
    }
    for (std::size_t i = 0; i < n_; ++i) f.y[i] = std::sqrt(found[i]), f.fastest[i] = std::sqrt(x_[i]);
  }

  // Accelerations at the ends of a cell, the active limit, and how well limits are met in its middle.
  void accelerations(std::size_t i, double x0, double x1, Fastest& f) {
    const double h = step(i);
    const Bounds b0 = bounds(2 * i, x0), b1 = bounds(2 * i + 2, x1);
    const int kind = f.kind[i];
    const bool bends = (kind == Cell::forward && b0.most.quantity != b1.most.quantity) ||
                       (kind == Cell::backward && b0.least.quantity != b1.least.quantity);
    if (narrow_[i] == 1) {
      const double mean = (x1 - x0) / (2 * length(i));
      f.u_begin[i] = std::max(std::min(mean, b0.most.value), b0.least.value);
      f.u_end[i] = std::max(std::min(mean, b1.most.value), b1.least.value);
      f.error[i] = 0;
      f.active[i] = kind == Cell::backward ? b0.least.row : b0.most.row;
      return;
    }
    if (bends) f.error[i] = std::max(f.error[i], 2.0);
    if (kind == Cell::forward) {
      f.u_begin[i] = b0.most.value, f.u_end[i] = b1.most.value, f.active[i] = b0.most.row;
    } else if (kind == Cell::backward) {
      f.u_begin[i] = b0.least.value, f.u_end[i] = b1.least.value, f.active[i] = b0.least.row;
    } else if (kind == Cell::riding && at_speed_limit(2 * i, x0) && at_speed_limit(2 * i + 2, x1)) {
      const double middle = limits_.fastest[2 * i + 1] * limits_.fastest[2 * i + 1];
      f.u_begin[i] = ds_[2 * i] > 0 ? (4 * middle - 3 * x0 - x1) / (2 * h * ds_[2 * i]) : 0.0;
      f.u_end[i] = ds_[2 * i + 2] > 0 ? (3 * x1 + x0 - 4 * middle) / (2 * h * ds_[2 * i + 2]) : 0.0;
      f.active[i] = speed_limit;
    } else {
      f.u_begin[i] = f.u_end[i] = (x1 - x0) / (2 * length(i));
      f.active[i] = b0.most.row;
    }
    const double d0 = 2 * f.u_begin[i] * ds_[2 * i], d1 = 2 * f.u_end[i] * ds_[2 * i + 2];
    const double middle = (x0 + x1) / 2 + h / 8 * (d0 - d1);
    const double u = (0.75 * (x1 - x0) / h - (d0 + d1) / 8) / ds_[2 * i + 1];
    const double excess = LimitsAtPlace(limits_, 2 * i + 1).excess(std::sqrt(std::max(0.0, middle)), u);
    const bool riding = kind == Cell::riding;
    const double over = std::max(excess, kind == Cell::crossing || riding ? 0.0 : -0.2 * excess);
    f.error[i] = std::max(f.error[i], over / tolerances_.excess);
    if (riding) {
      // A change from one limit of speed to another within the cell shows at its ends.
      const auto over_at = [&](std::size_t place, double x, double u) {
        return std::max(0.0, LimitsAtPlace(limits_, place).excess(std::sqrt(x), u));
      };
      f.error[i] = std::max({f.error[i], over_at(2 * i, x0, f.u_begin[i]) / tolerances_.excess,
                             over_at(2 * i + 2, x1, f.u_end[i]) / tolerances_.excess});
      const double top = limits_.fastest[2 * i + 1];
      const double below = 1 - middle / (top * top);  // along the tip of a cone the speed misses the tip by the step²
      if (limits_.norms > 0 && below < 0.01) f.error[i] = std::max(f.error[i], below / tolerances_.excess);
      f.error[i] = std::max(f.error[i], 0.5 * (middle / (top * top) - 1) / tolerances_.excess);
    }
    if (narrow_[i]) f.error[i] = 0;
  }

  const PathLimits& limits_;
  const double *r_, *s_, *ds_;
  std::size_t n_;
  const unsigned char* narrow_;
  Tolerances tolerances_;
  std::vector<double> top_, x_;  // largest x without and with regard to what follows
  std::vector<int> kind_;
  std::vector<double> error_;
  double largest_ = 0;
};

}  // namespace bellcrank
