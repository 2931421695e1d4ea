// Steps of fixed size on a nonlinear problem with a known solution: the error falls with the declared order.
#include "explicit_runge_kutta.hpp"
#include "known_problem.hpp"
#include "radau_iia.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

template <class Stepper>
Numbers state(const Stepper& stepper) {
  return Numbers(stepper.state(), stepper.state() + known::n);
}

template <class Stepper>
Numbers end_of_steps(const Problem& p, int count) {
  Rhs rhs(p);
  Stepper stepper(rhs);
  REQUIRE(stepper.begin());
  for (int k = 1; k <= count; ++k) REQUIRE(stepper.fixed(p.t0 + (p.t1 - p.t0) * k / count) == Outcome::accepted);
  return state(stepper);
}

template <class Stepper>
double observed_order(int first) {
  Numbers errors;
  for (int count : {first, 2 * first, 4 * first})
    errors.push_back(distance(end_of_steps<Stepper>(known::problem(), count), known::solution(known::end)));
  CAPTURE(errors.front());
  CAPTURE(errors.back());
  CHECK(errors.back() > 1e-13);  // the order is not read from rounding errors
  return order(errors);
}

// A step that is repeated with another size is the step of that size.
template <class Stepper>
void check_redo() {
  const Problem p = known::problem();
  for (double share : {0.1, 0.5, 0.9, 1.0}) {
    Rhs rhs(p);
    Stepper stepper(rhs), other(rhs);
    REQUIRE(stepper.begin());
    REQUIRE(stepper.fixed(p.t0 + 0.1) == Outcome::accepted);
    alignas(64) double x[8] = {};
    REQUIRE(stepper.redo(share * 0.1, x));
    REQUIRE(other.begin());
    REQUIRE(other.fixed(p.t0 + share * 0.1) == Outcome::accepted);
    CHECK(distance(Numbers(x, x + known::n), state(other)) < 1e-14);
  }
}

}  // namespace

TEST_CASE("RK4 converges with order 4") { CHECK(observed_order<ExplicitRungeKutta<Rk4, 2>>(40) > 3.9); }
TEST_CASE("RK45 converges with order 5") { CHECK(observed_order<ExplicitRungeKutta<DormandPrince, 2>>(24) > 4.9); }
TEST_CASE("DOP853 converges with order 8") { CHECK(observed_order<ExplicitRungeKutta<Dop853, 2>>(6) > 7.7); }
TEST_CASE("Radau IIA converges with order 5") { CHECK(observed_order<Radau<2>>(24) > 4.9); }

TEST_CASE("a repeated step of RK4 is the step of that size") { check_redo<ExplicitRungeKutta<Rk4, 2>>(); }
TEST_CASE("a repeated step of RK45 is the step of that size") { check_redo<ExplicitRungeKutta<DormandPrince, 2>>(); }
TEST_CASE("a repeated step of DOP853 is the step of that size") { check_redo<ExplicitRungeKutta<Dop853, 2>>(); }
TEST_CASE("a repeated step of Radau IIA is the step of that size") { check_redo<Radau<2>>(); }

TEST_CASE("a number of blocks that is known at run time gives the same steps") {
  const Problem p = known::problem();
  const Numbers fixed = end_of_steps<ExplicitRungeKutta<Dop853, 2>>(p, 10);
  CHECK(distance(fixed, end_of_steps<ExplicitRungeKutta<Dop853, 0>>(p, 10)) < 1e-14);
  CHECK(distance(end_of_steps<Radau<2>>(p, 10), end_of_steps<Radau<0>>(p, 10)) < 1e-13);
}

TEST_CASE("a kernel that adds the newest slope itself gives the same steps") {
  Problem staged = known::problem();
  staged.rhs = known::staged_slope, staged.staged = true;
  const Problem plain = known::problem();
  CHECK(distance(end_of_steps<ExplicitRungeKutta<DormandPrince, 2>>(staged, 10),
                 end_of_steps<ExplicitRungeKutta<DormandPrince, 2>>(plain, 10)) < 1e-14);
  CHECK(distance(end_of_steps<ExplicitRungeKutta<Dop853, 2>>(staged, 10),
                 end_of_steps<ExplicitRungeKutta<Dop853, 2>>(plain, 10)) < 1e-14);
}

// R(z) = (1 + 2 z / 5 + z^2 / 20) / (1 - 3 z / 5 + 3 z^2 / 20 - z^3 / 60): E. Hairer, G. Wanner, Solving Ordinary
// Differential Equations II, sec. IV.3, the subdiagonal Pade approximation of exp(z).
TEST_CASE("one step of Radau IIA on a linear problem multiplies by its stability function") {
  const Numbers start{1};
  for (const double z : {0.5, -0.1, -2.0, -50.0, -1e6}) {
    const auto slope = [](const double* const* in, double* const* out) -> std::int32_t {
      return *out[0] = *in[3] * *in[1], 0;
    };
    KnownDerivatives derivatives([](const double* const* in, double* const* out) -> std::int32_t {
      return *out[0] = *in[3], 0;
    });
    Problem p = plain_problem(slope, start, 0, 1);
    p.p = &z, p.derivatives = &derivatives;
    Rhs rhs(p);
    Radau<1> stepper(rhs);
    REQUIRE(stepper.begin());
    REQUIRE(stepper.fixed(1) == Outcome::accepted);
    const double expected = (1 + 0.4 * z + z * z / 20) / (1 - 0.6 * z + 0.15 * z * z - z * z * z / 60);
    CHECK(std::fabs(*stepper.state() - expected) < 1e-14);
  }
}

TEST_CASE("a slope that is not finite ends the step at its start") {
  const Numbers start{1};
  const auto undefined = [](const double* const* in, double* const* out) -> std::int32_t {
    return *out[0] = *in[0] > 0.5 ? NAN : 1, 0;
  };
  const Problem p = plain_problem(undefined, start, 0, 2);
  Rhs rhs(p);
  ExplicitRungeKutta<Rk4, 1> stepper(rhs);
  REQUIRE(stepper.begin());
  REQUIRE(stepper.fixed(0.25) == Outcome::accepted);
  CHECK(stepper.fixed(1) == Outcome::non_finite);
  CHECK(stepper.t == 0.25);
  CHECK(*stepper.state() == 1.25);
}
