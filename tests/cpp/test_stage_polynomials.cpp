// Polynomials through the stages of DOP853, and the test of its dense output by them.
#include "dense_output.hpp"
#include "support.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

using Terms = StagePolynomialTerms<Dop853>;
constexpr Terms terms;

// s^2 (1 - s)^2 (c0 + c1 s + c2 s^2) and its slope.
double value(const double* c, double s) { return s * s * (1 - s) * (1 - s) * (c[0] + s * (c[1] + s * c[2])); }
double slope(const double* c, double s) {
  const double bump = s * s * (1 - s) * (1 - s), rise = 2 * s * (1 - s) * (1 - 2 * s);
  return rise * (c[0] + s * (c[1] + s * c[2])) + bump * (c[1] + 2 * c[2] * s);
}

// By how much the dense output differs from the finer polynomial, and this from the coarser one, in tolerances, as root
// mean square over the two places that are compared.
bool passes(double far, double near) {
  const double first = 0.4 * 0.4 * 0.6 * 0.6, second = 0.75 * 0.75 * 0.25 * 0.25;
  const double unit = 1 / std::sqrt(0.5 * (first * first + second * second)), tolerance = 1e-7;
  const HighTerms<double> finer{1, 2, 0.3, 0}, coarser{1 + near * unit * tolerance, 2, 0.3, 0};
  const HighTerms<double> dense{1 + far * unit * tolerance, 2, 0.3, 0};
  DenseOutputTest<double> test;
  test.add(dense, finer, coarser, 1 / tolerance);
  return DenseOutputTest<double>::passes(test.far(), test.near(), 1);
}

}  // namespace

// C(5) of these stages; Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, sec. II.5.
TEST_CASE("the chosen stages of DOP853 integrate powers of time up to the fourth") {
  for (int i : Terms::stage)
    for (int k = 0; k <= 5; ++k) {
      double sum = 0;
      for (int j = 0; j < i; ++j) sum += Dop853::a[i][j] * (k ? std::pow(Dop853::c[j], k) : 1.0);
      const double miss = std::fabs(sum - std::pow(Dop853::c[i], k + 1) / (k + 1));
      if (k <= 4) CHECK(miss < 1e-13);
      else CHECK(miss > 1e-7);
    }
}

TEST_CASE("slopes at three stages determine the polynomial of degree 6, and at two that of degree 5") {
  Random random(1);
  for (int turn = 0; turn < 20; ++turn) {
    const Numbers c = random.vector(3);
    double missing[3], found[3];
    for (int i = 0; i < 3; ++i) missing[i] = slope(c.data(), Dop853::c[Terms::stage[i]]);
    terms.finer(missing, found);
    for (int j = 0; j < 3; ++j) CHECK(found[j] == doctest::Approx(c[j]).epsilon(1e-11).scale(1));
    const double plain[] = {c[0], c[1], 0};
    for (int i = 0; i < 3; ++i) missing[i] = slope(plain, Dop853::c[Terms::stage[i]]);
    terms.coarser(missing, found);
    for (int j = 0; j < 2; ++j) CHECK(found[j] == doctest::Approx(c[j]).epsilon(1e-11).scale(1));
  }
}

TEST_CASE("the terms of the dense output are the same polynomial in another basis") {
  Random random(2);
  for (int turn = 0; turn < 20; ++turn) {
    const Numbers c = random.vector(3);
    const auto finer = HighTerms<double>::finer(c.data()), coarser = HighTerms<double>::coarser(c.data());
    const double plain[] = {c[0], c[1], 0}, s = random.between(0, 1), bump = s * s * (1 - s) * (1 - s);
    CHECK(std::fabs(bump * finer(s) - value(c.data(), s)) < 1e-15);
    CHECK(std::fabs(bump * coarser(s) - value(plain, s)) < 1e-15);
  }
}

TEST_CASE("a dense output is refused beyond a hundred tolerances and ten times the spread of the stages") {
  CHECK(passes(0, 0));
  CHECK(passes(99, 0));
  CHECK_FALSE(passes(101, 0));
  CHECK(passes(990, 100));
  CHECK_FALSE(passes(1010, 100));
  CHECK_FALSE(passes(NAN, 1));
}
