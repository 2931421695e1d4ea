// Step size control: norms and first steps by their formulas (E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary
// Differential Equations I, sec. II.4), and that errors and numbers of steps follow the tolerance.
#include "explicit_runge_kutta.hpp"
#include "known_problem.hpp"
#include "radau_iia.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

// x' = lambda x from 1.
const Numbers one{1};
std::int32_t slope(const double* const* in, double* const* out) { return *out[0] = *in[3] * *in[1], 0; }
struct Decay {
  double lambda;
  Problem p = plain_problem(slope, one, 0, 100);

  explicit Decay(double rate) : lambda(rate) { p.p = &lambda; }
  double first(int estimator, double bound = 100) {
    Rhs rhs(p);
    return first_step(rhs, 0, one.data(), &lambda, bound, estimator);
  }
};

struct Work {
  double error;
  int steps;
};

template <class Stepper>
Work work(double tolerance) {
  Problem p = known::problem();
  p.rtol = p.atol = tolerance;
  p.t1 = 12;
  Rhs rhs(p);
  Stepper stepper(rhs);
  REQUIRE(stepper.begin());
  stepper.choose_step(p.t1);
  int steps = 0;
  double error = 0;
  while (stepper.t < p.t1) {
    const double before = stepper.t;
    REQUIRE(stepper.advance(p.t1) == Outcome::accepted);
    REQUIRE(stepper.t > before);
    ++steps;
    error = std::max(error, distance(Numbers(stepper.state(), stepper.state() + known::n), known::solution(stepper.t)));
  }
  CHECK(stepper.t == p.t1);
  return {error, steps};
}

// Errors stay in proportion to the tolerance, and steps grow with its power -1 / (estimator + 1).
template <class Stepper>
void check_tolerances(int estimator) {
  const Work coarse = work<Stepper>(1e-5), fine = work<Stepper>(1e-9);
  CHECK(coarse.error < 1000 * 1e-5);  // over two orbits, along which an error of the period adds up
  CHECK(fine.error < 1000 * 1e-9);
  const double growth = static_cast<double>(fine.steps) / coarse.steps, expected = std::pow(1e4, 1.0 / (estimator + 1));
  CHECK(growth > expected / 1.6);
  CHECK(growth < expected * 1.6);
}

// x' = t^q, q the order of the estimate: the error of a step of size h is `constant` h^(q + 1) at all times. So the
// second step is the safety factor times (tolerance / constant)^(1 / (q + 1)) whatever the first, and so is the third.
template <class Stepper>
void check_prediction(int order, double constant, double safety_factor) {
  const double power = order;
  const auto rate = [](const double* const* in, double* const* out) -> std::int32_t {
    return *out[0] = std::pow(*in[0], *in[3]), 0;
  };
  KnownDerivatives derivatives([](const double* const*, double* const* out) -> std::int32_t {
    return *out[0] = 0, 0;
  });
  const Numbers start{0};
  Problem p = plain_problem(rate, start, 0, 1);
  p.p = &power, p.derivatives = &derivatives;
  p.atol = 1e-8, p.rtol = 1e-12;
  const double expected = safety_factor * std::pow(p.atol / std::fabs(constant), 1.0 / (order + 1));
  for (double share : {0.2, 0.5, 0.8}) {
    p.first_step = share * expected;
    Rhs rhs(p);
    Stepper stepper(rhs);
    REQUIRE(stepper.begin());
    stepper.choose_step(1);
    for (int k = 0; k < 3; ++k) {
      REQUIRE(stepper.advance(1) == Outcome::accepted);
      CHECK(stepper.t - stepper.t_old == doctest::Approx(k ? expected : p.first_step).epsilon(1e-6));
    }
  }
}

}  // namespace

TEST_CASE("the scaled norm is the root mean square over the tolerances of the entries that count") {
  const Numbers x{1, -2, 0, 100}, v{0.3, 0.1, -0.2, 50};
  Problem p = plain_problem(nullptr, x, 0, 1);
  p.norm_size = 3, p.atol = 0.1, p.rtol = 0.01;
  const double expected = std::sqrt((std::pow(0.3 / 0.11, 2) + std::pow(0.1 / 0.12, 2) + std::pow(0.2 / 0.1, 2)) / 3);
  CHECK(scaled_norm<double>(p, p.atol, p.rtol, v.data(), x.data()) == doctest::Approx(expected).epsilon(1e-14));
}

// For x' = lambda x, with w = 1 / (atol + rtol): |x| = w, |x'| = |lambda| w, |x''| = lambda^2 w.
TEST_CASE("the first step of an exponential is that of the algorithm") {
  for (double lambda : {-1.0, -200.0, 0.01})
    for (int estimator : {3, 4, 7}) {
      Decay decay(lambda);
      const double w = 1 / (decay.p.atol + decay.p.rtol), size = std::fabs(lambda);
      const double h0 = 0.01 / size, h1 = std::pow(0.01 / (w * std::max(size, size * size)), 1.0 / (estimator + 1));
      CHECK(decay.first(estimator) == doctest::Approx(std::min(100 * h0, h1)).epsilon(1e-12));
    }
}

TEST_CASE("the first step keeps within the span and the largest step") {
  Decay decay(-1);
  const double free = decay.first(7);
  decay.p.max_step = free / 2;
  CHECK(decay.first(7) == free / 2);
  decay.p.max_step = INFINITY, decay.p.t1 = free / 3;
  CHECK(decay.first(7) == free / 3);
}

TEST_CASE("an equation at rest begins with a small step, a slope that is undefined with its first guess") {
  Decay decay(0);
  CHECK(decay.first(4) == doctest::Approx(1e-6).epsilon(1e-12));
  decay.p.rhs = [](const double* const*, double* const* out) -> std::int32_t { return *out[0] = NAN, 0; };
  decay.lambda = -1;
  CHECK(decay.first(4) == doctest::Approx(0.01).epsilon(1e-12));
}

TEST_CASE("errors and steps of RK45 follow the tolerance") {
  check_tolerances<ExplicitRungeKutta<DormandPrince, 2>>(4);
}
TEST_CASE("errors and steps of DOP853 follow the tolerance") { check_tolerances<ExplicitRungeKutta<Dop853, 2>>(7); }
TEST_CASE("errors and steps of Radau IIA follow the tolerance") { check_tolerances<Radau<2>>(3); }

TEST_CASE("the step of RK45 after an error of a known power is predicted at once") {
  double constant = 0;
  for (int i = 0; i < DormandPrince::rows; ++i) constant += DormandPrince::e[i] * std::pow(DormandPrince::c[i], 4);
  check_prediction<ExplicitRungeKutta<DormandPrince, 1>>(4, constant, 0.9);
}
TEST_CASE("the step of Radau IIA after an error of a known power is predicted at once") {
  double constant = 0;  // z_i = sum_j a_ij c_j^3
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) constant += RadauIIA::e[i] * RadauIIA::a[i][j] * std::pow(RadauIIA::c[j], 3);
  constant /= RadauIIA::mu;
  check_prediction<Radau<1>>(3, constant, 0.9 * 13 / 14);  // 13 / 14: after two iterations
}

TEST_CASE("no step is longer than the largest one, nor goes beyond a bound") {
  Problem p = known::problem();
  p.max_step = 0.05;
  Rhs rhs(p);
  ExplicitRungeKutta<Dop853, 2> stepper(rhs);
  REQUIRE(stepper.begin());
  stepper.choose_step(1);
  while (stepper.t < 1) {
    const double before = stepper.t;
    REQUIRE(stepper.advance(1) == Outcome::accepted);
    CHECK(stepper.t - before <= 0.05 * (1 + 1e-14));
  }
  CHECK(stepper.t == 1);
}

// The slope jumps at t = 0.5, where steps are rejected.
TEST_CASE("a step that follows a rejected one is not longer") {
  const auto jump = [](const double* const* in, double* const* out) -> std::int32_t {
    return *out[0] = *in[0] < 0.5 ? 1 : 40 * *in[1], 0;
  };
  const Problem p = plain_problem(jump, one, 0, 1);
  Rhs rhs(p);
  ExplicitRungeKutta<DormandPrince, 1> stepper(rhs);
  REQUIRE(stepper.begin());
  stepper.choose_step(1);
  int rejected_steps = 0;
  while (stepper.t < 1) {
    const std::int64_t before = stepper.rejected;
    REQUIRE(stepper.advance(1) == Outcome::accepted);
    if (stepper.rejected == before) continue;
    ++rejected_steps;
    CHECK(stepper.next_step() <= (stepper.t - stepper.t_old) * (1 + 1e-12));
  }
  CHECK(rejected_steps > 1);
}

template <class Stepper>
void check_stop() {
  const Problem p = known::problem();
  Rhs rhs(p);
  Stepper stepper(rhs);
  REQUIRE(stepper.begin());
  stepper.choose_step(p.t1);
  for (int k = 0; k < 5; ++k) REQUIRE(stepper.advance(p.t1) == Outcome::accepted);
  const double proposed = stepper.next_step(), stop = stepper.t + 0.01 * proposed;
  REQUIRE(stepper.advance(stop) == Outcome::accepted);
  CHECK(stepper.t == stop);
  CHECK(stepper.next_step() >= proposed);
}
TEST_CASE("a stop that cuts a step does not limit the next one") {
  check_stop<ExplicitRungeKutta<Dop853, 2>>();
  check_stop<Radau<2>>();
}

// x' = x^2 from 1 has no solution beyond t = 1.
TEST_CASE("a solution that grows without bounds ends with steps that are too small") {
  const auto square = [](const double* const* in, double* const* out) -> std::int32_t {
    return *out[0] = *in[1] * *in[1], 0;
  };
  const Problem p = plain_problem(square, one, 0, 2);
  Rhs rhs(p);
  ExplicitRungeKutta<DormandPrince, 1> stepper(rhs);
  REQUIRE(stepper.begin());
  stepper.choose_step(2);
  Outcome outcome = Outcome::accepted;
  while (outcome == Outcome::accepted) outcome = stepper.advance(2);
  CHECK((outcome == Outcome::too_small || outcome == Outcome::non_finite));
  CHECK(std::fabs(stepper.t - 1) < 1e-6);
}

TEST_CASE("a run that may not evaluate any more says so") {
  Problem p = known::problem();
  p.max_evaluations = 40;
  Rhs rhs(p);
  ExplicitRungeKutta<DormandPrince, 2> stepper(rhs);
  REQUIRE(stepper.begin());
  stepper.choose_step(p.t1);
  Outcome outcome = Outcome::accepted;
  while (outcome == Outcome::accepted) outcome = stepper.advance(p.t1);
  CHECK(status_of(outcome) == Status::evaluations_spent);
  CHECK(rhs.evaluations < 40 + 6);
}
