// The fastest motion along a path: a mass between limits of acceleration and speed, whose solution is known, and random
// limits against a search over all speeds.
#include "path_of_limits.hpp"
#include "reachability.hpp"

using namespace bellcrank;

namespace {

Numbers grid(int count) {
  Numbers s(count);
  for (int i = 0; i < count; ++i) s[i] = static_cast<double>(i) / (count - 1);
  return s;
}

// A mass of 1 along a line of length 1, |u| <= most.
Path line(int places, double most) {
  Path path(places, 1, 0, 0);
  for (int i = 0; i < places; ++i) path.set(i, 0, 1, 0, 0, 0);
  path.limit(0, most);
  return path;
}

// Whether some u at the speed y keeps all limits of the place and reaches the goal.
bool possible(const LimitsAtPlace& place, double y, const Goal& goal) {
  double low = (goal.slowest * goal.slowest - y * y) / (2 * goal.step);
  double high = (goal.fastest * goal.fastest - y * y) / (2 * goal.step);
  const auto excess = [&](double u) { return place.excess(y, u); };
  for (int k = 0; k < 100; ++k) {  // the excess is convex in u: the largest of linear functions
    const double a = low + (high - low) / 3, b = high - (high - low) / 3;
    (excess(a) < excess(b) ? high : low) = excess(a) < excess(b) ? b : a;
  }
  return excess(0.5 * (low + high)) <= 1e-12;
}

}  // namespace

// y^2 = 2 a s while accelerating, 2 a (1 - s) while braking (a double integrator; L.
// Pontryagin et al., The Mathematical Theory of Optimal Processes, sec. 5).
TEST_CASE("a mass between rest and rest accelerates for half of the way and brakes for the rest") {
  const int n = 101;
  const Numbers s = grid(n);
  for (double most : {0.5, 3.0}) {
    const Path path = line(n, most);
    const Fastest f = fastest_on_grid(path.limits, s.data(), n, 0, 0);
    REQUIRE(f.failed == -1);
    double time = 0;
    for (int i = 0; i < n; ++i) {
      CHECK(f.y[i] == doctest::Approx(std::sqrt(2 * most * std::min(s[i], 1 - s[i]))).epsilon(1e-12));
      if (i + 1 < n) {
        CHECK(std::fabs(std::fabs(f.u_begin[i]) - most) < 1e-9);
        CHECK(f.kind[i] == (i < n / 2 ? Cell::forward : Cell::backward));
        time += 2 * (s[i + 1] - s[i]) / (f.y[i] + f.y[i + 1]);
      }
    }
    CHECK(time == doctest::Approx(2 / std::sqrt(most)).epsilon(1e-12));
  }
}

TEST_CASE("a mass with a largest speed rides at it, between given speeds at the ends") {
  const int n = 201;
  const Numbers s = grid(n);
  Path path = line(n, 1);
  std::fill(path.fastest.begin(), path.fastest.end(), 0.8);
  const Fastest f = fastest_on_grid(path.limits, s.data(), n, 0.3, 0.5);
  REQUIRE(f.failed == -1);
  for (int i = 0; i < n; ++i) {
    const double square = std::min({0.09 + 2 * s[i], 0.64, 0.25 + 2 * (1 - s[i])});
    CHECK(f.y[i] == doctest::Approx(std::sqrt(square)).epsilon(1e-12));
  }
}

// At s = 0.6 a quantity 1.25 - y^2 must not exceed 1: y >= 0.5 there, and before it y^2 >= 0.25 - 2 a (0.6 - s).
TEST_CASE("a place that can only be passed with speed needs a run-up") {
  const int n = 101, place = 60;
  const Numbers s = grid(n);
  Path path(n, 2, 0, 0);
  for (int i = 0; i < n; ++i) path.set(i, 0, 1, 0, 0, 0);
  path.set(place, 1, 0, -1, 0, 1.25);
  path.limit(0, 0.4);
  path.limit(1, 1);
  const Fastest f = fastest_on_grid(path.limits, s.data(), n, 0.1, 0.1);
  REQUIRE(f.failed == -1);
  for (int i = 0; i <= place; ++i) {
    const double expected = std::sqrt(std::max(0.0, 0.25 - 0.8 * (0.6 - s[i])));
    CHECK(f.slowest[i] == doctest::Approx(expected).epsilon(1e-9));
  }
  CHECK(f.y[place] >= 0.5);
}

TEST_CASE("ends that cannot be reached are refused") {
  const int n = 51;
  const Numbers s = grid(n);
  const Path path = line(n, 1);
  const Fastest fast = fastest_on_grid(path.limits, s.data(), n, 2, 0);
  const Fastest slow = fastest_on_grid(path.limits, s.data(), n, 0, 2);
  CHECK(fast.failed == 0);  // braking from 2 takes a way of 2
  CHECK(fast.failed_at_start);
  CHECK(slow.failed == 0);
  CHECK(slow.failed_at_start);
  CHECK(fastest_on_grid(path.limits, s.data(), n, std::sqrt(2), 0).failed == -1);
  Path blocked = line(n, 1);
  blocked.set(20, 0, 0, 0, 0, 2);  // the quantity is 2 whatever the motion
  const Fastest none_there = fastest_on_grid(blocked.limits, s.data(), n, 0, 0);
  CHECK(none_there.failed == 20);
  CHECK_FALSE(none_there.failed_at_start);
}

TEST_CASE("controllable speeds under random limits are those of a search over all speeds") {
  Random random(1);
  int compared = 0;
  for (int turn = 0; turn < 15; ++turn) {
    const int n = 12;
    const Numbers s = grid(n);
    Path path(n, 3, 0, 0);
    path.fill(random);
    std::fill(path.fastest.begin(), path.fastest.end(), 1.5);
    for (int k = 0; k < 3; ++k) path.limit(k, random.between(1, 2));
    const Fastest f = fastest_on_grid(path.limits, s.data(), n, 0, 0);
    for (int i = n - 2; i > std::max(f.failed, 0); --i) {
      const LimitsAtPlace place(path.limits, i);
      const Goal goal{f.slowest[i + 1], f.fastest[i + 1], s[i + 1] - s[i]};
      constexpr int speeds = 600;
      double top = -1;
      for (int k = speeds; k >= 0 && top < 0; --k)
        if (possible(place, 1.5 * k / speeds, goal)) top = 1.5 * k / speeds;
      CAPTURE(turn);
      CHECK(f.fastest[i] >= top - 1e-9);
      CHECK(f.fastest[i] <= top + 1.5 / speeds + 1e-9);
      ++compared;
    }
  }
  CHECK(compared > 100);
}

TEST_CASE("a motion keeps the limits at each place and the controllable speeds") {
  Random random(2);
  int moved = 0;
  for (int turn = 0; turn < 30; ++turn) {
    const int n = 40;
    const Numbers s = grid(n);
    Path path(n, 2, 0, 0);
    path.fill(random);
    for (int k = 0; k < 2; ++k) path.limit(k, 1.5);
    const Fastest f = fastest_on_grid(path.limits, s.data(), n, 0, 0);
    if (f.failed >= 0) continue;
    ++moved;
    for (int i = 0; i + 1 < n; ++i) {
      CHECK(f.y[i] >= f.slowest[i] - 1e-12);
      CHECK(f.y[i] <= f.fastest[i] + 1e-12);
      CHECK(LimitsAtPlace(path.limits, i).excess(f.y[i], f.u_begin[i]) < 1e-7);
      CHECK(std::fabs(f.y[i + 1] * f.y[i + 1] - f.y[i] * f.y[i] - 2 * (s[i + 1] - s[i]) * f.u_begin[i]) < 1e-12);
    }
  }
  CHECK(moved > 20);
}

TEST_CASE("the root of a parabola nearest to an end of an interval is found") {
  const Parabola p{2, -2 * (0.3 + 0.7), 2 * 0.3 * 0.7};
  CHECK(crossing(p, 0, 0, 1) == doctest::Approx(0.3).epsilon(1e-14));
  CHECK(crossing(p, 1, 0, 1) == doctest::Approx(0.7).epsilon(1e-14));
  CHECK(crossing(p, 0.5, 0.5, 1) == doctest::Approx(0.7).epsilon(1e-14));
  CHECK(crossing({0, -2, 1}, 0, 0, 1) == 0.5);
  CHECK(std::isnan(crossing(p, 0.4, 0.4, 0.6)));
  CHECK(std::isnan(crossing({1, 0, 1}, 0, 0, 1)));
}
