// Signals: piecewise polynomials of the time and their derivatives, held before the first break and after the last.
#include "known_problem.hpp"
#include "right_hand_side.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

const Numbers breaks{-1, 0, 0.5, 2, 3}, one_state(1);

// Three quantities that are cubics of the time; u: values, slopes, second derivatives.
struct Cubics {
  Numbers power = Random(1).vector(12, -2, 2);  // of quantity j: power[4 j ...]
  Numbers coefficients;
  Signal signal;
  Problem p = plain_problem(nullptr, one_state, 0, 1);

  explicit Cubics(bool kinked = false) {
    for (std::size_t k = 0; k + 1 < breaks.size(); ++k)
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 3; ++j) coefficients.push_back(derivative(j, breaks[k], i) / factorial(i));
    signal = {breaks.data(), coefficients.data(), 4, 4, 3, 2, kinked};
    p.signals = &signal, p.signal_count = 1, p.signal_entries = 9;
  }
  static double factorial(int i) { return i < 2 ? 1 : i * factorial(i - 1); }
  double derivative(int j, double t, int times) const {
    double sum = 0;
    for (int i = times; i < 4; ++i)
      sum += power[4 * j + i] * factorial(i) / factorial(i - times) * std::pow(t, i - times);
    return sum;
  }
};

}  // namespace

TEST_CASE("a signal made of pieces of one cubic is that cubic, with its derivatives") {
  const Cubics cubics;
  Rhs rhs(cubics.p);
  Random random(2);
  for (int turn = 0; turn < 300; ++turn) {
    const double t = turn < 5 ? breaks[turn] : turn < 150 ? -1 + 4.0 * turn / 150 : random.between(-1, 3);
    rhs.signals(t);
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k <= 2; ++k) CHECK(std::fabs(rhs.u()[3 * k + j] - cubics.derivative(j, t, k)) < 1e-12);
  }
}

TEST_CASE("before its first break and after its last a signal is held, without slope") {
  const Cubics cubics;
  Rhs rhs(cubics.p);
  for (const auto& [t, end] : {std::pair{-1.5, -1.0}, {-100.0, -1.0}, {3.1, 3.0}, {1e9, 3.0}}) {
    rhs.signals(t);
    for (int j = 0; j < 3; ++j) {
      CHECK(std::fabs(rhs.u()[j] - cubics.derivative(j, end, 0)) < 1e-12);
      CHECK(rhs.u()[3 + j] == 0);
      CHECK(rhs.u()[6 + j] == 0);
    }
  }
}

TEST_CASE("a signal with jumps belongs to the piece of the step, at both of its ends") {
  const Numbers steps{1, 5, -3, 2};  // constant between breaks
  const Signal signal{breaks.data(), steps.data(), 4, 1, 1, 0, true};
  Problem p = plain_problem(nullptr, one_state, 0, 1);
  p.signals = &signal, p.signal_count = p.signal_entries = 1;
  Rhs rhs(p);
  for (std::size_t k = 0; k < steps.size(); ++k) {
    rhs.pin(breaks[k], breaks[k + 1]);
    for (double t : {breaks[k], 0.5 * (breaks[k] + breaks[k + 1]), breaks[k + 1]}) {
      rhs.signals(t);
      CHECK(*rhs.u() == steps[k]);
    }
  }
}
