// Outputs: states at requested times. States between steps are first projected onto the constraints, many at a time
// where there is a kernel for that.
#pragma once

#include "right_hand_side.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

class Outputs {
 public:
  Outputs(Rhs& rhs, Record& record)
      : rhs_(rhs), p_(rhs.problem), record_(record), width_(p_.nq + p_.nv), room_(p_.project_batch ? most : 0),
        x_(room_ * p_.n), plain_(p_.n), time_(room_), correction_(room_ * width_), guard_(room_), waits_(room_) {}

  // A state at the end of a step, which is projected already.
  void take(double t, const double* x) {
    if (!p_.project_batch) return record_.output(t, x);
    keep(t, x, false);
  }

  // A state between steps, which is not.
  void take_between(double t, double* x) {
    if (p_.project_batch) return keep(t, x, true);
    project_between(t, x);
    record_.output(t, x);
  }

  void flush() {
    for (int pass = 0; pass < passes && waiting_ >= p_.lanes && project(); ++pass) correct();
    for (int i = 0; i < count_; ++i) {
      double* x = x_ + i * p_.n;
      if (waits_[i]) project_between(time_[i], x);
      record_.output(time_[i], x);
    }
    count_ = waiting_ = 0;
  }

 private:
  static constexpr int most = 64, passes = 2;

  Rhs& rhs_;
  const Problem& p_;
  Record& record_;
  const int width_, room_;
  Buffer x_, plain_, time_, correction_, guard_;
  Array<bool> waits_;
  int count_ = 0, waiting_ = 0;

  void keep(double t, const double* x, bool waits) {
    std::memcpy(x_ + count_ * p_.n, x, p_.n * sizeof(double));
    time_[count_] = t;
    waits_[count_] = waits;
    waiting_ += waits;
    if (++count_ == most) flush();
  }

  // Projects a state between the ends of steps.
  void project_between(double t, double* x) {
    if (!p_.project) return rhs_.normalise(x);
    std::memcpy(plain_, x, p_.n * sizeof(double));
    rhs_.normalise_and_project(t, x);
    rhs_.keep_velocity(plain_, x);
  }

  bool project() {
    const double* const in[] = {time_, x_, rhs_.u(), p_.p};
    double* const out[] = {correction_, guard_};
    const std::int64_t strides[] = {1, p_.n, 0, 0};
    return p_.project_batch(in, out, strides, count_) == 0;
  }

  // Applies the corrections that need no fallback; a state that is exact to rounding waits no longer.
  void correct() {
    for (int i = 0; i < count_; ++i) {
      const double* d = correction_ + i * width_;
      const double size = rhs_.size(d);
      if (!waits_[i] || !(guard_[i] > 0) || !(size <= Rhs::safe)) continue;
      double* x = x_ + i * p_.n;
      std::memcpy(plain_, x, p_.n * sizeof(double));
      rhs_.correct(x, d);
      rhs_.keep_velocity(plain_, x);
      waits_[i] = size > Rhs::exact;
      waiting_ -= !waits_[i];
    }
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
