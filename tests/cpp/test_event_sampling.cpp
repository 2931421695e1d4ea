// Bounds on a function between its samples. They are exact for polynomials of low degree, and what they rule out does
// not occur between the samples.
#include "event_sampling.hpp"

#include "support.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

template <class Function>
Numbers samples(const Function& f, int stride = 1) {
  Numbers v;
  for (int i = 0; i <= parts; i += stride) v.push_back(f(place[i]));
  return v;
}

// The polynomial of degree 3 with random coefficients.
struct Cubic {
  Numbers c;
  double operator()(double s) const { return c[0] + s * (c[1] + s * (c[2] + s * c[3])); }
  double curve(double s) const { return 2 * c[2] + 6 * c[3] * s; }
};

// The least and the largest value between samples i and i + 1.
template <class Function>
std::pair<double, double> range(const Function& f, double a, double b) {
  double least = INFINITY, most = -INFINITY;
  for (int k = 0; k <= 200; ++k) {
    const double value = f(a + (b - a) * k / 200);
    least = std::min(least, value), most = std::max(most, value);
  }
  return {least, most};
}

}  // namespace

TEST_CASE("cubics are not missed, and a quartic is missed by its distance from the cubic through four neighbours") {
  Random random(1);
  for (int turn = 0; turn < 50; ++turn) {
    const Cubic cubic{random.vector(4)};
    CHECK(Shape(samples(cubic).data()).miss < 1e-14);
    CHECK(ShapeOf<double, 2>(samples(cubic, 2).data()).miss < 1e-14);
  }
  double expected = 0;  // s^4 less the cubic through four samples is the product of the distances from them
  for (int i = 1; i < parts; ++i) {
    const int k = i < 3 ? 0 : i > parts - 3 ? parts - 4 : i - 2;
    double product = 1;
    for (int j = k; j <= k + 4; ++j)
      if (j != i) product *= std::fabs(place[i] - place[j]);
    expected = std::max(expected, product);
  }
  const auto quartic = [](double s) { return s * s * s * s; };
  CHECK(Shape(samples(quartic).data()).miss == doctest::Approx(expected).epsilon(1e-10));
}

// The arc of a parabola rises above its chord by an eighth of its second derivative times the square of the width.
TEST_CASE("the bend of a parabola is its rise over the longer chord") {
  const auto parabola = [](double s) { return 3 * s * s - s; };
  const Numbers v = samples(parabola);
  const Shape shape(v.data());
  for (int i = 1; i < parts; ++i) {
    const double width = std::max(place[i] - place[i - 1], place[i + 1] - place[i]);
    CHECK(shape.bend[i] == doctest::Approx(6 * width * width / 8).epsilon(1e-12));
  }
  CHECK(shape.miss < 1e-15);
  for (int i = 0; i < parts; ++i) CHECK(shape.parabola(i));
}

TEST_CASE("the bends at the ends of a step are exact for cubics") {
  Random random(2);
  for (int turn = 0; turn < 50; ++turn) {
    const Cubic cubic{random.vector(4)};
    const Numbers v = samples(cubic);
    const ShapeToEnds<double> shape(v.data());
    const double front = place[1] * place[1] / 8, back = std::pow(1 - place[parts - 1], 2) / 8;
    CHECK(shape.bend[0] == doctest::Approx(std::max(shape.bend[1], std::fabs(cubic.curve(0)) * front)).epsilon(1e-10));
    CHECK(shape.bend[parts] ==
          doctest::Approx(std::max(shape.bend[parts - 1], std::fabs(cubic.curve(1)) * back)).epsilon(1e-10));
  }
}

TEST_CASE("parabolas keep to what is ruled out between samples") {
  Random random(3);
  int kept = 0, within = 0, monotonic = 0;
  for (int turn = 0; turn < 2000; ++turn) {
    const Cubic parabola{{random.between(-1, 1), random.between(-2, 2), random.between(-2, 2), 0}};
    const Numbers v = samples(parabola);
    const ShapeToEnds<double> shape(v.data());
    for (int i = 0; i < parts; ++i) {
      const auto [least, most] = range(parabola, place[i], place[i + 1]);
      if (v[i] * v[i + 1] > 0 && shape.has_no_zero(i, v.data(), 2)) {
        CHECK((least > 0 || most < 0));
        ++kept;
      }
      if (!shape.may_leave(i, v.data(), -0.5, 0.5, 2)) {
        CHECK((least > -0.5 - 1e-14 && most < 0.5 + 1e-14));
        ++within;
      }
      if (shape.runs(i, v.data())) {
        CHECK(most - least <= std::fabs(v[i + 1] - v[i]) + 1e-14);
        ++monotonic;
      }
    }
  }
  CHECK(kept > 1000);  // it is not that nothing is ruled out
  CHECK(within > 1000);
  CHECK(monotonic > 1000);
}

TEST_CASE("two roots between neighbouring samples are not ruled out") {
  Random random(4);
  for (int turn = 0; turn < 1000; ++turn) {
    const int i = random.integer(0, parts - 1);
    const double width = place[i + 1] - place[i];
    const double middle = place[i] + width * random.between(0.3, 0.7), half = width * random.between(1e-6, 0.25);
    const auto f = [&](double s) { return (s - middle) * (s - middle) - half * half; };
    const Numbers v = samples(f);
    REQUIRE(v[i] > 0);
    REQUIRE(v[i + 1] > 0);
    CHECK_FALSE(Shape(v.data()).has_no_zero(i, v.data(), 2));
  }
}

TEST_CASE("samples of an oscillation alternate, those of a kink do not") {
  CHECK(Shape::oscillates(samples([](double s) { return std::sin(40 * s); }).data()));
  CHECK_FALSE(Shape::oscillates(samples([](double s) { return std::fabs(s - 0.4); }).data()));
  CHECK_FALSE(Shape::oscillates(samples([](double s) { return s < 0.4 ? 0.0 : 1.0; }).data()));
}

TEST_CASE("samples that are not numbers make the miss undefined") {
  for (int i = 0; i <= parts; ++i) {
    Numbers v(parts + 1, 1.0);
    v[i] = NAN;
    const double miss = Shape(v.data()).miss;
    CHECK(miss != miss);
  }
}
