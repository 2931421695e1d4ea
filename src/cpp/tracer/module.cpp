// bellcrank._trace: runs Pinocchio's algorithms on symbols and hands the expression graphs to Python.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "tree.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using bellcrank::Description;
using bellcrank::Tree;

namespace {

nb::bytes serialized(const ::casadi::Function& f) {
  const std::string text = f.serialize();
  return nb::bytes(text.data(), text.size());
}

template <typename T>
nb::ndarray<nb::numpy, T, nb::ndim<1>> array_of(std::vector<T>&& values) {
  auto* held = new std::vector<T>(std::move(values));
  nb::capsule owner(held, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return nb::ndarray<nb::numpy, T, nb::ndim<1>>(held->data(), {held->size()}, owner);
}

// The instructions of an SX function, one row each: operation, result, two arguments, constant.
nb::tuple instructions(nb::bytes text) {
  const auto f = ::casadi::Function::deserialize(std::string(text.c_str(), text.size()));
  const ::casadi_int n = f.n_instructions();
  std::vector<int32_t> op(n), result(n), first(n), second(n);
  std::vector<double> constant(n);
  for (::casadi_int k = 0; k < n; ++k) {
    op[k] = static_cast<int32_t>(f.instruction_id(k));
    const auto out = f.instruction_output(k);
    const auto in = f.instruction_input(k);
    result[k] = out.empty() ? -1 : static_cast<int32_t>(out[0]);
    if (op[k] == ::casadi::OP_OUTPUT && out.size() > 1) constant[k] = static_cast<double>(out[1]);
    if (op[k] == ::casadi::OP_CONST) constant[k] = f.instruction_constant(k);
    first[k] = in.size() > 0 ? static_cast<int32_t>(in[0]) : -1;
    second[k] = in.size() > 1 ? static_cast<int32_t>(in[1]) : -1;
  }
  nb::list outs;  // dense size, and where each stored entry lies in the dense vector
  for (::casadi_int k = 0; k < f.n_out(); ++k) {
    std::vector<int64_t> where;
    for (auto i : f.sparsity_out(k).find()) where.push_back(i);
    outs.append(nb::make_tuple(f.numel_out(k), array_of(std::move(where))));
  }
  nb::list ins;
  for (::casadi_int k = 0; k < f.n_in(); ++k) ins.append(f.numel_in(k));
  return nb::make_tuple(array_of(std::move(op)), array_of(std::move(result)), array_of(std::move(first)),
                        array_of(std::move(second)), array_of(std::move(constant)), ins, outs);
}

nb::dict operations() {
  using namespace ::casadi;
  nb::dict d;
  const std::pair<const char*, int> names[] = {
      {"assign", OP_ASSIGN}, {"add", OP_ADD}, {"sub", OP_SUB}, {"mul", OP_MUL}, {"div", OP_DIV}, {"neg", OP_NEG},
      {"exp", OP_EXP}, {"log", OP_LOG}, {"pow", OP_POW}, {"constpow", OP_CONSTPOW}, {"sqrt", OP_SQRT}, {"sq", OP_SQ},
      {"twice", OP_TWICE}, {"sin", OP_SIN}, {"cos", OP_COS}, {"tan", OP_TAN}, {"asin", OP_ASIN}, {"acos", OP_ACOS},
      {"atan", OP_ATAN}, {"lt", OP_LT}, {"le", OP_LE}, {"eq", OP_EQ}, {"ne", OP_NE}, {"not", OP_NOT}, {"and", OP_AND},
      {"or", OP_OR}, {"floor", OP_FLOOR}, {"ceil", OP_CEIL}, {"fmod", OP_FMOD}, {"fabs", OP_FABS}, {"sign", OP_SIGN},
      {"copysign", OP_COPYSIGN}, {"if_else_zero", OP_IF_ELSE_ZERO}, {"fmin", OP_FMIN}, {"fmax", OP_FMAX},
      {"inv", OP_INV}, {"sinh", OP_SINH}, {"cosh", OP_COSH}, {"tanh", OP_TANH}, {"atan2", OP_ATAN2},
      {"const", OP_CONST}, {"input", OP_INPUT}, {"output", OP_OUTPUT}, {"log1p", OP_LOG1P}, {"expm1", OP_EXPM1},
      {"hypot", OP_HYPOT}};
  for (const auto& [name, code] : names) d[nb::int_(code)] = name;
  return d;
}

}  // namespace

NB_MODULE(_trace, m) {
  using namespace bellcrank;
  nb::class_<Placement>(m, "Placement").def(nb::init<std::array<double, 9>, std::array<double, 3>>());
  nb::class_<Joint>(m, "Joint").def(
      "__init__",
      [](Joint* j, int kind, double sign, int parent, std::array<double, 3> axis, double pitch, Placement placement,
         double mass, std::array<double, 3> lever, std::array<double, 6> inertia, std::vector<double> armature) {
        new (j) Joint{static_cast<JointKind>(kind), sign, parent, axis, pitch, placement, mass, lever, inertia, armature};
      },
      "kind"_a, "sign"_a, "parent"_a, "axis"_a, "pitch"_a, "placement"_a, "mass"_a, "lever"_a, "inertia"_a,
      "armature"_a);
  nb::class_<Frame>(m, "Frame").def(
      nb::init<int, int, int, Placement, Placement, std::array<double, 3>, double, std::array<double, 3>,
               std::array<double, 6>>(),
      "parent_frame"_a, "parent_joint"_a, "moving_joint"_a, "placement"_a, "in_parent"_a, "rpy"_a, "mass"_a, "lever"_a,
      "inertia"_a);
  nb::class_<Mimic>(m, "Mimic").def(nb::init<int, int, double, double>());
  nb::class_<Setting>(m, "Setting").def(nb::init<int, int, int>());

  nb::class_<Tree>(m, "Tree")
      .def(
          "__init__",
          [](Tree* tree, std::vector<Joint> joints, std::vector<Frame> frames, std::vector<Mimic> mimics,
             std::vector<Setting> settings, std::array<double, 3> gravity, int parameters) {
            new (tree) Tree(Description{joints, frames, mimics, settings, gravity, parameters});
          },
          "joints"_a, "frames"_a, "mimics"_a, "settings"_a, "gravity"_a, "parameters"_a)
      .def("inverse_dynamics", [](const Tree& t) { return serialized(t.inverse_dynamics()); })
      .def("inverse_dynamics_derivatives", [](const Tree& t) { return serialized(t.inverse_dynamics_derivatives()); })
      .def("reactions", [](const Tree& t) { return serialized(t.reactions()); })
      .def("forward_dynamics", [](const Tree& t) { return serialized(t.forward_dynamics()); })
      .def("mass_matrix", [](const Tree& t) { return serialized(t.mass_matrix()); })
      .def("energy", [](const Tree& t) { return serialized(t.energy()); })
      .def("configuration_rate", [](const Tree& t) { return serialized(t.configuration_rate()); })
      .def("frames", [](const Tree& t, std::vector<int> which) { return serialized(t.frames(which)); });
  m.def("instructions", &instructions);
  m.def("operations", &operations);
}
