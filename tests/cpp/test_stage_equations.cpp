// The stage equations of Radau IIA and their solution by simplified Newton iterations.
#include "known_problem.hpp"
#include "simplified_newton.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

constexpr int n = known::n;

// The Jacobian along directions, a row each.
std::int32_t tangent(const double* const* in, double* const* out, const std::int64_t* strides, std::int64_t rows) {
  double j[n * n];
  double* const matrix[] = {j};
  known::jacobian(in, matrix);
  for (std::int64_t r = 0; r < rows; ++r)
    for (int i = 0; i < n; ++i) {
      out[0][r * n + i] = 0;
      for (int k = 0; k < n; ++k) out[0][r * n + i] += j[k * n + i] * in[4][r * strides[4] + k];
    }
  return 0;
}

struct Tangents final : Derivatives {
  DerivativeKernels kernels() override { return {nullptr, tangent, 4}; }
};

// The largest |z_i - h sum_j a_ij f(t + c_j h, x0 + z_j)|.
double residual(double t, double h, const double* x0, const double* z, std::size_t stride) {
  Numbers slopes[3];
  for (int j = 0; j < 3; ++j) {
    const double time = t + RadauIIA::c[j] * h;
    Numbers x(n);
    for (int i = 0; i < n; ++i) x[i] = x0[i] + z[j * stride + i];
    slopes[j].resize(n);
    const double* const in[] = {&time, x.data()};
    double* const out[] = {slopes[j].data()};
    known::slope(in, out);
  }
  double most = 0;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < n; ++k) {
      double left = z[i * stride + k];
      for (int j = 0; j < 3; ++j) left -= h * RadauIIA::a[i][j] * slopes[j][k];
      most = std::max(most, std::fabs(left));
    }
  return most;
}

}  // namespace

TEST_CASE("the iteration to rounding error solves the stage equations") {
  const Problem p = known::problem();
  Rhs rhs(p);
  StageEquations<2> equations(rhs);
  alignas(64) double x[8] = {};
  std::copy(known::start.begin(), known::start.end(), x);
  REQUIRE(equations.renew_jacobian(p.t0, x));
  for (double h : {0.01, 0.1, 0.4}) {
    REQUIRE(equations.factors(h));
    std::fill(equations.stages(), equations.stages() + 3 * equations.lanes(), 0.0);
    CHECK(equations.iterate_fully(p.t0, h, x).converged);
    CHECK(residual(p.t0, h, x, equations.stages(), equations.lanes()) < 1e-14);
  }
}

TEST_CASE("the iteration to a tolerance leaves an error of a fraction of it") {
  Problem p = known::problem();
  p.rtol = p.atol = 1e-6;
  Rhs rhs(p);
  StageEquations<2> equations(rhs);
  alignas(64) double x[8] = {};
  std::copy(known::start.begin(), known::start.end(), x);
  REQUIRE(equations.renew_jacobian(p.t0, x));
  REQUIRE(equations.factors(0.1));
  equations.tolerances(x, x);
  const Newton newton = equations.iterate(p.t0, 0.1, x);
  CHECK(newton.converged);
  CHECK(newton.iterations <= StageEquations<2>::most_iterations);
  CHECK(newton.rate < 0.1);
  CHECK(residual(p.t0, 0.1, x, equations.stages(), equations.lanes()) < 1e-7);
}

TEST_CASE("the iteration on linear equations converges at once") {
  const Numbers start{1, 0};
  const auto slope = [](const double* const* in, double* const* out) -> std::int32_t {
    out[0][0] = -100 * in[1][0] + in[1][1], out[0][1] = in[1][0] - 3 * in[1][1];
    return 0;
  };
  KnownDerivatives derivatives([](const double* const*, double* const* out) -> std::int32_t {
    out[0][0] = -100, out[0][1] = 1, out[0][2] = 1, out[0][3] = -3;
    return 0;
  });
  Problem p = plain_problem(slope, start, 0, 1);
  p.derivatives = &derivatives;
  Rhs rhs(p);
  StageEquations<1> equations(rhs);
  alignas(64) double x[4] = {1, 0, 0, 0};
  REQUIRE(equations.renew_jacobian(0, x));
  REQUIRE(equations.factors(0.5));
  equations.tolerances(x, x);
  const Newton newton = equations.iterate(0, 0.5, x);
  CHECK(newton.converged);
  CHECK(newton.iterations == 2);  // the second finds that nothing is left
  CHECK(newton.rate < 1e-10);
}

TEST_CASE("a Jacobian along directions is the same as the whole one") {
  Problem whole = known::problem(), along = known::problem();
  Tangents tangents;
  along.derivatives = &tangents;
  Rhs rhs(whole), other(along);
  StageEquations<2> equations(rhs), others(other);
  alignas(64) double x[8] = {};
  std::copy(known::start.begin(), known::start.end(), x);
  REQUIRE(equations.renew_jacobian(0.4, x));
  REQUIRE(others.renew_jacobian(0.4, x));
  for (int i = 0; i < n * n; ++i) CHECK(equations.jacobian()[i] == others.jacobian()[i]);
}

// (mu - h J)^-1 (h f + sum_i e_i z_i), E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, sec. IV.8; for
// x' = lambda x this is a rational function of z = h lambda.
TEST_CASE("the error estimate of one linear equation is the known function") {
  for (const double z : {-0.3, -4.0, -300.0}) {
    const Numbers start{1};
    const auto slope = [](const double* const* in, double* const* out) -> std::int32_t {
      return *out[0] = *in[3] * *in[1], 0;
    };
    KnownDerivatives derivatives([](const double* const* in, double* const* out) -> std::int32_t {
      return *out[0] = *in[3], 0;
    });
    Problem p = plain_problem(slope, start, 0, 1);
    p.p = &z, p.derivatives = &derivatives;
    p.atol = 1e-3, p.rtol = 1e-2;
    Rhs rhs(p);
    StageEquations<1> equations(rhs);
    alignas(64) const double x[4] = {1, 0, 0, 0}, f[4] = {z, 0, 0, 0};
    REQUIRE(equations.renew_jacobian(0, x));
    REQUIRE(equations.factors(1));
    REQUIRE(equations.iterate_fully(0, 1, x).converged);
    equations.tolerances(x, x);
    double expected = z;
    for (int i = 0; i < 3; ++i) expected += RadauIIA::e[i] * equations.stages()[i * equations.lanes()];
    expected /= RadauIIA::mu - z;
    CHECK(equations.estimate(1, f) == doctest::Approx(std::fabs(expected) / 0.011).epsilon(1e-12));
    CHECK(equations.error()[0] == doctest::Approx(expected).epsilon(1e-12));
  }
}

TEST_CASE("an iteration on a slope that is not finite says so") {
  Problem p = known::problem();
  p.rhs = [](const double* const*, double* const* out) -> std::int32_t {
    std::fill(out[0], out[0] + n, NAN);
    return 0;
  };
  Rhs rhs(p);
  StageEquations<2> equations(rhs);
  alignas(64) double x[8] = {};
  std::copy(known::start.begin(), known::start.end(), x);
  REQUIRE(equations.renew_jacobian(p.t0, x));
  REQUIRE(equations.factors(0.1));
  equations.tolerances(x, x);
  const Newton newton = equations.iterate(p.t0, 0.1, x);
  CHECK(newton.bad);
  CHECK_FALSE(newton.converged);
}
