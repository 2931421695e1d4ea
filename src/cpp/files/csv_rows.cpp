// Rows of CSV files: Python takes several times as long to write a number as a run takes to compute it.
#include "csv_rows.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

namespace nb = nanobind;

namespace bellcrank {
namespace {

using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::device::cpu>;
using Codes = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::device::cpu>;

// One column: numbers, or texts by their codes.
struct Column {
  const double* numbers = nullptr;
  const std::int32_t* codes = nullptr;
  std::int64_t stride = 1;
  std::vector<std::string> texts;
};

constexpr int longest = 32;  // characters of a number

// The shortest decimal that is read back as the same number, as repr() writes it: in fixed notation from 1e-4 to 1e16.
#ifdef __cpp_lib_to_chars  // from GCC 11 on
using Unlocked = nb::gil_scoped_release;

char* write_number(double x, char* to) {
  char* const end = to + longest;
  const double size = std::fabs(x);
  if (!(size == 0 || (size >= 1e-4 && size < 1e16))) return std::to_chars(to, end, x, std::chars_format::scientific).ptr;
  char* const stop = std::to_chars(to, end, x, std::chars_format::fixed).ptr;
  for (const char* c = to; c != stop; ++c)
    if (*c == '.') return stop;
  stop[0] = '.', stop[1] = '0';
  return stop + 2;
}
#else  // Python's own, which needs the GIL and takes several times as long
struct Unlocked {
  Unlocked() {}
};

char* write_number(double x, char* to) {
  char* const text = PyOS_double_to_string(x, 'r', 0, Py_DTSF_ADD_DOT_0, nullptr);
  if (!text) throw std::bad_alloc();
  char* const stop = std::copy_n(text, std::strlen(text), to);
  PyMem_Free(text);
  return stop;
}
#endif

void append(const Column& column, std::size_t row, bool blank, std::string& to) {
  if (column.codes) {
    to += column.texts[static_cast<std::size_t>(column.codes[static_cast<std::int64_t>(row) * column.stride])];
    return;
  }
  const double x = column.numbers[static_cast<std::int64_t>(row) * column.stride];
  if (std::isfinite(x)) {
    char text[longest];
    to.append(text, write_number(x, text));
  } else if (!blank) {
    to += std::isnan(x) ? "nan" : x > 0 ? "inf" : "-inf";
  }
}

// A row a line: numbers (n,), or codes (n,) of texts with these texts.
nb::bytes csv_rows(nb::list columns, bool blank) {
  std::vector<Column> read;
  std::size_t rows = 0;
  const auto add = [&](auto array, Column& column) {
    if (!read.empty() && array.shape(0) != rows) throw std::invalid_argument("csv_rows: columns differ in length");
    rows = array.shape(0), column.stride = array.stride(0);
    return array.data();
  };
  for (nb::handle each : columns) {
    Column column;
    if (nb::isinstance<nb::tuple>(each)) {
      const auto pair = nb::borrow<nb::tuple>(each);
      column.texts = nb::cast<std::vector<std::string>>(pair[1]);
      column.codes = add(nb::cast<Codes>(pair[0], false), column);
      for (std::size_t row = 0; row < rows; ++row) {
        const std::int32_t code = column.codes[static_cast<std::int64_t>(row) * column.stride];
        if (code < 0 || static_cast<std::size_t>(code) >= column.texts.size())
          throw std::invalid_argument("csv_rows: a code has no text");
      }
    } else {
      column.numbers = add(nb::cast<Numbers>(each, false), column);
    }
    read.push_back(std::move(column));
  }
  std::string text;
  {
    const Unlocked unlocked;
    text.reserve(rows * read.size() * 20);
    for (std::size_t row = 0; row < rows; ++row)
      for (std::size_t k = 0; k < read.size(); ++k) {
        append(read[k], row, blank, text);
        text += k + 1 < read.size() ? ',' : '\n';
      }
  }
  return nb::bytes(text.data(), text.size());
}

}  // namespace

void bind_csv_rows(nb::module_& m) {
  using namespace nb::literals;
  m.def("csv_rows", &csv_rows, "columns"_a, "blank"_a);
}

}  // namespace bellcrank
