// Forward dynamics by Pinocchio's articulated-body algorithm.
#include "symbolic.hpp"

#include "pinocchio/algorithm/aba.hpp"
#include "pinocchio/algorithm/crba.hpp"
#include "pinocchio/algorithm/rnea.hpp"

namespace bellcrank {

namespace {

// The mass matrix of the independent coordinates, S' M S; crba fills the upper triangle only.
SX reduced_mass_matrix(const Symbolic& s) {
  Data data(s.model);
  pinocchio::crba(s.model, data, s.q_full, pinocchio::Convention::WORLD);
  const int n = s.v.size1();
  SX m(n, n);  // structurally zero where the tree couples nothing
  for (int i = 0; i < s.model.nv; ++i)
    for (int j = i; j < s.model.nv; ++j) {
      const SX entry = data.M(i, j);
      if (entry.is_zero()) continue;
      const SX term = (s.multiplier[i] * s.multiplier[j]) * entry;
      const int r = s.column[i], c = s.column[j];
      m(r, c) += term;
      if (i != j) m(c, r) += term;
    }
  return m;
}

}  // namespace

::casadi::Function Tree::forward_dynamics() const {
  const Symbolic& s = *symbolic_;
  Data data(s.model);
  SX acceleration;
  if (!s.has_mimic()) {
    VectorSX tau(s.model.nv);
    for (int i = 0; i < s.model.nv; ++i) tau[i] = s.multiplier[i] * s.tau(s.column[i]);
    pinocchio::aba(s.model, data, s.q_full, s.v_full, tau, pinocchio::Convention::LOCAL);
    acceleration = s.reduce(data.ddq);
  } else {  // a mimic joint is a constraint that ABA's recursion cannot carry: S' M S a = tau - S' bias
    pinocchio::rnea(s.model, data, s.q_full, s.v_full, VectorSX(VectorSX::Constant(s.model.nv, SX(0.0))));
    const SX m = reduced_mass_matrix(s);
    const SX rhs = s.tau - s.reduce(data.tau);
    SX d, l;
    std::vector<::casadi_int> order;
    ::casadi::SX::ldl(m, d, l, order, true);
    acceleration = ::casadi::SX::ldl_solve(rhs, d, l, order);
  }
  return ::casadi::Function("forward_dynamics", {s.q, s.v, s.tau, s.p}, {acceleration}, {"q", "v", "tau", "p"},
                            {"a"});
}

::casadi::Function Tree::mass_matrix() const {
  const Symbolic& s = *symbolic_;
  const SX m = SX::densify(reduced_mass_matrix(s));
  return ::casadi::Function("mass_matrix", {s.q, s.p}, {vec(m)}, {"q", "p"}, {"M"});
}

}  // namespace bellcrank
