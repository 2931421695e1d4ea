// Forces of joints that dry friction holds: against the enumeration of all modes, and where forces are not unique; and a run
// that sticks and slides as the closed form says.
#include "explicit_runge_kutta.hpp"
#include "holds_record.hpp"
#include "bounded_forces.hpp"
#include "integration_loop.hpp"
#include "known_problem.hpp"
#include "radau_iia.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

// Accelerations b + A τ of forces that obey the law, to a tolerance.
void check_law(const BoundedForces& m, int n) {
  for (int i = 0; i < n; ++i) {
    double a = m.right[i], size = std::fabs(a);
    for (int j = 0; j < n; ++j) a += m.matrix[i * n + j] * m.force[j], size += std::fabs(m.matrix[i * n + j] * m.force[j]);
    CHECK(std::fabs(a - m.acceleration[i]) <= 1e-13 * size);
    CHECK(std::fabs(m.force[i]) <= m.high[i] * (1 + 1e-9));
    if (!m.at_limit(i)) CHECK(std::fabs(a) <= 1e-8 * size);
    else CHECK(a * m.force[i] <= 1e-8 * size * m.high[i]);
  }
}

void set(BoundedForces& m, int n, int rank, Random& random) {
  Numbers factor(n * rank);
  for (double& x : factor) x = random.between(-1, 1);
  for (int i = 0; i < n; ++i) {
    m.high[i] = std::pow(10.0, random.between(-2, 1)), m.low[i] = -m.high[i], m.right[i] = 0;
    for (int j = 0; j < n; ++j) {
      m.matrix[i * n + j] = 0;
      for (int k = 0; k < rank; ++k) m.matrix[i * n + j] += factor[i * rank + k] * factor[j * rank + k];
    }
  }
  for (int k = 0; k < rank; ++k) {  // b in the range of A, as in a linkage
    const double load = random.between(-3, 3);
    for (int i = 0; i < n; ++i) m.right[i] += factor[i * rank + k] * load;
  }
}

// x'' = -x + τ of a block on a rail, whose mode is in the held entries: direction, moves, holds, slack.
constexpr double mu = 0.15;
double friction(const double* const* in) { return in[2][2] ? in[1][0] : -mu * in[2][0]; }
std::int32_t block(const double* const* in, double* const* out) {
  return out[0][0] = in[1][1], out[0][1] = in[2][1] * (-in[1][0] + friction(in)), 0;
}
std::int32_t block_slope(const double* const* in, double* const* out) {
  return out[0][0] = 0, out[0][1] = -in[2][1], out[0][2] = 1, out[0][3] = 0, 0;
}
std::int32_t block_switch(const double* const* in, double* const* out) {
  const double share = in[2][2] * in[1][0] / mu;
  return out[0][0] = in[2][1] ? in[2][0] * in[1][1] : 1 + in[2][3] - share * share, 0;
}
std::int32_t block_turn(const double* const* in, double* const* out) {
  const double sliding = in[2][2] ? 0 : -mu * in[2][0];
  const double found[] = {in[1][1], -in[1][0] + sliding, 1, 1, -mu, mu, sliding, 0, 0, 0, 1};
  return std::copy(found, found + 11, out[0]), 0;
}

// x'' = -g of a ball above a stop at 0 with a restitution of 0.8; its mode: side, free, held, impulse.
constexpr double g = 9.81, bounce = 0.8;
std::int32_t ball(const double* const* in, double* const* out) {
  return out[0][0] = in[1][1], out[0][1] = in[2][1] ? -g : 0, out[0][2] = 0, 0;
}
std::int32_t ball_slope(const double* const*, double* const* out) {
  return std::fill(out[0], out[0] + 9, 0.0), out[0][3] = 1, 0;
}
std::int32_t ball_switch(const double* const* in, double* const* out) {
  return out[0][0] = in[2][2] ? g : in[1][0], 0;
}
std::int32_t ball_turn(const double* const* in, double* const* out) {
  const double found[] = {in[1][1], -g, 1, 1, 0, 0, 0, 0, 1e300, bounce, 1};
  return std::copy(found, found + 11, out[0]), 0;
}

constexpr int friction_kind[] = {0}, stop_kind[] = {1}, velocity_row[] = {1}, position_row[] = {0};

constexpr int ends[] = {1};
const Numbers ball_first{1, 0, 0}, ball_held{0, 1, 0, 0};

// A ball that falls from 1 m.
Problem ball_problem() {
  const Numbers &first = ball_first, &start = ball_held;
  Problem p = plain_problem(ball, first, 0, 10);
  p.nq = p.nv = 1;
  p.held.count = p.signal_entries = 4, p.held.start = start.data();
  p.held.mode_count = 1, p.held.mode_kinds = stop_kind, p.held.mode_rows = velocity_row;
  p.held.mode_places = position_row, p.held.work_row = 2, p.held.response_rows = 1;
  p.held.turn = ball_turn, p.held.switches = ball_switch;
  return p;
}

template <class Stepper>
void check_first_contact(double accuracy) {
  Problem p = ball_problem();
  KnownDerivatives derivatives(ball_slope);
  p.derivatives = &derivatives;
  p.held.mode_ends = ends;
  Holds found(p);
  Counts counts;
  CHECK(IntegrationLoop<Stepper>(p, found, counts)() == Status::contact);
  const double fall = std::sqrt(2 / g);
  CHECK(std::fabs(found.end_time - fall) < accuracy);
  CHECK(std::fabs(found.end_state[1] - bounce * g * fall) < 1e2 * accuracy);  // after the impact
}

template <class Stepper>
void check_ball(double accuracy) {
  Problem p = ball_problem();
  KnownDerivatives derivatives(ball_slope);
  p.derivatives = &derivatives;
  Holds found(p);
  Counts counts;
  CHECK(IntegrationLoop<Stepper>(p, found, counts)() == Status::finished);
  const double fall = std::sqrt(2 / g);
  double time = fall, flight = 2 * fall * bounce;
  int impacts = 0;
  for (const auto& [when, mode] : found.holds) {
    if (mode[3] == 0) continue;
    CHECK(std::fabs(when - time) < accuracy);
    time += flight, flight *= bounce, ++impacts;
  }
  CHECK(impacts > 80);
  CHECK(found.holds.back().second[2] == 1.0);
  CHECK(std::fabs(found.holds.back().first - fall * (1 + bounce) / (1 - bounce)) < accuracy);
  CHECK(found.end_state[0] == 0.0);
  CHECK(found.end_state[1] == 0.0);
  CHECK(std::fabs(found.end_state[2] + g) < 1e-9);  // all of the energy is work of the impacts
}

template <class Stepper>
void check_block(double accuracy) {
  const Numbers first{1, 0}, start{0, 0, 1, 0};
  Problem p = plain_problem(block, first, 0, 20);
  p.nq = p.nv = 1;
  KnownDerivatives derivatives(block_slope);
  p.derivatives = &derivatives;
  p.held.count = p.signal_entries = 4, p.held.start = start.data();
  p.held.mode_count = 1, p.held.mode_kinds = friction_kind, p.held.mode_rows = velocity_row;
  p.held.mode_places = position_row, p.held.work_row = -1, p.held.response_rows = 1;
  p.held.turn = block_turn, p.held.switches = block_switch;
  Holds found(p);
  Counts counts;
  CHECK(IntegrationLoop<Stepper>(p, found, counts)() == Status::finished);
  REQUIRE(found.holds.size() == 4);  // three half swings, and rest
  const double pi = 3.141592653589793;
  for (int k = 0; k < 4; ++k) {
    CHECK(std::fabs(found.holds[k].first - k * pi) < accuracy);
    CHECK(found.holds[k].second == (k == 3 ? Numbers{0, 0, 1, 0} : Numbers{k % 2 ? 1.0 : -1.0, 1, 0, 0}));
  }
  CHECK(std::fabs(found.end_state[0] + 0.1) < accuracy);
  CHECK(found.end_state[1] == 0.0);
}

}  // namespace

TEST_CASE("forces of dry friction obey its law for joints that move freely of each other") {
  Random random(7);
  for (int k = 0; k < 2000; ++k) {
    const int n = 1 + k % 8;
    BoundedForces m(n);
    set(m, n, n + 2, random);
    m.solve(n);
    check_law(m, n);
  }
}

TEST_CASE("forces of joints that hold each other obey the law, and only as many bear the load as are needed") {
  Random random(7);
  for (int k = 0; k < 2000; ++k) {
    const int n = 2 + k % 6, rank = 1 + k % 2;
    BoundedForces m(n);
    set(m, n, rank, random);
    m.solve(n);
    check_law(m, n);
    int holding = 0;
    for (int i = 0; i < n; ++i) holding += m.holds(i);
    CHECK(holding <= rank);
    for (int i = 0; i < n; ++i)
      if (holding == rank && !m.holds(i)) CHECK_FALSE(m.can_move(i, n));
  }
}

TEST_CASE("gears lose by their load as the sides say on which the accelerations are, of joints at rest and of moving ones") {
  Random random(11);
  for (int k = 0; k < 5000; ++k) {
    const int n = 1 + k % 6;
    BoundedForces m(n);
    set(m, n, n + 1, random);
    std::vector<int> ways(n);
    Numbers rubs(n);
    for (int i = 0; i < n; ++i) {
      const double load = random.between(-4, 4);
      rubs[i] = k % 3 ? random.between(0, 1) : 0;
      m.compliance[i] = i % 4 == 3 ? 0 : random.between(0, 2);
      m.forward[i] = load - rubs[i], m.backward[i] = load + rubs[i];
      ways[i] = random.between(-1, 1) > 0.4 ? (load > 0 ? 1 : -1) : 0;
      if (ways[i]) {
        m.low[i] = m.high[i] = ways[i] > 0 ? std::fmin(0, m.forward[i]) : std::fmax(0, m.backward[i]);
      } else {
        m.low[i] = -rubs[i] + std::fmin(0, m.forward[i]), m.high[i] = rubs[i] + std::fmax(0, m.backward[i]);
      }
    }
    m.solve_gears(n, ways.data());
    for (int i = 0; i < n; ++i) {
      double a = m.right[i], size = std::fabs(a) + std::fabs(m.force[i]) + 1;
      for (int j = 0; j < n; ++j) a += m.matrix[i * n + j] * m.force[j], size += std::fabs(m.matrix[i * n + j] * m.force[j]);
      CHECK(std::fabs(a - m.acceleration[i]) <= 1e-12 * size);
      const double rub = ways[i] ? 0 : rubs[i];
      const double ahead = -rub + std::fmin(0, m.forward[i] - m.compliance[i] * a);
      const double back = rub + std::fmax(0, m.backward[i] - m.compliance[i] * a);
      const double near = 1e-8 * size * (1 + m.compliance[i]);
      if (ways[i]) {
        CHECK(std::fabs(m.force[i] - (ways[i] > 0 ? ahead : back)) <= near);
      } else if (!m.at_limit(i)) {
        CHECK(std::fabs(a) <= 1e-8 * size);
        CHECK(m.force[i] >= m.low[i] - near);
        CHECK(m.force[i] <= m.high[i] + near);
      } else {
        CHECK(std::fabs(m.force[i] - (m.at_most(i) ? back : ahead)) <= near);
        CHECK((m.at_most(i) ? -a : a) >= -1e-8 * size);
      }
    }
  }
}

TEST_CASE("a load at the limit of a joint alone can move it") {
  BoundedForces m(1);
  m.matrix[0] = 2, m.right[0] = -2 * 5.0, m.low[0] = -5.0, m.high[0] = 5.0;
  m.solve(1);
  CHECK(m.at_limit(0));
  CHECK(m.can_move(0, 1));
  CHECK_FALSE(m.moves(0, 1));
}

TEST_CASE("a joint without friction follows those that hold the same freedom, and only these") {
  BoundedForces m(3);  // two joints of one freedom, the second without friction, and another freedom without any
  const double matrix[] = {1, 2, 0, 2, 4, 0, 0, 0, 3}, right[] = {0.5, 1, 0.1}, high[] = {1, 0, 0};
  for (int i = 0; i < 3; ++i) {
    m.right[i] = right[i], m.high[i] = high[i], m.low[i] = -high[i];
    for (int j = 0; j < 3; ++j) m.matrix[3 * i + j] = matrix[3 * i + j];
  }
  m.solve(3);
  CHECK(m.force[0] == -0.5);
  CHECK(m.force[1] == 0);
  CHECK(m.force[2] == 0);
  CHECK(m.holds(0));
  CHECK(!m.can_move(1, 3, 1e-9));
  CHECK(m.can_move(2, 3, 1e-9));
}

TEST_CASE("a Coulomb oscillator sticks as its closed form says") {
  check_block<ExplicitRungeKutta<Dop853, 1>>(1e-6);
  check_block<ExplicitRungeKutta<DormandPrince, 1>>(1e-5);
}

TEST_CASE("a contact that ends a run leaves the state after the impact") {
  check_first_contact<ExplicitRungeKutta<Dop853, 1>>(1e-9);
  check_first_contact<Radau<1>>(1e-7);
}

TEST_CASE("a ball passes infinitely many impacts and rests as its closed form says") {
  check_ball<ExplicitRungeKutta<Dop853, 1>>(1e-8);
  check_ball<Radau<1>>(1e-8);
}
