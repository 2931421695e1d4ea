// A record that keeps what a run holds in u, and from when on.
#pragma once

#include <utility>
#include <vector>

#include "known_problem.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

struct Holds final : Record {
  std::vector<std::pair<double, Numbers>> holds;  // from when on, and which values
  Numbers end_state, ends = Numbers(100000);
  double end_time = 0;
  int n, count, updates = 0;
  bool fails = false;

  explicit Holds(const Problem& p) : n(p.n), count(p.held.count) { more_steps(); }
  void more_steps() override { next_step = ends.data(), steps_end = next_step + ends.size(); }
  void output(double, const double*) override {}
  void event(int, double, const double*) override {}
  void unresolved(int, double) override {}
  void undefined(int, double) override {}
  void end(double t, const double* x) override { end_time = t, end_state.assign(x, x + n); }
  void hold(double t, const double* values) override { holds.push_back({t, Numbers(values, values + count)}); }
  bool update(int, double t, const double* x, double* values) override {
    return values[0] = t - x[0], ++updates, !fails;
  }
  bool look(double, const double*, const Counts&, std::int64_t* attempts) override { return *attempts = 1000, false; }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
