// LU factorisations, real, complex and reduced to the velocities. The reference is the residual, which Gaussian
// elimination with partial pivoting keeps at rounding size whatever the condition (N. Higham, Accuracy and Stability of
// Numerical Algorithms, sec. 9.3).
#include <complex>

#include "known_problem.hpp"
#include "stage_matrices.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

constexpr int room = 64;

// |shift x - h J x - b| over n eps (|shift| + |h J|) |x|, J column by column.
template <class Number>
double residual(Number shift, double h, const Numbers& jacobian, const std::vector<Number>& x,
                const std::vector<Number>& b) {
  const int n = static_cast<int>(x.size());
  double worst = 0, size = 0, matrix = std::abs(shift);
  for (const Number& entry : x) size = std::max(size, std::abs(entry));
  for (double entry : jacobian) matrix = std::max(matrix, std::fabs(h * entry));
  for (int i = 0; i < n; ++i) {
    Number left = shift * x[i] - b[i];
    for (int j = 0; j < n; ++j) left -= h * jacobian[j * n + i] * x[j];
    worst = std::max(worst, std::abs(left));
  }
  return worst / (n * 2.2e-16 * matrix * size);
}

template <int Blocks>
double real_residual(int n, double shift, double h, const Numbers& jacobian, const Numbers& b) {
  RealLu<Blocks> lu(n);
  REQUIRE(lu.factorise(shift, h, jacobian.data()));
  alignas(64) double right[room] = {}, x[room] = {};
  std::copy(b.begin(), b.end(), right);
  lu.solve(right, x);
  return residual(shift, h, jacobian, Numbers(x, x + n), b);
}

template <int Blocks>
double complex_residual(int n, std::complex<double> shift, double h, const Numbers& jacobian, const Numbers& re,
                        const Numbers& im) {
  ComplexLu<Blocks> lu(n);
  REQUIRE(lu.factorise(shift.real(), shift.imag(), h, jacobian.data()));
  alignas(64) double right[2][room] = {}, x[2][room] = {};
  std::copy(re.begin(), re.end(), right[0]), std::copy(im.begin(), im.end(), right[1]);
  lu.solve(right[0], right[1], x[0], x[1]);
  std::vector<std::complex<double>> found, b;
  for (int i = 0; i < n; ++i) found.emplace_back(x[0][i], x[1][i]), b.emplace_back(re[i], im[i]);
  return residual(shift, h, jacobian, found, b);
}

// A mechanism's Jacobian by the state (q, v, W), column by column: the q' of a joint depends on its own q and v, W' on
// all but W.
struct Mechanism {
  std::vector<JointBlock> joints;
  int nq = 0, nv = 0, n = 0;
  Problem problem{};
  Numbers jacobian;

  Mechanism(const std::vector<std::pair<int, int>>& sizes, int quadratures, Random& random) {
    for (const auto& [q, v] : sizes) joints.push_back({nq, q, nv, v}), nq += q, nv += v;
    n = nq + nv + quadratures;
    jacobian.assign(static_cast<std::size_t>(n) * n, 0.0);
    for (int i = nq; i < n; ++i)
      for (int j = 0; j < nq + nv; ++j) jacobian[j * n + i] = random.between(-3, 3);
    for (const JointBlock& joint : joints)
      for (int i = joint.q; i < joint.q + joint.nq; ++i) {
        for (int j = joint.q; j < joint.q + joint.nq; ++j) jacobian[j * n + i] = random.between(-3, 3);
        for (int j = joint.v; j < joint.v + joint.nv; ++j) jacobian[(nq + j) * n + i] = random.between(-3, 3);
      }
    problem.n = n, problem.nq = nq, problem.nv = nv;
    problem.joints = joints.data(), problem.joint_count = static_cast<int>(joints.size());
  }
};

}  // namespace

TEST_CASE("real systems of all sizes are solved to rounding") {
  Random random(1);
  for (int n = 1; n <= 12; ++n)
    for (int turn = 0; turn < 10; ++turn) {
      const Numbers jacobian = random.vector(n * n), b = random.vector(n);
      const double shift = random.between(0, 3), h = random.between(0.1, 5);
      CAPTURE(n);
      if (n <= 4) CHECK(real_residual<1>(n, shift, h, jacobian, b) < 10);
      if (n <= 8) CHECK(real_residual<2>(n, shift, h, jacobian, b) < 10);
      CHECK(real_residual<3>(n, shift, h, jacobian, b) < 10);
      CHECK(real_residual<0>(n, shift, h, jacobian, b) < 10);
    }
  for (int n : {17, 32, 45}) CHECK(real_residual<0>(n, 1.5, 1, random.vector(n * n), random.vector(n)) < 10);
}

TEST_CASE("complex systems of all sizes are solved to rounding") {
  Random random(2);
  for (int n = 1; n <= 12; ++n)
    for (int turn = 0; turn < 10; ++turn) {
      const Numbers jacobian = random.vector(n * n), re = random.vector(n), im = random.vector(n);
      const std::complex<double> shift(random.between(0, 3), random.between(-3, 3));
      CAPTURE(n);
      if (n <= 4) CHECK(complex_residual<1>(n, shift, 2, jacobian, re, im) < 10);
      if (n <= 8) CHECK(complex_residual<2>(n, shift, 2, jacobian, re, im) < 10);
      CHECK(complex_residual<3>(n, shift, 2, jacobian, re, im) < 10);
      CHECK(complex_residual<0>(n, shift, 2, jacobian, re, im) < 10);
    }
}

// Hilbert's matrix of size 10 has the condition 1.6e13 (Higham, sec. 28.1): x is wrong, its residual is not.
TEST_CASE("ill conditioned systems keep small residuals") {
  constexpr int n = 10;
  Numbers hilbert(n * n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) hilbert[j * n + i] = -1.0 / (i + j + 1);
  CHECK(real_residual<3>(n, 0, 1, hilbert, Numbers(n, 1.0)) < 10);
  CHECK(complex_residual<3>(n, 0, 1, hilbert, Numbers(n, 1.0), Numbers(n, -2.0)) < 10);
}

TEST_CASE("a zero on the diagonal, and entries that would grow without pivoting, are no obstacles") {
  const Numbers exchange{0, -1, 0, 0, 0, -1, -1, 0, 0};  // a permutation
  CHECK(real_residual<1>(3, 0, 1, exchange, {1, 2, 3}) == 0);
  CHECK(complex_residual<1>(3, 0, 1, exchange, {1, 2, 3}, {4, 5, 6}) == 0);
  const Numbers tiny{-1e-20, -1, -1, -1};
  CHECK(real_residual<1>(2, 0, 1, tiny, {1, 2}) < 1);
  CHECK(complex_residual<1>(2, 0, 1, tiny, {1, 2}, {3, 4}) < 1);
}

TEST_CASE("singular and undefined matrices are refused") {
  const Numbers dependent{-1, -2, -2, -4}, undefined{-1, NAN, 0, -1}, zero(4);
  RealLu<1> real(2);
  ComplexLu<1> complex(2);
  for (const Numbers* matrix : {&dependent, &undefined, &zero}) {
    CHECK_FALSE(real.factorise(0, 1, matrix->data()));
    CHECK_FALSE(complex.factorise(0, 0, 1, matrix->data()));
  }
  CHECK(real.factorise(1, 1, zero.data()));
  CHECK(complex.factorise(0, 1, 1, zero.data()));
}

TEST_CASE("systems of mechanisms that are reduced to the velocities have the solution of the whole") {
  Random random(3);
  const std::vector<std::vector<std::pair<int, int>>> robots = {
      {{1, 1}}, {{1, 1}, {1, 1}, {1, 1}}, {{4, 3}}, {{7, 6}, {1, 1}, {2, 1}}, {{7, 6}, {4, 3}, {1, 1}, {1, 1}, {4, 3}}};
  for (const auto& sizes : robots)
    for (int quadratures : {0, 2})
      for (int turn = 0; turn < 10; ++turn) {
        const Mechanism m(sizes, quadratures, random);
        const double h = random.between(0.01, 1);
        const Numbers re = random.vector(m.n), im = random.vector(m.n);
        const std::complex<double> shift(RadauIIA::mu_real, -RadauIIA::mu_imaginary);
        StageMatrices<0> matrices(m.problem);  // reduced, because the joints are given
        REQUIRE(matrices.factorise(h, m.jacobian.data()));
        alignas(64) double right[2][room] = {}, x[2][room] = {};
        std::copy(re.begin(), re.end(), right[0]), std::copy(im.begin(), im.end(), right[1]);
        matrices.solve(right[0], x[0]);
        // elimination by blocks is stable for well conditioned blocks alone
        CHECK(residual(RadauIIA::mu, h, m.jacobian, Numbers(x[0], x[0] + m.n), re) < 1e4);
        matrices.solve(right[0], right[1], x[0], x[1]);
        std::vector<std::complex<double>> found, b;
        for (int i = 0; i < m.n; ++i) found.emplace_back(x[0][i], x[1][i]), b.emplace_back(re[i], im[i]);
        CHECK(residual(shift, h, m.jacobian, found, b) < 1e4);
      }
}

TEST_CASE("the stage matrices are the same with blocks known when compiled and at run time") {
  Random random(4);
  for (int n : {3, 6, 12}) {
    const Numbers jacobian = random.vector(n * n), b = random.vector(n);
    Problem p{};
    p.n = n;
    StageMatrices<3> fixed(p);
    StageMatrices<0> any(p);
    REQUIRE(fixed.factorise(0.3, jacobian.data()));
    REQUIRE(any.factorise(0.3, jacobian.data()));
    alignas(64) double right[12] = {}, x[12] = {}, y[12] = {};
    std::copy(b.begin(), b.end(), right);
    fixed.solve(right, x), any.solve(right, y);
    CHECK(residual(RadauIIA::mu, 0.3, jacobian, Numbers(x, x + n), b) < 10);
    CHECK(distance(Numbers(x, x + n), Numbers(y, y + n)) < 1e-14);
  }
}

TEST_CASE("a mechanism whose positions cannot be eliminated is refused") {
  Random random(5);
  Mechanism m({{1, 1}}, 0, random);
  ReducedSolver<RealView> solver(m.problem);
  m.jacobian[0] = 2;  // s - h A = 0
  CHECK_FALSE(solver.factorise(1, 0.5, m.jacobian.data()));
  m.jacobian[0] = 1;
  CHECK(solver.factorise(1, 0.5, m.jacobian.data()));
}
