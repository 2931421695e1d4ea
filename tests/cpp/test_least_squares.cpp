// Least squares of any rank. Matrices are made from their singular value decomposition A = U S Vt, so that the solution
// V S^+ Ut b is known (G. Golub, C. Van Loan, Matrix Computations, sec. 5.5).
#include "least_squares.hpp"

#include "support.hpp"

using namespace bellcrank;

namespace {

using Columns = std::vector<Numbers>;

// Orthonormal columns from random ones (Gram and Schmidt, twice).
Columns orthonormal(int size, int count, Random& random) {
  Columns q;
  for (int k = 0; k < count; ++k) {
    Numbers v = random.vector(size);
    for (int turn = 0; turn < 2; ++turn)
      for (const Numbers& other : q) {
        const double along = dot(v, other);
        for (int i = 0; i < size; ++i) v[i] -= along * other[i];
      }
    const double length = norm(v);
    for (double& entry : v) entry /= length;
    q.push_back(v);
  }
  return q;
}

struct Case {
  int rows, columns;
  Columns u, v;
  Numbers values;

  Case(int m, int n, Numbers singular_values, Random& random)
      : rows(m), columns(n), u(orthonormal(m, static_cast<int>(singular_values.size()), random)),
        v(orthonormal(n, static_cast<int>(singular_values.size()), random)), values(singular_values) {}

  double entry(int i, int j) const {
    double sum = 0;
    for (std::size_t k = 0; k < values.size(); ++k) sum += u[k][i] * values[k] * v[k][j];
    return sum;
  }
  // The pseudo-inverse times b, from the first `rank` singular values.
  Numbers expected(const Numbers& b, std::size_t rank) const {
    Numbers x(columns);
    for (std::size_t k = 0; k < rank; ++k)
      for (int j = 0; j < columns; ++j) x[j] += dot(u[k], b) / values[k] * v[k][j];
    return x;
  }
  Numbers solution(const Numbers& b, double rcond, double scale = 1) const {
    LeastSquares solver;
    solver.resize(rows, columns);
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < columns; ++j) solver.a(i, j) = scale * entry(i, j);
    Numbers x(columns, 7.0);
    solver.solve(b.data(), x.data(), rcond);
    return x;
  }
};

const std::pair<int, int> shapes[] = {{1, 1}, {5, 5}, {9, 4}, {4, 9}, {20, 12}, {12, 20}, {1, 6}, {6, 1}};

}  // namespace

TEST_CASE("matrices of full rank give the solution of least squares, or of least length") {
  Random random(1);
  for (const auto& [m, n] : shapes)
    for (int turn = 0; turn < 5; ++turn) {
      const Case given(m, n, random.vector(std::min(m, n), 0.1, 1), random);
      const Numbers b = random.vector(m);
      CHECK(distance(given.solution(b, 1e-10), given.expected(b, std::min(m, n))) < 1e-12);
    }
}

TEST_CASE("matrices that lack rank give the solution of least length") {
  Random random(2);
  for (const auto& [m, n] : shapes)
    for (int rank = 0; rank < std::min(m, n); rank += 2) {
      const Case given(m, n, random.vector(rank, 0.1, 1), random);
      const Numbers b = random.vector(m);
      CHECK(distance(given.solution(b, 1e-10), given.expected(b, rank)) < 1e-12);
    }
}

TEST_CASE("small singular values count or not by the given bound") {
  Random random(3);
  for (const auto& [m, n] : {std::pair{6, 6}, std::pair{9, 5}, std::pair{5, 9}}) {
    const Case given(m, n, {2, 1, 1e-4, 2e-8}, random);
    const Numbers b = random.vector(m);
    const Numbers three = given.expected(b, 3), four = given.expected(b, 4);
    CHECK(distance(given.solution(b, 1e-6), three) < 1e-11 * largest(three));  // rounding times the condition 2e4
    CHECK(distance(given.solution(b, 1e-9), four) < 1e-7 * largest(four));     // 1e8
  }
}

// Pivots do not show that this matrix is nearly singular: W. Kahan's (Golub and Van Loan, sec. 5.4.3).
TEST_CASE("Kahan's matrix loses its smallest singular value") {
  constexpr int n = 60;
  const double sine = 0.84, cosine = std::sqrt(1 - sine * sine);
  LeastSquares solver;
  Numbers matrix(n * n);
  for (int i = 0; i < n; ++i)
    for (int j = i; j < n; ++j) matrix[i * n + j] = std::pow(sine, i) * (i == j ? 1 : -cosine);
  Random random(4);
  const Numbers b = random.vector(n);
  solver.resize(n, n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) solver.a(i, j) = matrix[i * n + j];
  Numbers x(n);
  solver.solve(b.data(), x.data(), 1e-10);
  CHECK(largest(x) < 1e8);  // the whole inverse has entries of 1e12
  Numbers left(b), gradient(n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) left[i] -= matrix[i * n + j] * x[j];
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) gradient[j] += matrix[i * n + j] * left[i];
  CHECK(largest(gradient) < 1e-9);  // of the singular value left out
}

TEST_CASE("units of the matrix and the right side do not matter") {
  Random random(5);
  const Case given(7, 5, {1, 0.5, 0.2}, random);
  const Numbers b = random.vector(7), expected = given.expected(b, 3);
  for (double scale : {1e-280, 1e-120, 1e120, 1e280}) {
    Numbers x = given.solution(b, 1e-10, scale);
    for (double& entry : x) entry *= scale;
    CHECK(distance(x, expected) < 1e-12);
    Numbers much(b);
    for (double& entry : much) entry *= scale;
    x = given.solution(much, 1e-10, scale);
    CHECK(distance(x, expected) < 1e-12);
  }
}

TEST_CASE("a matrix of zeros gives zero, and a solver can be used again") {
  LeastSquares solver;
  const Numbers b{1, 2, 3};
  Numbers x{5, 5};
  solver.resize(3, 2);
  solver.solve(b.data(), x.data(), 1e-10);
  CHECK(largest(x) == 0);
  solver.resize(3, 2);
  solver.a(0, 0) = solver.a(1, 1) = 2;
  solver.solve(b.data(), x.data(), 1e-10);
  CHECK(distance(x, {0.5, 1}) < 1e-15);
}
