// Parabolas, and the limits at a place of a path: bounds of the path acceleration are where a limit is met exactly.
#include "limits_at_place.hpp"
#include "path_of_limits.hpp"

using namespace bellcrank;

namespace {

// A path with two constant limits of four quantities with friction, and two norms.
Path random_path(Random& random) {
  Path path(3, 4, 2, 2);
  path.fill(random);
  for (int k = 0; k < 4; ++k) path.limit(k, random.between(1, 3));
  return path;
}

bool same(double found, double expected) { return found == expected || std::fabs(found - expected) < 1e-12; }

}  // namespace

TEST_CASE("the next root of a parabola is the smallest above y at which it becomes negative") {
  Random random(1);
  for (int turn = 0; turn < 500; ++turn) {
    const double low = random.between(-2, 2), high = low + random.between(0.01, 3), scale = random.between(0.1, 4);
    const Parabola opens{scale, -scale * (low + high), scale * low * high};
    const Parabola closes{-opens.p2, -opens.p1, -opens.p0};
    for (double y : {low - 0.5, 0.5 * (low + high), high + 0.5}) {
      if (y <= 0) continue;
      CHECK(same(opens.next_root(y), y < low ? low : unlimited));
      CHECK(same(closes.next_root(y), y < high ? high : unlimited));
    }
    CHECK(opens.slope(0.7) == doctest::Approx((opens(0.7 + 1e-4) - opens(0.7 - 1e-4)) / 2e-4).epsilon(1e-8));
  }
  CHECK(Parabola{0, -2, 3}.next_root(1) == 1.5);
  CHECK(Parabola{0, 2, -3}.next_root(1) == unlimited);
  CHECK(Parabola{1, 0, 1}.next_root(1) == unlimited);
  CHECK(Parabola{0, 0, 1}.next_root(1) == unlimited);
  CHECK(Parabola{1, -2, 1}.next_root(0.5) == unlimited);  // it touches zero
  const double small = 1e-9;  // beside a root of 1: no digits are lost
  CHECK(std::fabs(Parabola{1, -1 - small, small}.next_root(0) / small - 1) < 1e-15);
}

TEST_CASE("no limit is exceeded between the bounds, and one is beyond each of them") {
  Random random(2);
  int looked = 0;
  for (int turn = 0; turn < 200; ++turn) {
    const Path path = random_path(random);
    const LimitsAtPlace place(path.limits, turn % 3);
    const double y = random.between(0, 0.8);
    const Bounds b = place.bounds(y);
    if (b.gap() < 0.01 || b.speed.value < 0) continue;
    ++looked;
    CHECK(std::fabs(place.excess(y, b.most.value)) < 1e-12);
    CHECK(std::fabs(place.excess(y, b.least.value)) < 1e-12);
    CHECK(place.excess(y, b.most.value + 1e-6) > 0);
    CHECK(place.excess(y, b.least.value - 1e-6) > 0);
    CHECK(place.excess(y, 0.5 * (b.most.value + b.least.value)) < 0);
    CHECK(std::fabs(b.most.shape(y) - b.most.value) < 1e-12);
    CHECK(std::fabs(b.least.shape(y) - b.least.value) < 1e-12);
  }
  CHECK(looked > 100);
}

TEST_CASE("the parabola of a bound is its tangent in the speed") {
  Random random(3);
  int looked = 0;
  for (int turn = 0; turn < 200; ++turn) {
    const Path path = random_path(random);
    const LimitsAtPlace place(path.limits, 0);
    const double y = random.between(0.1, 0.8), d = 1e-5;
    const Bounds b = place.bounds(y), before = place.bounds(y - d), after = place.bounds(y + d);
    if (b.gap() < 0.05 || before.most.row != after.most.row || before.least.row != after.least.row) continue;
    const double most = (after.most.value - before.most.value) / (2 * d);
    const double least = (after.least.value - before.least.value) / (2 * d);
    CHECK(b.most.shape.slope(y) == doctest::Approx(most).epsilon(1e-6));
    CHECK(b.least.shape.slope(y) == doctest::Approx(least).epsilon(1e-6));
    ++looked;
  }
  CHECK(looked > 100);
}

TEST_CASE("shares of limits have the derivatives of their differences") {
  Random random(4);
  for (int turn = 0; turn < 100; ++turn) {
    const Path path = random_path(random);
    const LimitsAtPlace place(path.limits, 1);
    const double y = random.between(0.1, 1), u = random.between(-1, 1), d = 1e-5;
    const std::size_t count = 2 * path.limits.rows.size() + path.limits.norms;
    Numbers share(count), by_u(count), by_y(count), limited(count), unused(count);
    place.linearised(y, u, share.data(), by_u.data(), by_y.data(), limited.data());
    const auto shares = [&](double speed, double acceleration) {
      Numbers found(count), a(count), b(count);
      place.linearised(speed, acceleration, found.data(), a.data(), b.data(), unused.data());
      return found;
    };
    const Numbers faster = shares(y + d, u), slower = shares(y - d, u);
    const Numbers more = shares(y, u + d), less = shares(y, u - d);
    for (std::size_t k = 0; k < count; ++k) {
      CHECK(std::fabs(by_y[k] - (faster[k] - slower[k]) / (2 * d)) < 1e-6);
      CHECK(std::fabs(by_u[k] - (more[k] - less[k]) / (2 * d)) < 1e-6);
    }
    double worst = -unlimited;
    for (std::size_t k = 0; k < 2 * path.limits.rows.size(); ++k) worst = std::max(worst, share[k]);
    for (std::size_t k = count - path.limits.norms; k < count; ++k)
      worst = std::max(worst, std::sqrt(share[k] + 1) - 1);  // share of a norm: of its square
    CHECK(std::fabs(worst - place.excess(y, u)) < 1e-12);
  }
}

TEST_CASE("the first speed that exceeds a limit without acceleration is where the excess becomes positive") {
  Random random(5);
  for (int turn = 0; turn < 100; ++turn) {
    Path path = random_path(random);
    path.limits.norms = 0;
    const LimitsAtPlace place(path.limits, 2);
    if (place.excess(0, 0) >= 0) continue;
    const auto [speed, row] = place.first_exceeded(0, 5);
    for (int k = 0; k < 50; ++k) CHECK(place.excess(speed * k / 50.0, 0) < 1e-9);
    CHECK((row >= 0) == (speed < 5));
    if (speed < 5) CHECK(place.excess(speed * (1 + 1e-6), 0) > 0);
  }
}

// A motor whose torque falls from 2 to 1.6 between the speeds 0 and 1 and to 0 at 2, with a gear of 3.
TEST_CASE("a torque-speed curve is read at the motor's speed") {
  Path path(1, 1, 0, 0);
  path.set(0, 0, 1, 0, 0, 0);
  path.motor_rate = {3};
  path.limits.motors = 1, path.limits.motor_rate = path.motor_rate.data();
  path.limits.curves = {{{0, 1, 2}, {2, 1.6, 0}}};
  path.limits.rows = {{0, -1, 0, 0, 0, 1, 2}, {0, -1, 0, 0, 0, -1, 2}};
  const LimitsAtPlace place(path.limits, 0);
  for (double y : {0.0, 0.1, 0.3, 0.4, 0.6}) {
    const double torque = y < 1.0 / 3 ? 2 - 1.2 * y : 3.2 - 4.8 * y;
    const Bounds b = place.bounds(y);
    CHECK(b.most.value == doctest::Approx(torque).epsilon(1e-14));
    CHECK(b.least.value == doctest::Approx(-torque).epsilon(1e-14));
  }
  CHECK(place.bounds(0.7).gap() < 0);  // beyond the curve no torque is allowed
}
