// Bounds of the path acceleration u at a place and a path speed y, each with the parabola by which it changes with y.
#pragma once

#include <cmath>
#include <cstddef>

#include "parabola.hpp"

namespace bellcrank {

struct Bound {
  double value;
  Parabola shape;
  int row, quantity = -1;
  double hole = 0;  // width of the row's hole (below) at whose end the bound is; 0 elsewhere

  int hole_row() const { return hole > 0 ? row : -1; }
};

// The bounds of u at a place and a speed: least <= u <= most, and the worst limit that does not depend on u. Where gears
// lose power some u between them may not be allowed; least and most themselves are.
struct Bounds : Range {
  Bound least{-unlimited, {}, -1}, most{unlimited, {}, -1};
  Bound speed{unlimited, {}, -1};  // value >= 0 where the limits without u are kept

  double gap() const { return most.value - least.value; }
};

// Accelerations low < u < high that are not allowed.
struct Hole {
  double low, high;
  Parabola low_shape, high_shape;
  int row, low_quantity, high_quantity;

  Bound at_low() const { return {low, low_shape, row, low_quantity, high - low}; }
  Bound at_high() const { return {high, high_shape, row, high_quantity, high - low}; }
};

// The holes at a place and a speed; no more than there is room for.
struct Holes {
  static constexpr std::size_t room = 256;
  std::size_t count = 0;
  Hole all[room];  // not set

  void add(const Hole& one) {
    if (one.low < one.high && count < room) all[count++] = one;
  }
};

enum class Side { most, least, speed };

// A bound of u from above or below, or a limit of y alone.
struct SidedBound {
  Side side;
  Bound bound;
};

inline void add(Bounds& found, const SidedBound& one) {
  if (one.side == Side::most && one.bound.value < found.most.value) found.most = one.bound;
  if (one.side == Side::least && one.bound.value > found.least.value) found.least = one.bound;
  if (one.side == Side::speed && one.bound.value < found.speed.value) found.speed = one.bound;
}

// One of two limits has to be kept. Of two on the same side the looser one counts; of two on different sides both ends
// of a hole are found, if they leave one. With `narrowed` the speeds are added between which the same is found.
inline void add_looser(Bounds& found, Holes& holes, const SidedBound& drive, const SidedBound& back, double y,
                       bool narrowed) {
  if (drive.side != back.side) {
    const SidedBound* const fixed = drive.side == Side::speed ? &drive : back.side == Side::speed ? &back : nullptr;
    if (fixed != nullptr) {
      if (narrowed) found.narrow_to_sign(fixed->bound.shape, y);
      if (fixed->bound.value < 0.0) add(found, fixed == &drive ? back : drive);
      return;
    }
    const Bound& least = (drive.side == Side::least ? drive : back).bound;
    const Bound& most = (drive.side == Side::least ? back : drive).bound;
    if (least.value > most.value)
      holes.add({most.value, least.value, most.shape, least.shape, least.row, most.quantity, least.quantity});
    return;
  }
  if (narrowed) found.narrow_to_sign(difference(drive.bound.shape, back.bound.shape), y);
  const bool larger = drive.bound.value > back.bound.value;
  add(found, (drive.side == Side::least) == larger ? back : drive);
}

// Moves the bounds to the nearest u that lie in no hole; where there are none, least > most, at the speeds of the range
// (with `narrowed`) too.
inline void leave_holes(Bounds& found, const Holes& holes, double y, bool narrowed) {
  for (bool moved = holes.count > 0; moved;) {
    moved = false;
    for (std::size_t k = 0; k < holes.count; ++k) {
      const Hole& hole = holes.all[k];
      const auto inside = [&](double u) {
        const double rounded = rounding * (std::abs(u) + std::abs(hole.low) + std::abs(hole.high));
        return u > hole.low + rounded && u < hole.high - rounded;
      };
      if (inside(found.least.value)) {
        if (narrowed) found.narrow_to_sign(difference(found.least.shape, hole.low_shape), y);
        found.least = hole.at_high(), moved = true;
      }
      if (inside(found.most.value)) {
        if (narrowed) found.narrow_to_sign(difference(hole.high_shape, found.most.shape), y);
        found.most = hole.at_low(), moved = true;
      }
    }
  }
}

}  // namespace bellcrank
