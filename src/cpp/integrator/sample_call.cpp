// A compiled function of one sample, prepared so that a call costs little more than its evaluation: arrays are checked,
// the answer is allocated and the function evaluated in one call from Python.
#include "sample_call.hpp"

#include <cstdint>
#include <cstring>

namespace nb = nanobind;

namespace bellcrank {
namespace {

using Evaluate = std::int32_t (*)(const double* const* inputs, double* const* outputs);  // codegen/kernels.py

// A sum that is 0 where all numbers are finite, else NaN.
double not_finite(const double* x, Py_ssize_t size) {
  double sum = 0;
  for (Py_ssize_t i = 0; i < size; ++i) sum += x[i] * 0.0;
  return sum;
}

// The memory of a contiguous array of doubles of the expected size.
class Memory {
 public:
  Memory() = default;
  Memory(const Memory&) = delete;
  ~Memory() {
    if (held_) PyBuffer_Release(&view_);
  }
  // False where the object has no such memory; no error is left.
  bool get(PyObject* array, Py_ssize_t size, int flags) {
    if (PyObject_GetBuffer(array, &view_, flags) != 0) return PyErr_Clear(), false;
    held_ = true;
    return view_.format && std::strcmp(view_.format, "d") == 0 && view_.len == size * Py_ssize_t{8};
  }
  int dimensions() const { return view_.ndim; }
  double* data() const { return static_cast<double*>(view_.buf); }

 private:
  Py_buffer view_;
  bool held_ = false;
};

class SampleCall {
 public:
  static constexpr int most = 4;

  // The object that keeps the function's code in memory, the function's address, the sizes of its inputs, and the shape
  // of its one output; `array` is numpy.ndarray and `empty` numpy.empty.
  SampleCall(nb::object code, std::uintptr_t address, nb::tuple sizes, nb::tuple shape, nb::object array,
             nb::object empty)
      : code_(code), function_(reinterpret_cast<Evaluate>(address)), count_(static_cast<int>(nb::len(sizes))), shape_(shape),
        array_(array), empty_(empty) {
    if (count_ > most) throw nb::value_error("SampleCall: too many inputs");
    for (int k = 0; k < count_; ++k) sizes_[k] = nb::cast<Py_ssize_t>(sizes[k]);
    for (nb::handle length : shape) size_ *= nb::cast<Py_ssize_t>(length);
  }

  // A new array, or None where an input is not a finite vector of doubles of its size, or the answer is not finite.
  template <class... Arrays>
  nb::object call(Arrays... arrays) const {
    constexpr int given = sizeof...(Arrays);
    const nb::handle inputs[] = {arrays...};
    Memory memory[given], answer;
    const double* in[most];
    static const double nothing = 0;
    double sum = 0;
    if (given > count_) return nb::none();
    for (int k = 0; k < given; ++k) {
      if (reinterpret_cast<PyObject*>(Py_TYPE(inputs[k].ptr())) != array_.ptr() ||
          !memory[k].get(inputs[k].ptr(), sizes_[k], PyBUF_C_CONTIGUOUS | PyBUF_FORMAT) || memory[k].dimensions() != 1)
        return nb::none();
      in[k] = memory[k].data();
      sum += not_finite(in[k], sizes_[k]);
    }
    for (int k = given; k < count_; ++k) {
      if (sizes_[k] != 0) return nb::none();
      in[k] = &nothing;
    }
    if (sum != 0) return nb::none();
    PyObject* shape = shape_.ptr();
    nb::object made = nb::steal(PyObject_Vectorcall(empty_.ptr(), &shape, 1, nullptr));
    if (!made) throw nb::python_error();
    if (!answer.get(made.ptr(), size_, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | PyBUF_WRITABLE)) return nb::none();
    double* out[] = {answer.data()};
    if (function_(in, out) != 0 || not_finite(out[0], size_) != 0) return nb::none();
    return made;
  }

 private:
  nb::object code_;
  Evaluate function_;
  int count_;
  Py_ssize_t sizes_[most] = {}, size_ = 1;
  nb::object shape_, array_, empty_;
};

}  // namespace

void bind_sample_call(nb::module_& m) {
  using H = nb::handle;
  const auto any = nb::arg().none();
  nb::class_<SampleCall>(m, "SampleCall")
      .def(nb::init<nb::object, std::uintptr_t, nb::tuple, nb::tuple, nb::object, nb::object>())
      .def("__call__", [](const SampleCall& f, H a) { return f.call(a); }, any)
      .def("__call__", [](const SampleCall& f, H a, H b) { return f.call(a, b); }, any, any)
      .def("__call__", [](const SampleCall& f, H a, H b, H c) { return f.call(a, b, c); }, any, any, any);
}

}  // namespace bellcrank
