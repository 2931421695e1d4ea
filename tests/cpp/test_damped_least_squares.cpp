// Damped least squares: the gradient At (A x - b) + mu x vanishes; limits for small and large mu (J. Nocedal, S.
// Wright, Numerical Optimization, sec. 10.3).
#include "damped_least_squares.hpp"

#include "least_squares.hpp"
#include "support.hpp"

using namespace bellcrank;

namespace {

struct Case {
  int m, n;
  Numbers a, b;  // a: row by row

  Case(int rows, int columns, Random& random)
      : m(rows), n(columns), a(random.vector(rows * columns)), b(random.vector(rows)) {}

  Numbers transposed_times(const Numbers& y) const {
    Numbers x(n);
    for (int i = 0; i < m; ++i)
      for (int j = 0; j < n; ++j) x[j] += a[i * n + j] * y[i];
    return x;
  }
  Numbers residual(const Numbers& x) const {
    Numbers r(b);
    for (int i = 0; i < m; ++i)
      for (int j = 0; j < n; ++j) r[i] -= a[i * n + j] * x[j];
    return r;
  }
  template <class Solver>
  void fill(Solver& solver) const {
    solver.resize(m, n);
    for (int i = 0; i < m; ++i)
      for (int j = 0; j < n; ++j) solver.a(i, j) = a[i * n + j];
  }
  Numbers solution(double mu) const {
    DampedLeastSquares solver;
    fill(solver);
    solver.form(b.data());
    Numbers x(n);
    REQUIRE(solver.solve(mu, x.data()));
    return x;
  }
};

std::vector<Case> cases() {
  Random random(1);
  std::vector<Case> all;
  for (const auto& [m, n] : {std::pair{1, 1}, {4, 4}, {9, 3}, {3, 9}, {1, 5}, {5, 1}, {12, 11}})
    all.emplace_back(m, n, random);
  all[2].a[4] = all[2].a[7] = 0;  // entries that are skipped
  return all;
}

}  // namespace

TEST_CASE("the gradient of the damped problem vanishes at its solution") {
  for (const Case& given : cases())
    for (double mu : {1e-6, 0.01, 1.0, 100.0}) {
      const Numbers x = given.solution(mu);
      Numbers gradient = given.transposed_times(given.residual(x));
      for (int j = 0; j < given.n; ++j) gradient[j] -= mu * x[j];
      CHECK(largest(gradient) < 1e-13);
    }
}

TEST_CASE("little damping gives least squares, much damping the direction of steepest descent") {
  for (const Case& given : cases()) {
    LeastSquares plain;
    given.fill(plain);
    Numbers x(given.n);
    plain.solve(given.b.data(), x.data(), 1e-10);
    const double size = largest(x);
    CHECK(distance(given.solution(1e-11), x) < 1e-6 * size);
    Numbers descent = given.transposed_times(given.b);
    for (double& entry : descent) entry /= 1e8;
    CHECK(distance(given.solution(1e8), descent) < 1e-6 * largest(descent));
  }
}

TEST_CASE("the gradient and the largest diagonal entry are those of the smaller normal equations") {
  for (const Case& given : cases()) {
    DampedLeastSquares solver;
    given.fill(solver);
    const double found = solver.form(given.b.data());
    CHECK(distance(solver.gradient(), given.transposed_times(given.b)) < 1e-14);
    double expected = 0;
    const bool by_rows = given.m <= given.n;
    for (int k = 0; k < std::min(given.m, given.n); ++k) {
      double square = 0;
      for (int i = 0; i < (by_rows ? given.n : given.m); ++i) {
        const double entry = by_rows ? given.a[k * given.n + i] : given.a[i * given.n + k];
        square += entry * entry;
      }
      expected = std::max(expected, square);
    }
    CHECK(found == doctest::Approx(expected).epsilon(1e-14));
  }
}

TEST_CASE("a factorisation of a singular matrix without damping fails") {
  DampedLeastSquares solver;
  solver.resize(2, 2);
  solver.a(0, 0) = 1;
  const Numbers b{1, 1};
  solver.form(b.data());
  Numbers x(2);
  CHECK_FALSE(solver.solve(0, x.data()));
  CHECK(solver.solve(1, x.data()));
  CHECK(distance(x, {0.5, 0}) < 1e-15);
}
