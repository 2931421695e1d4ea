#pragma once

#include <nanobind/nanobind.h>

namespace bellcrank {
// Adds integrate(), StepResult and StepBlock to the module.
void bind_integrate(nanobind::module_& m);
// Adds integrate_ensemble() and has_lanes().
void bind_ensemble(nanobind::module_& m);
// Adds propagate_sensitivities() and SensitivityResult.
void bind_sensitivities(nanobind::module_& m);
// Adds methods() and tableau().
void bind_tableaus(nanobind::module_& m);
}  // namespace bellcrank
