// What tree.cpp builds and the algorithms' files read: model, symbols and the mimic map.
#pragma once

#include <memory>

#include "joints.hpp"
#include "tree.hpp"
#include "workspace.hpp"

namespace bellcrank {

struct Symbolic {
  Description description;
  Model model;                // every URDF joint a joint of its own, mimicking ones too
  std::vector<Model::SE3> frame_placements;  // in the parent joint's frame

  SX q, v, a, tau, p;               // independent coordinates
  VectorSX q_full, v_full, a_full;  // all joints' coordinates, as expressions of the independent ones
  // column of each full velocity coordinate in the independent ones, and its multiplier
  std::vector<int> column;
  std::vector<double> multiplier;

  std::unique_ptr<const Workspace> placed;  // of kinematics(), once it has run

  bool has_mimic() const { return !description.mimics.empty(); }

  // S' x: what acts on the joints, gathered on the independent coordinates.
  SX reduce(const VectorSX& full) const {
    std::vector<SX> out(v.size1(), SX(0.0));
    for (Eigen::Index i = 0; i < full.size(); ++i) out[column[i]] += SX(multiplier[i]) * full[i];
    return vertcat(out);
  }
};

const Workspace& kinematics(Symbolic& s);   // placements and velocities of all joints
SX reduced_mass_matrix(const Symbolic& s);  // of the independent coordinates
SX bias_force(const Symbolic& s);           // C(q, v) v + g(q) on the independent coordinates

}  // namespace bellcrank
