// bellcrank._step: calls compiled functions. It depends on nothing but the interpreter, so that a run from the
// cache loads neither Pinocchio nor casadi.
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include "../files/csv_rows.hpp"
#include "../motion/spline.hpp"
#include "consistent_starts.hpp"
#include "integrate.hpp"
#include "lazy_kernel.hpp"
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

using Rows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// A sample a row, one after another: a tuple of new matrices. An input of one row holds for all samples.
nb::tuple evaluate_rows(std::uintptr_t address, std::vector<Rows> inputs, std::vector<std::size_t> output_sizes,
                        std::size_t samples) {
  std::vector<const double*> in(inputs.size());
  std::vector<double*> out(output_sizes.size());
  std::vector<std::unique_ptr<double[]>> memory;
  for (const Rows& rows : inputs)
    if (rows.shape(0) != 1 && rows.shape(0) != samples) throw std::invalid_argument("evaluate_rows: rows differ");
  for (std::size_t size : output_sizes) memory.push_back(std::make_unique<double[]>(samples * size + 1));
  {
    nb::gil_scoped_release released;
    for (std::size_t i = 0; i < samples; ++i) {
      for (std::size_t k = 0; k < in.size(); ++k)
        in[k] = inputs[k].data() + (inputs[k].shape(0) > 1 ? i * inputs[k].shape(1) : 0);
      for (std::size_t k = 0; k < out.size(); ++k) out[k] = memory[k].get() + i * output_sizes[k];
      reinterpret_cast<Evaluate>(address)(in.data(), out.data());
    }
  }
  nb::list list;
  for (std::size_t k = 0; k < out.size(); ++k) {
    double* data = memory[k].release();
    nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<double*>(p); });
    list.append(nb::ndarray<nb::numpy, double, nb::ndim<2>>(data, {samples, output_sizes[k]}, owner));
  }
  return nb::tuple(list);
}

}  // namespace

NB_MODULE(_step, m) {
  nb::set_leak_warnings(false);  // an error that ends the program may hold a result until after the interpreter
  m.def("evaluate", &evaluate);
  m.def("evaluate_rows", &evaluate_rows);
  bellcrank::bind_sample_call(m);
  bellcrank::bind_lazy_kernel(m);
  bellcrank::bind_integrate(m);
  bellcrank::bind_ensemble(m);
  bellcrank::bind_sensitivities(m);
  bellcrank::bind_tableaus(m);
  bellcrank::bind_consistent_starts(m);
  bellcrank::bind_csv_rows(m);
  bellcrank::bind_spline(m);
}
