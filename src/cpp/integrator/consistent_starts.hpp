#pragma once

#include <nanobind/nanobind.h>

namespace bellcrank {
// Adds consistent_postures(), consistent_velocities(), followed_postures() and row_sizes() to the module.
void bind_consistent_starts(nanobind::module_& m);
}  // namespace bellcrank
