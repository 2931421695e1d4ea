// The tables of the methods: Butcher's order conditions over all rooted trees, and the simplifying assumptions of Radau
// IIA. References: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, sec. II.2; E.
// Hairer, G. Wanner, Solving Ordinary Differential Equations II, sec. IV.3, IV.5 and IV.8.
#include <complex>

#include "runge_kutta_tableaus.hpp"
#include "support.hpp"

using namespace bellcrank;

namespace {

// Rooted trees of up to `most` vertices, each by its branches: indices of smaller trees, in ascending order.
struct Trees {
  struct Tree {
    int vertices;
    double density;  // gamma: the product of the vertices of all its subtrees
    std::vector<int> branches;
  };
  std::vector<Tree> all;

  explicit Trees(int most) {
    for (int vertices = 1; vertices <= most; ++vertices) {
      const int smaller = static_cast<int>(all.size());
      grow(vertices, vertices - 1, 0, smaller, {});
    }
  }
  int count(int vertices) const {
    const auto of_size = [&](const Tree& tree) { return tree.vertices == vertices; };
    return static_cast<int>(std::count_if(all.begin(), all.end(), of_size));
  }

 private:
  void grow(int vertices, int left, int from, int end, std::vector<int> branches) {
    if (left == 0) {
      double density = vertices;
      for (int b : branches) density *= all[b].density;
      all.push_back({vertices, density, branches});
      return;
    }
    for (int b = from; b < end; ++b) {
      if (all[b].vertices > left) continue;
      branches.push_back(b);
      grow(vertices, left - all[b].vertices, b, end, branches);
      branches.pop_back();
    }
  }
};

const Trees trees(9);

// Phi_i(tree) for each tree and stage: the product over the branches of sum_j a_ij Phi_j(branch).
template <class Method>
std::vector<Numbers> stage_weights() {
  std::vector<Numbers> phi;
  for (const auto& tree : trees.all) {
    Numbers own(Method::rows, 1.0);
    for (int b : tree.branches)
      for (int i = 0; i < Method::rows; ++i) {
        double sum = 0;
        for (int j = 0; j < Method::rows; ++j) sum += Method::a[i][j] * phi[b][j];
        own[i] *= sum;
      }
    phi.push_back(own);
  }
  return phi;
}

// The largest |weights . Phi(tree) - expected / gamma(tree)| over the trees with so many vertices.
template <class Method>
double residual(const Numbers& weights, int vertices, double expected) {
  static const std::vector<Numbers> phi = stage_weights<Method>();
  double most = 0;
  for (std::size_t k = 0; k < trees.all.size(); ++k)
    if (trees.all[k].vertices == vertices)
      most = std::max(most, std::fabs(dot(weights, phi[k]) - expected / trees.all[k].density));
  return most;
}

template <class Method>
void check_order() {
  const Numbers weights(Method::a[Method::stages], Method::a[Method::stages] + Method::rows);
  for (int p = 1; p <= Method::order; ++p) CHECK(residual<Method>(weights, p, 1) < 1e-13);
  CHECK(residual<Method>(weights, Method::order + 1, 1) > 1e-7);
  for (int i = 0; i < Method::rows; ++i) {
    double sum = 0;
    for (double a : Method::a[i]) sum += a;
    CHECK(std::fabs(sum - Method::c[i]) < 2e-14);
    for (int j = i; j < Method::rows; ++j) CHECK(Method::a[i][j] == 0);  // explicit
  }
}

// Weights of a difference of two methods, both of the order that is given, one of them of no higher order.
template <class Method, int Size>
void check_estimate(const double (&difference)[Size], int order) {
  Numbers weights(difference, difference + Size);
  weights.resize(Method::rows);
  for (int p = 1; p <= order; ++p) CHECK(residual<Method>(weights, p, 0) < 1e-13);
  CHECK(residual<Method>(weights, order + 1, 0) > 1e-5);
}

// The largest |R(-z)|, z in [0, limit], of an explicit method: R(z) = 1 + z b (I - z A)^-1 (1, ..., 1).
template <class Method>
double amplification(double z) {
  double k[Method::stages];
  for (int i = 0; i < Method::stages; ++i) {
    k[i] = 1;
    for (int j = 0; j < i; ++j) k[i] -= z * Method::a[i][j] * k[j];
  }
  double end = 1;
  for (int j = 0; j < Method::stages; ++j) end -= z * Method::a[Method::stages][j] * k[j];
  return std::fabs(end);
}

// The stiffness test compares h |lambda| with the length of the interval in which |R| < 1.
template <class Method>
void check_stability() {
  for (double z = 0.01; z < Method::stability; z += 0.01) CHECK(amplification<Method>(z) < 1);
  CHECK(amplification<Method>(1.05 * Method::stability) > 1);
}

using Radau3 = double[3][3];

}  // namespace

TEST_CASE("rooted trees are counted as Cayley counted them") {  // OEIS A000081
  const int expected[] = {1, 1, 2, 4, 9, 20, 48, 115, 286};
  for (int vertices = 1; vertices <= 9; ++vertices) CHECK(trees.count(vertices) == expected[vertices - 1]);
}

TEST_CASE("RK4 satisfies all order conditions up to 4") { check_order<Rk4>(); }
TEST_CASE("RK45 satisfies all order conditions up to 5") { check_order<DormandPrince>(); }
TEST_CASE("DOP853 satisfies all order conditions up to 8") { check_order<Dop853>(); }

TEST_CASE("the embedded weights of RK45 are of order 4") { check_estimate<DormandPrince>(DormandPrince::e, 4); }
TEST_CASE("the embedded weights of DOP853 are of orders 5 and 3") {
  check_estimate<Dop853>(Dop853::e5, 5);
  check_estimate<Dop853>(Dop853::e3, 3);
}

TEST_CASE("RK45 and DOP853 damp real eigenvalues up to their declared limits of stability") {
  check_stability<DormandPrince>();
  check_stability<Dop853>();
}

// x(t + s h) has order q if sum_j b_j(s) Phi_j(tree) = s^vertices / gamma for all trees of up to q vertices
// (Hairer, Norsett, Wanner I, theorem II.6.1).
TEST_CASE("the dense output of RK45 satisfies the order conditions up to 4 within the step") {
  for (int power = 1; power <= DormandPrince::powers; ++power) {
    Numbers weights(DormandPrince::rows);
    for (int j = 0; j < DormandPrince::rows; ++j) weights[j] = DormandPrince::dense[j][power - 1];
    for (int p = 1; p <= 4; ++p) CHECK(residual<DormandPrince>(weights, p, p == power ? 1 : 0) < 1e-12);
  }
}

TEST_CASE("the dense output of DOP853 satisfies the order conditions up to 7 within the step") {
  for (double s : {0.15, 0.5, 0.6, 0.95}) {
    const double r = 1 - s;
    Numbers weights(Dop853::rows);
    for (int j = 0; j < Dop853::rows; ++j) {
      // x - x0 = s (d + r (f - d + s (2 d - f - g + r (D0 + s (D1 + r (D2 + s D3))))))
      const double d = Dop853::a[12][j], f = j == 0, g = j == 12;
      const auto& high = Dop853::dense;
      weights[j] = s * (d + r * (f - d + s * (2 * d - f - g +
                        r * (high[0][j] + s * (high[1][j] + r * (high[2][j] + s * high[3][j]))))));
    }
    for (int p = 1; p <= 7; ++p) CHECK(residual<Dop853>(weights, p, std::pow(s, p)) < 1e-12);
    CHECK(residual<Dop853>(weights, 8, std::pow(s, 8)) > 1e-9);
  }
}

// B(5), C(3) and D(2) give order 5 (Hairer, Wanner II, theorem IV.5.1).
TEST_CASE("Radau IIA satisfies B(5), C(3) and D(2)") {
  const auto& a = RadauIIA::a;
  const auto& c = RadauIIA::c;
  const double* b = a[3];
  for (int k = 1; k <= 6; ++k) {
    double sum = 0;
    for (int j = 0; j < 3; ++j) sum += b[j] * std::pow(c[j], k - 1);
    if (k <= 5) CHECK(std::fabs(sum - 1.0 / k) < 1e-15);
    else CHECK(std::fabs(sum - 1.0 / k) > 1e-4);
  }
  for (int k = 1; k <= 3; ++k)
    for (int i = 0; i < 3; ++i) {
      double sum = 0;
      for (int j = 0; j < 3; ++j) sum += a[i][j] * std::pow(c[j], k - 1);
      CHECK(std::fabs(sum - std::pow(c[i], k) / k) < 1e-15);
    }
  for (int k = 1; k <= 2; ++k)
    for (int j = 0; j < 3; ++j) {
      double sum = 0;
      for (int i = 0; i < 3; ++i) sum += b[i] * std::pow(c[i], k - 1) * a[i][j];
      CHECK(std::fabs(sum - b[j] * (1 - std::pow(c[j], k)) / k) < 1e-15);
    }
  for (int j = 0; j < 3; ++j) CHECK(a[2][j] == b[j]);  // stiffly accurate
}

TEST_CASE("the transformation of Radau IIA makes the inverse of A block diagonal") {
  const auto &T = RadauIIA::T, &inverse = RadauIIA::inverse_T;
  const double re = RadauIIA::mu_real, im = RadauIIA::mu_imaginary;
  const Radau3 blocks = {{RadauIIA::mu, 0, 0}, {0, re, im}, {0, -im, re}};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double product = 0, left = 0;  // T^-1 T; A T blocks, which is T
      for (int k = 0; k < 3; ++k) {
        product += inverse[i][k] * T[k][j];
        for (int m = 0; m < 3; ++m) left += RadauIIA::a[i][k] * T[k][m] * blocks[m][j];
      }
      CHECK(std::fabs(product - (i == j)) < 1e-14);
      CHECK(std::fabs(left - T[i][j]) < 1e-14);
    }
  for (const std::complex<double> mu : {std::complex<double>(RadauIIA::mu), std::complex<double>(re, im)})
    CHECK(std::abs(((mu - 9.0) * mu + 36.0) * mu - 60.0) < 1e-12);
}

// The estimate h f(x0) + sum_i e_i z_i vanishes where the solution is a polynomial of degree 3, z_i = c_i^k: its
// embedded formula has order 3 (Hairer, Wanner II, sec. IV.8).
TEST_CASE("the error estimate of Radau IIA is of order 3") {
  for (int k = 1; k <= 4; ++k) {
    double estimate = k == 1;
    for (int i = 0; i < 3; ++i) estimate += RadauIIA::e[i] * std::pow(RadauIIA::c[i], k);
    if (k <= 3) CHECK(std::fabs(estimate) < 1e-14);
    else CHECK(std::fabs(estimate) > 0.01);
  }
}

TEST_CASE("the collocation polynomial of Radau IIA passes through its stages") {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double value = 0;
      for (int k = 0; k < 3; ++k) value += RadauIIA::dense[j][k] * std::pow(RadauIIA::c[i], k + 1);
      CHECK(std::fabs(value - (i == j)) < 2e-14);
    }
}
