// The extension `_planner`: the fastest motion along a path.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>

#include "../integrator/new_array.hpp"
#include "lower_bound.hpp"
#include "refined_pass.hpp"

namespace nb = nanobind;

namespace bellcrank {
namespace {

template <int dimensions>
using In = nb::ndarray<const double, nb::ndim<dimensions>, nb::c_contig, nb::device::cpu>;

using Narrow = nb::ndarray<const std::uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// Limits along a path, as `bellcrank.planning.limits.path_limits.PathLimits` names them. Keeps its arrays alive.
struct LimitArrays {
  In<2> a, b, d, c;
  In<3> w;
  In<2> rate, motor_rate;
  In<1> fastest, width, negligible;
  In<2> along, bend, across;
  In<1> norm;
  PathLimits limits;

  LimitArrays(In<2> a, In<2> b, In<2> d, In<2> c, In<3> w, In<2> rate, In<2> motor_rate, In<1> fastest, In<1> width,
              In<1> negligible, In<2> along, In<2> bend, In<2> across, In<1> norm, nb::list rows,
              nb::list curves)
      : a(a), b(b), d(d), c(c), w(w), rate(rate), motor_rate(motor_rate), fastest(fastest), width(width),
        negligible(negligible), along(along), bend(bend), across(across), norm(norm) {
    PathLimits& l = limits;
    l.places = a.shape(0), l.quantities = a.shape(1), l.joints = rate.shape(1), l.motors = motor_rate.shape(1);
    const auto same = [&](const auto& array) { return array.shape(0) == l.places; };
    if (!(same(b) && same(d) && same(c) && same(w) && same(rate) && same(motor_rate) && same(fastest)) ||
        b.shape(1) != l.quantities || d.shape(1) != l.quantities || c.shape(1) != l.quantities ||
        w.shape(1) != l.quantities || w.shape(2) != l.joints || width.shape(0) != l.joints ||
        negligible.shape(0) != l.quantities || l.quantities > most_quantities)
      throw nb::value_error("path limits: the arrays do not fit each other");
    l.a = a.data(), l.b = b.data(), l.d = d.data(), l.c = c.data(), l.w = w.data(), l.rate = rate.data();
    l.norms = norm.shape(0);
    if (!(same(along) && same(bend) && same(across)) || along.shape(1) != l.norms || bend.shape(1) != l.norms ||
        across.shape(1) != l.norms)
      throw nb::value_error("path limits: the arrays of norms do not fit each other");
    l.along = along.data(), l.bend = bend.data(), l.across = across.data(), l.norm = norm.data();
    l.motor_rate = motor_rate.data(), l.fastest = fastest.data(), l.width = width.data(), l.negligible = negligible.data();
    for (nb::handle given : curves) {
      Curve curve;
      for (nb::handle point : given) {
        nb::tuple pair = nb::cast<nb::tuple>(point);
        curve.speed.push_back(nb::cast<double>(pair[0])), curve.torque.push_back(nb::cast<double>(pair[1]));
      }
      if (curve.speed.size() < 2) throw nb::value_error("path limits: a curve needs two points");
      l.curves.push_back(std::move(curve));
    }
    const auto inside = [](int k, std::size_t count, bool optional) {
      return k < static_cast<int>(count) && (k >= 0 || (optional && k == -1));
    };
    for (nb::handle given : rows) {
      nb::tuple r = nb::cast<nb::tuple>(given);
      const LimitRow row{nb::cast<int>(r[0]), nb::cast<int>(r[1]),    nb::cast<int>(r[2]),   nb::cast<int>(r[3]),
                         nb::cast<int>(r[4]), nb::cast<double>(r[5]), nb::cast<double>(r[6])};
      if (!inside(row.drive, l.quantities, false) || !inside(row.back, l.quantities, true) ||
          !inside(row.motor, l.motors, true) || !inside(row.curve, l.curves.size(), true) ||
          !inside(row.braking, l.curves.size(), true) || (row.curve >= 0) != (row.braking >= 0) ||
          ((row.curve >= 0 || row.back >= 0) && row.motor < 0))
        throw nb::value_error("path limits: a row names what is not there");
      l.rows.push_back(row);
    }
  }
};

template <class T, class From>
nb::object column(const std::vector<From>& values) {
  Column<T> made(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) *made[i] = static_cast<T>(values[i]);
  return made.array(true);
}

nb::dict answer(const Fastest& f) {
  nb::dict d;
  d["speed"] = column<double>(f.y);
  d["begin"] = column<double>(f.u_begin);
  d["end"] = column<double>(f.u_end);
  d["slowest"] = column<double>(f.slowest);
  d["fastest"] = column<double>(f.fastest);
  d["active"] = column<std::int32_t>(f.active);
  d["kind"] = column<std::int32_t>(f.kind);
  d["error"] = column<double>(f.error);
  d["failed"] = f.failed;
  d["failed_at_start"] = f.failed_at_start;
  d["cause"] = f.cause;
  return d;
}

nb::dict on_grid(const LimitArrays& given, In<1> s, double begin, double end) {
  if (s.shape(0) != given.limits.places || s.shape(0) < 2) throw nb::value_error("the grid does not fit the limits");
  Fastest f;
  {
    nb::gil_scoped_release release;
    f = fastest_on_grid(given.limits, s.data(), s.shape(0), begin, end);
  }
  return answer(f);
}

nb::dict refined(const LimitArrays& given, In<1> r, In<1> s, In<1> ds, Narrow narrow, double begin, double end, double speed_tolerance,
                 double excess_tolerance, double tooth, double apart) {
  const std::size_t n = r.shape(0);
  if (n < 2 || 2 * n != given.limits.places + 1 || narrow.shape(0) + 1 != n || s.shape(0) + 1 != 2 * n ||
      ds.shape(0) + 1 != 2 * n)
    throw nb::value_error("the grid does not fit the limits");
  Fastest f;
  {
    nb::gil_scoped_release release;
    f = RefinedPass(given.limits, r.data(), s.data(), ds.data(), n, narrow.data(), {speed_tolerance, excess_tolerance, tooth, apart})
            .run(begin, end);
  }
  return answer(f);
}

// A lower bound of the time, from and to rest, and the time by about which each cell loosens it;
// ds = ds/dr at places of which those of a cell, four and the begin of the next one, are at equal distances of r.
nb::tuple lower_bound(const LimitArrays& given, In<1> r, In<1> ds) {
  const std::size_t places = given.limits.places;
  if (places < 5 || places % LowerBound::parts != 1 || r.shape(0) != places || ds.shape(0) != places)
    throw nb::value_error("the places do not fit the limits");
  LowerBound bound(given.limits, r.data(), ds.data(), places / LowerBound::parts);
  double time = 0;
  {
    nb::gil_scoped_release release;
    time = bound.time(0.0, 0.0);
  }
  return nb::make_tuple(time, column<double>(bound.looseness()));
}

// The bounds (least, most) of the path acceleration at a place and a speed, and the rows that give them.
nb::tuple bounds_at(const LimitArrays& given, std::size_t place, double y) {
  if (place >= given.limits.places) throw nb::index_error("there is no such place");
  const Bounds b = LimitsAtPlace(given.limits, place).bounds(y);
  return nb::make_tuple(b.least.value, b.most.value, b.least.row, b.most.row, b.speed.row < 0 ? unlimited : b.speed.value);
}

// The worst share by which accelerations u exceed a limit at speeds y, a place each.
nb::object excess(const LimitArrays& given, In<1> y, In<1> u) {
  if (y.shape(0) != given.limits.places || u.shape(0) != given.limits.places)
    throw nb::value_error("the states do not fit the limits");
  Column<double> found(y.shape(0));
  for (std::size_t i = 0; i < y.shape(0); ++i)
    *found[i] = LimitsAtPlace(given.limits, i).excess(y.data()[i], u.data()[i]);
  return found.array(true);
}

// Shares by which limits are exceeded at speeds y and accelerations u, a place each, and their derivatives by u and y,
// and the limits over the largest ones: four arrays, place by place.
nb::tuple linearised(const LimitArrays& given, In<1> y, In<1> u) {
  const std::size_t n = given.limits.places, width = 2 * given.limits.rows.size() + given.limits.norms;
  if (y.shape(0) != n || u.shape(0) != n) throw nb::value_error("the states do not fit the limits");
  Column<double> share(n * width), by_u(n * width), by_y(n * width), limited(n * width);
  if (n * width > 0)
    for (std::size_t i = 0; i < n; ++i)
      LimitsAtPlace(given.limits, i)
          .linearised(y.data()[i], u.data()[i], share[i * width], by_u[i * width], by_y[i * width], limited[i * width]);
  return nb::make_tuple(share.array(true), by_u.array(true), by_y.array(true), limited.array(true));
}

// The largest factor of the speed in [1, to] up to which all limits are kept everywhere with u = 0; where 1 is too much,
// the largest one below. The place and the row that limit it: -1 for a limit of speed, or for none.
nb::tuple largest_factor(const LimitArrays& given, double to) {
  const PathLimits& limits = given.limits;
  double factor = 1;
  std::size_t at = 0;
  int by = -1;
  bool within = true;
  for (std::size_t i = 0; i < limits.places; ++i)
    if (limits.fastest[i] < factor || LimitsAtPlace(limits, i).excess(factor, 0.0) > 1e-12) within = false;
  if (within) {
    factor = to;
    for (std::size_t i = 0; i < limits.places; ++i) {
      const LimitsAtPlace place(limits, i);
      if (limits.fastest[i] < factor) factor = limits.fastest[i], at = i, by = -1;
      const auto [y, row] = place.first_exceeded(1.0, factor);
      if (row >= 0 && y < factor) factor = y, at = i, by = row;
    }
    return nb::make_tuple(factor, at, by);
  }
  std::pair<int, int> cause{-1, -1};
  for (bool moved = true; moved && factor > 0;) {
    moved = false;
    for (std::size_t i = 0; i < limits.places; ++i) {
      const LimitsAtPlace place(limits, i);
      if (limits.fastest[i] < factor) factor = limits.fastest[i], at = i, by = -1, moved = true;
      const double y = nearest_allowed(place, Goal{}, factor, 0.0, cause);
      if (std::isnan(y)) return nb::make_tuple(0.0, i, cause.first);
      if (y < factor) factor = y, at = i, by = cause.first, moved = true;
    }
  }
  return nb::make_tuple(factor, at, by);
}

}  // namespace

NB_MODULE(_planner, m) {
  nb::class_<LimitArrays>(m, "LimitArrays")
      .def(nb::init<In<2>, In<2>, In<2>, In<2>, In<3>, In<2>, In<2>, In<1>, In<1>, In<1>, In<2>, In<2>, In<2>, In<1>,
                    nb::list, nb::list>(),
           nb::arg("a"), nb::arg("b"), nb::arg("d"), nb::arg("c"), nb::arg("w"), nb::arg("rate"), nb::arg("motor_rate"),
           nb::arg("fastest"), nb::arg("width"), nb::arg("negligible"), nb::arg("along"), nb::arg("bend"),
           nb::arg("across"), nb::arg("norm"), nb::arg("rows"), nb::arg("curves"));
  m.def("fastest_on_grid", &on_grid, nb::arg("limits"), nb::arg("s"), nb::arg("begin"), nb::arg("end"));
  m.def("fastest_refined", &refined, nb::arg("limits"), nb::arg("r"), nb::arg("s"), nb::arg("ds"), nb::arg("narrow"), nb::arg("begin"), nb::arg("end"),
        nb::arg("speed_tolerance"), nb::arg("excess_tolerance"), nb::arg("tooth"), nb::arg("apart"));
  m.def("lower_bound", &lower_bound, nb::arg("limits"), nb::arg("r"), nb::arg("ds"));
  m.def("excess", &excess, nb::arg("limits"), nb::arg("speed"), nb::arg("acceleration"));
  m.def("linearised", &linearised, nb::arg("limits"), nb::arg("speed"), nb::arg("acceleration"));
  m.def("largest_factor", &largest_factor, nb::arg("limits"), nb::arg("to"));
  m.def("bounds_at", &bounds_at, nb::arg("limits"), nb::arg("place"), nb::arg("speed"));
}

}  // namespace bellcrank
