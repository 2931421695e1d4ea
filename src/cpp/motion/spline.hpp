// Quintic splines (spline.cpp).
#pragma once

#include <nanobind/nanobind.h>

namespace bellcrank {

void bind_spline(nanobind::module_& m);

}  // namespace bellcrank
