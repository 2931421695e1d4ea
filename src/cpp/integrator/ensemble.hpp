// Input and output of the ensemble engine: many runs of the same equations, in SIMD lanes. As in problem.hpp, plain data
// and virtual functions: the engine is compiled once for each instruction set.
#pragma once

#include "problem.hpp"

namespace bellcrank {

// Functions of as many states as there are lanes, as structure of arrays (codegen/kernels.py, kind "lanes").
struct LaneKernels {
  int width;
  Kernel rhs, fallback, events, project, project_fallback, observe;
};

// What differs between runs, one row a run; null: all runs take what `common` says.
struct Designs {
  std::int64_t count;
  int np;
  const double *t1, *x0, *p;
  const double *rtol, *atol, *step, *first_step, *max_step, *max_evaluations;
};

// What is found of each run, one row a run; E event functions, m observed quantities.
struct Columns {
  bool *done, *single;
  std::int64_t *status, *stopped_by, *accepted, *rejected, *evaluations;
  double *end_time, *end_state;                     // (N), (N, n)
  std::int64_t *event_count, *unresolved, *undefined;  // (N, E)
  double *event_time, *event_state;                 // (N, E), (N, E, n): of the first, NaN before
  double *least, *largest;                          // (N, m)
  double *held_start, *held_end, *held_event;       // (N, h), (N, h), (N, E, h): of the h held entries
};

struct Ensemble {
  Problem common;  // its t1, x0, p, stops and latest are not used
  LaneKernels lanes;
  Designs designs;
  Columns columns;
  int observed, observed_within;
  const double* jumps;  // times of stops and of breaks of kinked signals, sorted
  int jump_count;
};

// What a thread's engine asks of the outside.
class Worker {
 public:
  // The next designs to be done, at most `most`: their number; `first` becomes the first of them.
  virtual int take(int most, std::int64_t* first) = 0;
  virtual void single(std::int64_t design) = 0;  // runs a design from its start by the integrator of single runs
  virtual void report(int designs) = 0;          // so many more are done
  virtual bool stopped() = 0;                    // whether the runs have to end at once

 protected:
  ~Worker() = default;
};

namespace baseline {
void run_lanes(const char* method, const Ensemble& ensemble, Worker& worker);
}
namespace avx2 {
void run_lanes(const char* method, const Ensemble& ensemble, Worker& worker);
}
namespace avx512 {
void run_lanes(const char* method, const Ensemble& ensemble, Worker& worker);
}

}  // namespace bellcrank
