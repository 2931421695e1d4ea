// The mass matrix by Pinocchio's composite-rigid-body algorithm.
#include "symbolic.hpp"

#include "pinocchio/algorithm/crba.hpp"

namespace bellcrank {

// S' M S; crba fills the upper triangle only.
SX reduced_mass_matrix(const Symbolic& s) {
  Workspace data(s.model);
  const int nv = s.model.nv;
  data.oYcrb.assign(s.model.njoints, Data::Inertia::Zero());
  data.mass.assign(s.model.njoints, SX(0.0));
  data.com.assign(s.model.njoints, Data::Vector3::Zero());
  data.J = data.Ag = Data::Matrix6x::Zero(6, nv);
  data.M = Data::MatrixXs::Zero(nv, nv);
  data.nvSubtree.assign(s.model.njoints, 0);
  for (int j = s.model.njoints - 1; j > 0; --j) {
    data.nvSubtree[j] += s.model.nvs[j];
    data.nvSubtree[s.model.parents[j]] += data.nvSubtree[j];
  }
  pinocchio::crba(s.model, data, s.q_full, pinocchio::Convention::WORLD);
  const int n = s.v.size1();
  std::vector<SX> entries(static_cast<std::size_t>(n) * n);  // column after column; a new one stores nothing
  const auto add = [&](int row, int column, const SX& term) {
    SX& entry = entries[static_cast<std::size_t>(column) * n + row];
    entry = entry.is_empty() ? term : entry + term;
  };
  for (int i = 0; i < nv; ++i)
    for (int j = i; j < nv; ++j) {
      const SX& entry = data.M(i, j);
      if (entry.is_zero()) continue;
      const SX term = (s.multiplier[i] * s.multiplier[j]) * entry;
      add(s.column[i], s.column[j], term);
      if (i != j) add(s.column[j], s.column[i], term);
    }
  std::vector<::casadi_int> rows, columns;
  std::vector<SX> present;
  for (int c = 0; c < n; ++c)
    for (int r = 0; r < n; ++r) {
      const SX& entry = entries[static_cast<std::size_t>(c) * n + r];
      if (entry.is_empty()) continue;
      rows.push_back(r), columns.push_back(c), present.push_back(SX::densify(entry));
    }
  return SX(::casadi::Sparsity::triplet(n, n, rows, columns), vertcat(present));
}

::casadi::Function Tree::mass_matrix() const {
  const Symbolic& s = *symbolic_;
  const SX m = SX::densify(reduced_mass_matrix(s));
  return ::casadi::Function("mass_matrix", {s.q, s.p}, {vec(m)}, {"q", "p"}, {"M"});
}

}  // namespace bellcrank
