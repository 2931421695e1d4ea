// Extremes of observed quantities in lanes.
#pragma once

#include "lane_runge_kutta.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <class Method>
class LaneObservation {
 public:
  LaneObservation(LaneEquations& equations, LaneRungeKutta<Method>& method) : equations_(equations), method_(method) {}

  // The extremes at the starts (t_old, old) of a block's runs, into its least and largest.
  void begin(LaneBlock&) {}

  // The steps just accepted in `lanes`, which no event has ended.
  void add(LaneBlock&, Bits) {}

 private:
  LaneEquations& equations_;
  LaneRungeKutta<Method>& method_;
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
