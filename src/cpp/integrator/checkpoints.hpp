// Checkpoints: every few seconds Python gets what a long run has found since the last time, to keep it on disk.
#pragma once

#include <chrono>
#include <utility>

#include <nanobind/nanobind.h>

namespace bellcrank {

class Checkpoints {
 public:
  Checkpoints(nanobind::object take, double seconds) : take_(std::move(take)), next_(after(seconds)) {}

  bool due() const { return !take_.is_none() && Clock::now() >= next_; }

  // Calls Python with a block, with the GIL held; it returns the seconds until the next. False where it raised.
  bool hand_over(const nanobind::object& block) {
    PyObject* answer = PyObject_CallFunctionObjArgs(take_.ptr(), block.ptr(), nullptr);
    if (!answer) return false;
    const double seconds = PyFloat_AsDouble(answer);
    Py_DECREF(answer);
    if (PyErr_Occurred()) return false;
    next_ = after(seconds);
    return true;
  }

 private:
  using Clock = std::chrono::steady_clock;

  nanobind::object take_;
  Clock::time_point next_;

  static Clock::time_point after(double seconds) {
    return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  }
};

}  // namespace bellcrank
