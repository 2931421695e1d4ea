// Event location: roots of functions of time whose crossings are known, and of a motion with a known solution.
#include "explicit_runge_kutta.hpp"
#include "integration_loop.hpp"
#include "known_problem.hpp"
#include "radau_iia.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

struct Crossings final : Record {
  struct Event {
    int index;
    double time;
    Numbers state;
  };
  std::vector<Event> events;
  int unresolved_steps = 0, undefined_steps = 0;
  double first_undefined = INFINITY, end_time = NAN;
  Numbers end_state, ends = Numbers(1000);
  int n;

  explicit Crossings(const Problem& p) : n(p.n) { more_steps(); }
  void more_steps() override { next_step = ends.data(), steps_end = next_step + ends.size(); }
  void output(double, const double*) override {}
  void event(int index, double t, const double* x) override { events.push_back({index, t, Numbers(x, x + n)}); }
  void unresolved(int, double) override { ++unresolved_steps; }
  void undefined(int, double t) override { ++undefined_steps, first_undefined = std::min(first_undefined, t); }
  void end(double t, const double* x) override { end_time = t, end_state.assign(x, x + n); }
  bool look(double, const double*, const Counts&, std::int64_t* attempts) override { return *attempts = 1000, false; }
  Numbers times() const {
    Numbers found;
    for (const Event& event : events) found.push_back(event.time);
    return found;
  }
};

template <class Stepper>
Crossings run(const Problem& p, Status expected = Status::finished) {
  Crossings found(p);
  Counts counts;
  CHECK(IntegrationLoop<Stepper>(p, found, counts)() == expected);
  return found;
}

// One step from 0 to 1 of x' = 1, in which `events` are functions of time and parameters.
const Numbers zero{0};
std::int32_t one(const double* const*, double* const* out) { return *out[0] = 1, 0; }
struct Clock {
  bool terminal[2] = {};
  int direction[2] = {};
  Problem p;

  explicit Clock(Kernel events, const Numbers& parameters = zero, int count = 1)
      : p(plain_problem(one, zero, 0, 1)) {
    p.events = events, p.event_count = count, p.p = parameters.data();
    p.terminal = terminal, p.direction = direction;
    p.step = 1;
  }
  Crossings search(Status expected = Status::finished) { return run<ExplicitRungeKutta<Dop853, 1>>(p, expected); }
};

std::int32_t product(const double* const* in, double* const* out) {  // of t - root; in[3]: their number, and they
  *out[0] = 1;
  for (int i = 1; i <= static_cast<int>(*in[3]); ++i) *out[0] *= *in[0] - in[3][i];
  return 0;
}
std::int32_t wave(const double* const* in, double* const* out) {  // in[3]: frequency, phase
  return *out[0] = std::sin(in[3][0] * *in[0] + in[3][1]), 0;
}

// x'' = -x as (sin, cos); events: x - 0.5 and x' - 0.5.
const Numbers at_rest{0, 1};
struct Oscillator {
  bool terminal[2] = {};
  int direction[2] = {};
  KnownDerivatives derivatives{[](const double* const*, double* const* out) -> std::int32_t {
    return out[0][0] = out[0][3] = 0, out[0][1] = -1, out[0][2] = 1, 0;
  }};
  Problem p = plain_problem(
      [](const double* const* in, double* const* out) -> std::int32_t {
        return out[0][0] = in[1][1], out[0][1] = -in[1][0], 0;
      },
      at_rest, 0, 10);

  explicit Oscillator(double tolerance) {
    p.rtol = p.atol = tolerance;
    p.events = [](const double* const* in, double* const* out) -> std::int32_t {
      return out[0][0] = in[1][0] - 0.5, out[0][1] = in[1][1] - 0.5, 0;
    };
    p.event_count = 2, p.terminal = terminal, p.direction = direction, p.derivatives = &derivatives;
  }
};

// sin t = 0.5 at pi / 6 and 5 pi / 6, cos t = 0.5 at pi / 3 and 5 pi / 3, plus full turns.
std::vector<std::pair<double, int>> oscillator_events() {
  std::vector<std::pair<double, int>> all;
  for (double turn = 0; turn < 10; turn += 2 * M_PI)
    for (const auto& [angle, index] : {std::pair{1, 0}, {5, 0}, {2, 1}, {10, 1}})
      if (turn + angle * M_PI / 6 < 10) all.emplace_back(turn + angle * M_PI / 6, index);
  std::sort(all.begin(), all.end());
  return all;
}

template <class Stepper>
void check_oscillator() {
  for (double tolerance : {1e-5, 1e-8, 1e-11}) {
    Oscillator oscillator(tolerance);
    const Crossings found = run<Stepper>(oscillator.p);
    const auto expected = oscillator_events();
    REQUIRE(found.events.size() == expected.size());
    for (std::size_t k = 0; k < expected.size(); ++k) {
      const auto& event = found.events[k];
      CHECK(event.index == expected[k].second);
      CHECK(std::fabs(event.time - expected[k].first) < 30 * tolerance);
      CHECK(std::fabs(event.state[event.index] - 0.5) < 4e-15);  // of the state that is given with the time
    }
  }
}

}  // namespace

TEST_CASE("events of a motion are found as accurately as its steps by DOP853") {
  check_oscillator<ExplicitRungeKutta<Dop853, 1>>();
}
TEST_CASE("events of a motion are found as accurately as its steps by RK45") {
  check_oscillator<ExplicitRungeKutta<DormandPrince, 1>>();
}
TEST_CASE("events of a motion are found as accurately as its steps by Radau IIA") { check_oscillator<Radau<1>>(); }

TEST_CASE("all roots of random polynomials within one step are found") {
  Random random(1);
  for (int turn = 0; turn < 200; ++turn) {
    const int count = random.integer(1, 5);
    Numbers roots;
    while (static_cast<int>(roots.size()) < count) {
      const double root = random.between(0.01, 0.99);
      const auto far = [&](double other) { return std::fabs(other - root) > 0.02; };
      if (std::all_of(roots.begin(), roots.end(), far)) roots.push_back(root);
    }
    std::sort(roots.begin(), roots.end());
    Numbers parameters(roots);
    parameters.insert(parameters.begin(), count);
    const Crossings found = Clock(product, parameters).search();
    CAPTURE(turn);
    REQUIRE(found.events.size() == roots.size());
    CHECK(distance(found.times(), roots) < 1e-12);  // a factor of 0.02^4 in the slope magnifies rounding
  }
}

TEST_CASE("two crossings a thousandth of a step apart are found, and none where the curve only comes near") {
  Random random(2);
  for (int turn = 0; turn < 100; ++turn) {
    const double middle = random.between(0.01, 0.99);
    const Numbers twice{2, middle - 5e-4, middle + 5e-4};
    const Crossings found = Clock(product, twice).search();
    REQUIRE(found.events.size() == 2);
    CHECK(distance(found.times(), {twice[1], twice[2]}) < 1e-12);
    const Numbers near{middle};
    const auto above = [](const double* const* in, double* const* out) -> std::int32_t {
      return *out[0] = (*in[0] - *in[3]) * (*in[0] - *in[3]) + 1e-7, 0;
    };
    CHECK(Clock(above, near).search().events.empty());
  }
}

TEST_CASE("all crossings of oscillations within one step are found") {
  Random random(3);
  for (int turn = 0; turn < 100; ++turn) {
    const Numbers parameters{random.between(5, 300), random.between(0.05, 3)};
    Numbers expected;
    for (int k = 1; (k * M_PI - parameters[1]) / parameters[0] < 1; ++k)
      expected.push_back((k * M_PI - parameters[1]) / parameters[0]);
    const Crossings found = Clock(wave, parameters).search();
    CAPTURE(parameters[0]);
    REQUIRE(found.events.size() == expected.size());
    CHECK(distance(found.times(), expected) < 1e-14);
    CHECK(found.unresolved_steps == 0);
  }
}

TEST_CASE("an event with a direction is a crossing in that direction") {
  const Numbers parameters{20, 1};  // sin falls at pi, 3 pi, ... and rises at 2 pi, 4 pi, ...
  const Numbers all = Clock(wave, parameters).search().times();
  for (int direction : {1, -1}) {
    Clock clock(wave, parameters);
    clock.direction[0] = direction;
    Numbers expected;
    for (std::size_t k = direction > 0 ? 1 : 0; k < all.size(); k += 2) expected.push_back(all[k]);
    CHECK(distance(clock.search().times(), expected) == 0);
  }
}

TEST_CASE("a run ends at its first terminal event, with the state there") {
  const auto two = [](const double* const* in, double* const* out) -> std::int32_t {
    return out[0][0] = std::sin(10 * *in[0]), out[0][1] = *in[0] - 0.7, 0;
  };
  Clock clock(two, zero, 2);
  clock.terminal[1] = true;
  const Crossings found = clock.search(Status::event);
  CHECK(distance(found.times(), {M_PI / 10, 2 * M_PI / 10, 0.7}) < 1e-15);
  CHECK(found.end_time == 0.7);
  CHECK(std::fabs(found.end_state[0] - 0.7) < 1e-15);
}

TEST_CASE("jumps, and curves that stay at zero, are crossings; a start at zero is none") {
  const auto jump = [](const double* const* in, double* const* out) -> std::int32_t {
    return *out[0] = *in[0] < 0.4 ? -1 : 2, 0;
  };
  CHECK(distance(Clock(jump).search().times(), {0.4}) < 1e-15);
  const auto stays = [](const double* const* in, double* const* out) -> std::int32_t {
    return *out[0] = std::max(0.0, 0.3 - *in[0]), 0;
  };
  CHECK(distance(Clock(stays).search().times(), {0.3}) < 1e-15);
  const auto from_zero = [](const double* const* in, double* const* out) -> std::int32_t {
    return *out[0] = *in[0] * (*in[0] - 0.6), 0;
  };
  CHECK(distance(Clock(from_zero).search().times(), {0.6}) < 1e-15);
}

TEST_CASE("a function that is not a number is reported with the time") {
  const auto undefined = [](const double* const* in, double* const* out) -> std::int32_t {
    return *out[0] = *in[0] > 0.5 && *in[0] < 0.6 ? NAN : 1, 0;
  };
  const Crossings found = Clock(undefined).search();
  CHECK(found.events.empty());
  CHECK(found.undefined_steps == 1);
  CHECK(found.first_undefined > 0.5);
  CHECK(found.first_undefined < 0.6);
}

TEST_CASE("three samples rule out crossings of straight lines, and no two crossings of a parabola") {
  Random random(4);
  for (int turn = 0; turn < 200; ++turn) {
    const double a = random.between(0.1, 1), b = random.between(0.1, 1);
    const double line[] = {a, 0.5 * (a + b), b};
    CHECK(halves_have_no_zero(line));
    const double middle = random.between(0.2, 0.8), half = random.between(0, std::min(0.19, std::fabs(0.5 - middle)));
    const auto f = [&](double s) { return (s - middle) * (s - middle) - half * half; };
    const double parabola[] = {f(0), f(0.5), f(1)};
    CHECK_FALSE(halves_have_no_zero(parabola));
  }
}

TEST_CASE("samples at the middle of steps alone find what is not close together") {
  for (double root : {0.1, 0.5, 0.77}) {
    const Numbers once{1, root};
    Clock clock(product, once);
    clock.p.event_samples = 2;
    CHECK(distance(clock.search().times(), {root}) < 1e-15);
  }
  const Numbers twice{2, 0.2, 0.6};
  Clock clock(product, twice);
  clock.p.event_samples = 2;
  CHECK(distance(clock.search().times(), {0.2, 0.6}) < 1e-14);
}
