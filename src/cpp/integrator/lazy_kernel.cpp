// Code that is made when a kernel is first called (codegen/machine_code.py): the kernel's entry calls this function, which calls
// Python.
#include "lazy_kernel.hpp"

#include <cstdint>
#include <system_error>
#include <thread>

namespace bellcrank {
namespace {

namespace nb = nanobind;

// The address of the code that the Python function makes; null where it made none. Called with the GIL or without.
// Python runs in a thread of its own: signal handlers run in the main thread alone, so that Ctrl-C waits until the
// integrator asks for it.
void* make_code(PyObject* maker) {
  void* address = nullptr;
  const auto call = [maker, &address]() noexcept {
    const PyGILState_STATE state = PyGILState_Ensure();
    PyObject* made = PyObject_CallNoArgs(maker);
    if (made) address = PyLong_AsVoidPtr(made);
    if (PyErr_Occurred()) PyErr_WriteUnraisable(maker);
    Py_XDECREF(made);
    PyGILState_Release(state);
  };
  const PyGILState_STATE state = PyGILState_Ensure();  // held from here on, whether it was or not
  PyThreadState* const held = PyEval_SaveThread();     // so that the other thread can take it
  try {
    std::thread(call).join();
  } catch (const std::system_error&) {  // there is no room for another thread
    call();
  }
  PyEval_RestoreThread(held);
  PyGILState_Release(state);
  return address;
}

}  // namespace

void bind_lazy_kernel(nb::module_& m) {
  m.def("code_maker", [] { return reinterpret_cast<std::uintptr_t>(&make_code); });
}

}  // namespace bellcrank
