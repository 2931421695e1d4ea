// Pinocchio's derivatives of dynamics in C++: a loop over samples, one row each, as libpinocchio's wheel has them.
#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/serialization.hpp>

#include <sstream>

namespace {

struct Robot {
  pinocchio::Model model;
  pinocchio::Data data;
};

using Vector = Eigen::VectorXd;
using Square = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

}  // namespace

extern "C" {

// The robot of what Model.saveToString() wrote, or null.
void* new_robot(const char* text) {
  try {
    auto* robot = new Robot;
    std::istringstream stream(text);
    pinocchio::serialization::loadFromStringStream(robot->model, stream);
    robot->data = pinocchio::Data(robot->model);
    return robot;
  } catch (const std::exception&) {
    return nullptr;
  }
}

void delete_robot(void* robot) { delete static_cast<Robot*>(robot); }

// For n states; the results (n, nv, nv) are written where `by_q` is not null.
void derivatives(void* of, int forward, const double* q, const double* v, const double* third, double* by_q,
                 double* by_v, double* by_third, long n) {
  auto& [model, data] = *static_cast<Robot*>(of);
  const int nq = model.nq, nv = model.nv, size = nv * nv;
  Vector position(nq), velocity(nv), last(nv);
  for (long i = 0; i < n; ++i) {
    position = Eigen::Map<const Vector>(q + i * nq, nq);
    velocity = Eigen::Map<const Vector>(v + i * nv, nv);
    last = Eigen::Map<const Vector>(third + i * nv, nv);
    if (forward) {
      pinocchio::computeABADerivatives(model, data, position, velocity, last);
    } else {
      pinocchio::computeRNEADerivatives(model, data, position, velocity, last);
    }
    if (!by_q) continue;
    if (forward) {
      Square(by_q + i * size, nv, nv) = data.ddq_dq;
      Square(by_v + i * size, nv, nv) = data.ddq_dv;
      Square(by_third + i * size, nv, nv) = data.Minv.selfadjointView<Eigen::Upper>();
    } else {
      Square(by_q + i * size, nv, nv) = data.dtau_dq;
      Square(by_v + i * size, nv, nv) = data.dtau_dv;
      Square(by_third + i * size, nv, nv) = data.M.selfadjointView<Eigen::Upper>();
    }
  }
}

}
