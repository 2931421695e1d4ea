// Held entries of u: what sampled updates and the sides of switches make of motions that are known in closed form.
#include "explicit_runge_kutta.hpp"
#include "holds_record.hpp"
#include "integration_loop.hpp"
#include "known_problem.hpp"
#include "radau_iia.hpp"

using namespace bellcrank;
using namespace bellcrank::BELLCRANK_ISA;

namespace {

struct Run {
  Numbers first, start;
  Problem p;
  Update sample{};
  bool terminal[1] = {};
  KnownDerivatives derivatives;

  Run(Kernel rhs, const Numbers& x0, double end, const Numbers& held, Kernel jacobian = nullptr)
      : first(x0), start(held), p(plain_problem(rhs, first, 0, end)), derivatives(jacobian) {
    p.held.count = p.signal_entries = static_cast<int>(start.size()), p.held.start = start.data();
    p.derivatives = &derivatives;
  }
  Run(const Run&) = delete;  // the problem points to the numbers of this one
  Run& switches(Kernel kernel, int count) { return p.held.switches = kernel, p.held.switch_count = count, *this; }
  Run& samples(Kernel kernel, double first, double period) {
    sample = {kernel, first, period};
    return p.held.updates = &sample, p.held.update_count = 1, *this;
  }
  template <class Stepper>
  Holds operator()(Status expected = Status::finished) const {
    Holds found(p);
    Counts counts;
    CHECK(IntegrationLoop<Stepper>(p, found, counts)() == expected);
    return found;
  }
};

using Explicit = ExplicitRungeKutta<Dop853, 1>;
using Pairs = ExplicitRungeKutta<DormandPrince, 1>;
const Numbers one_state{1.0}, thrown{0.0, 0.7};

// x' = u
std::int32_t held_slope(const double* const* in, double* const* out) { return out[0][0] = in[2][0], 0; }
std::int32_t no_slope(const double* const*, double* const* out) { return out[0][0] = 0, 0; }
std::int32_t controller(const double* const* in, double* const* out) { return out[0][0] = -3 * in[1][0], 0; }

// x'' = -s, where s is the side of x: parabolas, with x = 0 at every 2 v_0.
std::int32_t valley(const double* const* in, double* const* out) {
  return out[0][0] = in[1][1], out[0][1] = -in[2][0], 0;
}
std::int32_t valley_slope(const double* const*, double* const* out) {
  return std::fill(out[0], out[0] + 4, 0.0), out[0][2] = 1, 0;
}
std::int32_t position(const double* const* in, double* const* out) { return out[0][0] = in[1][0], 0; }

template <class Stepper>
void check_valley() {
  const Holds found = Run(valley, thrown, 10, {1}, valley_slope).switches(position, 1).operator()<Stepper>();
  REQUIRE(found.holds.size() == 8);  // the start, and 7 turns
  for (std::size_t k = 0; k < found.holds.size(); ++k) {
    CHECK(std::fabs(found.holds[k].first - 1.4 * static_cast<double>(k)) < 1e-11);
    CHECK(found.holds[k].second[0] == (k % 2 ? -1 : 1));
  }
  const double late = 10 - 7 * 1.4;  // below zero
  CHECK(std::fabs(found.end_state[0] - (-0.7 * late + late * late / 2)) < 1e-11);
  CHECK(std::fabs(found.end_state[1] - (-0.7 + late)) < 1e-11);
}

template <class Stepper>
void check_controller() {
  // x_{k+1} = (1 - 3 T) x_k, from the first instant on; the entry that is given acts before
  const Holds found = Run(held_slope, one_state, 2, {0.5}, no_slope).samples(controller, 0.25, 0.1).operator()<Stepper>();
  double x = 1 + 0.5 * 0.25;
  REQUIRE(found.holds.size() == 19);  // the start and 18 instants, 0.25, 0.35, … 1.95
  CHECK(found.holds[0].second[0] == 0.5);
  for (int k = 0; k < 18; ++k, x *= 1 - 3 * 0.1) {
    CHECK(std::fabs(found.holds[k + 1].first - (0.25 + 0.1 * k)) < 1e-12);
    CHECK(std::fabs(found.holds[k + 1].second[0] + 3 * x) < 1e-12);
  }
  CHECK(std::fabs(found.end_state[0] - x / 0.7 * (1 - 3 * 0.05)) < 1e-12);
}

}  // namespace

TEST_CASE("a force that switches with the side of x gives parabolas that meet where x is zero") {
  check_valley<Explicit>();
  check_valley<Pairs>();
  check_valley<Radau<1>>();
}

TEST_CASE("a sampled controller gives the sequence of its difference equation") {
  check_controller<Explicit>();
  check_controller<Pairs>();
  check_controller<Radau<1>>();
}

TEST_CASE("an instant at the end of the run is not an instant of it, and one at the start is") {
  const Holds found = Run(held_slope, one_state, 1, {0}).samples(controller, 0, 0.5).operator()<Explicit>();
  REQUIRE(found.holds.size() >= 2);
  CHECK(found.holds[0].first == 0);
  CHECK(found.holds[0].second[0] == -3);
  CHECK(std::fabs(found.holds[1].first - 0.5) < 1e-12);
  CHECK(std::fabs(found.end_state[0] - 0.25) < 1e-12);  // (1 - 3 / 2)^2
}

TEST_CASE("an update without a kernel is the record's, and one that fails ends the run") {
  Run run(held_slope, one_state, 1, {0});
  run.samples(nullptr, 0.25, 0.25);
  const Holds found = run.operator()<Explicit>();
  CHECK(found.updates == 3);
  double x = 1;
  for (double t : {0.25, 0.5, 0.75}) x += 0.25 * (t - x);
  CHECK(std::fabs(found.end_state[0] - x) < 1e-12);
  Holds broken(run.p);
  broken.fails = true;
  Counts counts;
  CHECK(IntegrationLoop<Explicit>(run.p, broken, counts)() == Status::interrupted);
  CHECK(broken.updates == 1);
}

TEST_CASE("a switch whose force drives x back from both sides ends the run as chattering") {
  const auto back = [](const double* const* in, double* const* out) -> std::int32_t { return out[0][0] = -in[2][0], 0; };
  const Holds found = Run(back, one_state, 3, {1}).switches(position, 1).operator()<Explicit>(Status::chattering);
  CHECK(std::fabs(found.holds[1].first - 1) < 1e-12);
}

TEST_CASE("switches of x and -x turn together, once at an instant") {
  const auto both = [](const double* const* in, double* const* out) -> std::int32_t {
    return out[0][0] = in[1][0], out[0][1] = -in[1][0], 0;
  };
  const auto half = [](const double* const* in, double* const* out) -> std::int32_t {
    return out[0][0] = in[1][1], out[0][1] = -0.5 * (in[2][0] - in[2][1]), 0;
  };
  const Holds found = Run(half, thrown, 10, {1, -1}).switches(both, 2).operator()<Explicit>();
  std::vector<std::pair<double, Numbers>> last;  // of those at one instant, where rounding puts one before the other
  for (const auto& hold : found.holds) {
    if (!last.empty() && hold.first - last.back().first < 1e-11) last.pop_back();
    last.push_back(hold);
  }
  REQUIRE(last.size() == 8);
  for (std::size_t k = 0; k < last.size(); ++k) {
    CHECK(std::fabs(last[k].first - 1.4 * static_cast<double>(k)) < 1e-11);
    CHECK(last[k].second[0] == (k % 2 ? -1 : 1));
    CHECK(last[k].second[1] == -last[k].second[0]);
  }
  CHECK(std::fabs(found.end_state[1] - (-0.7 + 0.2)) < 1e-11);
}

TEST_CASE("a side that is wrong at the start is set right before the first step") {
  const Holds found = Run(held_slope, one_state, 1, {-1}).switches(position, 1).operator()<Explicit>();
  REQUIRE(found.holds.size() == 1);
  CHECK(found.holds[0].second[0] == 1);
  CHECK(std::fabs(found.end_state[0] - 2) < 1e-12);
}
