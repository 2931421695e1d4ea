// The spectral radius of matrices whose eigenvalues are known, to the tenth that is promised.
#include "spectral_radius.hpp"

#include "known_problem.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

double radius(const Numbers& columns, int n, int positions = 0) {
  const Numbers start(n);
  Problem p = plain_problem(nullptr, start, 0, 1);
  p.nq = positions;
  return SpectralRadius(p)(columns.data());
}

// Whether `found` is `expected` to a tenth.
bool near(double found, double expected) { return std::fabs(found - expected) < 0.1 * expected; }

// B <- (I + x y^T) B (I + x y^T)^-1, the inverse by Sherman and Morrison: the same eigenvalues.
void transform(Numbers& b, int n, const Numbers& x, const Numbers& y) {
  const double scale = 1 / (1 + dot(x, y));
  for (int j = 0; j < n; ++j) {
    double along = 0;
    for (int i = 0; i < n; ++i) along += y[i] * b[j * n + i];
    for (int i = 0; i < n; ++i) b[j * n + i] += x[i] * along;
  }
  for (int i = 0; i < n; ++i) {
    double along = 0;
    for (int j = 0; j < n; ++j) along += b[j * n + i] * x[j];
    for (int j = 0; j < n; ++j) b[j * n + i] -= scale * along * y[j];
  }
}

}  // namespace

TEST_CASE("the spectral radius of similar matrices is that of the largest eigenvalue") {
  Random random(1);
  for (int turn = 0; turn < 50; ++turn) {
    const int n = random.integer(2, 9);
    Numbers b(n * n);
    for (int i = 0; i < n; ++i) b[i * n + i] = random.between(-3, 3);
    const double largest = random.between(5, 1000) * (turn % 2 ? 1 : -1);
    b[0] = largest;
    transform(b, n, random.vector(n, -0.3, 0.3), random.vector(n, -0.3, 0.3));
    CHECK(near(radius(b, n), std::fabs(largest)));
  }
}

TEST_CASE("a complex pair of eigenvalues has the radius of its modulus") {
  for (double angle : {0.3, 1.0, 1.5, 2.6}) {
    const double c = 40 * std::cos(angle), s = 40 * std::sin(angle);
    CHECK(near(radius({c, s, 0, -s, c, 0, 0, 0, 2}, 3), 40));
  }
}

// q'' = -omega^2 q - 2 zeta omega q': eigenvalues omega (-zeta +- sqrt(zeta^2 - 1)). Velocities are omega times as
// large as positions, so that sizes of whole states would swing.
TEST_CASE("the radius of a damped oscillator is the modulus of its faster eigenvalue") {
  for (double omega : {1.0, 1e3, 1e4})
    for (double zeta : {0.0, 0.1, 0.3, 0.7, 1.5}) {
      const double expected = omega * (zeta <= 1 ? 1 : zeta + std::sqrt(zeta * zeta - 1));
      CHECK(near(radius({0, -omega * omega, 1, -2 * zeta * omega}, 2, 1), expected));
    }
}

TEST_CASE("a stiff and a slow oscillator have the frequency of the stiff one") {
  Numbers b(16);
  b[0 * 4 + 2] = -1e6, b[1 * 4 + 3] = -4, b[0 * 4 + 3] = 1, b[2 * 4 + 0] = b[3 * 4 + 1] = 1;
  CHECK(near(radius(b, 4, 2), 1000));
}

TEST_CASE("matrices without eigenvalues other than zero, or that are undefined, have the radius 0") {
  CHECK(radius(Numbers(9), 3) == 0);
  CHECK(radius({0, 0, 1, 0}, 2) == 0);  // nilpotent
  CHECK(radius({NAN, 0, 0, 1}, 2) == 0);
}

TEST_CASE("entries outside the error norm do not count") {
  const Numbers start(3), b{2, 0, 9, 0, 1, 9, 0, 0, 500};
  Problem p = plain_problem(nullptr, start, 0, 1);
  p.norm_size = 2;
  CHECK(near(SpectralRadius(p)(b.data()), 2));
}
