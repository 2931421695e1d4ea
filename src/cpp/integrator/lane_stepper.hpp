// Steps runs in lanes: every pass tries one step in each lane, at the lane's own time and step size. Steps that are
// rejected are tried again in the next pass while other lanes go on; a lane whose run has ended takes the next run. The
// formulas of a step are those of explicit_runge_kutta.hpp; the loops are two, because a lone run has its state, not other runs, in
// the lanes of a register: as the only run of a block it takes 1.1 (planar_2r_swing) to 8.6 times (four_bar) as long.
#pragma once

#include "lane_starts.hpp"
#include "stiffness_detection.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <class Method>
class LaneStepper {
 public:
  // leave_when_stiff: a run that becomes stiff is begun anew as a single run.
  LaneStepper(const Ensemble& e, Worker& worker, bool leave_when_stiff = false)
      : ensemble_(e), worker_(worker), equations_(e), method_(equations_), block_(e, Method::rows),
        search_(equations_, method_, worker), starts_(equations_, search_, worker), slope_(e.common.n),
        leave_when_stiff_(leave_when_stiff) {}

  // Runs designs until there are none left, or the worker is stopped.
  void operator()() {
    each(all_lanes, [&](int l) { refill(l); });
    while (active_ && !worker_.stopped()) {
      if (jumped_) resume();
      give_up();
      if (active_) attempt();
    }
  }

 private:
  static constexpr int last = Method::stages;

  const Ensemble& ensemble_;
  Worker& worker_;
  LaneEquations equations_;
  LaneRungeKutta<Method> method_;
  LaneBlock block_;
  LaneSearch<Method> search_;
  LaneStarts<Method> starts_;
  Vectors slope_;
  const bool leave_when_stiff_;
  Bits active_ = 0, jumped_ = 0;  // lanes that hold a run; that have passed a stop and need their first stage anew

  // The next run into a lane; one without keeps the last good state of its former run.
  void refill(int lane) {
    const Bits bit = 1u << lane;
    active_ |= bit, jumped_ &= ~bit;
    if (!search_.give_back(block_, lane)) {
      if (starts_.next(block_, lane)) return;
      if (search_.waiting()) search_.work();
      if (!search_.give_back(block_, lane)) return void(active_ &= ~bit);
    }
    end_steps(bit);
  }

  void end(Bits lanes, Status status) {
    each(lanes, [&](int l) {
      write_end(ensemble_, worker_, block_, l, status, block_.t_old[l], block_.old);
      refill(l);
    });
  }

  // The first stage anew after a stop, from the side after the jump.
  void resume() {
    LaneBlock& b = block_;
    const Mask wanted = mask(jumped_);
    jumped_ = 0;
    equations_.rhs(b, b.t_old, b.old, slope_);
    Mask real = Mask{} == 0;
    for (int i = 0; i < b.n; ++i) {
      real &= finite(slope_[i]);
      b.k[i] = wanted & real ? slope_[i] : b.k[i];
    }
    b.evaluations += wanted ? splat(1) : Vec{};
    search_.begin_again(b, bits(wanted & real));
    end(bits(wanted & ~real), Status::non_finite);
  }

  // Ends runs whose steps have become too small, or whose evaluations are used up.
  void give_up() {
    for (;;) {
      const LaneBlock& b = block_;
      const Mask small = ~(b.step > 0.0) & (b.next < 10.0 * spacing(b.t_old));
      const Bits bad = active_ & bits(small & (b.bad != 0.0)), too_small = active_ & bits(small) & ~bad;
      const Bits out_of_evaluations = active_ & bits(~small & (b.evaluations >= b.max_evaluations));
      if (!(bad | too_small | out_of_evaluations)) return;
      end(bad, Status::non_finite);
      end(too_small, Status::step_too_small);
      end(out_of_evaluations, Status::evaluations_spent);
    }
  }

  // One step in each lane.
  void attempt() {
    LaneBlock& b = block_;
    const Mask active = mask(active_), fixed = b.step > 0.0;
    const Vec until = active ? step_end(fixed) : b.t_old, h = until - b.t_old, proposed = b.next;
    method_.stages(b, h, b.x);
    if constexpr (Method::fsal) {
      equations_.normalise_and_project(b, until, b.x, active);
      method_.slope(b, until, b.x);
    }
    const Vec error = fixed ? Vec{} : method_.error_square(b, h);
    Mask good = active & (error < 1.0);
    if constexpr (!Method::fsal) {
      if (bits(good)) {
        equations_.normalise_and_project(b, until, b.x, good);
        method_.slope(b, until, b.x);
      }
    }
    b.evaluations += active ? splat(Method::stages - 1) + (Method::fsal | good ? splat(1) : Vec{}) : Vec{};
    good &= all_finite();
    adapt(h, proposed, until, error, active, good);
    const Bits failed = bits(active & fixed & ~good), stiff = leave_when_stiff_ ? stiff_lanes(h, good & ~fixed) : 0;
    proceed(bits(good) & ~stiff, until);
    end(failed, Status::non_finite);
    each(stiff, [&](int l) {
      worker_.single(static_cast<std::int64_t>(b.design[l]));
      refill(l);
    });
  }

  // Where the steps end: at the size to try, or at the next point of the grid of a fixed step; at stops at the latest.
  Vec step_end(Mask fixed) {
    LaneBlock& b = block_;
    const Vec end = smaller(b.t_old + b.next, b.bound);
    if (!bits(fixed)) return end;
    b.next += fixed & (b.next * b.step <= b.t_old + 1e-6 * b.step) ? splat(1) : Vec{};
    const Vec point = b.next * b.step;
    return fixed ? (point > b.bound - 1e-6 * b.step ? b.bound : point) : end;
  }

  Mask all_finite() const {
    const Vec *f = block_.k + last * block_.n, *x = block_.x;
    Vec sum = {};
    for (int i = 0; i < block_.n; ++i) sum += f[i] * 0.0 + x[i] * 0.0;
    return sum == 0.0;
  }

  // Counts the steps, and chooses the next sizes after steps of size h that were `good`, or were not.
  void adapt(Vec h, Vec proposed, Vec until, Vec error, Mask tried, Mask good) {
    LaneBlock& b = block_;
    const Mask rejected = tried & ~good, bad = ~(error < INFINITY) | (error < 1.0);
    b.accepted += good ? splat(1) : Vec{};
    b.rejected += rejected ? splat(1) : Vec{};
    if constexpr (Method::estimator > 0) {
      const Vec factor = size_factor<Method>(error);
      Vec next = size_after(h, factor, b.tried != 0.0, until == b.bound, proposed);
      next = larger(smaller(next, b.max_step), 10.0 * spacing(until));
      const Vec less = size_instead(h, factor, bad);
      const Mask free = ~(b.step > 0.0);
      b.next = free & good ? next : free & rejected ? less : b.next;
    }
    b.tried = rejected ? splat(1) : good ? Vec{} : b.tried;
    b.bad = rejected & bad ? splat(1) : tried ? Vec{} : b.bad;
  }

  // Lanes whose run has become stiff with this step of size h, by the rules of stiffness_switching.hpp.
  Bits stiff_lanes(Vec h, Mask good) {
    if constexpr (Method::estimator > 0) {
      using Rules = StiffnessDetector;
      LaneBlock& b = block_;
      b.untested += good ? splat(1) : Vec{};
      const Mask due = good & ((b.suspicions > 0.0) | (b.accepted <= Rules::early) | (b.untested >= Rules::interval));
      if (!bits(due)) return 0;
      const Mask suspicious = due & method_.held_short(b, h), calm = due & ~suspicious;
      b.untested = due ? Vec{} : b.untested;
      b.suspicions += suspicious ? splat(1) : Vec{};
      b.unsuspicious = suspicious ? Vec{} : b.unsuspicious + (calm & (b.suspicions > 0.0) ? splat(1) : Vec{});
      const Mask over = b.unsuspicious >= Rules::most_calm;
      b.suspicions = over ? Vec{} : b.suspicions, b.unsuspicious = over ? Vec{} : b.unsuspicious;
      const Vec left = (b.t1 - b.t_old) * (Method::stages / h);  // evaluations
      return bits((b.suspicions >= quick_series) & (left > costly)) & active_;
    }
    return 0;
  }

  // Searches the steps in `good` lanes, which were accepted and end at `until`; then the next steps begin there.
  void proceed(Bits good, Vec until) {
    LaneBlock& b = block_;
    if (!good) return;
    b.t = mask(good) ? until : b.t_old;
    const Bits doubtful = search_.look(b, good);
    end_steps(good & ~doubtful);
    each(doubtful, [&](int l) {
      search_.park(b, l);
      refill(l);
    });
  }

  // The next steps begin where those in `lanes` end, maybe after a stop, or in another run.
  void end_steps(Bits lanes) {
    LaneBlock& b = block_;
    const Mask accepted = mask(lanes);
    b.t_old = accepted ? b.t : b.t_old;
    const Vec* f = b.k + last * b.n;
    for (int i = 0; i < b.n; ++i) {
      b.old[i] = accepted ? b.x[i] : b.old[i];
      b.k[i] = accepted ? f[i] : b.k[i];
    }
    const Bits at_stop = lanes & bits(b.t_old == b.bound), finished = at_stop & bits(b.bound == b.t1);
    each(at_stop & ~finished, [&](int l) {
      next_stop(ensemble_, b, l, b.t_old[l]);
      equations_.pin(b, l, b.t_old[l], b.bound[l]);
      jumped_ |= 1u << l;
    });
    end(finished, Status::finished);
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
