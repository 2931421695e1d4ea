// Frame placements and velocities, kinetic and potential energy.
#include "symbolic.hpp"

#include "pinocchio/algorithm/kinematics.hpp"

namespace bellcrank {

const Workspace& kinematics(Symbolic& s) {
  if (!s.placed) {
    auto data = std::make_unique<Workspace>(s.model);
    pinocchio::forwardKinematics(s.model, *data, s.q_full, s.v_full);
    s.placed = std::move(data);
  }
  return *s.placed;
}

::casadi::Function Tree::energy() const {
  const Symbolic& s = *symbolic_;
  const Workspace& data = kinematics(*symbolic_);
  // Pinocchio's own kinetic energy leaves out the armature of joints along no coordinate axis.
  SX twice = 0.0, potential = 0.0;
  for (int j = 1; j < s.model.njoints; ++j) {
    const auto& body = s.model.inertias[j];
    twice += body.vtiv(data.v[j]);
    SX rotors = 0.0;
    for (int i = s.model.idx_vs[j]; i < s.model.idx_vs[j] + s.model.nvs[j]; ++i)
      rotors += s.model.armature[i] * (s.v_full[i] * s.v_full[i]);
    twice += rotors;
    Model::SE3::Vector3 centre;
    centre.noalias() = data.oMi[j].translation() + data.oMi[j].rotation() * body.lever();
    potential -= body.mass() * centre.dot(s.model.gravity.linear());
  }
  const SX kinetic = 0.5 * twice;
  return ::casadi::Function("energy", {s.q, s.v, s.p}, {vertcat(kinetic, potential)}, {"q", "v", "p"}, {"energy"});
}

::casadi::Function Tree::frames(const std::vector<int>& which) const {
  const Symbolic& s = *symbolic_;
  const Workspace& data = kinematics(*symbolic_);
  std::vector<SX> rows;
  for (const int f : which) {
    const auto joint = s.description.frames.at(f).parent_joint;
    const auto& in_joint = s.frame_placements.at(f);
    const Model::SE3 placement = data.oMi[joint] * in_joint;
    const auto velocity = in_joint.actInv(data.v[joint]);  // in the frame's own axes
    for (int i = 0; i < 3; ++i) rows.push_back(placement.translation()[i]);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) rows.push_back(placement.rotation()(i, j));
    const Model::SE3::Vector3 linear = placement.rotation() * velocity.linear();
    const Model::SE3::Vector3 angular = placement.rotation() * velocity.angular();
    for (int i = 0; i < 3; ++i) rows.push_back(linear[i]);
    for (int i = 0; i < 3; ++i) rows.push_back(angular[i]);
  }
  return ::casadi::Function("frames", {s.q, s.v, s.p}, {vertcat(rows)}, {"q", "v", "p"}, {"frames"});
}

}  // namespace bellcrank
