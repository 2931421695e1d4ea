// SIMD lanes against the same operations on single numbers; a program for each register width of this processor.
#include "lane_vector.hpp"

#include "runge_kutta_stages.hpp"
#include "support.hpp"
#include "zero_search.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

Vec filled(Random& random, double low, double high) {
  Vec v;
  for (int l = 0; l < width; ++l) v[l] = random.between(low, high);
  return v;
}
bool equal(double a, double b) { return a == b || (a != a && b != b); }

constexpr double unusual[] = {0.0, -0.0, 1.0, -1.0, 5e-324, 1e308, -1e308, INFINITY, -INFINITY, NAN};

// Table row 6 of RK45, which begins with a weight, has a zero and ends with a weight.
using Row = Weights<RowOf<DormandPrince, 6>>;

}  // namespace

TEST_CASE("comparisons of lanes are those of their numbers") {
  for (double a : unusual)
    for (double b : unusual)
      for (int l = 0; l < width; ++l) {
        Vec x = splat(3), y = splat(2);
        x[l] = a, y[l] = b;
        const Vec more = larger(x, y), less = smaller(x, y), plain = absolute(x);
        const Mask whole = finite(x);
        for (int k = 0; k < width; ++k) {
          CHECK(equal(more[k], larger(double(x[k]), double(y[k]))));
          CHECK(equal(less[k], smaller(double(x[k]), double(y[k]))));
          CHECK(equal(plain[k], std::fabs(x[k])));
          CHECK((whole[k] != 0) == std::isfinite(double(x[k])));
        }
      }
}

TEST_CASE("masks and bits are the same lanes") {
  for (Bits lanes = 0; lanes <= all_lanes; ++lanes) {
    const Mask m = mask(lanes);
    CHECK(bits(m) == lanes);
    CHECK(any(m) == (lanes != 0));
    Bits visited = 0;
    each(lanes, [&](int lane) { visited |= 1u << lane; });
    CHECK(visited == lanes);
    for (int l = 0; l < width; ++l) CHECK(m[l] == ((lanes >> l & 1) ? -1 : 0));
  }
}

TEST_CASE("square roots and spacings are exact") {
  Random random(1);
  for (int turn = 0; turn < 200; ++turn) {
    const Vec v = filled(random, 0, 1) * std::pow(10.0, random.integer(-300, 300));
    const Vec roots = root(v), gaps = spacing(turn % 2 ? v : -v);
    for (int l = 0; l < width; ++l) {
      CHECK(roots[l] == std::sqrt(double(v[l])));
      CHECK(gaps[l] == std::nextafter(double(v[l]), INFINITY) - v[l]);
      CHECK(gaps[l] == spacing(double(v[l])));
    }
  }
}

TEST_CASE("powers are accurate to 1e-9, and exact at 1") {
  Random random(2);
  for (int turn = 0; turn < 2000; ++turn) {
    Vec x;
    for (int l = 0; l < width; ++l) x[l] = std::exp2(random.between(-300, 300));
    const double y = turn % 4 == 0 ? -1.0 / 8 : turn % 4 == 1 ? -1.0 / 5 : random.between(-3, 3);
    const Vec found = power(x, y);
    for (int l = 0; l < width; ++l) CHECK(std::fabs(found[l] / std::pow(double(x[l]), y) - 1) < 1e-9);
  }
  for (double y : {-2.0, -0.125, 0.5}) CHECK(power(splat(1), y)[width - 1] == 1);
}

TEST_CASE("no lane's value reaches another lane") {
  Random random(3);
  for (int l = 0; l < width; ++l)
    for (double value : unusual) {
      const Vec x = filled(random, 0.5, 2);
      Vec disturbed = x;
      disturbed[l] = value;
      const auto normal = [](Vec v) { return smaller(larger(v, splat(1e-290)), splat(1e290)); };  // as power takes them
      const Vec a[] = {power(normal(x), -0.3), root(x), spacing(x)};
      const Vec b[] = {power(normal(disturbed), -0.3), root(disturbed), spacing(disturbed)};
      for (int i = 0; i < 3; ++i)
        for (int k = 0; k < width; ++k)
          if (k != l) CHECK(a[i][k] == b[i][k]);
    }
}

TEST_CASE("four lanes: sizes, sums and fresh loads") {
  Random random(4);
  for (int turn = 0; turn < 50; ++turn) {
    alignas(64) double v[8];
    for (double& entry : v) entry = random.between(-1, 1);
    const Lanes loaded = at(v + 4), anew = fresh(v + 4), sizes = magnitude(loaded);
    for (int l = 0; l < 4; ++l) {
      CHECK(loaded[l] == v[4 + l]);
      CHECK(anew[l] == v[4 + l]);
      CHECK(sizes[l] == std::fabs(v[4 + l]));
    }
    CHECK(std::fabs(total(loaded) - (v[4] + v[5] + v[6] + v[7])) < 1e-15);
  }
}

TEST_CASE("weighted sums of stages are those of the table") {
  Random random(5);
  for (int turn = 0; turn < 50; ++turn) {
    alignas(64) double k[7 * 8];
    for (double& entry : k) entry = random.between(-1, 1);
    const Lanes sum = weighted<Row, 5>(vectors(k) + 1, 2), again = weighted<Row, 5, true>(vectors(k) + 1, 2);
    for (int l = 0; l < 4; ++l) {
      double expected = 0;
      for (int j = 0; j < 6; ++j) expected += DormandPrince::a[6][j] * k[8 * j + 4 + l];
      CHECK(std::fabs(sum[l] - expected) < 1e-15);
      CHECK(again[l] == sum[l]);
    }
  }
  CHECK(Row::first(0));
  CHECK_FALSE(Row::first(1));
}

// cos(w s + p) has one zero between 0 and 1.
TEST_CASE("roots in lanes are those of single functions, and lanes that are not active do not matter") {
  Random random(6);
  for (int turn = 0; turn < 50; ++turn) {
    Vec w = filled(random, 1.2, 2.5);
    const Vec p = filled(random, 0.4, 1.5), none = {}, one = splat(1), rounding = splat(1e-16);
    const int idle = random.integer(0, width - 1);
    const auto value = [](double rate, double phase, double s) { return std::cos(rate * s + phase); };
    const auto along = [&](Vec s) {
      Vec v;
      for (int l = 0; l < width; ++l) v[l] = l == idle ? NAN : value(w[l], p[l], s[l]);
      return v;
    };
    Vec hit;
    const Vec found = bracketed_root(along, none, along(none), one, along(one), rounding, mask(all_lanes & ~(1u << idle)), &hit);
    for (int l = 0; l < width; ++l) {
      if (l == idle) continue;
      const double rate = w[l], phase = p[l];
      const auto single = [&](double s) { return value(rate, phase, s); };
      double at_hit;
      const double root = bracketed_root(single, 0.0, single(0), 1.0, single(1), 1e-16, true, &at_hit);
      CHECK(std::fabs(root - (M_PI / 2 - phase) / rate) < 4e-16);
      CHECK(std::fabs(found[l] - root) < 4e-16);
    }
  }
}
