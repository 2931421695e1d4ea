#pragma once

#include <nanobind/nanobind.h>

namespace bellcrank {
// Adds integrate(), StepResult, methods() and tableau() to the module.
void bind_integrate(nanobind::module_& m);
}  // namespace bellcrank
