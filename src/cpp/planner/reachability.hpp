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

// The next place, as bounds of u: slowest² <= y² + 2 step u <= fastest².
struct Goal {
  double slowest = 0, fastest = unlimited, step = 0;
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

constexpr double rounding = 1e-12;

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
    const Bounds b = with_goal(place.bounds(y), y, goal);
    if (allowed(b)) return y;
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
  const Bounds b = with_goal(place.bounds(guess), guess, goal);
  const Parabola &p = b.most.shape, &q = b.least.shape;
  const bool settled = !allowed(b) && b.gap() < 0 && b.high >= from &&
                       std::isnan(crossing({p.p2 - q.p2, p.p1 - q.p1, p.p0 - q.p0}, guess, guess, from));
  return settled ? nearest_allowed(place, goal, guess, 0.0, cause) : largest_allowed(place, goal, cause);
}

struct Cell {
  enum Kind : int { forward, backward, riding, crossing };
};

struct Fastest {
  std::vector<double> y, u_begin, u_end;           // speeds (n), accelerations of each cell at its ends (n - 1)
  std::vector<double> slowest, fastest;            // controllable speeds (n)
  std::vector<int> active, kind;                   // (n - 1)
  std::vector<double> error;                       // (n - 1): of the cells that should be halved, else 0
  int failed = -1;                                 // the place without a controllable speed, -1: none
  bool failed_at_start = false;
  std::pair<int, int> cause{none, none};
  std::vector<unsigned char> gap;                  // (n): optimality is not proved here
};

// First order: u is constant over each cell and the limits are kept at its beginning, as in the reference.
inline Fastest fastest_on_grid(const PathLimits& limits, const double* s, std::size_t n, double begin, double end) {
  Fastest f;
  f.y.assign(n, 0), f.slowest.assign(n, 0), f.fastest.assign(n, 0), f.gap.assign(n, 0);
  f.u_begin.assign(n - 1, 0), f.u_end.assign(n - 1, 0), f.active.assign(n - 1, none), f.kind.assign(n - 1, 0);
  f.error.assign(n - 1, 0);
  f.slowest[n - 1] = f.fastest[n - 1] = end;
  for (std::size_t i = n - 1; i-- > 0;) {
    const LimitsAtPlace place(limits, i);
    const Goal goal{f.slowest[i + 1], f.fastest[i + 1], s[i + 1] - s[i]};
    double top = largest_allowed(place, goal, 1.05 * goal.fastest, f.cause);
    if (goal.step == 0 && !std::isnan(top)) top = std::min(top, goal.fastest);
    if (std::isnan(top)) return f.failed = static_cast<int>(i), f;
    std::pair<int, int> ignored;
    f.fastest[i] = top;
    f.slowest[i] = nearest_allowed(place, goal, 0.0, top, ignored);
  }
  if (begin > f.fastest[0] * (1 + rounding) || begin < f.slowest[0] * (1 - rounding)) {
    f.failed = 0, f.failed_at_start = true;
    return f;
  }
  f.y[0] = std::min(begin, f.fastest[0]);
  Bounds ahead = LimitsAtPlace(limits, 0).bounds(f.y[0]);  // at place i and f.y[i]
  for (std::size_t i = 0; i + 1 < n; ++i) {
    const double step = s[i + 1] - s[i];
    if (step == 0) {
      f.y[i + 1] = std::min(f.y[i], f.fastest[i + 1]);
      ahead = LimitsAtPlace(limits, i + 1).bounds(f.y[i + 1]);
      continue;
    }
    const LimitsAtPlace place(limits, i);
    const Bounds own = ahead;
    const Bounds all = with_goal(own, f.y[i], {f.slowest[i + 1], f.fastest[i + 1], step});
    f.gap[i] = own.hole;
    const double x = std::max(0.0, f.y[i] * f.y[i] + 2 * step * all.most.value);
    f.y[i + 1] = std::min(std::max(std::sqrt(x), f.slowest[i + 1]), f.fastest[i + 1]);
    if (i + 2 < n) {
      const LimitsAtPlace next(limits, i + 1);
      const Goal beyond{f.slowest[i + 2], f.fastest[i + 2], s[i + 2] - s[i + 1]};
      ahead = next.bounds(f.y[i + 1]);
      const Bounds there = with_goal(ahead, f.y[i + 1], beyond);
      if (!allowed(there) && f.y[i + 1] < f.fastest[i + 1]) {  // a hole among the controllable speeds
        const double lower = nearest_allowed(next, beyond, f.y[i + 1], f.slowest[i + 1], f.cause);
        if (!std::isnan(lower)) f.y[i + 1] = lower, f.gap[i + 1] = 1, ahead = next.bounds(lower);
      }
    }
    const double u = (f.y[i + 1] * f.y[i + 1] - f.y[i] * f.y[i]) / (2 * step);
    f.u_begin[i] = f.u_end[i] = u;
    const double near = 1e-7 * (std::abs(own.most.value) + std::abs(own.least.value));
    f.active[i] = u >= own.most.value - near                          ? own.most.row
                  : u <= own.least.value + near                       ? own.least.row
                  : f.y[i] >= place.fastest() * (1 - 1e-9)            ? speed_limit
                  : f.y[i + 1] >= limits.fastest[i + 1] * (1 - 1e-9) ? speed_limit
                                                                      : next_place;
    f.kind[i] = u >= own.most.value - near ? Cell::forward : u <= own.least.value + near ? Cell::backward : Cell::riding;
  }
  return f;
}

}  // namespace bellcrank
