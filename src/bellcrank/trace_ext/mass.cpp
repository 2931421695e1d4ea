// The mass matrix by Pinocchio's composite-rigid-body algorithm.
#include "symbolic.hpp"

#include "pinocchio/algorithm/crba.hpp"

namespace bellcrank {

// S' M S; crba fills the upper triangle only.
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

::casadi::Function Tree::mass_matrix() const {
  const Symbolic& s = *symbolic_;
  const SX m = SX::densify(reduced_mass_matrix(s));
  return ::casadi::Function("mass_matrix", {s.q, s.p}, {vec(m)}, {"q", "p"}, {"M"});
}

}  // namespace bellcrank
