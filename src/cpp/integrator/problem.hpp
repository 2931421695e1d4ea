// Input and output of the engine: plain data and virtual functions. The engine is compiled once for each instruction set
// and must share no inline function with the code that is compiled once.
#pragma once

#include <cstddef>
#include <cstdint>

namespace bellcrank {

using Kernel = std::int32_t (*)(const double* const* inputs, double* const* outputs);
using BatchKernel = std::int32_t (*)(const double* const* inputs, double* const* outputs, const std::int64_t* strides,
                                     std::int64_t rows);

enum class Status : int { finished, event, step_too_small, non_finite, evaluations_spent, interrupted, chattering, contact };

// A piecewise polynomial of the time: breaks (pieces + 1), coefficients (pieces, powers, width), ascending powers.
struct Signal {
  const double *breaks, *coefficients;
  int pieces, powers, width, derivatives;
  bool kinked;  // value or slope jumps at the breaks: every break is a stop
};

struct Unit {
  int start, length;
};

// The parts of q and v of a joint: q' of a joint depends on its own q and v alone.
struct JointBlock {
  int q, nq, v, nv;
};

// The derivatives of rhs by x: the whole matrix, column by column, or along many directions at once.
struct DerivativeKernels {
  Kernel jacobian;
  BatchKernel tangent;
  int lanes;
};
class Derivatives {
 public:
  virtual DerivativeKernels kernels() = 0;  // may have to compile them

 protected:
  ~Derivatives() = default;
};

// Entries of u that change only at instants of a run: they follow those of the signals. First the sides of switches, the
// signs of functions of (t, x, u, p); then what updates compute anew at first, first + period, …
struct Update {
  Kernel kernel;  // (t, x, u, p) -> all entries after the sides; 0: the record computes them
  double first, period;
};
struct HeldEntries {
  int count, switch_count;  // sides first, then modes, then what updates compute
  int mode_count;           // of joints with dry friction or stops; four entries each (held_entries.hpp)
  // 0 dry friction, 1 a stop, 2 one that latches, 3 a joint without forces in a linkage, 4 dry friction of a gear with losses
  // by load
  const int* mode_kinds;
  const int* mode_sides;    // which of the switches is the side of a gear with losses by load, or -1
  const int* mode_ends;     // whether a contact, or friction that brings a joint to rest, ends the run; 0: none does
  const int *mode_rows, *mode_places;  // the entries of x that are their velocities (-1: none), and positions
  int work_row;             // the entry of x that is the work, which impacts change, or -1
  int response_rows;        // how many entries of x, from nq on, forces of modes accelerate
  Kernel turn;              // (t, x, u, p) -> velocity (m), acceleration without the forces of joints at rest (m), the
                            // response of all velocities to each force (m, response_rows), that of the joints (m, m),
                            // least and largest force at rest (m, m), forces of sliding joints (m), lower and upper stop
                            // (m, m), restitution (m), the joints' own inertias (m)
  const double* start;  // (count)
  Kernel switches;      // (t, x, u, p) -> the functions of sides, and those that are positive while modes last
  const Update* updates;
  int update_count;
};

struct Problem {
  Kernel rhs, events;
  Kernel fallback;  // used where the second output of rhs, a guard, is not positive; 0: there is no guard
  Kernel project, project_fallback;  // correction of x; the first gives a guard as well; or 0
  BatchKernel project_batch;  // `project` for many states at once, where there are no signals; or 0
  int nq, nv;
  const double* weights;  // (nq) 1 over the characteristic size of each position, for corrections; 0: all are 1
  bool staged;  // rhs and fallback take k and s as well and evaluate at x + s k
  Derivatives* derivatives;  // for implicit methods; or 0
  const JointBlock* joints;  // the blocks of q and v, one a joint, in ascending order and without gaps; or 0
  int joint_count;
  int n, norm_size, lanes;
  bool mixed;  // there are states beside positions and velocities, before what norm_size leaves out
  double t0, t1;
  const double *x0, *p;
  double rtol, atol, step, first_step, max_step;
  const double* times;
  std::size_t time_count;
  bool every_step;
  const Unit* units;
  int unit_count;
  const Signal* signals;
  int signal_count, signal_entries;  // the entries of u, held ones included
  HeldEntries held;
  const double* stops;  // sorted, strictly between t0 and t1
  int stop_count;
  double latest;  // the last time at which stages are evaluated: just before a stop at t1, else infinite
  const bool* terminal;
  const int* direction;
  int event_count, event_samples;
  Kernel observe;  // the quantities whose extremes are wanted; or 0
  int observed, observed_within;  // how many they are; how many of the first are looked at within steps too
  std::int64_t max_evaluations;
};

struct Counts {
  std::int64_t accepted = 0, rejected = 0, evaluations = 0, jacobians = 0, factorisations = 0;
  std::int64_t stiff_steps = 0;  // steps of an explicit method that stiffness held short
  double stiff_since = __builtin_nan("");  // when the first of them began
  std::int64_t implicit_steps = 0, implicit_evaluations = 0;  // those of an implicit method
};

// Receives what the engine finds.
class Record {
 public:
  double *next_step = nullptr, *steps_end = nullptr;              // room for the ends of accepted steps
  double *least = nullptr, *largest = nullptr;                    // room for the extremes of what is observed
  virtual void more_steps() = 0;                                  // called where there is none
  virtual void output(double t, const double* x) = 0;
  virtual void event(int index, double t, const double* x) = 0;
  virtual void unresolved(int index, double t) = 0;  // crossings may be missed in the step from t on
  virtual void undefined(int index, double t) = 0;   // the event function is NaN in this step, first at t
  virtual void switched(double, bool) {}  // from this time on the method is implicit, or explicit again
  virtual void end(double t, const double* x) = 0;
  virtual void hold(double, const double*) {}  // from this time on the held entries of u have these values
  // Update number k, where it has no kernel: changes the entries after the sides. False: it failed.
  virtual bool update(int, double, const double*, double*) { return false; }
  // Called between steps, at time t and state x; true: stop. `attempts` becomes the number of steps until the next call.
  virtual bool look(double t, const double* x, const Counts& counts, std::int64_t* attempts) = 0;

 protected:
  ~Record() = default;
};

constexpr const char* automatic = "auto";  // the method that switches between DOP853 and Radau

namespace baseline {
Status run(const char* method, const Problem& problem, Record& record, Counts& counts);
}
namespace avx2 {
Status run(const char* method, const Problem& problem, Record& record, Counts& counts);
}

}  // namespace bellcrank
