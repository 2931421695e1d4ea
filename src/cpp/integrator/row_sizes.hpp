// The usual sizes of a scene's constraint rows at the parameters of one design; dynamics/constraints/constraint_rows.py states the
// rules. Only where they are regular: M and J M⁻¹ Jᵀ have full rank, and the rows that bind are the expected ones, beyond
// doubt. The other designs are left to Python.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "problem.hpp"

namespace bellcrank {

enum class RowUnit : int { length, angle, other };

// What the designs share: functions, and the postures in which they are sampled.
struct RowModel {
  int nq, nv, rows, constraints;
  BatchKernel sampled;               // (q, t, u, p) -> entries of J, (φ, ψ), lever arms and lengths
  int sample_count, sample_size;     // of its outputs
  const double *q, *moves, *t, *u;   // (samples, …) postures with coordinates in m at 0, and what L times is added
  int signals;
  std::vector<int> entry_row, entry_column;
  std::vector<bool> lever;           // (entries) a lever arm: a row in m by an angle
  bool far_coordinates;              // whether any coordinate is in m
  BatchKernel inertia;               // (q, a, p) -> M a
  int factorised, inertia_count;     // postures in which M is evaluated; samples of it, at least one a lane
  const double* directions;          // a (inertia_count, nv)
  std::vector<int> inertia_posture;  // (inertia_count)
  std::vector<bool> far;             // (nv) in m
  std::vector<int> unit_kind, constraint;  // of each row
  std::vector<bool> rigid;                 // of each constraint: its frames are on one body
  std::vector<int> kept;
  double longest;                    // the robot's largest dimension, m
  std::vector<int> length_parameters;
  std::vector<double> powers;        // of ten, from `least_power` on
  int least_power;
};

class RowSizes {
 public:
  explicit RowSizes(const RowModel& model)
      : m_(model), samples_(model.sample_count * model.sample_size), q_(model.sample_count * model.nq),
        mass_(model.inertia_count * model.nv), inertia_q_(model.inertia_count * model.nq),
        jacobian_(model.sample_count * model.rows * model.nv), unit_(model.rows), size_(model.rows),
        apart_(model.rows) {}

  // Writes scale, square, unit (kept rows each) and L; false where the design is not regular.
  bool operator()(const double* p, double* out) {
    evaluate(p, 0);
    double length;
    if (!characteristic_length(p, &length)) return false;
    if (m_.far_coordinates) evaluate(p, length);
    if (!units(length) || !binding_as_expected()) return false;
    const int kept = static_cast<int>(m_.kept.size());
    usual_.assign(kept, 0.0);
    square_.assign(kept, 0.0);
    for (int n = 0; n < m_.factorised; ++n)
      if (!compliance(n, p, length)) return false;
    for (int k = 0; k < kept; ++k) {
      const double unit = unit_[m_.kept[k]];
      if (!power_of_ten(usual_[k] * (unit * unit), out + k) || !power_of_ten(square_[k] * (unit * unit), out + kept + k))
        return false;
      out[2 * kept + k] = unit;
    }
    out[3 * kept] = length;
    return true;
  }

 private:
  static constexpr double LARGEST = 1e100, SMALLEST = 1e-100, MEANT = 1e-7;
  static constexpr double DEAD = 1e-5, RIGID = 1e-8, IMPOSSIBLE = 1e-5, CLOSED = 1e-9, SPREAD = 1e3;
  static constexpr double FIRM = 1e-9;   // squares of pivots of a matrix with a diagonal of 1: clearly regular
  static constexpr double CLEAR = 1e-6;  // in decades from where rounding to a power of ten changes
  static constexpr double DOUBT = 1e-6;  // relative, of a comparison

  const RowModel& m_;
  std::vector<double> samples_, q_, mass_, inertia_q_, jacobian_, unit_, size_, apart_;
  std::vector<double> usual_, square_, found_, diagonal_, factor_, c_, w_, own_;

  void evaluate(const double* p, double length) {
    for (int i = 0; i < m_.sample_count * m_.nq; ++i) q_[i] = m_.q[i] + length * m_.moves[i];
    const double* in[] = {q_.data(), m_.t, m_.u, p};
    double* out[] = {samples_.data()};
    const std::int64_t strides[] = {m_.nq, 1, m_.signals, 0};
    if (m_.rows) m_.sampled(in, out, strides, m_.sample_count);
  }

  const double* sample(int n) const { return samples_.data() + static_cast<std::size_t>(n) * m_.sample_size; }
  double& jacobian(int n, int row, int column) { return jacobian_[(static_cast<std::size_t>(n) * m_.rows + row) * m_.nv + column]; }

  // numpy's sum of contiguous numbers, to the bit.
  static double sum(const double* a, std::size_t n) {
    if (n < 8) {
      double total = 0;
      for (std::size_t i = 0; i < n; ++i) total += a[i];
      return total;
    }
    if (n <= 128) {
      double r[8];
      std::copy(a, a + 8, r);
      std::size_t i = 8;
      for (; i < n - n % 8; i += 8)
        for (int k = 0; k < 8; ++k) r[k] += a[i + k];
      double total = ((r[0] + r[1]) + (r[2] + r[3])) + ((r[4] + r[5]) + (r[6] + r[7]));
      for (; i < n; ++i) total += a[i];
      return total;
    }
    std::size_t half = n / 2;
    half -= half % 8;
    return sum(a, half) + sum(a + half, n - half);
  }

  bool characteristic_length(const double* p, double* length) {
    double longest = m_.longest, most = 0;
    for (int k : m_.length_parameters) longest = std::max(longest, std::fabs(p[k]));
    if (longest > LARGEST) return false;
    const int entries = static_cast<int>(m_.entry_row.size());
    found_.clear();
    const auto add = [&](double x) {
      const double size = std::fabs(x);
      if (size <= LARGEST && size > MEANT * longest) found_.push_back(x * x), most = std::max(most, size);
    };
    for (int n = 0; n < m_.sample_count && m_.rows; ++n) {
      for (int e = 0; e < entries; ++e)
        if (m_.lever[e]) add(sample(n)[e]);
      for (int k = entries + m_.rows; k < m_.sample_size; ++k) add(sample(n)[k]);
    }
    if (found_.empty()) {
      *length = longest != 0 ? longest : 1;
      return true;
    }
    *length = std::sqrt(sum(found_.data(), found_.size()) / static_cast<double>(found_.size()));
    return most >= SMALLEST;
  }

  double column(int j, double length) const { return m_.far[j] ? length : 1; }

  // The unit and the size of each row, and how far it is from 0; false where a value is undefined or huge.
  bool units(double length) {
    std::fill(jacobian_.begin(), jacobian_.end(), 0.0);
    std::fill(size_.begin(), size_.end(), 0.0);
    std::fill(apart_.begin(), apart_.end(), 0.0);
    const int entries = static_cast<int>(m_.entry_row.size());
    for (int n = 0; n < m_.sample_count && m_.rows; ++n) {
      for (int e = 0; e < entries; ++e) {
        const int row = m_.entry_row[e], j = m_.entry_column[e];
        if (!(std::fabs(sample(n)[e]) <= LARGEST)) return false;
        const double scaled = sample(n)[e] * column(j, length);
        jacobian(n, row, j) = scaled;
        size_[row] = std::max(size_[row], std::fabs(scaled));
      }
      for (int row = 0; row < m_.rows; ++row) {
        const double residual = std::fabs(sample(n)[entries + row]);
        if (!(residual <= LARGEST)) return false;
        apart_[row] = std::max(apart_[row], residual);
      }
    }
    for (int row = 0; row < m_.rows; ++row) {
      unit_[row] = 1;
      if (m_.unit_kind[row] == static_cast<int>(RowUnit::length)) unit_[row] = length;
      if (m_.unit_kind[row] == static_cast<int>(RowUnit::other) && size_[row] > 2.2250738585072014e-308 &&
          !power_of_ten(size_[row], &unit_[row]))
        return false;
    }
    return true;
  }

  static bool doubtful(double value, double bound) { return std::fabs(value - bound) <= DOUBT * bound; }

  bool binding_as_expected() {
    std::vector<double>& largest = w_;
    largest.assign(2 * m_.constraints, 0.0);
    double* widest = largest.data() + m_.constraints;
    for (int row = 0; row < m_.rows; ++row) {
      const int k = m_.constraint[row];
      largest[k] = std::max(largest[k], size_[row] / unit_[row]);
      widest[k] = std::max(widest[k], apart_[row] / unit_[row]);
    }
    std::size_t next = 0;
    for (int row = 0; row < m_.rows; ++row) {
      const int k = m_.constraint[row];
      const double size = size_[row] / unit_[row];
      if (doubtful(largest[k], RIGID) || doubtful(size, DEAD * largest[k])) return false;
      const bool rigid = largest[k] <= RIGID || m_.rigid[k], binds = !rigid && size > DEAD * largest[k];
      if (binds != (next < m_.kept.size() && m_.kept[next] == row)) return false;
      next += binds;
      const double allowed = (rigid ? CLOSED : std::max(IMPOSSIBLE * widest[k], CLOSED)) * unit_[row];
      if (!binds && (apart_[row] > allowed || doubtful(apart_[row], allowed))) return false;
    }
    return true;
  }

  // L Lᵀ = D^-½ A D^-½, D the diagonal of A, in place of the lower half; false where A is not clearly regular: `scaled`,
  // in this scaling, or else as it is.
  static bool factorise(std::vector<double>& a, int n, std::vector<double>& size, bool scaled) {
    size.resize(n);
    double most = 0, least = INFINITY, pivot = INFINITY;
    for (int i = 0; i < n; ++i) {
      const double own = a[i * n + i];
      if (!(own > 0) || !std::isfinite(own)) return false;
      most = std::max(most, own), least = std::min(least, own);
      size[i] = std::sqrt(own);
    }
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j) {
        double rest = a[i * n + j] / (size[i] * size[j]);
        for (int k = 0; k < j; ++k) rest -= a[i * n + k] * a[j * n + k];
        if (i != j) {
          a[i * n + j] = rest / a[j * n + j];
          continue;
        }
        if (!(rest > FIRM)) return false;
        pivot = std::min(pivot, rest);
        a[i * n + i] = std::sqrt(rest);
      }
    return n == 0 || (scaled ? least > 1e-11 * most : pivot * least > 1e-12 * most);
  }

  // w = L^-1 D^-½ b
  static void forward(const std::vector<double>& l, int n, const std::vector<double>& size, double* w) {
    for (int i = 0; i < n; ++i) {
      double rest = w[i] / size[i];
      for (int k = 0; k < i; ++k) rest -= l[i * n + k] * w[k];
      w[i] = rest / l[i * n + i];
    }
  }

  // Adds posture n to the usual sizes; false where M or J M⁻¹ Jᵀ is not clearly regular.
  bool compliance(int n, const double* p, double length) {
    const int nv = m_.nv, rows = static_cast<int>(m_.kept.size());
    if (n == 0) masses(p);
    const double* columns = mass_.data() + static_cast<std::size_t>(n) * nv * nv;
    factor_.resize(nv * nv);
    for (int i = 0; i < nv; ++i)
      for (int j = 0; j < nv; ++j)
        factor_[i * nv + j] =
            0.5 * (columns[i * nv + j] + columns[j * nv + i]) * column(i, length) * column(j, length);
    if (!factorise(factor_, nv, own_, true)) return false;
    w_.resize(rows * nv);
    for (int k = 0; k < rows; ++k) {
      double square = 0;
      for (int j = 0; j < nv; ++j) {
        const double entry = jacobian(n, m_.kept[k], j) / unit_[m_.kept[k]];
        w_[k * nv + j] = entry;
        square += entry * entry;
      }
      square_[k] = std::max(square_[k], square);
      forward(factor_, nv, own_, &w_[k * nv]);
    }
    c_.resize(rows * rows);
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < rows; ++j) {
        double entry = 0;
        for (int k = 0; k < nv; ++k) entry += w_[i * nv + k] * w_[j * nv + k];
        c_[i * rows + j] = entry;
      }
    diagonal_.resize(rows);
    for (int i = 0; i < rows; ++i) diagonal_[i] = c_[i * rows + i];
    if (!factorise(c_, rows, own_, false)) return false;
    found_.assign(rows * rows, 0.0);
    for (int i = 0; i < rows; ++i) {
      found_[i * rows + i] = 1;
      forward(c_, rows, own_, &found_[i * rows]);
      double stiffness = 0;
      for (int k = 0; k < rows; ++k) stiffness += found_[i * rows + k] * found_[i * rows + k];
      usual_[i] = std::max(usual_[i], std::min(diagonal_[i], SPREAD / std::max(stiffness, 1e-300)));
    }
    return true;
  }

  void masses(const double* p) {
    for (int i = 0; i < m_.inertia_count; ++i)
      std::copy_n(q_.data() + m_.inertia_posture[i] * m_.nq, m_.nq, inertia_q_.data() + static_cast<std::size_t>(i) * m_.nq);
    const double* in[] = {inertia_q_.data(), m_.directions, p};
    double* out[] = {mass_.data()};
    const std::int64_t strides[] = {m_.nq, m_.nv, 0};
    m_.inertia(in, out, strides, m_.inertia_count);
  }

  // The nearest power of ten; false near the middle between two.
  bool power_of_ten(double value, double* power) const {
    if (!(value > 0)) return *power = 1, std::isfinite(value);
    const double exponent = std::log10(value), whole = std::floor(exponent + 0.5);
    const long place = static_cast<long>(whole) - m_.least_power;
    if (std::fabs(std::fabs(exponent - whole) - 0.5) < CLEAR || !std::isfinite(exponent) || place < 0 ||
        place >= static_cast<long>(m_.powers.size()))
      return false;
    *power = m_.powers[place];
    return true;
  }
};

}  // namespace bellcrank
