// The fastest motion along a path by reachability analysis: a pass from the end to the start finds from which speeds the
// end can be reached (controllable speeds), a pass from the start to the end takes the largest acceleration that stays
// among them (H. Pham and Q.-C. Pham, IEEE Trans. Robotics 34, 2018). That method solves a linear program a place; here
// the bounds are parabolas in the speed y, and the next speed at which a violated pair of bounds meets is its root.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "limits_at_place.hpp"

namespace bellcrank {

// The speeds from which the next place is reached: 0 <= slowest <= y <= fastest; empty where slowest > fastest.
struct Controllable {
  double slowest = 1, fastest = 0;
  bool empty() const { return slowest > fastest; }
};

// What a place is reached by; numbers >= 0 are rows of the limits.
enum Active : int { none = -1, speed_limit = -2, next_place = -3 };

// Speeds y between others that are no places to be at: from there the end is not reached.
using Gaps = std::vector<std::pair<double, double>>;

// The next place, as bounds of u: slowest² <= y² + 2 step u <= fastest², and not within its gaps.
struct Goal {
  double slowest = 0, fastest = unlimited, step = 0;
  const Gaps* gaps = nullptr;
};

inline Bounds with_goal(Bounds found, double y, const Goal& goal) {
  if (goal.step == 0) return found;
  const double half = 0.5 / goal.step, low = goal.slowest * goal.slowest, high = goal.fastest * goal.fastest;
  if (const double value = (high - y * y) * half; value < found.most.value)
    found.most = {value, {-half, 0, high * half}, next_place};
  if (const double value = (low - y * y) * half; value > found.least.value)
    found.least = {value, {-half, 0, low * half}, next_place};
  return found;
}

// The bounds of the u that keep the limits and reach the goal; see `LimitsAtPlace::bounds`.
inline Bounds reaching(const LimitsAtPlace& place, double y, const Goal& goal, bool narrowed = false) {
  Holes holes;
  const Bounds of_limits = place.bounds_with_holes(y, holes, narrowed);
  Bounds found = with_goal(of_limits, y, goal);
  if (goal.gaps != nullptr && goal.step > 0) {
    const double half = 0.5 / goal.step;
    for (const auto& [from, to] : *goal.gaps) {
      const double low = from * from, high = to * to;
      holes.add({(low - y * y) * half, (high - y * y) * half, {-half, 0, low * half}, {-half, 0, high * half}, next_place,
                 -1, -1});
    }
  }
  leave_holes(found, holes, y, narrowed);
  return found;
}

inline bool allowed(const Bounds& b) {
  return b.gap() >= -rounding * (std::abs(b.most.value) + std::abs(b.least.value)) &&
         (b.speed.row < 0 || b.speed.value >= -rounding * (1.0 + std::abs(b.speed.shape.p0)));
}

// The root of p in (low, high), the nearest to `from` (one end of it) at which p becomes >= 0; NaN without one. A root
// that rounding has put beyond `from` counts as `from`: steep bounds meet within the last digits of a speed.
inline double crossing(const Parabola& p, double from, double low, double high) {
  const bool down = from >= high;
  double roots[2];
  int count = 0;
  const double scale = std::max({std::abs(p.p2) * high * high, std::abs(p.p1) * high, std::abs(p.p0)});
  if (std::abs(p.p2) * high * high <= 1e-15 * scale) {
    if (p.p1 != 0) roots[count++] = -p.p0 / p.p1;
  } else {
    const double square = p.p1 * p.p1 - 4 * p.p2 * p.p0;
    if (square >= 0) {
      const double q = -0.5 * (p.p1 + std::copysign(std::sqrt(square), p.p1));
      roots[count++] = q / p.p2;
      if (q != 0) roots[count++] = p.p0 / q;
    }
  }
  double best = std::nan("");
  for (int k = 0; k < count; ++k)
    if (std::abs(roots[k] - from) <= 1e-14 * from) roots[k] = from;
  for (int k = 0; k < count; ++k)
    if (roots[k] >= low && roots[k] <= high && (std::isnan(best) || (down ? roots[k] > best : roots[k] < best)))
      best = roots[k];
  return best;
}

// The allowed speed nearest to `from` in the direction towards `to`; NaN without one. `cause` becomes the rows of the
// pair of limits that was met last.
inline double nearest_allowed(const LimitsAtPlace& place, const Goal& goal, double from, double to,
                              std::pair<int, int>& cause) {
  const bool down = to < from;
  double y = from;
  for (int turn = 0; turn < 500; ++turn) {
    Bounds b = reaching(place, y, goal);
    if (allowed(b)) return y;
    if (place.may_split() || goal.gaps != nullptr) b = reaching(place, y, goal, true);
    const bool by_speed = b.speed.row >= 0 && b.speed.value < 0;
    cause = by_speed ? std::make_pair(b.speed.row, b.speed.row) : std::make_pair(b.most.row, b.least.row);
    if (y == to) return std::nan("");
    const Parabola &p = b.most.shape, &q = b.least.shape;
    const Parabola gap = by_speed ? b.speed.shape : Parabola{p.p2 - q.p2, p.p1 - q.p1, p.p0 - q.p0};
    const double end = down ? std::max(b.low, to) : std::min(b.high, to);
    double next = down ? crossing(gap, y, end, y) : crossing(gap, y, y, end);
    const double least_move = 1e-14 * std::max(std::abs(y), std::abs(to));
    if (std::isnan(next)) next = end;
    if (std::abs(next - y) <= least_move) {  // the root is here, or a shape ends here: beyond it another one holds
      next = down ? y - 4 * least_move : y + 4 * least_move;
      if (down ? next < to : next > to) next = to;
    }
    y = next;
  }
  return std::nan("");
}

inline double largest_allowed(const LimitsAtPlace& place, const Goal& goal, std::pair<int, int>& cause) {
  return nearest_allowed(place, goal, place.fastest(), 0.0, cause);
}

// The same from a guess: where a pair of limits leaves no u at the guess, nor at any speed above it, the search begins
// there.
inline double largest_allowed(const LimitsAtPlace& place, const Goal& goal, double guess, std::pair<int, int>& cause) {
  const double from = place.fastest();
  if (!(guess > 0 && guess < from)) return largest_allowed(place, goal, cause);
  Bounds b = reaching(place, guess, goal);
  if (place.may_split() && !allowed(b)) b = reaching(place, guess, goal, true);
  const Parabola &p = b.most.shape, &q = b.least.shape;
  const bool settled = !allowed(b) && b.gap() < 0 && b.high >= from &&
                       std::isnan(crossing({p.p2 - q.p2, p.p1 - q.p1, p.p0 - q.p0}, guess, guess, from));
  return settled ? nearest_allowed(place, goal, guess, 0.0, cause) : largest_allowed(place, goal, cause);
}

struct Cell {
  enum Kind : int { forward, backward, riding, crossing, switching };
};

struct Fastest {
  std::vector<double> y, u_begin, u_end;           // speeds (n), accelerations of each cell at its ends (n - 1)
  std::vector<double> slowest, fastest;            // controllable speeds (n)
  std::vector<int> active, kind;                   // (n - 1)
  std::vector<double> error;                       // (n - 1): of the cells that should be halved, else 0
  int failed = -1;                                 // the place without a controllable speed, -1: none
  bool failed_at_start = false;
  std::pair<int, int> cause{none, none};
};

// First order: u is constant over each cell and the limits are kept at its beginning, as in the reference. Gaps among
// the controllable speeds, which holes and friction leave, are found where the motion comes to them: then they are
// left out, and the step before is done anew.
class GridPass {
 public:
  GridPass(const PathLimits& limits, const double* s, std::size_t n) : limits_(limits), s_(s), n_(n), gaps_(n) {}

  Fastest run(double begin, double end) {
    f_.y.assign(n_, 0), f_.slowest.assign(n_, 0), f_.fastest.assign(n_, 0);
    f_.u_begin.assign(n_ - 1, 0), f_.u_end.assign(n_ - 1, 0), f_.active.assign(n_ - 1, none), f_.kind.assign(n_ - 1, 0);
    f_.error.assign(n_ - 1, 0);
    f_.slowest[n_ - 1] = f_.fastest[n_ - 1] = end;
    for (std::size_t i = n_ - 1; i-- > 0;) {
      const LimitsAtPlace place(limits_, i);
      const Goal next = goal(i);
      double top = largest_allowed(place, next, 1.05 * next.fastest, f_.cause);
      if (next.step == 0 && !std::isnan(top)) top = std::min(top, next.fastest);
      if (std::isnan(top)) return f_.failed = static_cast<int>(i), f_;
      std::pair<int, int> ignored;
      f_.fastest[i] = top;
      f_.slowest[i] = nearest_allowed(place, next, 0.0, top, ignored);
    }
    forward(begin);
    return f_;
  }

 private:
  Goal goal(std::size_t i) const {
    return {f_.slowest[i + 1], f_.fastest[i + 1], s_[i + 1] - s_[i], gaps_[i + 1].empty() ? nullptr : &gaps_[i + 1]};
  }

  // The bounds at a place and a speed, which are kept for the next step.
  const Bounds& bounds(std::size_t i, double y) {
    if (known_ != i || known_speed_ != y) bounds_ = LimitsAtPlace(limits_, i).bounds(y), known_ = i, known_speed_ = y;
    return bounds_;
  }

  Bounds reached_from(std::size_t i, double y) {
    const bool whole = !splits_ && gaps_[i + 1].empty();
    return whole ? with_goal(bounds(i, y), y, goal(i)) : reaching(LimitsAtPlace(limits_, i), y, goal(i));
  }

  bool controllable(std::size_t i, double y) {
    return i + 1 >= n_ || s_[i + 1] == s_[i] || allowed(reached_from(i, y));
  }

  void forward(double begin) {
    const auto outside = [&] {
      if (begin > f_.fastest[0] * (1 + rounding) || begin < f_.slowest[0] * (1 - rounding)) return true;
      return std::any_of(gaps_[0].begin(), gaps_[0].end(),
                         [&](const auto& gap) { return begin > gap.first && begin < gap.second; });
    };
    f_.y[0] = std::min(begin, f_.fastest[0]);
    std::size_t left = 1000 + 20 * n_;  // of steps that are done anew
    for (std::size_t i = 0; i + 1 < n_;) {
      if (outside()) {
        f_.failed = 0, f_.failed_at_start = true;
        return;
      }
      if (s_[i + 1] == s_[i]) {
        f_.y[i + 1] = std::min(f_.y[i], f_.fastest[i + 1]);
      } else {
        step(i);
      }
      ++i;
      if (i + 1 < n_ && !controllable(i, f_.y[i])) i = last_controllable(i, left);
      if (left == 0) {
        f_.failed = static_cast<int>(i);
        return;
      }
    }
  }

  // Leaves out y_i, and what leads to nothing but such speeds before it; the last place whose speed remains.
  std::size_t last_controllable(std::size_t i, std::size_t& left) {
    for (; left > 0; --left) {
      leave_gap(i);
      if (i == 0) return 0;
      --i;
      if (s_[i + 1] == s_[i]) {
        gaps_[i] = gaps_[i + 1], f_.slowest[i] = f_.slowest[i + 1], f_.fastest[i] = f_.fastest[i + 1];
      } else if (controllable(i, f_.y[i])) {
        return i;
      }
    }
    return i;
  }

  // Leaves out the speeds around y_i from which the end is not reached.
  void leave_gap(std::size_t i) {
    if (s_[i + 1] == s_[i]) return;
    const LimitsAtPlace place(limits_, i);
    const Goal next = goal(i);
    const double lower = nearest_allowed(place, next, f_.y[i], f_.slowest[i], f_.cause);
    const double upper = nearest_allowed(place, next, f_.y[i], f_.fastest[i], f_.cause);
    if (std::isnan(lower) && std::isnan(upper)) {
      f_.slowest[i] = 1, f_.fastest[i] = 0;
    } else if (std::isnan(lower)) {
      f_.slowest[i] = upper;
    } else if (std::isnan(upper)) {
      f_.fastest[i] = lower;
    } else {
      gaps_[i].push_back({lower, upper});
    }
  }

  void step(std::size_t i) {
    const double step = s_[i + 1] - s_[i], y = f_.y[i];
    const LimitsAtPlace place(limits_, i);
    const Bounds own = bounds(i, y), all = reached_from(i, y);
    const double x = std::max(0.0, y * y + 2 * step * all.most.value);
    double& reached = f_.y[i + 1];
    reached = std::min(std::max(std::sqrt(x), f_.slowest[i + 1]), f_.fastest[i + 1]);
    for (const auto& [from, to] : gaps_[i + 1])  // rounding has put it within a gap
      if (reached > from && reached < to) reached = reached - from < to - reached ? from : to;
    const double u = (reached * reached - y * y) / (2 * step);
    f_.u_begin[i] = f_.u_end[i] = u;
    const double near = 1e-7 * (std::abs(own.most.value) + std::abs(own.least.value));
    f_.active[i] = u >= own.most.value - near                           ? own.most.row
                   : u <= own.least.value + near                        ? own.least.row
                   : y >= place.fastest() * (1 - 1e-9)                  ? speed_limit
                   : reached >= limits_.fastest[i + 1] * (1 - 1e-9)     ? speed_limit
                   : all.most.row >= 0                                  ? all.most.row
                                                                        : next_place;
    f_.kind[i] = u >= own.most.value - near ? Cell::forward : u <= own.least.value + near ? Cell::backward : Cell::riding;
  }

  const PathLimits& limits_;
  const double* s_;
  std::size_t n_;
  bool splits_ = limits_.may_split();
  std::vector<Gaps> gaps_;
  Bounds bounds_;
  std::size_t known_ = static_cast<std::size_t>(-1);
  double known_speed_ = 0;
  Fastest f_;
};

inline Fastest fastest_on_grid(const PathLimits& limits, const double* s, std::size_t n, double begin, double end) {
  return GridPass(limits, s, n).run(begin, end);
}

}  // namespace bellcrank
