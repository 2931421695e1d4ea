// Interruption: reads the clock between steps, and every 50 ms handles Ctrl-C and progress in Python.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include <nanobind/nanobind.h>

namespace bellcrank {

class Watch {
 public:
  explicit Watch(nanobind::object progress) : progress_(std::move(progress)) {}

  // Called without the GIL. True where the run has to stop. `attempts` becomes the number of steps until the next call:
  // it doubles while calls are less than 5 ms apart and falls where they are late, so that their cost is negligible.
  bool look(double t, std::int64_t* attempts) {
    const auto now = Clock::now();
    const double gap = seconds(now - last_look_);
    last_look_ = now;
    if (gap < 0.005) count_ = std::min<std::int64_t>(2 * count_, std::int64_t{1} << 40);
    else if (gap > 0.01) count_ = std::max<std::int64_t>(1, static_cast<std::int64_t>(count_ * 0.0075 / gap));
    *attempts = count_;
    if (seconds(now - last_call_) < 0.05) return false;
    last_call_ = now;
    return call(t);
  }

  // Handles Ctrl-C, and calls `progress` with what is reached if it was not called in the last 0.1 s.
  template <class T>
  bool call(T reached) {
    nanobind::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) return failed();
    const auto now = Clock::now();
    if (progress_.is_none() || seconds(now - last_progress_) < 0.1) return false;
    last_progress_ = now;
    PyObject* answer = PyObject_CallFunctionObjArgs(progress_.ptr(), nanobind::cast(reached).ptr(), nullptr);
    if (!answer) return failed();
    Py_DECREF(answer);
    return false;
  }

  // Called with the GIL, where Python raised: keeps the error, unless it is Ctrl-C. True: the run has to stop.
  bool failed() {
    if (PyErr_ExceptionMatches(PyExc_KeyboardInterrupt)) PyErr_Clear();
    else error_ = raised();
    return true;
  }

  // Raises what signal handlers or `progress` raised, unless it was Ctrl-C.
  void raise() {
    if (!error_) return;
    PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(error_)), error_);
    Py_CLEAR(error_);
    throw nanobind::python_error();
  }

 private:
  using Clock = std::chrono::steady_clock;
  static double seconds(Clock::duration d) { return std::chrono::duration<double>(d).count(); }

  nanobind::object progress_;
  Clock::time_point last_look_ = Clock::now(), last_call_ = last_look_, last_progress_ = last_look_;
  std::int64_t count_ = 1;
  PyObject* error_ = nullptr;

  static PyObject* raised() {
#if PY_VERSION_HEX >= 0x030C0000
    return PyErr_GetRaisedException();
#else
    PyObject *type, *value, *trace;
    PyErr_Fetch(&type, &value, &trace);
    PyErr_NormalizeException(&type, &value, &trace);
    if (trace) PyException_SetTraceback(value, trace);
    Py_XDECREF(type);
    Py_XDECREF(trace);
    return value;
#endif
  }
};

}  // namespace bellcrank
