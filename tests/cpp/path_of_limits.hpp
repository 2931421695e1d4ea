// Limits along a path, with the arrays that they refer to.
#pragma once

#include "path_limits.hpp"
#include "support.hpp"

namespace bellcrank {

struct Path {
  Numbers a, b, d, c, w, rate, fastest, width, negligible, along, bend, across, norm, motor_rate;
  PathLimits limits;

  Path(std::size_t places, std::size_t quantities, std::size_t joints, std::size_t norms)
      : a(places * quantities), b(a), d(a), c(a), w(places * quantities * joints), rate(places * joints),
        fastest(places, 10.0), width(joints, 0.05), negligible(quantities, 1e-12), along(places * norms), bend(along),
        across(along), norm(norms, 1.0) {
    limits.places = places, limits.quantities = quantities, limits.joints = joints, limits.norms = norms;
    refer();
  }
  Path(const Path& other) { *this = other; }
  Path& operator=(const Path& other) {
    a = other.a, b = other.b, d = other.d, c = other.c, w = other.w, rate = other.rate, fastest = other.fastest;
    width = other.width, negligible = other.negligible, along = other.along, bend = other.bend, across = other.across;
    norm = other.norm, motor_rate = other.motor_rate, limits = other.limits;
    refer();
    return *this;
  }

  // value = a u + b y^2 + d y + c
  void set(std::size_t place, std::size_t quantity, double u, double square, double speed, double constant) {
    const std::size_t at = place * limits.quantities + quantity;
    a[at] = u, b[at] = square, d[at] = speed, c[at] = constant;
  }
  void fill(Random& random) {
    for (Numbers* values : {&a, &b, &d, &bend})
      for (double& value : *values) value = random.between(-1, 1);
    for (Numbers* values : {&c, &w, &rate})
      for (double& value : *values) value = random.between(-0.3, 0.3);
    for (Numbers* values : {&along, &across})
      for (double& value : *values) value = random.between(0.1, 1);
  }
  // The quantity is kept within +- most.
  void limit(int quantity, double most) {
    for (double sense : {1.0, -1.0}) limits.rows.push_back({quantity, -1, -1, -1, -1, sense, most});
  }

 private:
  void refer() {
    limits.a = a.data(), limits.b = b.data(), limits.d = d.data(), limits.c = c.data(), limits.w = w.data();
    limits.rate = rate.data(), limits.fastest = fastest.data(), limits.width = width.data();
    limits.negligible = negligible.data(), limits.along = along.data(), limits.bend = bend.data();
    limits.across = across.data(), limits.norm = norm.data(), limits.motor_rate = motor_rate.data();
  }
};

}  // namespace bellcrank
