// A robot's tree on symbolic scalars, and the algorithms that can be traced on it.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include <casadi/casadi.hpp>

namespace bellcrank {

enum class JointKind { RX, RY, RZ, Revolute, PX, PY, PZ, Prismatic, FreeFlyer, Planar, Spherical, Helical };

struct Placement {  // maps coordinates of the child frame into its parent's
  std::array<double, 9> rotation;  // row major
  std::array<double, 3> translation;
};

struct Joint {
  JointKind kind;
  double sign;  // -1: turns or slides against the axis of its kind
  int parent;  // joint index, 0 is the world
  std::array<double, 3> axis;
  double pitch;  // of a helical joint: translation along the axis, m per rad
  Placement placement;  // in the parent joint's frame
  double mass;
  std::array<double, 3> lever;    // centre of mass in the joint's frame
  std::array<double, 6> inertia;  // about the centre of mass: xx xy yy xz yz zz
  std::vector<double> armature;
};

struct Frame {
  int parent_frame;  // -1 for the first
  int parent_joint;
  int moving_joint;        // the joint this frame belongs to, or -1
  Placement placement;     // in the parent joint's frame
  Placement in_parent;     // in the parent frame
  std::array<double, 3> rpy;  // the same rotation as the file gives it: a parameter may set one angle of the three
  double mass;
  std::array<double, 3> lever;
  std::array<double, 6> inertia;
};

struct Mimic {  // q[follower] = multiplier q[leader] + offset
  int follower, leader;
  double multiplier, offset;
};

// One number of the model that stays a symbol. What: 0-2 origin x y z, 3-5 origin roll pitch yaw,
// 6 mass, 7-9 centre of mass x y z, 10-15 inertia xx xy yy xz yz zz (about the centre of mass, link
// axes), 16 a factor on the link's mass and inertia.
struct Setting {
  int frame, what, parameter;
};

struct Description {
  std::vector<Joint> joints;  // without the world
  std::vector<Frame> frames;
  std::vector<Mimic> mimics;
  std::vector<Setting> settings;
  std::array<double, 3> gravity;
  int parameters = 0;
};

struct Symbolic;  // the Pinocchio model and data; hidden, so that only the algorithms' files see them

class Tree {
 public:
  explicit Tree(const Description& description);
  ~Tree();

  ::casadi::Function inverse_dynamics() const;  // (q, v, a, p) -> tau
  ::casadi::Function inverse_dynamics_derivatives() const;  // (q, v, a, p) -> sparse dtau/dq, dtau/dv, M; dq in the
                                                // tangent space: to the right, as v
  ::casadi::Function reactions() const;         // (q, v, a, p) -> wrench through each joint, joint frame
  ::casadi::Function forward_dynamics() const;  // (q, v, tau, p) -> a
  ::casadi::Function mass_matrix() const;       // (q, p) -> M, dense, row by row
  ::casadi::Function energy() const;            // (q, v, p) -> kinetic, potential
  ::casadi::Function configuration_rate() const;  // (q, v) -> dq/dt
  ::casadi::Function frames(const std::vector<int>& which) const;  // (q, v, p) -> per frame: position,
                                                // rotation (row major), linear, angular velocity; world axes

 private:
  std::unique_ptr<Symbolic> symbolic_;
};

}  // namespace bellcrank
