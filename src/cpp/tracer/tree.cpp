#include "symbolic.hpp"

namespace bellcrank {

namespace {

using SE3 = Model::SE3;
using Inertia = Model::Inertia;
using Matrix3 = SE3::Matrix3;
using Vector3 = SE3::Vector3;

SE3 placement_of(const Placement& m) {
  Matrix3 rotation;
  Vector3 translation;
  for (int i = 0; i < 3; ++i) {
    translation[i] = SX(m.translation[i]);
    for (int j = 0; j < 3; ++j) rotation(i, j) = SX(m.rotation[3 * i + j]);
  }
  return SE3(rotation, translation);
}

Matrix3 rotation_of(const SX& roll, const SX& pitch, const SX& yaw) {  // URDF: Rz(yaw) Ry(pitch) Rx(roll)
  const SX cr = cos(roll), sr = sin(roll), cp = cos(pitch), sp = sin(pitch), cy = cos(yaw), sy = sin(yaw);
  Matrix3 m;
  m << cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr,  //
      sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr,   //
      -sp, cp * sr, cp * cr;
  return m;
}

template <typename Values6>
Inertia inertia_of(const SX& mass, const Vector3& lever, const Values6& i) {
  return Inertia(mass, lever, pinocchio::Symmetric3Tpl<SX, 0>(i[0], i[1], i[2], i[3], i[4], i[5]));
}

Inertia inertia_of(double mass, const std::array<double, 3>& lever, const std::array<double, 6>& i) {
  const Vector3 c{SX(lever[0]), SX(lever[1]), SX(lever[2])};
  std::array<SX, 6> s;
  for (int k = 0; k < 6; ++k) s[k] = SX(i[k]);
  return inertia_of(SX(mass), c, s);
}

Model::JointModel joint_of(const Joint& j) {
  using namespace pinocchio;
  const Vector3 axis{SX(j.axis[0]), SX(j.axis[1]), SX(j.axis[2])};
  switch (j.kind) {
    case JointKind::RX: return JointModelRevoluteTpl<SX, 0, 0>();
    case JointKind::RY: return JointModelRevoluteTpl<SX, 0, 1>();
    case JointKind::RZ: return JointModelRevoluteTpl<SX, 0, 2>();
    case JointKind::Revolute: {
      JointModelRevoluteUnalignedTpl<SX, 0> model;
      model.axis = axis;  // unit already; the constructor would test it, and a symbol cannot be tested
      return model;
    }
    case JointKind::PX: return JointModelPrismaticTpl<SX, 0, 0>();
    case JointKind::PY: return JointModelPrismaticTpl<SX, 0, 1>();
    case JointKind::PZ: return JointModelPrismaticTpl<SX, 0, 2>();
    case JointKind::Prismatic: {
      JointModelPrismaticUnalignedTpl<SX, 0> model;
      model.axis = axis;
      return model;
    }
    case JointKind::FreeFlyer: return JointModelFreeFlyerTpl<SX, 0>();
    case JointKind::Planar: return JointModelPlanarTpl<SX, 0>();
    case JointKind::Spherical: return JointModelSphericalTpl<SX, 0>();
    case JointKind::Helical: {
      JointModelHelicalUnalignedTpl<SX, 0> model;
      model.axis = axis;
      model.m_pitch = SX(j.pitch);
      return model;
    }
  }
  throw std::invalid_argument("unknown joint kind");
}

struct Bodies {
  std::vector<SE3> joint_placements, frame_placements;
  std::vector<Inertia> inertias;
};

// Placements and inertias as the model has them: every number a constant.
Bodies constant_bodies(const Description& d) {
  Bodies b;
  for (const Joint& j : d.joints) {
    b.joint_placements.push_back(placement_of(j.placement));
    b.inertias.push_back(inertia_of(j.mass, j.lever, j.inertia));
  }
  for (const Frame& f : d.frames) b.frame_placements.push_back(placement_of(f.placement));
  return b;
}

// The same, composed again along the frames, so that a symbol in one reaches all that hang on it.
Bodies symbolic_bodies(const Description& d, const SX& p) {
  Bodies b;
  b.joint_placements.assign(d.joints.size(), SE3::Identity());
  b.inertias.assign(d.joints.size(), Inertia::Zero());
  for (std::size_t k = 0; k < d.frames.size(); ++k) {
    const Frame& f = d.frames[k];
    SE3 in_parent = placement_of(f.in_parent);
    SX mass(f.mass), factor(1.0);
    Vector3 lever{SX(f.lever[0]), SX(f.lever[1]), SX(f.lever[2])};
    std::array<SX, 6> inertia;
    for (int i = 0; i < 6; ++i) inertia[i] = SX(f.inertia[i]);
    std::array<SX, 3> rpy{SX(f.rpy[0]), SX(f.rpy[1]), SX(f.rpy[2])};
    bool turned = false;
    for (const Setting& s : d.settings) {
      if (s.frame != static_cast<int>(k)) continue;
      const SX value = p(s.parameter);
      if (s.what < 3) in_parent.translation()[s.what] = value;
      else if (s.what < 6) {
        rpy[s.what - 3] = value;
        turned = true;
      } else if (s.what == 6) mass = value;
      else if (s.what < 10) lever[s.what - 7] = value;
      else if (s.what < 16) inertia[s.what - 10] = value;
      else factor = value;
    }
    if (turned) in_parent.rotation() = rotation_of(rpy[0], rpy[1], rpy[2]);
    const SE3 placement = f.parent_frame < 0 ? in_parent : b.frame_placements[f.parent_frame] * in_parent;
    if (f.moving_joint > 0) {
      b.joint_placements[f.moving_joint - 1] = placement;
      b.frame_placements.push_back(SE3::Identity());
    } else {
      b.frame_placements.push_back(placement);
    }
    if (f.parent_joint > 0) {
      for (auto& i : inertia) i *= factor;
      b.inertias[f.parent_joint - 1] += b.frame_placements.back().act(inertia_of(mass * factor, lever, inertia));
    }
  }
  return b;
}

}  // namespace

Tree::Tree(const Description& d) : symbolic_(new Symbolic) {
  Symbolic& s = *symbolic_;
  s.description = d;
  s.p = SX::sym("p", d.parameters);
  Bodies bodies = d.settings.empty() ? constant_bodies(d) : symbolic_bodies(d, s.p);
  s.frame_placements = bodies.frame_placements;

  Model& model = s.model;
  for (std::size_t k = 0; k < d.joints.size(); ++k) {
    const Joint& j = d.joints[k];
    const auto index = model.addJoint(j.parent, joint_of(j), bodies.joint_placements[k], std::to_string(k));
    model.inertias[index] = bodies.inertias[k];
    for (std::size_t i = 0; i < j.armature.size(); ++i)
      model.armature[model.idx_vs[index] + i] = SX(j.armature[i]);
  }
  for (int i = 0; i < 3; ++i) model.gravity.linear()[i] = SX(d.gravity[i]);
  model.gravity.angular().setZero();

  // Independent coordinates: those of every joint that mimics no other, in order.
  std::vector<const Mimic*> mimic_of(model.njoints, nullptr);
  for (const Mimic& m : d.mimics) mimic_of[m.follower] = &m;
  std::vector<int> first_q(model.njoints), first_v(model.njoints);
  int nq = 0, nv = 0;
  for (int j = 1; j < model.njoints; ++j) {
    if (mimic_of[j]) continue;
    first_q[j] = nq, first_v[j] = nv;
    nq += model.nqs[j], nv += model.nvs[j];
  }
  s.q = SX::sym("q", nq), s.v = SX::sym("v", nv), s.a = SX::sym("a", nv), s.tau = SX::sym("tau", nv);
  s.q_full.resize(model.nq), s.v_full.resize(model.nv), s.a_full.resize(model.nv);
  s.column.resize(model.nv), s.multiplier.resize(model.nv);
  for (int j = 1; j < model.njoints; ++j) {
    const int iq = model.idx_qs[j], iv = model.idx_vs[j];
    // an aligned joint against its axis turns by -q
    double multiplier = d.joints[j - 1].sign, offset = 0.0;
    int leader = j;
    while (mimic_of[leader]) {  // a follower may follow a follower
      const Mimic& m = *mimic_of[leader];
      offset += multiplier * m.offset;
      multiplier *= m.multiplier;
      leader = m.leader;
    }
    for (int i = 0; i < model.nqs[j]; ++i)
      s.q_full[iq + i] = multiplier * s.q(first_q[leader] + i) + offset;
    for (int i = 0; i < model.nvs[j]; ++i) {
      s.column[iv + i] = first_v[leader] + i;
      s.multiplier[iv + i] = multiplier;
      s.v_full[iv + i] = multiplier * s.v(first_v[leader] + i);
      s.a_full[iv + i] = multiplier * s.a(first_v[leader] + i);
    }
  }
}

Tree::~Tree() = default;

namespace {

// Writes ½ q ⊗ ω, the rate of the unit quaternion x y z w at iq for the angular velocity at iv, in the body's axes.
void quaternion_rate(const SX& q, int iq, const SX& v, int iv, SX& rate) {
  const SX x = q(iq), y = q(iq + 1), z = q(iq + 2), w = q(iq + 3);
  const SX w1 = v(iv), w2 = v(iv + 1), w3 = v(iv + 2);
  rate(iq) = 0.5 * (w * w1 + y * w3 - z * w2);
  rate(iq + 1) = 0.5 * (w * w2 + z * w1 - x * w3);
  rate(iq + 2) = 0.5 * (w * w3 + x * w2 - y * w1);
  rate(iq + 3) = -0.5 * (x * w1 + y * w2 + z * w3);
}

}  // namespace

// dq/dt = E(q) v, joint by joint: R v and ½ q ⊗ ω for a free flyer, ½ q ⊗ ω for a spherical joint, R2 v for a planar one.
::casadi::Function Tree::configuration_rate() const {
  const Symbolic& s = *symbolic_;
  SX rate = SX::zeros(s.q.size1(), 1);
  int iq = 0, iv = 0;
  std::vector<bool> follows(s.model.njoints, false);
  for (const Mimic& m : s.description.mimics) follows[m.follower] = true;
  for (std::size_t k = 0; k < s.description.joints.size(); ++k) {
    if (follows[k + 1]) continue;
    const JointKind kind = s.description.joints[k].kind;
    if (kind == JointKind::FreeFlyer) {
      const SX x = s.q(iq + 3), y = s.q(iq + 4), z = s.q(iq + 5), w = s.q(iq + 6);
      const SX u1 = s.v(iv), u2 = s.v(iv + 1), u3 = s.v(iv + 2);
      rate(iq) = (1 - 2 * (y * y + z * z)) * u1 + 2 * (x * y - w * z) * u2 + 2 * (x * z + w * y) * u3;
      rate(iq + 1) = 2 * (x * y + w * z) * u1 + (1 - 2 * (x * x + z * z)) * u2 + 2 * (y * z - w * x) * u3;
      rate(iq + 2) = 2 * (x * z - w * y) * u1 + 2 * (y * z + w * x) * u2 + (1 - 2 * (x * x + y * y)) * u3;
      quaternion_rate(s.q, iq + 3, s.v, iv + 3, rate);
      iq += 7, iv += 6;
    } else if (kind == JointKind::Spherical) {
      quaternion_rate(s.q, iq, s.v, iv, rate);
      iq += 4, iv += 3;
    } else if (kind == JointKind::Planar) {
      const SX c = s.q(iq + 2), sn = s.q(iq + 3);
      rate(iq) = c * s.v(iv) - sn * s.v(iv + 1);
      rate(iq + 1) = sn * s.v(iv) + c * s.v(iv + 1);
      rate(iq + 2) = -sn * s.v(iv + 2);
      rate(iq + 3) = c * s.v(iv + 2);
      iq += 4, iv += 3;
    } else {
      rate(iq++) = s.v(iv++);
    }
  }
  return ::casadi::Function("configuration_rate", {s.q, s.v}, {rate}, {"q", "v"}, {"rate"});
}

}  // namespace bellcrank
