// What accepted steps are searched for, in lanes: events, and extremes of observed quantities. Each step is sampled on a
// cheap polynomial. A run whose samples leave a doubt is taken out of its lane, with its step, and the lane goes on with
// another run; as soon as there is one such step for each lane, they are searched together. So one step with an event does
// not keep seven others waiting. What is found of a step depends on that step alone, whichever others it is searched with.
#pragma once

#include "lane_events.hpp"
#include "lane_observation.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <class Method>
class LaneSearch {
 public:
  LaneSearch(LaneEquations& equations, LaneRungeKutta<Method>& method, Worker& worker)
      : ensemble_(equations.ensemble), equations_(equations), worker_(worker), dense_(equations, method),
        events_(equations, method, dense_), observation_(equations, dense_), parked_(ensemble_, Method::rows),
        searched_(ensemble_, Method::rows), x_(ensemble_.common.n) {}

  // The starts (t_old, old) of a block's runs.
  void begin(LaneBlock& starts) {
    if (with_events()) events_.begin(starts);
    if (ensemble_.observed) observation_.begin(starts);
  }

  // Runs that go on after a jump of forces.
  void begin_again(LaneBlock& block, Bits lanes) {
    if (ensemble_.observed) observation_.begin_again(block, mask(lanes));
  }

  // The steps just accepted in `lanes`: those that leave a doubt are returned, the others are done with.
  Bits look(LaneBlock& block, Bits lanes) {
    if (!with_events() && !ensemble_.observed) return 0;
    const Mask clear = sample(block), done = mask(lanes) & clear;
    if (with_events()) events_.accept(block, done);
    if (ensemble_.observed) observation_.accept(block, done);
    return lanes & ~bits(clear);
  }

  // Takes a run that leaves a doubt out of its lane.
  void park(const LaneBlock& block, int lane) {
    if (parked_count_ == width) work();
    parked_.copy(parked_count_++, block, lane);
  }

  // Puts a run whose step has been searched into a lane of a block, where its step is to be ended; false: there is none.
  bool give_back(LaneBlock& block, int lane) {
    if (!ready_) return false;
    const int from = __builtin_ctz(ready_);
    ready_ &= ready_ - 1;
    block.copy_ends(lane, searched_, from, Method::stages);
    return true;
  }

  bool waiting() const { return parked_count_ > 0; }

  // Searches the steps that are kept. At most as many runs as there are lanes are kept afterwards: each that is parked
  // leaves a lane that takes one of them.
  void work() {
    LaneBlock& b = parked_;
    const Bits lanes = (1u << parked_count_) - 1;
    parked_count_ = 0;
    dense_.begin(b);
    Bits lost = lanes & ~bits(dense_.prepare(b, mask(lanes)));
    LaneEnds ends;
    ends.time = b.t;
    for (int i = 0; i < b.n; ++i) x_[i] = b.x[i];
    if (with_events()) {
      events_.search(b, lanes & ~lost & bits(b.eventful != 0.0), ends, x_);
      events_.accept(b, mask(lanes));
      lost |= ends.lost;
    }
    if (ensemble_.observed) {
      observation_.search(b, lanes & ~lost, ends.time, x_);
      observation_.accept(b, mask(lanes));
    }
    each(lost, [&](int l) { worker_.single(row(b, l)); });
    each(ends.ended & ~lost, [&](int l) {
      ensemble_.columns.stopped_by[row(b, l)] = ends.event[l];
      write_end(ensemble_, worker_, b, l, Status::event, ends.time[l], x_);
    });
    ready_ = lanes & ~lost & ~ends.ended;
    each(ready_, [&](int l) { searched_.copy_ends(l, b, l, Method::stages); });
  }

 private:
  const Ensemble& ensemble_;
  LaneEquations& equations_;
  Worker& worker_;
  LaneDenseOutput<Method> dense_;
  LaneEvents<Method> events_;
  LaneObservation<Method> observation_;
  LaneBlock parked_, searched_;  // runs with a step to be searched; and those whose step has been
  Vectors x_;
  int parked_count_ = 0;
  Bits ready_ = 0;  // lanes of searched_ that hold a run

  bool with_events() const { return ensemble_.common.event_count > 0; }
  static std::int64_t row(const LaneBlock& block, int lane) { return static_cast<std::int64_t>(block.design[lane]); }

  // Samples the steps in all lanes; false in those that leave a doubt.
  Mask sample(LaneBlock& b) {
    const bool few = with_events() && events_.few(), many = with_events() && !few, within = observation_.within();
    const Vec h = b.t - b.t_old;
    if (with_events() || within) dense_.begin(b);
    if (with_events()) events_.sample_ends(b);
    if (ensemble_.observed) observation_.sample_ends(b, b.t, b.x);
    for (int i = many ? 1 : 2; i < parts && (many || within); i += many ? 1 : 2) {
      const Vec time = b.t_old + place[i] * h;
      dense_.approximate(b, splat(place[i]), x_, i % 2 == 0);
      if (many) events_.sample(b, i, time, x_);
      if (within && i % 2 == 0) observation_.sample(b, i, time, x_);
    }
    if (few) {
      dense_.approximate(b, splat(0.5), x_, false);
      events_.sample(b, 1, b.t_old + 0.5 * h, x_);
    }
    Mask clear = Mask{} == 0;
    if (with_events()) {
      clear = events_.has_no_zero(b);
      b.eventful = clear ? Vec{} : splat(1);
    }
    return within ? clear & observation_.stays_within(b) : clear;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
