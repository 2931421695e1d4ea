// The joint types that a robot's tree can hold, as a Pinocchio joint collection.
// Pinocchio's default collection has 25; instantiating only these keeps the build small.
#pragma once

#include "pinocchio/autodiff/casadi.hpp"

#include "pinocchio/multibody.hpp"

namespace bellcrank {

using SX = ::casadi::SX;

template <typename Scalar_, int Options_>
struct UrdfJoints {
  using Scalar = Scalar_;
  static constexpr int Options = Options_;

  using JointModelVariant = boost::variant<
      pinocchio::JointModelRevoluteTpl<Scalar, Options, 0>,
      pinocchio::JointModelRevoluteTpl<Scalar, Options, 1>,
      pinocchio::JointModelRevoluteTpl<Scalar, Options, 2>,
      pinocchio::JointModelRevoluteUnalignedTpl<Scalar, Options>,
      pinocchio::JointModelPrismaticTpl<Scalar, Options, 0>,
      pinocchio::JointModelPrismaticTpl<Scalar, Options, 1>,
      pinocchio::JointModelPrismaticTpl<Scalar, Options, 2>,
      pinocchio::JointModelPrismaticUnalignedTpl<Scalar, Options>,
      pinocchio::JointModelFreeFlyerTpl<Scalar, Options>,
      pinocchio::JointModelPlanarTpl<Scalar, Options>,
      pinocchio::JointModelSphericalTpl<Scalar, Options>,
      pinocchio::JointModelHelicalUnalignedTpl<Scalar, Options>>;

  using JointDataVariant = boost::variant<
      pinocchio::JointDataRevoluteTpl<Scalar, Options, 0>,
      pinocchio::JointDataRevoluteTpl<Scalar, Options, 1>,
      pinocchio::JointDataRevoluteTpl<Scalar, Options, 2>,
      pinocchio::JointDataRevoluteUnalignedTpl<Scalar, Options>,
      pinocchio::JointDataPrismaticTpl<Scalar, Options, 0>,
      pinocchio::JointDataPrismaticTpl<Scalar, Options, 1>,
      pinocchio::JointDataPrismaticTpl<Scalar, Options, 2>,
      pinocchio::JointDataPrismaticUnalignedTpl<Scalar, Options>,
      pinocchio::JointDataFreeFlyerTpl<Scalar, Options>,
      pinocchio::JointDataPlanarTpl<Scalar, Options>,
      pinocchio::JointDataSphericalTpl<Scalar, Options>,
      pinocchio::JointDataHelicalUnalignedTpl<Scalar, Options>>;
};

using Model = pinocchio::ModelTpl<SX, 0, UrdfJoints>;
using Data = pinocchio::DataTpl<SX, 0, UrdfJoints>;
using VectorSX = Model::VectorXs;

}  // namespace bellcrank
