// What the engine is given and what it hands back: plain data and calls that are compiled once, because the engine
// itself is compiled once for each instruction set and must share no inline function with the rest.
#pragma once

#include <cstddef>
#include <cstdint>

namespace bellcrank {

using Kernel = std::int32_t (*)(const double* const* inputs, double* const* outputs);
using BatchKernel = std::int32_t (*)(const double* const* inputs, double* const* outputs, const std::int64_t* strides,
                                     std::int64_t rows);

enum class Status : int { finished, event, step_too_small, non_finite, evaluations_spent, interrupted };

// A piecewise polynomial of the time: breaks (pieces + 1), coefficients (pieces, powers, width), ascending powers.
struct Signal {
  const double *breaks, *coefficients;
  int pieces, powers, width, derivatives;
  bool kinked;  // value or slope jumps at breaks: every break is a stop
};

struct Unit {
  int start, length;
};

struct Problem {
  Kernel rhs, jacobian, events;
  Kernel fallback;  // where the right-hand side's second output, a guard, is negative; 0: no guard
  Kernel project, project_fallback;  // (x) -> correction of x, and the first a guard as well; or 0
  BatchKernel project_batch;                  // `project` for many states at once, where there are no signals; or 0
  int nq, nv;
  const double* weights;  // (nq) 1 over how large 1 is in a coordinate, for corrections; 0: all are 1
  bool staged;  // the right-hand side takes k and s too, and evaluates at x + s k
  BatchKernel tangent;
  int n, norm_size, lanes;
  double t0, t1;
  const double *x0, *p;
  double rtol, atol, step, first_step, max_step;
  const double* times;
  std::size_t time_count;
  bool every_step;
  const Unit* units;
  int unit_count;
  const Signal* signals;
  int signal_count, signal_entries;
  const double* stops;  // sorted, strictly between t0 and t1
  int stop_count;
  double latest;  // the last time that stages see: just before a stop at t1, else infinite
  const bool* terminal;
  const int* direction;
  int event_count, event_samples;
  std::int64_t max_evaluations;
};

struct Counts {
  std::int64_t accepted = 0, rejected = 0, evaluations = 0, jacobians = 0, factorisations = 0;
};

// Receives what the engine finds.
class Record {
 public:
  double *next_step = nullptr, *steps_end = nullptr;              // room for the ends of accepted steps
  virtual void more_steps() = 0;                                  // called where there is none
  virtual void output(double t, const double* x) = 0;
  virtual void event(int index, double t, const double* x) = 0;
  virtual void unresolved(int index, double t) = 0;               // crossings may be missed in the step from t on
  virtual void undefined(int index, double t) = 0;                // its function is not a number in this step, first at t
  virtual void end(double t, const double* x) = 0;
  // Between steps, at time t and state x; true: stop. `attempts` becomes the number of them until the next look.
  virtual bool look(double t, const double* x, const Counts& counts, std::int64_t* attempts) = 0;

 protected:
  ~Record() = default;
};

namespace baseline {
Status run(const char* method, const Problem& problem, Record& record, Counts& counts);
}
namespace avx2 {
Status run(const char* method, const Problem& problem, Record& record, Counts& counts);
}

}  // namespace bellcrank
