// Binding of SampleCall (sample_call.cpp).
#pragma once

#include <nanobind/nanobind.h>

namespace bellcrank {

void bind_sample_call(nanobind::module_& m);

}  // namespace bellcrank
