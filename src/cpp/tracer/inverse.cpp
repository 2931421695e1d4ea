// Inverse dynamics and joint reactions by Pinocchio's recursive Newton-Euler algorithm.
#include "symbolic.hpp"

#include "pinocchio/algorithm/rnea.hpp"

namespace bellcrank {

::casadi::Function Tree::inverse_dynamics() const {
  const Symbolic& s = *symbolic_;
  Workspace data(s.model);
  pinocchio::rnea(s.model, data, s.q_full, s.v_full, s.a_full);
  return ::casadi::Function("inverse_dynamics", {s.q, s.v, s.a, s.p}, {s.reduce(data.tau)},
                            {"q", "v", "a", "p"}, {"tau"});
}

SX bias_force(const Symbolic& s) {
  Workspace data(s.model);
  const VectorSX rest = VectorSX::Constant(s.model.nv, SX(0.0));
  pinocchio::rnea(s.model, data, s.q_full, s.v_full, rest);
  return s.reduce(data.tau);
}

::casadi::Function Tree::reactions() const {
  const Symbolic& s = *symbolic_;
  Workspace data(s.model);
  pinocchio::rnea(s.model, data, s.q_full, s.v_full, s.a_full);
  std::vector<SX> rows;
  for (int j = 1; j < s.model.njoints; ++j)
    for (int i = 0; i < 6; ++i) rows.push_back(data.f[j].toVector()[i]);
  return ::casadi::Function("reactions", {s.q, s.v, s.a, s.p}, {vertcat(rows)}, {"q", "v", "a", "p"}, {"wrench"});
}

}  // namespace bellcrank
