// The projection of states onto constraints, and unit vectors. A point in the plane, whose mass differs along the axes,
// is held on the circle (|q|^2 - 1) / 2 = 0; a correction is the smallest in the metric of M, M^-1 Jt (J M^-1 Jt)^-1
// times the residual (E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, sec. VII.2).
#include "known_problem.hpp"
#include "right_hand_side.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

constexpr double mass[2] = {1, 4};
int calls = 0, fallback_calls = 0;

// M^-1 Jt (J M^-1 Jt)^-1 times a residual, of one row J.
void least(const double* row, double residual, double* to) {
  const double size = row[0] * row[0] / mass[0] + row[1] * row[1] / mass[1];
  for (int k = 0; k < 2; ++k) to[k] = -row[k] / mass[k] * residual / size;
}

// in[3]: the square of the radius.
std::int32_t on_circle(const double* const* in, double* const* out) {
  const double *q = in[1], *v = in[1] + 2;
  double *dq = out[0], *dv = out[0] + 2;
  ++calls;
  least(q, 0.5 * (q[0] * q[0] + q[1] * q[1] - *in[3]), dq);
  least(q, q[0] * v[0] + q[1] * v[1] + dq[0] * v[0] + dq[1] * v[1], dv);  // of phi' where q will be
  *out[1] = 1;
  return 0;
}
std::int32_t refused(const double* const*, double* const* out) { return ++calls, *out[1] = -1, 0; }
std::int32_t instead(const double* const* in, double* const* out) {
  double guard;
  double* const both[] = {out[0], &guard};
  return ++fallback_calls, --calls, on_circle(in, both);
}
// A line 3 q0 + 4 q1 = 5 and its velocity.
std::int32_t on_line(const double* const* in, double* const* out) {
  const double row[] = {3, 4}, *q = in[1], *v = in[1] + 2;
  ++calls;
  least(row, 3 * q[0] + 4 * q[1] - 5, out[0]);
  least(row, 3 * v[0] + 4 * v[1], out[0] + 2);
  *out[1] = 1;
  return 0;
}

const Numbers start(4);
const double unit_square = 1;
Problem constrained(Kernel kernel) {
  Problem p = plain_problem(nullptr, start, 0, 1);
  p.nq = p.nv = 2;
  p.project = kernel, p.project_fallback = instead, p.p = &unit_square;
  calls = fallback_calls = 0;
  return p;
}

Numbers settled(const Problem& p, Numbers x) {
  Rhs rhs(p);
  rhs.normalise_and_project(0, x.data());
  return x;
}

double position_residual(const Numbers& x) { return 0.5 * (x[0] * x[0] + x[1] * x[1] - 1); }
double velocity_residual(const Numbers& x) { return x[0] * x[2] + x[1] * x[3]; }

}  // namespace

TEST_CASE("a projected state satisfies the constraint and its derivative, after few corrections") {
  Random random(1);
  const Problem p = constrained(on_circle);
  for (double off : {1e-9, 1e-5, 1e-2, 0.2})
    for (int turn = 0; turn < 20; ++turn) {
      const double angle = random.between(0, 6), speed = random.between(-1, 1);
      const double c = std::cos(angle), s = std::sin(angle);
      Numbers x{c, s, -s * speed, c * speed};
      for (double& entry : x) entry += off * random.between(-1, 1);
      calls = 0;
      x = settled(p, x);
      CHECK(std::fabs(position_residual(x)) < 4e-16);
      CHECK(std::fabs(velocity_residual(x)) < 1e-12);
      CHECK(calls <= (off < 1e-8 ? 1 : off < 1e-4 ? 2 : off < 0.1 ? 4 : 6));  // quadratic convergence
    }
}

TEST_CASE("a projected state is not moved again") {
  const Problem p = constrained(on_circle);
  const Numbers once = settled(p, {0.7, 0.8, 0.3, -0.2});
  calls = 0;
  const Numbers twice = settled(p, once);
  CHECK(calls == 1);
  CHECK(distance(once, twice) < 3e-16);
}

// On a line one correction is exact: the point of the line that is nearest in the metric of M.
TEST_CASE("the correction onto a line is orthogonal to it in the metric of the mass, and the smallest") {
  Random random(2);
  const Problem p = constrained(on_line);
  for (int turn = 0; turn < 20; ++turn) {
    const Numbers x = random.vector(4, -3, 3), found = settled(p, x);
    CHECK(std::fabs(3 * found[0] + 4 * found[1] - 5) < 1e-14);
    CHECK(std::fabs(3 * found[2] + 4 * found[3]) < 1e-14);
    for (int from : {0, 2}) {  // the tangent is (4, -3)
      const double dx = found[from] - x[from], dy = found[from + 1] - x[from + 1];
      CHECK(std::fabs(mass[0] * dx * 4 - mass[1] * dy * 3) < 1e-13);
      const double size = mass[0] * dx * dx + mass[1] * dy * dy, aside = random.between(-1, 1);
      CHECK(size <= mass[0] * std::pow(dx + 4 * aside, 2) + mass[1] * std::pow(dy - 3 * aside, 2));
    }
  }
}

// On the circle the directions at the start and at the end differ by the distance moved: second order.
TEST_CASE("the correction onto a circle is orthogonal to it in the metric of the mass to second order") {
  const Problem p = constrained(on_circle);
  Numbers along;
  for (double off : {0.08, 0.04, 0.02, 0.01}) {
    const Numbers x{std::cos(0.7) + off, std::sin(0.7) + 0.5 * off, 0, 0}, found = settled(p, x);
    along.push_back(std::fabs(mass[0] * (found[0] - x[0]) * -found[1] + mass[1] * (found[1] - x[1]) * found[0]));
  }
  CHECK(order(along) > 1.9);
}

TEST_CASE("a constraint that cannot be satisfied is given up") {
  const double impossible = -1;
  Problem p = constrained(on_circle);
  p.p = &impossible;
  const Numbers x = settled(p, {1, 0.5, 0, 0});
  CHECK(calls == 2);  // the second correction is longer than the first: it is not made
  CHECK(largest(x) < 1);
}

TEST_CASE("the fallback projects where the guard is not positive") {
  const Problem p = constrained(refused);
  const Numbers x = settled(p, {0.7, 0.8, 0.3, -0.2});
  CHECK(std::fabs(position_residual(x)) < 4e-16);
  CHECK(calls == fallback_calls);
  CHECK(fallback_calls > 1);
}

TEST_CASE("a guard that always refuses is tried once in 32 times") {
  const Problem p = constrained(refused);
  Rhs rhs(p);
  for (int k = 0; k < 200; ++k) {
    Numbers x{0.7, 0.8, 0.3, -0.2};
    rhs.normalise_and_project(0, x.data());
  }
  CHECK(fallback_calls > 400);
  CHECK(calls <= 8 + fallback_calls / 32 + 1);
}

TEST_CASE("weights measure a correction in characteristic lengths") {
  Problem p = constrained(on_circle);
  const Numbers correction{-0.5, 0.25, 9, 9}, weights{2, 4};
  CHECK(Rhs(p).size(correction.data()) == 0.75);
  p.weights = weights.data();
  CHECK(Rhs(p).size(correction.data()) == 2);
}

TEST_CASE("a projection between steps keeps a velocity that it would change by far more than the tolerance") {
  Problem p = constrained(on_circle);
  p.rtol = p.atol = 1e-6;
  const Numbers before{1, 0, 0.5, 0.5}, small{1, 0, 0.5, 0.505}, large{1.1, 0, 0.5, 0.6};
  Numbers x(small);
  Rhs(p).keep_velocity(before.data(), x.data());
  CHECK(distance(x, small) == 0);
  x = large;
  Rhs(p).keep_velocity(before.data(), x.data());
  CHECK(distance(x, {1.1, 0, 0.5, 0.5}) == 0);
  p.step = 0.1;  // fixed steps have no tolerance
  x = large;
  Rhs(p).keep_velocity(before.data(), x.data());
  CHECK(distance(x, large) == 0);
}

TEST_CASE("unit vectors get the length 1, and those that have it keep their digits") {
  const Unit units[] = {{1, 4}, {6, 2}};
  const Numbers eight(8);
  Problem p = plain_problem(nullptr, eight, 0, 1);
  p.units = units, p.unit_count = 2;
  Random random(3);
  for (int turn = 0; turn < 20; ++turn) {
    const Numbers x = random.vector(8);
    const Numbers found = settled(p, x), again = settled(p, found);
    for (const Unit& unit : units) {
      double square = 0, along = 0, before = 0;
      for (int i = unit.start; i < unit.start + unit.length; ++i)
        square += found[i] * found[i], along += found[i] * x[i], before += x[i] * x[i];
      CHECK(std::fabs(square - 1) < 5e-16);
      CHECK(along == doctest::Approx(std::sqrt(before)).epsilon(1e-14));  // the direction is kept
    }
    CHECK(found[0] == x[0]);
    CHECK(found[5] == x[5]);
    CHECK(distance(found, again) < 2e-16);
  }
  CHECK(largest(settled(p, eight)) == 0);  // zero has no direction
}
