// Dense output: it takes the values and slopes of the step's ends, and has its order within the step.
#include <memory>

#include "explicit_runge_kutta.hpp"
#include "known_problem.hpp"
#include "radau_iia.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

// One step from the start of the known problem, and a polynomial of the step.
template <class Stepper>
struct Step {
  const Problem p = known::problem();
  const double h;
  Rhs rhs{p};
  Stepper stepper{rhs};

  explicit Step(double size) : h(size) {
    REQUIRE(stepper.begin());
    REQUIRE(stepper.fixed(p.t0 + size) == Outcome::accepted);
    REQUIRE(stepper.t == p.t0 + size);
  }
  Numbers operator()(double s) {
    REQUIRE(stepper.prepare());
    alignas(64) double x[8];
    stepper.interpolate(s, x);
    return Numbers(x, x + known::n);
  }
  Numbers approximate(double s, bool finer) {
    alignas(64) double x[8];
    stepper.approximate(s, x, finer);
    return Numbers(x, x + known::n);
  }
  Numbers end() const { return Numbers(stepper.state(), stepper.state() + known::n); }
  Numbers slope(double s, const Numbers& x) const {
    const double time = p.t0 + s * h;
    const double* const in[] = {&time, x.data()};
    Numbers f(known::n);
    double* const out[] = {f.data()};
    known::slope(in, out);
    return f;
  }
};

// The derivative by s of a polynomial of degree 9 or less, from its values at ten places (Lagrange).
template <class Polynomial>
Numbers derivative(const Polynomial& polynomial, double s) {
  constexpr int count = 10;
  Numbers sum(known::n);
  const auto node = [](int i) { return 0.5 - 0.5 * std::cos(M_PI * (i + 0.5) / count); };
  for (int i = 0; i < count; ++i) {
    double weight = 0;
    for (int skipped = 0; skipped < count; ++skipped) {
      if (skipped == i) continue;
      double product = 1 / (node(i) - node(skipped));
      for (int j = 0; j < count; ++j)
        if (j != i && j != skipped) product *= (s - node(j)) / (node(i) - node(j));
      weight += product;
    }
    const Numbers value = polynomial(node(i));
    for (int k = 0; k < known::n; ++k) sum[k] += weight * value[k];
  }
  return sum;
}

template <class Stepper, class Polynomial>
void check_slope(const Step<Stepper>& step, const Polynomial& polynomial, double s) {
  Numbers rate = derivative(polynomial, s);
  for (double& entry : rate) entry /= step.h;
  CHECK(distance(rate, step.slope(s, polynomial(s))) < 1e-11);
}

template <class Stepper, class Polynomial>
void check_ends(const Step<Stepper>& step, const Polynomial& polynomial) {
  CHECK(distance(polynomial(0), known::start) < 1e-15);
  CHECK(distance(polynomial(1), step.end()) < 1e-15);
  check_slope(step, polynomial, 0);
  check_slope(step, polynomial, 1);
}

// The largest error within one step from the exact start.
template <class Stepper, class Value>
double error_within(Step<Stepper>& step, const Value& value) {
  double most = 0;
  for (double s = 0.05; s < 1; s += 0.1)
    most = std::max(most, distance(value(s), known::solution(known::begin + s * step.h)));
  return most;
}

// The order of one step's error, which is one more than the order of the polynomial.
template <class Stepper>
double local_order(double h) {
  Numbers errors;
  for (int k = 0; k < 4; ++k, h /= 2) {
    Step<Stepper> step(h);
    errors.push_back(error_within(step, [&](double s) { return step(s); }));
  }
  CHECK(errors.back() > 1e-14);
  return order(errors);
}
template <class Stepper>
double local_order_of_approximation(double h, bool finer) {
  Numbers errors;
  for (int k = 0; k < 4; ++k, h /= 2) {
    Step<Stepper> step(h);
    errors.push_back(error_within(step, [&](double s) { return step.approximate(s, finer); }));
  }
  CHECK(errors.back() > 1e-14);
  return order(errors);
}

template <class Stepper>
void check_powers(int degree) {
  const auto slope = [](const double* const* in, double* const* out) -> std::int32_t {
    for (int k = 0; k < 8; ++k) out[0][k] = std::pow(*in[0], k);
    return 0;
  };
  const Numbers zero(8);
  const Problem p = plain_problem(slope, zero, 0, 1);
  Rhs rhs(p);
  Stepper stepper(rhs);
  REQUIRE(stepper.begin());
  REQUIRE(stepper.fixed(1) == Outcome::accepted);
  REQUIRE(stepper.prepare());
  double miss = 0;
  for (double s : {0.1, 0.35, 0.5, 0.8}) {
    alignas(64) double x[8];
    stepper.interpolate(s, x);
    for (int k = 0; k < degree; ++k) CHECK(std::fabs(x[k] - std::pow(s, k + 1) / (k + 1)) < 1e-14);
    miss = std::max(miss, std::fabs(x[degree] - std::pow(s, degree + 1) / (degree + 1)));
  }
  CHECK(miss > 1e-6);
}

using StepOfRk4 = ExplicitRungeKutta<Rk4, 2>;
using StepOfRk45 = ExplicitRungeKutta<DormandPrince, 2>;
using StepOfDop853 = ExplicitRungeKutta<Dop853, 2>;

template <class Stepper>
void check_ends_of_dense_output() {
  Step<Stepper> step(0.2);
  check_ends(step, [&](double s) { return step(s); });
}

}  // namespace

TEST_CASE("the dense output of RK4 has the values and slopes of the step's ends") {
  check_ends_of_dense_output<StepOfRk4>();
}
TEST_CASE("the dense output of RK45 has the values and slopes of the step's ends") {
  check_ends_of_dense_output<StepOfRk45>();
}
TEST_CASE("the dense output of DOP853 has the values and slopes of the step's ends") {
  check_ends_of_dense_output<StepOfDop853>();
}

TEST_CASE("the dense output of RK4 is of order 4") { CHECK(local_order<StepOfRk4>(0.2) > 4.8); }
TEST_CASE("the dense output of RK45 is of order 4") { CHECK(local_order<StepOfRk45>(0.2) > 4.8); }
TEST_CASE("the dense output of DOP853 is of order 7") { CHECK(local_order<StepOfDop853>(0.4) > 7.6); }
TEST_CASE("the collocation polynomial of Radau IIA is of order 3") { CHECK(local_order<Radau<2>>(0.1) > 3.8); }

TEST_CASE("polynomials through stages have the values and slopes of the step's ends") {
  Step<StepOfDop853> step(0.2);
  for (bool finer : {true, false}) check_ends(step, [&](double s) { return step.approximate(s, finer); });
  Step<StepOfRk4> cubic(0.2);
  check_ends(cubic, [&](double s) { return cubic.approximate(s, true); });
}

// x' = (0, t, ..., t^6) beside a clock: x = t^(k + 1) / (k + 1). A dense output of order q is exact up to t^q.
TEST_CASE("dense outputs are exact for polynomials of time of their degree") {
  check_powers<ExplicitRungeKutta<Rk4, 2>>(4);
  check_powers<ExplicitRungeKutta<DormandPrince, 2>>(4);
  check_powers<ExplicitRungeKutta<Dop853, 2>>(7);
}

// The stages of DOP853 are accurate to the fifth power of the step, so their slopes times the step to the sixth.
TEST_CASE("polynomials through stages are of order 5, and the cubic of order 3") {
  CHECK(local_order_of_approximation<StepOfDop853>(0.2, true) > 5.8);
  CHECK(local_order_of_approximation<StepOfDop853>(0.2, false) > 5.8);
  CHECK(local_order_of_approximation<StepOfRk4>(0.1, true) > 3.8);
}

// E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, sec. IV.5: collocation.
TEST_CASE("the polynomial of Radau IIA satisfies the equations at the three collocation points") {
  Step<Radau<2>> step(0.2);
  const auto polynomial = [&](double s) { return step(s); };
  CHECK(distance(polynomial(0), known::start) == 0);
  CHECK(distance(polynomial(1), step.end()) < 1e-14);
  for (double c : RadauIIA::c) check_slope(step, polynomial, c);
}

// x' = 1, W' = (1, t, t^2, t^3): W is a quadrature, outside the error norm.
TEST_CASE("the dense output of Radau IIA is exact for quadratures of cubics") {
  const auto slope = [](const double* const* in, double* const* out) -> std::int32_t {
    const double t = in[1][0];
    out[0][0] = 1, out[0][1] = 1, out[0][2] = t, out[0][3] = t * t, out[0][4] = t * t * t;
    return 0;
  };
  KnownDerivatives derivatives([](const double* const* in, double* const* out) -> std::int32_t {
    const double t = in[1][0];
    std::fill(out[0], out[0] + 25, 0.0);
    out[0][2] = 1, out[0][3] = 2 * t, out[0][4] = 3 * t * t;
    return 0;
  });
  const Numbers start{0.5, 0, 0, 0, 0};
  Problem p = plain_problem(slope, start, 0.5, 2);
  p.derivatives = &derivatives, p.norm_size = 1;
  Rhs rhs(p);
  Radau<2> stepper(rhs);
  REQUIRE(stepper.begin());
  REQUIRE(stepper.fixed(2) == Outcome::accepted);
  REQUIRE(stepper.prepare());
  for (double s : {0.0, 0.2, 0.5, 0.85, 1.0}) {
    alignas(64) double x[8];
    stepper.interpolate(s, x);
    for (int k = 1; k <= 4; ++k) CHECK(std::fabs(x[k] - (std::pow(0.5 + 1.5 * s, k) - std::pow(0.5, k)) / k) < 1e-14);
  }
}
