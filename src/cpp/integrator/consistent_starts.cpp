// consistent_postures(), consistent_velocities(), followed_postures() and row_sizes() of many designs: reads the records
// of a scene's constraints, works in threads without the GIL.
#include "consistent_starts.hpp"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "design_threads.hpp"
#include "new_array.hpp"
#include "row_sizes.hpp"
#include "start_search.hpp"

namespace nb = nanobind;

namespace bellcrank {
namespace {

using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Matrix = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

void require(bool holds, const char* text) {
  if (!holds) throw std::invalid_argument(text);
}

template <class T>
T get(nb::handle record, const char* name) {
  T value;
  if (!nb::try_cast(record.attr(name), value))
    throw nb::type_error((std::string("designs: '") + name + "' has the wrong type").c_str());
  return value;
}

// The record StartEquations (dynamics/postures/start_equations.py).
struct Reading {
  StartModel model{};

  explicit Reading(nb::handle record) {
    StartModel& m = model;
    m.nq = get<int>(record, "nq"), m.nv = get<int>(record, "nv"), m.size = get<int>(record, "size");
    m.heights = get<int>(record, "heights"), m.rows = get<int>(record, "rows");
    m.linearised = kernel(record, "linearised");
    m.entry_row = get<std::vector<int>>(record, "entry_rows");
    m.entry_column = get<std::vector<int>>(record, "entry_columns");
    m.cosines = kernel(record, "cosines"), m.aligned = kernel(record, "aligned");
    m.cosine_count = get<int>(record, "cosine_count"), m.aligned_count = get<int>(record, "aligned_count");
    m.aligned_of = get<std::vector<int>>(record, "alignment_owners");
    m.sine = get<std::vector<bool>>(record, "sines");
    m.far = get<std::vector<bool>>(record, "lengths_in_velocity");
    signals_ = get<Vector>(record, "signals");
    m.t = get<double>(record, "time"), m.u = signals_.data();
    for (nb::handle joint : record.attr("joints")) add(joint);
    require(m.linearised && m.size >= m.nq + m.nv && m.heights <= m.rows, "StartEquations: sizes do not fit");
    require(m.entry_row.size() == m.entry_column.size(), "StartEquations: one row and one column an entry");
    for (std::size_t e = 0; e < m.entry_row.size(); ++e)
      require(0 <= m.entry_row[e] && m.entry_row[e] < m.rows && 0 <= m.entry_column[e] && m.entry_column[e] < m.nv,
              "StartEquations: an entry outside J");
    require(static_cast<int>(m.sine.size()) == m.heights && static_cast<int>(m.far.size()) == m.nv,
            "StartEquations: one flag a row, and one a degree of freedom");
    require(static_cast<int>(m.aligned_of.size()) == m.aligned_count, "StartEquations: one owner an alignment row");
    for (int k : m.aligned_of) require(0 <= k && k < m.cosine_count, "StartEquations: no such cosine");
    require((m.cosines || !m.cosine_count) && (m.aligned || !m.cosine_count), "StartEquations: no alignment functions");
  }
  Reading(const Reading&) = delete;

 private:
  Vector signals_;

  static Kernel kernel(nb::handle record, const char* name) {
    return reinterpret_cast<Kernel>(get<std::uintptr_t>(record, name));
  }

  void add(nb::handle joint) {
    const auto kind = get<std::string>(joint, "kind");
    const StartJoint one{kind == "planar"      ? JointKind::planar
                         : kind == "floating"  ? JointKind::floating
                         : kind == "spherical" ? JointKind::spherical
                                               : JointKind::one,
                         get<int>(joint, "q"), get<int>(joint, "v"), get<bool>(joint, "position_in_parent"),
                         get<bool>(joint, "velocity_in_parent")};
    const int nq = one.kind == JointKind::one ? 1 : one.kind == JointKind::floating ? 7 : 4;
    const int nv = one.kind == JointKind::one ? 1 : one.kind == JointKind::floating ? 6 : 3;
    require(one.q >= 0 && one.q + nq <= model.nq && one.v >= 0 && one.v + nv <= model.nv,
            "StartEquations: a joint outside q or v");
    model.joints.push_back(one);
  }
};

// What differs between designs: one row each, or one for all.
struct Designs {
  Matrix parameters, units;
  Vector lengths;

  void check(const StartModel& model, std::size_t count) const {
    require(parameters.shape(0) == count, "consistent starts: one row of parameters a design");
    require(units.shape(0) == count || units.shape(0) == 1, "consistent starts: one row of units a design, or of all");
    require(lengths.shape(0) == count || lengths.shape(0) == 1, "consistent starts: one length a design, or of all");
    require(static_cast<int>(units.shape(1)) == model.rows, "consistent starts: one unit a row");
  }

  StartDesign operator[](std::size_t k) const {
    return {parameters.data() + k * parameters.shape(1), units.data() + (units.shape(0) > 1 ? k : 0) * units.shape(1),
            lengths.data()[lengths.shape(0) > 1 ? k : 0]};
  }
};

void check(const Matrix& rows, int width, std::size_t count) {
  require(rows.shape(0) == count && static_cast<int>(rows.shape(1)) == width, "consistent starts: one state a design");
}

void check(const Flags& held, int count) {
  require(static_cast<int>(held.shape(0)) == count, "consistent starts: one flag a degree of freedom");
}

// search(design search, k) -> verdict, for every design k, in threads.
template <class Search>
nb::tuple searched(const Reading& reading, Column<double> found, int threads, const Search& search) {
  const std::size_t designs = found.rows;
  Column<std::int32_t> code(designs), index(designs);
  Column<double> value(designs);
  {
    nb::gil_scoped_release released;
    for_each_design(designs, threads, [&] {
      return [&, one = StartSearch(reading.model)](std::size_t k) mutable {
        const StartVerdict verdict = search(one, k, found[k]);
        *code[k] = static_cast<std::int32_t>(verdict.code), *index[k] = verdict.index, *value[k] = verdict.value;
      };
    });
  }
  return nb::make_tuple(found.array(false), code.array(true), index.array(true), value.array(true));
}

// The record RowSampling (dynamics/equations/design_parameters.py).
struct RowReading {
  RowModel model{};

  explicit RowReading(nb::handle record) {
    RowModel& m = model;
    m.nq = get<int>(record, "nq"), m.nv = get<int>(record, "nv");
    m.unit_kind = get<std::vector<int>>(record, "unit_kinds"), m.rows = static_cast<int>(m.unit_kind.size());
    m.constraint = get<std::vector<int>>(record, "constraint");
    m.rigid = get<std::vector<bool>>(record, "rigid"), m.constraints = static_cast<int>(m.rigid.size());
    m.sampled = reinterpret_cast<BatchKernel>(get<std::uintptr_t>(record, "sampled"));
    m.sample_size = get<int>(record, "sample_size");
    q_ = get<Matrix>(record, "q"), moves_ = get<Matrix>(record, "moves"), t_ = get<Matrix>(record, "times");
    u_ = get<Matrix>(record, "signals"), directions_ = get<Matrix>(record, "directions");
    m.q = q_.data(), m.moves = moves_.data(), m.t = t_.data(), m.u = u_.data(), m.directions = directions_.data();
    m.sample_count = static_cast<int>(q_.shape(0)), m.signals = static_cast<int>(u_.shape(1));
    m.entry_row = get<std::vector<int>>(record, "entry_rows");
    m.entry_column = get<std::vector<int>>(record, "entry_columns");
    m.lever = get<std::vector<bool>>(record, "levers");
    m.far_coordinates = get<bool>(record, "lengths_in_position");
    m.inertia = reinterpret_cast<BatchKernel>(get<std::uintptr_t>(record, "inertia"));
    m.inertia_posture = get<std::vector<int>>(record, "inertia_postures");
    m.inertia_count = static_cast<int>(m.inertia_posture.size());
    m.factorised = get<int>(record, "factorised");
    m.far = get<std::vector<bool>>(record, "lengths_in_velocity");
    m.kept = get<std::vector<int>>(record, "kept");
    m.longest = get<double>(record, "longest");
    m.length_parameters = get<std::vector<int>>(record, "length_parameters");
    m.powers = get<std::vector<double>>(record, "powers"), m.least_power = get<int>(record, "least_power");
    check();
  }
  RowReading(const RowReading&) = delete;

 private:
  Matrix q_, moves_, t_, u_, directions_;

  void check() const {
    const RowModel& m = model;
    const int entries = static_cast<int>(m.entry_row.size());
    require(m.inertia && (m.sampled || !m.rows), "RowSampling: a function is missing");
    require(static_cast<int>(q_.shape(1)) == m.nq && moves_.shape(0) == q_.shape(0) && moves_.shape(1) == q_.shape(1) &&
                t_.shape(0) == q_.shape(0) && u_.shape(0) == q_.shape(0),
            "RowSampling: samples do not fit together");
    require(static_cast<int>(m.entry_column.size()) == entries && static_cast<int>(m.lever.size()) == entries &&
                m.sample_size >= entries + m.rows,
            "RowSampling: entries do not fit together");
    for (int e = 0; e < entries; ++e)
      require(0 <= m.entry_row[e] && m.entry_row[e] < m.rows && 0 <= m.entry_column[e] && m.entry_column[e] < m.nv,
              "RowSampling: an entry outside J");
    require(static_cast<int>(m.constraint.size()) == m.rows && static_cast<int>(m.far.size()) == m.nv,
            "RowSampling: one constraint a row and one flag a degree of freedom");
    for (int k : m.constraint) require(0 <= k && k < m.constraints, "RowSampling: no such constraint");
    for (int k : m.kept) require(0 <= k && k < m.rows, "RowSampling: no such row");
    require(static_cast<int>(directions_.shape(0)) == m.inertia_count &&
                static_cast<int>(directions_.shape(1)) == m.nv && m.inertia_count >= m.factorised * m.nv,
            "RowSampling: directions do not fit");
    for (int n : m.inertia_posture) require(0 <= n && n < m.sample_count, "RowSampling: no such posture");
  }
};

// For each design scale, square and unit of the kept rows and L; and whether it is regular.
nb::tuple row_sizes(nb::object sampling, Matrix parameters, int threads) {
  const RowReading reading(sampling);
  const std::size_t designs = parameters.shape(0);
  for (int k : reading.model.length_parameters)
    require(0 <= k && k < static_cast<int>(parameters.shape(1)), "RowSampling: no such parameter");
  Column<double> sizes(designs, 3 * reading.model.kept.size() + 1);
  Column<bool> regular(designs);
  {
    nb::gil_scoped_release released;
    for_each_design(designs, threads, [&] {
      return [&, one = RowSizes(reading.model)](std::size_t k) mutable {
        *regular[k] = one(parameters.data() + k * parameters.shape(1), sizes[k]);
      };
    });
  }
  return nb::make_tuple(sizes.array(false), regular.array(true));
}

StartMethod method_named(const std::string& name) {
  if (name == "nearest") return StartMethod::nearest;
  if (name == "damped") return StartMethod::damped;
  require(name == "continued", "consistent starts: no such method");
  return StartMethod::continued;
}

nb::tuple consistent_postures(nb::object equations, Matrix parameters, Matrix units, Vector lengths, Matrix q, Flags held,
                              Flags rows, Flags cosines, const std::string& method, int threads) {
  const Reading reading(equations);
  const StartMethod way = method_named(method);
  check(rows, reading.model.heights);
  check(cosines, reading.model.cosine_count);
  const Designs designs{parameters, units, lengths};
  designs.check(reading.model, q.shape(0));
  check(q, reading.model.nq, q.shape(0));
  check(held, reading.model.nv);
  Column<double> found(q.shape(0), q.shape(1));
  std::copy_n(q.data(), q.size(), found[0]);
  return searched(reading, std::move(found), threads, [&](StartSearch& search, std::size_t k, double* at) {
    return search.posture(designs[k], held.data(), at, way, {rows.data(), cosines.data()});
  });
}

// The postures (designs, rows nq) of a motion, and for each design how many were reached and where the next one failed.
nb::tuple followed_postures(nb::object equations, Matrix parameters, Matrix units, Vector lengths, Matrix q, Vector times,
                            Matrix inputs, Matrix wanted, const std::vector<int>& leading_q,
                            const std::vector<int>& leading_v, double longest, double rounded, int threads) {
  const Reading reading(equations);
  const Designs designs{parameters, units, lengths};
  const std::size_t count = q.shape(0), rows = times.shape(0), leaders = leading_q.size();
  designs.check(reading.model, count);
  check(q, reading.model.nq, count);
  require(rows > 0 && inputs.shape(0) == rows && wanted.shape(0) == rows && wanted.shape(1) == leaders &&
              leading_v.size() == leaders,
          "followed postures: rows or leading joints do not fit together");
  for (std::size_t k = 0; k < leaders; ++k)
    require(0 <= leading_q[k] && leading_q[k] < reading.model.nq && 0 <= leading_v[k] && leading_v[k] < reading.model.nv,
            "followed postures: no such joint");
  const FollowedRows motion{static_cast<int>(rows) - 1, static_cast<int>(inputs.shape(1)), static_cast<int>(leaders),
                            times.data(), inputs.data(), wanted.data(), leading_q.data(), leading_v.data(),
                            longest, rounded};
  Column<double> found(count, (rows - 1) * q.shape(1)), share(count);
  Column<std::int32_t> reached(count);
  {
    nb::gil_scoped_release released;
    for_each_design(count, threads, [&] {
      return [&, one = StartSearch(reading.model), at = std::vector<double>(q.shape(1))](std::size_t k) mutable {
        std::copy_n(q.data() + k * at.size(), at.size(), at.begin());
        const FollowedCount done = one.follow(designs[k], motion, at.data(), found[k]);
        *reached[k] = done.rows, *share[k] = done.share;
      };
    });
  }
  return nb::make_tuple(found.array(false), reached.array(true), share.array(true));
}

nb::tuple consistent_velocities(nb::object equations, Matrix parameters, Matrix units, Vector lengths, Matrix q,
                                Matrix v, Flags held, int threads) {
  const Reading reading(equations);
  const Designs designs{parameters, units, lengths};
  designs.check(reading.model, q.shape(0));
  check(q, reading.model.nq, q.shape(0));
  check(v, reading.model.nv, q.shape(0));
  check(held, reading.model.nv);
  Column<double> found(v.shape(0), v.shape(1));
  std::copy_n(v.data(), v.size(), found[0]);
  return searched(reading, std::move(found), threads, [&](StartSearch& search, std::size_t k, double* at) {
    return search.velocity(designs[k], held.data(), q.data() + k * q.shape(1), at);
  });
}

}  // namespace

void bind_consistent_starts(nb::module_& m) {
  using namespace nb::literals;
  m.def("consistent_postures", &consistent_postures, "equations"_a, "parameters"_a, "units"_a, "lengths"_a, "q"_a,
        "held"_a, "rows"_a, "cosines"_a, "method"_a, "threads"_a);
  m.def("consistent_velocities", &consistent_velocities, "equations"_a, "parameters"_a, "units"_a, "lengths"_a, "q"_a,
        "v"_a, "held"_a, "threads"_a);
  m.def("followed_postures", &followed_postures, "equations"_a, "parameters"_a, "units"_a, "lengths"_a, "q"_a, "times"_a,
        "inputs"_a, "wanted"_a, "leading_q"_a, "leading_v"_a, "longest"_a, "rounded"_a, "threads"_a);
  m.def("row_sizes", &row_sizes, "sampling"_a, "parameters"_a, "threads"_a);
}

}  // namespace bellcrank
