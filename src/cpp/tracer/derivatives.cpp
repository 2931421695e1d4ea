// Derivatives of inverse dynamics by Pinocchio's recursive algorithm (Carpentier & Mansard, Analytical Derivatives of
// Rigid Body Dynamics Algorithms, RSS 2018).
#include "symbolic.hpp"

#include "pinocchio/algorithm/rnea-derivatives.hpp"

namespace bellcrank {

namespace {

// The arrays of Data that the algorithm reads and writes besides those of a Workspace.
void make_room(const Model& model, Data& data) {
  const std::size_t n = model.njoints;
  for (auto* motions : {&data.ov, &data.oa, &data.oa_gf}) motions->assign(n, Data::Motion::Zero());
  for (auto* forces : {&data.oh, &data.of}) forces->assign(n, Data::Force::Zero());
  for (auto* inertias : {&data.oinertias, &data.oYcrb}) inertias->assign(n, Data::Inertia::Zero());
  data.doYcrb.assign(n, Data::Inertia::Matrix6::Zero());
  data.Fcrb.assign(n, Data::Matrix6x());
  data.Fcrb[0] = Data::Matrix6x::Zero(6, model.nv);
  for (auto* columns : {&data.J, &data.dJ, &data.dVdq, &data.dAdq, &data.dAdv, &data.dFdq, &data.dFdv, &data.dFda})
    *columns = Data::Matrix6x::Zero(6, model.nv);
  data.nvSubtree.assign(n, 0);
  for (int j = model.njoints - 1; j > 0; --j) {
    data.nvSubtree[j] += model.nvs[j];
    data.nvSubtree[model.parents[j]] += data.nvSubtree[j];
  }
}

// S' X S of a matrix that is zero wherever two joints are not on one branch, with as few stored entries.
SX reduced(const Symbolic& s, const Data::MatrixXs& full) {
  const int n = s.v.size1();
  std::vector<::casadi_int> rows, columns;
  std::vector<SX> entries(static_cast<std::size_t>(n) * n);  // column after column; a new one stores nothing
  for (Eigen::Index c = 0; c < full.cols(); ++c)
    for (Eigen::Index r = 0; r < full.rows(); ++r) {
      if (full(r, c).is_zero()) continue;
      SX& entry = entries[static_cast<std::size_t>(s.column[c]) * n + s.column[r]];
      const SX term = (s.multiplier[r] * s.multiplier[c]) * full(r, c);
      entry = entry.is_empty() ? term : entry + term;
    }
  std::vector<SX> present;
  for (int c = 0; c < n; ++c)
    for (int r = 0; r < n; ++r) {
      const SX& entry = entries[static_cast<std::size_t>(c) * n + r];
      if (entry.is_empty()) continue;
      rows.push_back(r), columns.push_back(c), present.push_back(SX::densify(entry));
    }
  return SX(::casadi::Sparsity::triplet(n, n, rows, columns), vertcat(present));
}

// Where all of a robot moves with one joint, its forces depend on that joint's position by the direction of gravity
// alone: they are those at the joint's neutral position in a world that is turned with it. There the joint's axes are
// constants, and rows and columns of a free base are entries of forces.
void turn_world_with_root(const Symbolic& s, const Workspace& placed, Model& model, VectorSX& q) {
  for (int j = 2; j < model.njoints; ++j)
    if (model.parents[j] == 0) return;
  const auto& in_world = model.jointPlacements[1].rotation();
  const Model::SE3::Vector3 in_joint = placed.oMi[1].rotation().transpose() * model.gravity.linear();
  model.gravity.linear() = in_world * in_joint;
  for (int i = 0; i < model.nqs[1]; ++i) q[i] = SX(0.0);
  const JointKind kind = s.description.joints[0].kind;
  if (kind == JointKind::FreeFlyer || kind == JointKind::Spherical) q[model.nqs[1] - 1] = SX(1.0);
  if (kind == JointKind::Planar) q[2] = SX(1.0);
}

}  // namespace

// With q_full, v_full, a_full = S (q, v, a) + offsets and tau = S' tau_full, each derivative is S' D S.
::casadi::Function Tree::inverse_dynamics_derivatives() const {
  const Symbolic& s = *symbolic_;
  Model model = s.model;
  VectorSX q = s.q_full;
  if (model.njoints > 1) turn_world_with_root(s, kinematics(*symbolic_), model, q);
  Workspace data(model);
  make_room(model, data);
  const int nv = model.nv;
  Data::MatrixXs dq = Data::MatrixXs::Zero(nv, nv), dv = dq, da = dq;
  pinocchio::computeRNEADerivatives(model, data, q, s.v_full, s.a_full, dq, dv, da);
  da.triangularView<Eigen::StrictlyLower>() = da.transpose().triangularView<Eigen::StrictlyLower>();
  return ::casadi::Function("inverse_dynamics_derivatives", {s.q, s.v, s.a, s.p},
                            {reduced(s, dq), reduced(s, dv), reduced(s, da)}, {"q", "v", "a", "p"},
                            {"dtau_dq", "dtau_dv", "M"});
}

}  // namespace bellcrank
