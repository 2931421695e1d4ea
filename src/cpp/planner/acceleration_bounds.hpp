// Bounds of the path acceleration u at a place and a path speed y, each with the parabola by which it changes with y.
#pragma once

#include "parabola.hpp"

namespace bellcrank {

struct Bound {
  double value;
  Parabola shape;
  int row, quantity = -1;
};

// The bounds of u at a place and a speed: least <= u <= most, and the worst limit that does not depend on u.
struct Bounds : Range {
  Bound least{-unlimited, {}, -1}, most{unlimited, {}, -1};
  Bound speed{unlimited, {}, -1};  // value >= 0 where the limits without u are kept
  bool hole = false;  // some u between the bounds are left out although they are allowed

  double gap() const { return most.value - least.value; }
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

// One of two limits has to be kept. Where they bound u from different sides the set of u may have a hole: then the
// one that holds where the load takes power is kept, which is on the safe side.
inline void add_looser(Bounds& found, const SidedBound& drive, const SidedBound& back) {
  if (drive.side != back.side) {
    if (drive.side == Side::speed && drive.bound.value >= 0.0) return;
    if (back.side == Side::speed && back.bound.value >= 0.0) return;
    if (drive.side == Side::speed || back.side == Side::speed)
      return add(found, back.side == Side::speed ? drive : back);
    const SidedBound &least = drive.side == Side::least ? drive : back, &most = drive.side == Side::least ? back : drive;
    if (least.bound.value <= most.bound.value) return;
    found.hole = true;
    return add(found, drive);
  }
  const bool larger = drive.bound.value > back.bound.value;
  add(found, (drive.side == Side::least) == larger ? back : drive);
}

}  // namespace bellcrank
