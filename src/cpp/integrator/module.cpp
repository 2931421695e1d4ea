// bellcrank._step: calls compiled functions. It depends on nothing but the interpreter, so that a run from the
// cache loads neither Pinocchio nor casadi.
#include <cstdint>
#include <memory>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "integrate.hpp"
#include "sample_call.hpp"

namespace nb = nanobind;

namespace {

using Evaluate = int32_t (*)(const double* const* inputs, double* const* outputs);  // codegen/kernels.py
using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Answer = nb::ndarray<nb::numpy, double, nb::ndim<1>>;

// One sample: a tuple of new vectors, or None where an input is not a contiguous vector of doubles of the expected
// size; the caller then converts, or says what is wrong.
nb::object evaluate(std::uintptr_t address, nb::tuple inputs, nb::tuple input_sizes, nb::tuple output_sizes) {
  const std::size_t count = nb::len(inputs), results = nb::len(output_sizes);
  if (count != nb::len(input_sizes)) return nb::none();
  std::vector<Vector> held(count);
  std::vector<const double*> in(count);
  for (std::size_t k = 0; k < count; ++k) {
    if (!nb::try_cast(inputs[k], held[k], false)) return nb::none();
    if (held[k].shape(0) != nb::cast<std::size_t>(input_sizes[k])) return nb::none();
    in[k] = held[k].data();
  }
  std::vector<double*> out(results);
  std::vector<nb::object> answers(results);
  for (std::size_t k = 0; k < results; ++k) {
    const auto size = nb::cast<std::size_t>(output_sizes[k]);
    auto memory = std::make_unique<double[]>(size);
    out[k] = memory.get();
    nb::capsule owner(memory.release(), [](void* p) noexcept { delete[] static_cast<double*>(p); });
    answers[k] = nb::cast(Answer(out[k], {size}, owner));
  }
  const int32_t status = reinterpret_cast<Evaluate>(address)(in.data(), out.data());
  if (status != 0) return nb::none();
  nb::list list;
  for (auto& answer : answers) list.append(answer);
  return nb::tuple(list);
}

}  // namespace

NB_MODULE(_step, m) {
  nb::set_leak_warnings(false);  // an error that ends the program may hold a result until after the interpreter
  m.def("evaluate", &evaluate);
  bellcrank::bind_sample_call(m);
  bellcrank::bind_integrate(m);
  bellcrank::bind_ensemble(m);
  bellcrank::bind_tableaus(m);
}
