// Entry of the engine: chooses the stepper by method and number of states.
#pragma once

#include "integration_loop.hpp"
#include "stiffness_switching.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <class Method>
Status run_explicit(const Problem& problem, Record& record, Counts& counts) {
  switch ((problem.n + 3) / 4) {
    case 1: return IntegrationLoop<ExplicitRungeKutta<Method, 1>>(problem, record, counts)();
    case 2: return IntegrationLoop<ExplicitRungeKutta<Method, 2>>(problem, record, counts)();
    case 3: return IntegrationLoop<ExplicitRungeKutta<Method, 3>>(problem, record, counts)();
    case 4: return IntegrationLoop<ExplicitRungeKutta<Method, 4>>(problem, record, counts)();
    default: return IntegrationLoop<ExplicitRungeKutta<Method, 0>>(problem, record, counts)();
  }
}

Status run_automatic(const Problem& problem, Record& record, Counts& counts) {
  switch ((problem.n + 3) / 4) {
    case 1: return IntegrationLoop<StiffnessSwitching<1>>(problem, record, counts)();
    case 2: return IntegrationLoop<StiffnessSwitching<2>>(problem, record, counts)();
    case 3: return IntegrationLoop<StiffnessSwitching<3>>(problem, record, counts)();
    case 4: return IntegrationLoop<StiffnessSwitching<4>>(problem, record, counts)();
    default: return IntegrationLoop<StiffnessSwitching<0>>(problem, record, counts)();
  }
}

Status run(const char* method, const Problem& problem, Record& record, Counts& counts) {
  if (std::strcmp(method, Rk4::name) == 0) return run_explicit<Rk4>(problem, record, counts);
  if (std::strcmp(method, DormandPrince::name) == 0) return run_explicit<DormandPrince>(problem, record, counts);
  if (std::strcmp(method, Dop853::name) == 0) return run_explicit<Dop853>(problem, record, counts);
  if (std::strcmp(method, automatic) == 0) return run_automatic(problem, record, counts);
  switch ((problem.n + 3) / 4) {
    case 1: return IntegrationLoop<Radau<1>>(problem, record, counts)();
    case 2: return IntegrationLoop<Radau<2>>(problem, record, counts)();
    case 3: return IntegrationLoop<Radau<3>>(problem, record, counts)();
    default: return IntegrationLoop<Radau<0>>(problem, record, counts)();
  }
}

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
