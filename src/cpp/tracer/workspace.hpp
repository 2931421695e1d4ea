// The part of Pinocchio's Data that the traced algorithms read and write.
#pragma once

#include "joints.hpp"

namespace bellcrank {

// Pinocchio's own constructor also fills what no algorithm here touches, among it four nv x nv x nv arrays of symbols:
// at 400 joints 256 million of them. This one is proportional to the number of joints.
struct Workspace : Data {
  explicit Workspace(const Model& model) {
    const std::size_t n = model.njoints;
    joints.reserve(n);
    for (const auto& joint : model.joints)
      joints.push_back(pinocchio::CreateJointData<SX, 0, UrdfJoints>::run(joint));
    oMi.assign(n, SE3::Identity());
    liMi.assign(n, SE3::Identity());
    for (auto* motions : {&v, &a, &a_gf}) motions->assign(n, Motion::Zero());
    for (auto* forces : {&f, &h}) forces->assign(n, Force::Zero());
    for (auto* vector : {&tau, &u, &ddq}) *vector = VectorSX::Zero(model.nv);
  }
};

}  // namespace bellcrank
