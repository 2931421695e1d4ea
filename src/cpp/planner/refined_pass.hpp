// The fastest motion along a path to high order: the bounds of the path acceleration are integrated as differential
// equations, dx/ds = 2 least(s, x) from the end to the start and dx/ds = 2 most(s, x) from the start to the end. Friction
// makes the bounds depend on the root of x, which is not smooth at rest; over r with s = S sin²(π r / 2) it is, at both
// ends. The steps, in r, are those of the
// classical Runge-Kutta method of order 4 with Kutta's method of order 3 on the same stages for the error (E. Hairer,
// S. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.1). Places are the n ends of cells and
// between them their middles. Cells whose error is too large, and those in which the motion changes from one bound to
// another, have an `error` above 1: whoever calls halves them and calls again.
//
// Behind gears that lose power the allowed u may have holes. Where both ends of a hole lead back to a speed, above which
// the end that leads there is not allowed, or which is itself the largest, no motion is the fastest: one that switches
// between both ends comes as near to that speed as one likes. There each cell takes one end of the hole: the one that
// leads towards the speed unless the cell would pass it. Such cells are halved until they leave the speed by a small
// share of it (`Tolerances::tooth`), and need not find the places of the switches.
#pragma once

#include "reachability.hpp"

namespace bellcrank {

struct Tolerances {
  double speed;   // relative, of x
  double excess;  // share of a limit
  double tooth;   // relative, of x: between switches
  double apart;   // share of the whole time: switches are not closer to each other
};

class RefinedPass {
 public:
  // Cells end at r (n); s and ds = ds/dr are given at the 2 n - 1 places.
  // `narrow` (n - 1) marks cells that are not halved further: 1 cells that get the mean acceleration, 2 those next to
  // rest.
  RefinedPass(const PathLimits& limits, const double* r, const double* s, const double* ds, std::size_t n,
              const unsigned char* narrow, Tolerances tolerances)
      : limits_(limits), r_(r), s_(s), ds_(ds), n_(n), narrow_(narrow), tolerances_(tolerances), top_(2 * n - 1), x_(n), kind_(n - 1),
        error_(n - 1), hole_(n - 1, -1), back_(n - 1), ahead_(n - 1) {}

  Fastest run(double begin, double end) {
    Fastest f;
    f.y.assign(n_, 0), f.slowest.assign(n_, 0), f.fastest.assign(n_, 0);
    f.u_begin.assign(n_ - 1, 0), f.u_end.assign(n_ - 1, 0), f.active.assign(n_ - 1, none), f.kind.assign(n_ - 1, 0);
    f.error.assign(n_ - 1, 0);
    for (std::size_t p = 0; p < top_.size(); ++p) {
      const double before = largest_allowed(LimitsAtPlace(limits_, p, p - (p > 0)), Goal{}, f.cause);
      const bool turns = limits_.may_split() && p % 2 == 0 && p + 1 < top_.size();
      const double behind = turns ? largest_allowed(LimitsAtPlace(limits_, p, p + 1), Goal{}, f.cause) : before;
      const double y = std::isnan(before) ? before : std::isnan(behind) ? behind : std::min(before, behind);
      if (std::isnan(y) && p % 2 == 0) return f.failed = static_cast<int>(p / 2), f;
      top_[p] = std::isnan(y) ? -1.0 : y * y;
      largest_ = std::max(largest_, top_[p]);
    }
    least_ = tolerances_.apart * (s_[2 * n_ - 2] - s_[0]) / std::sqrt(largest_);
    if (end * end > top_.back() * (1 + rounding)) return f.failed = static_cast<int>(n_ - 1), f;
    x_[n_ - 1] = end * end;
    for (std::size_t i = n_ - 1; i-- > 0;)
      if (!backward(i, f)) return f.failed = static_cast<int>(i), f;
    mark_switching(back_, false, kind_, error_);
    if (begin * begin > x_[0] * (1 + rounding)) return f.failed = 0, f.failed_at_start = true, f;
    forward(begin, f);
    return f;
  }

 private:
  double length(std::size_t i) const { return s_[2 * i + 2] - s_[2 * i]; }
  double step(std::size_t i) const { return length(i) > 0 ? r_[i + 1] - r_[i] : 0.0; }

  // The limits at a place of cell i.
  LimitsAtPlace limits(std::size_t place, std::size_t i) const { return {limits_, place, 2 * i + 1}; }

  Bounds bounds(std::size_t place, std::size_t i, double x) const {
    return limits(place, i).bounds(std::sqrt(std::max(0.0, x)));
  }

  struct Step {
    double x, error, middle;
    bool sound = true;  // there are allowed accelerations at all stages
    int jump = -1;      // the row of a hole whose end u leaves, or comes to, within the cell
    Bound first, last;  // of u, at the end where the step begins and at the other one
    bool smooth() const { return sound && jump < 0; }
  };

  // What a step took over a cell: u at the ends of the cell, the row of the hole to whose end it keeps where the bound
  // alone would jump, and how far from that bound it leads.
  struct Taken {
    bool stepped = false;
    Bound begin, end;
    int hole = -1;
    double apart = 0, time = 0;
  };

  // Steps that keep to the end of a hole of a row, and their time.
  struct Run {
    int hole = -1;
    double time = 0;
  };

  // One step over cell i, from its begin with the most or from its end with the least acceleration; with `hole` beyond
  // the hole of that row.
  Step advance(std::size_t i, double from, bool most, int hole = -1) const {
    const std::size_t first = most ? 2 * i : 2 * i + 2, last = most ? 2 * i + 2 : 2 * i;
    const double h = most ? step(i) : -step(i);
    Step one;
    const auto bound = [&](std::size_t place, double x) {
      const LimitsAtPlace limits = this->limits(place, i);
      const double y = std::sqrt(std::max(0.0, x));
      const Bounds b = hole < 0 ? limits.bounds(y) : limits.beside_hole(y, hole, most);
      one.sound = one.sound && b.gap() >= -1e-9 * (std::abs(b.most.value) + std::abs(b.least.value));
      return most ? b.most : b.least;
    };
    one.first = bound(first, from);
    const auto f = [&](std::size_t place, double x) {
      const Bound u = bound(place, x);
      if (u.hole_row() != one.first.hole_row()) {
        const double width = std::max(u.hole, one.first.hole);
        if (std::abs(u.value - one.first.value) > 0.5 * width) one.jump = u.hole > 0 ? u.row : one.first.row;
      }
      one.last = u;
      return 2 * u.value * ds_[place];
    };
    const double k1 = 2 * one.first.value * ds_[first];
    const double k2 = f(2 * i + 1, from + h / 2 * k1), k3 = f(2 * i + 1, from + h / 2 * k2);
    const double k4 = f(last, from + h * k3), third = f(last, from + h * (2 * k2 - k1));
    one.x = from + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    one.error = std::abs(one.x - (from + h / 6 * (k1 + 4 * k2 + third)));
    one.middle = (from + one.x) / 2 + h / 8 * (k1 - f(last, one.x));
    one.sound = one.sound && std::isfinite(one.x) && std::isfinite(one.middle) && one.x >= 0;
    return one;
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
    const auto fits = [&](const Step& step) {
      return step.sound && step.x <= top_[2 * i] && step.middle <= top_[2 * i + 1] * (1 + 1e-9);
    };
    const auto take = [&](const Step& step, int hole) {
      x_[i] = step.x, kind_[i] = Cell::backward, error_[i] = relative(step.error, x_[i], next, i);
      back_[i] = {true, step.last, step.first, hole, apart(one, step, next), time(i, step.x, next)};
      keep(run_, back_[i]);
      return true;
    };
    const int hole = one.jump >= 0 ? one.jump : stays(run_, one, i, next, false) ? run_.hole : -1;
    if (hole >= 0)
      if (const Step other = advance(i, next, false, hole); other.jump < 0 && fits(other)) return take(other, hole);
    if (fits(one)) return take(one, -1);
    run_ = {};
    const double y = largest_allowed(limits(2 * i, i), {0, std::sqrt(next), length(i)}, f.cause);
    if (std::isnan(y)) return false;
    // A cell from the largest speed to a lower one is halved until the place where the speed begins to fall is found.
    x_[i] = y * y, kind_[i] = Cell::riding;
    const bool meets = one.sound && next < top_[2 * i + 2] * (1 - 1e-6) && x_[i] >= top_[2 * i] * (1 - 1e-9);
    error_[i] = meets ? 2.0 : 0.0;
    if (limits_.may_split()) {
      const double u = (next - x_[i]) / (2 * length(i));
      const int hole = limits(2 * i, i).hole_with(y, u);
      if (limits(2 * i + 2, i).hole_with(std::sqrt(next), u) >= 0) hole_[i] = hole;
    }
    return true;
  }

  // How far apart two steps over a cell lead, relative to x.
  static double apart(const Step& one, const Step& other, double x) {
    return std::abs(one.x - other.x) / std::max({x, one.x, other.x});
  }

  double time(std::size_t i, double x0, double x1) const { return 2 * length(i) / (std::sqrt(x0) + std::sqrt(x1)); }

  // Whether a step keeps to the end of a hole although the bound alone does not come to it: rows of a motion that are
  // too close to each other are rounding.
  bool stays(const Run& run, const Step& one, std::size_t i, double x, bool most) const {
    if (run.hole < 0 || one.first.hole_row() == run.hole) return false;
    double alone = run.time < least_ ? -unlimited : 0;
    for (std::size_t j = i; alone < least_ && j < n_ - 1 && step(j) > 0; most ? ++j : --j) {
      const Step next = advance(j, x, most);
      if (alone < 0 || !next.smooth() || (!most && next.x > top_[2 * j])) return true;
      const bool meets = most && next.x > x_[j + 1];  // the largest x, along which the motion goes on
      if (meets && hole_[j] >= 0) return true;
      const double reached = meets ? x_[j + 1] : next.x;
      alone += time(j, x, reached), x = reached;
    }
    return false;
  }

  static void keep(Run& run, const Taken& taken) {
    run = taken.hole < 0 ? Run{} : Run{taken.hole, taken.time + (run.hole == taken.hole ? run.time : 0)};
  }

  // Where many steps in turn take one end of a hole and the other, whose step alone would come to the hole: the kind of
  // the cells, and the errors of those that keep to the end of the hole. A step that does so alone changes the bound
  // there; the place is found by halving. In the direction of the pass.
  void mark_switching(const std::vector<Taken>& taken, bool ahead, std::vector<int>& kind, std::vector<double>& error) const {
    const std::size_t cells = n_ - 1;
    const auto at = [&](std::size_t k) { return ahead ? k : cells - 1 - k; };
    const int own = ahead ? Cell::forward : Cell::backward;
    const auto stepped = [&](std::size_t k) { return kind[at(k)] == own && taken[at(k)].stepped; };
    for (std::size_t k = 0; k < cells; ++k) {
      if (!stepped(k) || taken[at(k)].hole < 0) continue;
      std::size_t end = k, last = k, switches = 0;  // the cells in [k, last] that keep to an end are followed by others
      for (; end < cells && stepped(end); ++end) {
        const Taken &before = taken[at(end - (end > k))], &one = taken[at(end)];
        if (one.hole >= 0 || before.hole < 0) continue;
        const Bound& begin = ahead ? one.begin : one.end;
        if (begin.hole_row() == before.hole) break;  // it stays at that end
        ++switches, last = end - 1;
      }
      const bool many = switches >= many_switches;
      for (std::size_t j = k; j < end; ++j) {
        const Taken& one = taken[at(j)];
        if (many && j <= last) kind[at(j)] = Cell::switching;
        if (one.hole < 0 || narrow_[at(j)]) continue;
        if (many && j <= last && one.time > 2 * least_) error[at(j)] = std::max(error[at(j)], one.apart / tolerances_.tooth);
        if (!(many && j <= last) && (j == k || taken[at(j - 1)].hole < 0)) error[at(j)] = std::max(error[at(j)], 2.0);
      }
      k = end - (end > k);
    }
  }

  bool at_speed_limit(std::size_t place, double x) const {
    const double y = limits_.fastest[place];
    return x >= y * y * (1 - 1e-9);
  }

  void forward(double begin, Fastest& f) {
    std::vector<double> found(n_);
    found[0] = std::min(begin * begin, x_[0]);
    Run run;
    for (std::size_t i = 0; i + 1 < n_; ++i) {
      const double h = step(i), own = found[i];
      const bool on_top = own >= x_[i] * (1 - 1e-13);
      if (h == 0) {
        found[i + 1] = std::min(own, x_[i + 1]), f.kind[i] = Cell::riding;
        continue;
      }
      Step one = advance(i, own, true);
      const bool follows = on_top && hole_[i] < 0 && (one.x > x_[i + 1] || one.jump >= 0);
      int hole = follows ? -1 : one.jump >= 0 ? one.jump : one.x > x_[i + 1] ? hole_[i] : -1;
      if (hole < 0 && !follows && stays(run, one, i, own, true)) hole = run.hole;
      ahead_[i] = {true, one.first, one.last};
      if (hole >= 0) {
        const Step other = advance(i, own, true, hole);
        if (other.smooth() && other.x <= x_[i + 1]) {
          ahead_[i] = {true, other.first, other.last, hole, apart(one, other, own), time(i, own, other.x)};
          one = other;
        }
      }
      keep(run, ahead_[i]);
      const bool first_order = (narrow_[i] == 1 && ahead_[i].hole < 0) || !one.sound;
      if (first_order) {  // next to a place where a limit does not depend on u, the bounds vary too fast for the method
        one.x = std::max(0.0, own + 2 * length(i) * bounds(2 * i, i, own).most.value), one.middle = 0;
      }
      const bool leaves = one.x > x_[i + 1];
      if (follows || (leaves && on_top)) {
        found[i + 1] = x_[i + 1], f.kind[i] = kind_[i], f.error[i] = error_[i];
      } else if (leaves) {
        found[i + 1] = x_[i + 1], f.kind[i] = Cell::crossing, f.error[i] = 2;
      } else {
        found[i + 1] = std::max(0.0, one.x), f.kind[i] = Cell::forward, f.error[i] = relative(one.error, own, found[i + 1], i);
        if (first_order || one.middle > top_[2 * i + 1] * (1 + 1e-9)) f.error[i] = 2;
        ahead_[i].stepped = !first_order;
      }
      accelerations(i, own, found[i + 1], f);
    }
    mark_switching(ahead_, true, f.kind, f.error);
    for (std::size_t i = 0; i + 2 < n_; ++i) {  // where the motion changes its bound
      const int a = f.kind[i], b = f.kind[i + 1];
      if (a == Cell::switching || b == Cell::switching) continue;
      if (a != b && step(i) > 0 && step(i + 1) > 0 && a != Cell::crossing && b != Cell::crossing)
        for (const std::size_t k : {i, i + 1}) f.error[k] = narrow_[k] ? 0.0 : std::max(f.error[k], 2.0);
    }
    for (std::size_t i = 0; i < n_; ++i) f.y[i] = std::sqrt(found[i]), f.fastest[i] = std::sqrt(x_[i]);
  }

  // Accelerations at the ends of a cell, the active limit, and how well limits are met in its middle.
  void accelerations(std::size_t i, double x0, double x1, Fastest& f) {
    const double h = step(i);
    Bounds b0 = bounds(2 * i, i, x0), b1 = bounds(2 * i + 2, i, x1);
    int kind = f.kind[i];
    if (kind == Cell::forward && ahead_[i].stepped) b0.most = ahead_[i].begin, b1.most = ahead_[i].end;
    if (kind == Cell::switching) kind = Cell::backward;  // so far the backward pass alone has marked cells
    if (kind == Cell::backward) b0.least = back_[i].begin, b1.least = back_[i].end;
    const bool bends = (kind == Cell::forward && b0.most.quantity != b1.most.quantity) ||
                       (kind == Cell::backward && b0.least.quantity != b1.least.quantity);
    if (narrow_[i] == 1 && !(kind == Cell::forward && ahead_[i].stepped)) {
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
    const double excess = limits(2 * i + 1, i).excess(std::sqrt(std::max(0.0, middle)), u);
    const bool riding = kind == Cell::riding;
    const double over = std::max(excess, kind == Cell::crossing || riding ? 0.0 : -0.2 * excess);
    f.error[i] = std::max(f.error[i], over / tolerances_.excess);
    if (riding) {
      // A change from one limit of speed to another within the cell shows at its ends.
      const auto over_at = [&](std::size_t place, double x, double u) {
        return std::max(0.0, limits(place, i).excess(std::sqrt(x), u));
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

  static constexpr std::size_t many_switches = 8;  // fewer lie beside a place at which the bound changes once

  const PathLimits& limits_;
  const double *r_, *s_, *ds_;
  std::size_t n_;
  const unsigned char* narrow_;
  Tolerances tolerances_;
  std::vector<double> top_, x_;  // largest x without and with regard to what follows
  std::vector<int> kind_;
  std::vector<double> error_;
  std::vector<int> hole_;  // the row of the hole in which u along the largest x would lie; -1: in none
  std::vector<Taken> back_, ahead_;
  Run run_;           // of the backward pass
  double least_ = 0;  // time between switches
  double largest_ = 0;
};

}  // namespace bellcrank
