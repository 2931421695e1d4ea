// The step that a stepper took last, whatever its method. What is looked for within few steps, such as the time of an event,
// is compiled once for all steppers on this class; what is evaluated in every step takes the stepper's own type.
#pragma once

#include "right_hand_side.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

class LastStep {
 public:
  double t, t_old;  // its end and start
  virtual const double* state() const = 0;
  virtual const double* old_state() const = 0;
  // x at t_old + s (t - t_old) without new evaluations, by a finer or a coarser polynomial.
  virtual void approximate(double s, double* x, bool finer = true) = 0;
  // Computes the dense output if it is not there, which may cost evaluations; false where that fails.
  virtual bool prepare() = 0;
  // Repeats the step with another size, so that the state at t_old + h is the end of a step. False: not finite.
  virtual bool redo(double h, double* x) = 0;

 protected:
  ~LastStep() = default;
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
