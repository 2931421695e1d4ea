// Binding of lazy kernels (lazy_kernel.cpp).
#pragma once

#include <nanobind/nanobind.h>

namespace bellcrank {

void bind_lazy_kernel(nanobind::module_& m);

}  // namespace bellcrank
