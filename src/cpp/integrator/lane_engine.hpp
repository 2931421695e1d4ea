// Entry of the ensemble engine: chooses the stepper by method.
#pragma once

#include "lane_stepper.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

void run_lanes(const char* method, const Ensemble& ensemble, Worker& worker) {
  if (std::strcmp(method, Rk4::name) == 0) LaneStepper<Rk4>(ensemble, worker)();
  else if (std::strcmp(method, DormandPrince::name) == 0) LaneStepper<DormandPrince>(ensemble, worker)();
  else LaneStepper<Dop853>(ensemble, worker, std::strcmp(method, automatic) == 0)();
}

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
