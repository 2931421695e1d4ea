// methods() and tableau(): the tables of coefficients for Python, whose tests prove their orders.
#include <cstddef>
#include <stdexcept>
#include <string>

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include "integrate.hpp"
#include "runge_kutta_tableaus.hpp"

namespace nb = nanobind;

namespace bellcrank {
namespace {

template <std::size_t Rows, std::size_t Columns>
nb::list matrix(const double (&a)[Rows][Columns], std::size_t rows, std::size_t columns) {
  nb::list list;
  for (std::size_t i = 0; i < rows; ++i) {
    nb::list row;
    for (std::size_t j = 0; j < columns; ++j) row.append(a[i][j]);
    list.append(row);
  }
  return list;
}

// The order, A, b and c of a method: the row of A after the stages holds the weights b.
template <class Method>
nb::dict table() {
  constexpr std::size_t stages = Method::stages;
  nb::dict dict;
  nb::list c;
  for (std::size_t i = 0; i < stages; ++i) c.append(Method::c[i]);
  dict["order"] = static_cast<int>(Method::order);
  dict["a"] = matrix(Method::a, stages, stages);
  dict["b"] = nb::list(matrix(Method::a, stages + 1, stages)[stages]);
  dict["c"] = c;
  return dict;
}

nb::dict tableau(const std::string& name) {
  if (name == Rk4::name) return table<Rk4>();
  if (name == DormandPrince::name) return table<DormandPrince>();
  if (name == Dop853::name) return table<Dop853>();
  if (name != RadauIIA::name) throw std::invalid_argument("tableau: unknown method");
  nb::dict dict = table<RadauIIA>();
  dict["transformation"] = matrix(RadauIIA::T, 3, 3);
  dict["inverse_transformation"] = matrix(RadauIIA::inverse_T, 3, 3);
  dict["eigenvalues"] = nb::make_tuple(RadauIIA::mu, RadauIIA::mu_real, RadauIIA::mu_imaginary);
  return dict;
}

nb::dict methods() {
  nb::dict dict;
  for (const char* name : {Rk4::name, DormandPrince::name, Dop853::name, RadauIIA::name})
    dict[name] = tableau(name)["order"];
  return dict;
}

}  // namespace

void bind_tableaus(nb::module_& m) {
  using namespace nb::literals;
  m.def("methods", &methods);
  m.def("tableau", &tableau, "method"_a);
}

}  // namespace bellcrank
