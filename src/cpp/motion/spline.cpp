// Splines of degree 5 in B-spline form: their coefficients from values, and their values. SciPy has the same
// (make_interp_spline, BSpline); importing it takes a third of the time of a whole sizing. Source: C. de Boor, A Practical
// Guide to Splines (1978), ch. X (recurrences) and XIII (interpolation: the matrix is totally positive, so that banded
// elimination needs no pivots).
#include "spline.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <stdexcept>
#include <vector>

#include <nanobind/ndarray.h>

namespace nb = nanobind;

namespace bellcrank {
namespace {

constexpr int degree = 5, order = degree + 1, band = 2 * degree + 1;
using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Matrix = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// The span i with t[i] <= x < t[i + 1] among n coefficients; the first or last one beyond the ends.
std::ptrdiff_t span_of(const double* t, std::ptrdiff_t n, double x) {
  return std::upper_bound(t + order, t + n, x) - t - 1;
}

// The B-splines of degree 5 that are not 0 in span i, at x.
std::array<double, order> basis_at(const double* t, std::ptrdiff_t i, double x) {
  std::array<double, order> b{1.0};
  for (int p = 1; p <= degree; ++p) {
    double saved = 0.0;
    for (int j = 0; j < p; ++j) {
      const double right = t[i + j + 1], left = t[i + j + 1 - p], part = b[j] / (right - left);
      b[j] = saved + (right - x) * part;
      saved = (x - left) * part;
    }
    b[p] = saved;
  }
  return b;
}

nb::ndarray<nb::numpy, double, nb::ndim<2>> new_matrix(std::vector<double>&& from, std::size_t rows, std::size_t columns) {
  auto held = std::make_unique<std::vector<double>>(std::move(from));
  double* data = held->data();
  nb::capsule owner(held.release(), [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
  return nb::ndarray<nb::numpy, double, nb::ndim<2>>(data, {rows, columns}, owner);
}

// The coefficients (n, m) of the spline with knots t (n + 6,) through values (k, m) at x (k,), which rises. With k = n - 4
// the first and second derivative at both ends are 0, so that the first three coefficients are the first value, and the
// last three the last one.
nb::ndarray<nb::numpy, double, nb::ndim<2>> spline_coefficients(Vector knots, Vector at, Matrix values) {
  const std::ptrdiff_t n = static_cast<std::ptrdiff_t>(knots.shape(0)) - order, k = at.shape(0), m = values.shape(1);
  const bool rest = k == n - 4;
  if (n < order || k < 2 || (k != n && !rest) || values.shape(0) != at.shape(0))
    throw std::invalid_argument("spline_coefficients: knots, places and values do not fit");
  const double *t = knots.data(), *x = at.data(), *y = values.data();
  std::vector<double> c(n * m, 0.0);
  const std::ptrdiff_t given = rest ? 3 : 0, first = rest ? 1 : 0, rows = n - 2 * given;
  for (std::ptrdiff_t j = 0; j < given; ++j)
    for (std::ptrdiff_t e = 0; e < m; ++e) c[j * m + e] = y[e], c[(n - 1 - j) * m + e] = y[(k - 1) * m + e];
  std::vector<double> a(std::max<std::ptrdiff_t>(rows, 0) * band, 0.0);
  double* right = c.data() + given * m;  // solved in place
  for (std::ptrdiff_t r = 0; r < rows; ++r) {
    const double place = x[first + r];
    const std::ptrdiff_t i = span_of(t, n, place);
    const auto b = basis_at(t, i, place);
    std::copy_n(y + (first + r) * m, m, right + r * m);
    for (int j = 0; j < order; ++j) {
      const std::ptrdiff_t column = i - degree + j - given;
      if (b[j] == 0.0) continue;
      if (column < 0 || column >= rows) {
        const double* known = c.data() + (column + given) * m;
        for (std::ptrdiff_t e = 0; e < m; ++e) right[r * m + e] -= b[j] * known[e];
      } else if (column - r + degree < 0 || column - r + degree >= band) {
        throw std::invalid_argument("spline_coefficients: the places do not lie in the spans of their coefficients");
      } else {
        a[r * band + column - r + degree] = b[j];
      }
    }
  }
  for (std::ptrdiff_t p = 0; p < rows; ++p) {
    const double pivot = a[p * band + degree];
    if (!(pivot > 0.0)) throw std::invalid_argument("spline_coefficients: two places are too close");
    for (std::ptrdiff_t r = p + 1; r < std::min(rows, p + degree + 1); ++r) {
      const double factor = a[r * band + p - r + degree] / pivot;
      if (factor == 0.0) continue;
      for (std::ptrdiff_t q = p + 1; q < std::min(rows, p + degree + 1); ++q)
        a[r * band + q - r + degree] -= factor * a[p * band + q - p + degree];
      for (std::ptrdiff_t e = 0; e < m; ++e) right[r * m + e] -= factor * right[p * m + e];
    }
  }
  for (std::ptrdiff_t p = rows; p-- > 0;) {
    for (std::ptrdiff_t q = p + 1; q < std::min(rows, p + degree + 1); ++q)
      for (std::ptrdiff_t e = 0; e < m; ++e) right[p * m + e] -= a[p * band + q - p + degree] * right[q * m + e];
    for (std::ptrdiff_t e = 0; e < m; ++e) right[p * m + e] /= a[p * band + degree];
  }
  return new_matrix(std::move(c), n, m);
}

// Values (k, m) of a derivative of the spline at places (k,); beyond the ends the polynomials there go on.
nb::ndarray<nb::numpy, double, nb::ndim<2>> spline_values(Vector knots, Matrix coefficients, Vector at, int derivative) {
  const std::ptrdiff_t n = coefficients.shape(0), m = coefficients.shape(1), k = at.shape(0);
  if (static_cast<std::ptrdiff_t>(knots.shape(0)) != n + order || n < order || derivative < 0)
    throw std::invalid_argument("spline_values: knots and coefficients do not fit");
  const double *t = knots.data(), *c = coefficients.data(), *x = at.data();
  std::vector<double> found(k * m, 0.0), d(order * m);
  if (derivative <= degree) {
    for (std::ptrdiff_t row = 0; row < k; ++row) {
      const std::ptrdiff_t i = span_of(t, n, x[row]);
      std::copy_n(c + (i - degree) * m, order * m, d.data());
      int p = degree;
      for (; p > degree - derivative; --p)
        for (int j = 0; j < p; ++j) {
          const double factor = p / (t[i + j + 1] - t[i - p + j + 1]);
          for (std::ptrdiff_t e = 0; e < m; ++e) d[j * m + e] = factor * (d[(j + 1) * m + e] - d[j * m + e]);
        }
      for (int r = 1; r <= p; ++r)
        for (int j = p; j >= r; --j) {
          const double left = t[i - p + j], share = (x[row] - left) / (t[i + j + 1 - r] - left);
          for (std::ptrdiff_t e = 0; e < m; ++e)
            d[j * m + e] = (1.0 - share) * d[(j - 1) * m + e] + share * d[j * m + e];
        }
      std::copy_n(d.data() + p * m, m, found.data() + row * m);
    }
  }
  return new_matrix(std::move(found), k, m);
}

}  // namespace

void bind_spline(nb::module_& m) {
  using namespace nb::literals;
  m.def("spline_coefficients", &spline_coefficients, "knots"_a, "at"_a, "values"_a);
  m.def("spline_values", &spline_values, "knots"_a, "coefficients"_a, "at"_a, "derivative"_a);
}

}  // namespace bellcrank
