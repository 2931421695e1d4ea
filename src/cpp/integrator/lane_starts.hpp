// The runs that are about to start: as many as there are lanes are prepared at once, so that a lane that becomes free takes
// a run whose first slope and step size are known.
#pragma once

#include "lane_search.hpp"
#include "step_size_control.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// The next stop of a lane's run after time t, or its end, into `bound`; the last time at which stages are evaluated until
// then, into `latest`. Jumps closer together than rounding are one.
inline void next_stop(const Ensemble& e, LaneBlock& block, int lane, double t) {
  const double t1 = block.t1[lane], least = 1e-14 * t1;
  int low = 0, high = e.jump_count;
  while (low < high) {
    const int middle = (low + high) / 2;
    if (e.jumps[middle] > t + least) high = middle;
    else low = middle + 1;
  }
  const bool inside = low < e.jump_count && e.jumps[low] < t1 - least;
  const bool at_end = low < e.jump_count && !inside && e.jumps[low] <= t1 + least;
  const double bound = inside ? e.jumps[low] : t1;
  block.bound[lane] = bound;
  block.latest[lane] = inside || at_end ? std::nextafter(at_end ? smaller(e.jumps[low], t1) : bound, 0.0) : INFINITY;
}

template <class Method>
class LaneStarts {
 public:
  LaneStarts(LaneEquations& equations, LaneSearch<Method>& search, Worker& worker)
      : ensemble_(equations.ensemble), problem_(equations.problem), equations_(equations), search_(search),
        worker_(worker), block_(ensemble_, 1) {}

  // Puts the next run into a lane of a block; false where there is none left.
  bool next(LaneBlock& block, int lane) {
    while (!ready_ && !worker_.stopped()) {
      std::int64_t first = 0;
      const int count = worker_.take(width, &first);
      if (count == 0) return false;
      prepare(first, count);
    }
    if (!ready_) return false;
    const int from = __builtin_ctz(ready_);
    ready_ &= ready_ - 1;
    block.copy_start(lane, block_, from);
    return true;
  }

 private:
  const Ensemble& ensemble_;
  const Problem& problem_;
  LaneEquations& equations_;
  LaneSearch<Method>& search_;
  Worker& worker_;
  LaneBlock block_;
  Bits ready_ = 0;

  // Runs first … first + count - 1; those that do not get as far as a step are done with.
  void prepare(std::int64_t first, int count) {
    for (int l = 0; l < width; ++l) read(l, first + (l < count ? l : 0));
    const Bits taken = (1u << count) - 1;
    equations_.normalise(block_.old);
    search_.begin(block_);
    const Bits moving = taken & bits(block_.t1 > 0.0);
    end(taken & ~moving, Status::finished);
    block_.evaluations += 1.0;
    equations_.rhs(block_, block_.t_old, block_.old, block_.k);
    Mask real = Mask{} == 0;
    for (int i = 0; i < problem_.n; ++i) real &= finite(block_.k[i]);
    choose_step(mask(moving) & real);
    end(moving & bits(~real), Status::non_finite);
    ready_ = moving & bits(real);
  }

  void end(Bits lanes, Status status) {
    each(lanes, [&](int l) { write_end(ensemble_, worker_, block_, l, status, block_.t_old[l], block_.old); });
  }

  void read(int lane, std::int64_t row) {
    const Designs& d = ensemble_.designs;
    const auto of = [row](const double* values, double common) { return values ? values[row] : common; };
    LaneBlock& b = block_;
    b.design[lane] = static_cast<double>(row);
    b.t_old[lane] = b.t[lane] = 0;
    b.t1[lane] = d.t1[row];
    b.rtol[lane] = of(d.rtol, problem_.rtol), b.atol[lane] = of(d.atol, problem_.atol);
    b.step[lane] = of(d.step, problem_.step), b.first_step[lane] = of(d.first_step, problem_.first_step);
    b.max_step[lane] = of(d.max_step, problem_.max_step);
    b.max_evaluations[lane] = of(d.max_evaluations, static_cast<double>(problem_.max_evaluations));
    b.next[lane] = b.tried[lane] = b.bad[lane] = 0;
    b.untested[lane] = b.suspicions[lane] = b.unsuspicious[lane] = 0;
    b.evaluations[lane] = b.accepted[lane] = b.rejected[lane] = 0;
    for (int i = 0; i < d.np; ++i) b.p[i][lane] = d.p[row * d.np + i];
    for (int i = 0; i < b.n; ++i) b.old[i][lane] = d.x0[row * b.n + i];
    next_stop(ensemble_, b, lane, 0);
    equations_.pin(b, lane, 0, b.bound[lane]);
  }

  // The first step size (step_size_control.hpp, first_step).
  void choose_step(Mask wanted) {
    LaneBlock& b = block_;
    const Mask chosen = wanted & ~(b.step > 0.0) & ~(b.first_step > 0.0);
    b.next = b.step > 0.0 ? Vec{} : b.first_step;
    if (bits(chosen)) {
      const auto slope = [&](Vec after, const Vec* x, Vec* result) { equations_.rhs(b, after, x, result); };
      const Vec h = first_step<Vec>(problem_, b.atol, b.rtol, b.old, b.k, b.t1, b.bound, b.max_step, Method::estimator, slope);
      b.evaluations += chosen ? splat(1) : Vec{};
      b.next = chosen ? h : b.next;
    }
    b.next = b.step > 0.0 ? Vec{} : larger(smaller(b.next, b.max_step), 10.0 * spacing(b.t_old));
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
