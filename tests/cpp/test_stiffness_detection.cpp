// Stiffness detection: rates of linear equations, and how many suspicions make a series.
#include "stiffness_detection.hpp"

#include "known_problem.hpp"
#include "runge_kutta_tableaus.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

// |lambda|^2 from the difference d of two states of x' = A x, A row by row.
double rate(const Problem& p, const Numbers& matrix, const Numbers& d) {
  SquareSums states, slopes;
  for (int i = 0; i < p.n; ++i) {
    double slope = 0;
    for (int j = 0; j < p.n; ++j) slope += matrix[i * p.n + j] * d[j];
    states.add(i, d[i], p), slopes.add(i, slope, p);
  }
  return rate_square(p, states, slopes);
}

}  // namespace

TEST_CASE("the rate of a linear equation is its eigenvalue") {
  const Numbers start(2);
  const Problem p = plain_problem(nullptr, start, 0, 1);
  CHECK(rate(p, {-50, 0, 0, -50}, {0.1, 0.3}) == doctest::Approx(2500));
  CHECK(rate(p, {0, 7, -7, 0}, {0.1, 0.3}) == doctest::Approx(49));
  CHECK(rate(p, {1, 2, 3, 4}, {0, 0}) == 0);
}

TEST_CASE("the rate of an oscillator is its frequency whatever its phase") {
  const Numbers start(2);
  Problem p = plain_problem(nullptr, start, 0, 1);
  p.nq = 1;
  for (double omega : {0.1, 1.0, 1e4})
    for (double phase : {0.1, 1.0, 1.5})
      CHECK(rate(p, {0, 1, -omega * omega, 0}, {std::cos(phase), -omega * std::sin(phase)}) ==
            doctest::Approx(omega * omega).epsilon(1e-12));
}

TEST_CASE("a step is held short beyond the limit of stability, or well before where the solution is much slower") {
  const double limit = Dop853::stability, h = 0.01;
  const auto square = [&](double share) { return std::pow(share * limit / h, 2); };
  CHECK(held_short<Dop853>(h, square(1.01), square(1.01)));
  CHECK_FALSE(held_short<Dop853>(h, square(0.99), square(0.5)));
  CHECK(held_short<Dop853>(h, square(0.99), square(0.01)));
  CHECK_FALSE(held_short<Dop853>(h, square(0.2), 0.0));  // h |lambda| = 1.22 needs no short step
}

TEST_CASE("fifteen suspicious steps make a series, and six others end it") {
  StiffnessDetector detector;
  for (int k = 0; k < 14; ++k) detector.note(true, k);
  CHECK_FALSE(detector.stiff());
  CHECK(detector.steps() == 0);
  for (int k = 0; k < 5; ++k) detector.note(false, 14 + k);
  CHECK(detector.suspicions() == 14);  // five do not end it
  detector.note(true, 20);
  CHECK(detector.stiff());
  CHECK(detector.steps() == 15);
  CHECK(detector.since() == 0);
  detector.note(true, 21);
  CHECK(detector.steps() == 16);
  for (int k = 0; k < 6; ++k) detector.note(false, 22 + k);
  CHECK_FALSE(detector.stiff());
  CHECK(detector.since() == 0);
}

TEST_CASE("the first sixteen steps are tested, then each eighth, and each one under suspicion") {
  StiffnessDetector detector;
  int tested = 0;
  for (int k = 0; k < 16; ++k) tested += detector.due();
  CHECK(tested == 16);
  for (int k = 0; k < 80; ++k) tested += detector.due();
  CHECK(tested == 26);
  detector.note(true, 1);
  for (int k = 0; k < 10; ++k) tested += detector.due();
  CHECK(tested == 36);
}
