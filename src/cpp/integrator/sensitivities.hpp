// Sensitivities along a run: what the engine is given, and what it finds. Plain data, as in problem.hpp.
#pragma once

#include <cstdint>

#include "problem.hpp"

namespace bellcrank {

// A directional derivative (codegen/directional.py): at a point for one sample, then along directions in SIMD lanes.
// `guarded`: the point gives a guard before the tape; where it is not positive, another derivative stands in.
struct Directional {
  Kernel point, along;
  int tape;  // the size of what the point hands over
};

struct SensitivityProblem {
  Problem run;  // the equations of the run; its steps and its method are not used
  Directional rate, fallback, project, project_fallback;  // functions that are 0 do not exist
  int lanes, parameters, directions;
  const double *seeds, *changes;  // (directions, nq + nv) at t0; (directions, parameters): dp
  double tolerance, first_step;   // of sensitivities, relative to the largest of a direction so far
  const double* floors;           // (directions): smaller errors do not count
  bool given_steps;               // a step is tried from each bound to the next
  const double* bounds;           // times (bound_count) after t0 at which steps end, ascending
  const bool* marked;             // whether the sensitivities there are wanted
  std::size_t bound_count;
  const double *times, *states;   // rows of the run: (time_count), (time_count, n)
  std::size_t time_count;
};

struct SensitivityCounts {
  std::int64_t steps = 0, rejected = 0, evaluations = 0;
};

// Receives what is found.
class SensitivityRecord {
 public:
  virtual double* row(std::size_t index) = 0;      // where the sensitivities of a row belong: that of the first direction
  virtual double* mark(std::size_t index) = 0;     // and of a marked bound, counted from 0
  virtual std::size_t row_stride() const = 0;      // from one direction to the next
  virtual std::size_t mark_stride() const = 0;
  virtual bool interrupted() = 0;                  // asked now and then

 protected:
  ~SensitivityRecord() = default;
};

namespace baseline {
Status propagate(const SensitivityProblem& problem, SensitivityRecord& record, SensitivityCounts& counts);
}
namespace avx2 {
Status propagate(const SensitivityProblem& problem, SensitivityRecord& record, SensitivityCounts& counts);
}

}  // namespace bellcrank
