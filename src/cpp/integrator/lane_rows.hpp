// The rows of the results of runs that end in a lane.
#pragma once

#include "lane_block.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// A run of a block's lane ends at time t and state x (n, one vector an entry).
inline void write_end(const Ensemble& e, Worker& worker, const LaneBlock& block, int lane, Status status, double t,
                      const Vec* x) {
  const Columns& c = e.columns;
  const std::int64_t row = static_cast<std::int64_t>(block.design[lane]);
  c.status[row] = static_cast<std::int64_t>(status);
  c.end_time[row] = t;
  for (int i = 0; i < block.n; ++i) c.end_state[row * block.n + i] = x[i][lane];
  c.accepted[row] = static_cast<std::int64_t>(block.accepted[lane]);
  c.rejected[row] = static_cast<std::int64_t>(block.rejected[lane]);
  c.evaluations[row] = static_cast<std::int64_t>(block.evaluations[lane]);
  for (int i = 0; i < e.observed; ++i) {
    c.least[row * e.observed + i] = block.least[i][lane];
    c.largest[row * e.observed + i] = block.largest[i][lane];
  }
  c.done[row] = true;
  worker.report(1);
}

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
