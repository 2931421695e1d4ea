// The extremum of a function between samples, by the polynomial through those that are near.
#include "extremum_polynomial.hpp"

#include "support.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

double polynomial(const Numbers& c, double s) {
  double value = 0;
  for (std::size_t i = c.size(); i-- > 0;) value = value * s + c[i];
  return value;
}
double slope(const Numbers& c, double s) {
  double value = 0;
  for (std::size_t i = c.size(); i-- > 1;) value = value * s + i * c[i];
  return value;
}

}  // namespace

TEST_CASE("slopes at samples are exact for polynomials of degree 5") {
  Random random(1);
  for (int turn = 0; turn < 50; ++turn) {
    const Numbers c = random.vector(6);
    for (int i = 0; i < parts; ++i)
      for (int side = 0; side < 2; ++side) {
        double found = 0;
        for (int j = 0; j < near; ++j)
          found += slope_weights.weight[i][side][j] * polynomial(c, place[first_near(i) + j]);
        CHECK(std::fabs(found - slope(c, place[i + side])) < 1e-12);
      }
  }
}

TEST_CASE("a curve turns within the interval in which its extremum lies") {
  for (double where = 0.02; where < 1; where += 0.0313) {
    double v[parts + 1];
    for (int k = 0; k <= parts; ++k) v[k] = std::cos(2 * (place[k] - where));
    for (int i = 0; i < parts; ++i) CHECK(turns_within(i, v) == (place[i] < where && where < place[i + 1]));
  }
}

TEST_CASE("Newton's form is the polynomial through its values") {
  Random random(2);
  for (int turn = 0; turn < 50; ++turn) {
    const Numbers c = random.vector(6);
    ExtremumPolynomial<double> found;
    for (double s : {0.9, 0.0, 0.5, 0.2, 1.0, 0.35}) found.add(s, polynomial(c, s));
    for (double s : {0.1, 0.35, 0.77}) CHECK(std::fabs(found(s) - polynomial(c, s)) < 1e-13);
  }
}

TEST_CASE("the extremum of a cubic is where its slope vanishes") {
  Random random(3);
  int found = 0;
  for (int turn = 0; turn < 200; ++turn) {
    const Numbers c = random.vector(4);
    ExtremumPolynomial<double> through;
    for (double s : {0.0, 0.3, 0.6, 1.0}) through.add(s, polynomial(c, s));
    double where = -1;
    const bool turns = slope(c, 0) * slope(c, 1) < 0;
    CHECK(through.extremum(0, 1, &where) == turns);
    if (!turns) continue;
    ++found;
    CHECK(where > 0);
    CHECK(where < 1);
    double low = 0, high = 1;  // by bisection
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (slope(c, middle) * slope(c, 0) > 0 ? low : high) = middle;
    }
    CHECK(std::fabs(where - low) < 3e-8);  // the bisection to which Newton's method may turn ends there
  }
  CHECK(found > 50);
}

// The error of interpolation in six places is the sixth derivative over 720 times the product of their distances.
TEST_CASE("the extremum of a cosine is found to the error of its interpolation") {
  for (double where : {0.2, 0.45, 0.5, 0.8}) {
    ExtremumPolynomial<double> through;
    for (double s : {0.0, 0.15, 0.4, 0.6, 0.85, 1.0}) through.add(s, std::cos(s - where));
    double found = -1;
    REQUIRE(through.extremum(0, 1, &found));
    CHECK(std::fabs(found - where) < 1e-5);
    CHECK(std::fabs(through(found) - 1) < 1e-6);
  }
}
