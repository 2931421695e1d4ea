// Steps runs in lanes: every pass attempts one step in each lane, at the lane's own time and step size. Steps that are
// rejected are tried again in the next pass while other lanes go on; a lane whose run has ended takes the next run.
#pragma once

#include "lane_events.hpp"
#include "lane_observation.hpp"
#include "lane_rows.hpp"
#include "lane_starts.hpp"
#include "step_size_control.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <class Method>
class LaneStepper {
 public:
  LaneStepper(const Ensemble& e, Worker& worker)
      : ensemble_(e), worker_(worker), equations_(e), method_(equations_), block_(e, Method::rows),
        events_(equations_, method_, worker), observation_(equations_, method_), starts_(equations_, events_,
        observation_, worker) {}

  // Runs designs until there are none left, or the worker is stopped.
  void operator()() {
    for (int l = 0; l < width; ++l) refill(l);
    while (active_ && !worker_.stopped()) {
      resume();
      give_up();
      if (active_) attempt();
    }
    if (!active_) events_.finish();
  }

 private:
  const Ensemble& ensemble_;
  Worker& worker_;
  LaneEquations equations_;
  LaneRungeKutta<Method> method_;
  LaneBlock block_;
  LaneEvents<Method> events_;
  LaneObservation<Method> observation_;
  LaneStarts<Method> starts_;
  Bits active_ = 0, jumped_ = 0;  // lanes that hold a run; that have passed a stop and need their first stage anew

  // The next run into a lane; an idle lane keeps harmless numbers.
  void refill(int lane) {
    active_ &= ~(1u << lane);
    if (!starts_.next(block_, lane)) return;
    active_ |= 1u << lane;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
