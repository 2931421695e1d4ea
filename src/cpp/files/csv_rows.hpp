// Rows of CSV files (csv_rows.cpp).
#pragma once

#include <nanobind/nanobind.h>

namespace bellcrank {

void bind_csv_rows(nanobind::module_& m);

}  // namespace bellcrank
