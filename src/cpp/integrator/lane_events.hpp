// Events in lanes: where an event function changes sign in the steps that were just accepted.
#pragma once

#include "lane_runge_kutta.hpp"
#include "lane_rows.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <class Method>
class LaneEvents {
 public:
  LaneEvents(LaneEquations& equations, LaneRungeKutta<Method>& method, Worker& worker)
      : equations_(equations), method_(method), worker_(worker) {}

  // The event functions at the starts (t_old, old) of a block's runs, into its g.
  void begin(LaneBlock& starts) { equations_.events(starts, starts.t_old, starts.old, starts.g); }

  // A lane of the stepped block holds a new run.
  void start(LaneBlock&, int) {}

  // The events of the steps just accepted in `lanes`. Returns the lanes whose runs they end; the rows of these are
  // written (write_end) at once or until finish() returns.
  Bits search(LaneBlock&, Bits) { return 0; }

  // Writes all rows that are still to be written.
  void finish() {}

 private:
  LaneEquations& equations_;
  LaneRungeKutta<Method>& method_;
  Worker& worker_;
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
