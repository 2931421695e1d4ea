// Forward dynamics by Pinocchio's articulated-body algorithm.
#include "symbolic.hpp"

#include "pinocchio/algorithm/aba.hpp"

namespace bellcrank {

::casadi::Function Tree::forward_dynamics() const {
  const Symbolic& s = *symbolic_;
  SX acceleration;
  if (!s.has_mimic()) {
    Workspace data(s.model);
    data.Yaba.assign(s.model.njoints, Data::Inertia::Matrix6::Zero());
    VectorSX tau(s.model.nv);
    for (int i = 0; i < s.model.nv; ++i) tau[i] = s.multiplier[i] * s.tau(s.column[i]);
    pinocchio::aba(s.model, data, s.q_full, s.v_full, tau, pinocchio::Convention::LOCAL);
    acceleration = s.reduce(data.ddq);
  } else {  // a mimic joint is a constraint that ABA's recursion cannot carry: S' M S a = tau - S' bias
    const SX m = reduced_mass_matrix(s);
    const SX rhs = s.tau - bias_force(s);
    SX d, l;
    std::vector<::casadi_int> order;
    ::casadi::SX::ldl(m, d, l, order, true);
    acceleration = ::casadi::SX::ldl_solve(rhs, d, l, order);
  }
  return ::casadi::Function("forward_dynamics", {s.q, s.v, s.tau, s.p}, {acceleration}, {"q", "v", "tau", "p"},
                            {"a"});
}

}  // namespace bellcrank
