// Sensitivities S = dx/dp along a run: S' = f_x S + f_p beside x' = f, by DOP853 for both. The stages of x are the points at
// which directional derivatives are evaluated, for all directions in blocks of SIMD lanes. Steps are those of the run where
// it was made by DOP853; a step whose error is too large, of x or of S, is divided. This is the simultaneous method with
// error control of both. Source: A. C. Hindmarsh et al., SUNDIALS, ACM Trans. Math. Softw. 31 (2005), sec. 2.3 (CVODES).
#pragma once

#include "dense_output.hpp"
#include "sensitivities.hpp"
#include "step_size_control.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

class SensitivityPass {
 public:
  SensitivityPass(const SensitivityProblem& problem, SensitivityRecord& record, SensitivityCounts& counts)
      : d_(problem), p_(problem.run), record_(record), counts_(counts), rhs_(problem.run),
        m_(p_.nq + p_.nv), width_(problem.lanes), blocks_((problem.directions + width_ - 1) / width_),
        first_((p_.n + 7) / 8 * 8), block_(static_cast<std::size_t>(m_) * width_),
        size_((first_ + blocks_ * block_ + 7) / 8 * 8), y_(size_), old_(size_), stage_(size_), k_(size_ * Method::rows),
        errors_(2 * size_), kept_(2 * size_), largest_(2 * blocks_ * width_), changes_(blocks_ * lanes_of(d_.parameters)),
        tape_(largest_tape()), polynomials_((size_ - first_) / 4) {}

  Status operator()() {
    start();
    for (std::size_t i = 0, mark = 0, stop = 0; i < d_.bound_count; ++i) {
      const double bound = d_.bounds[i];
      while (stop < static_cast<std::size_t>(p_.stop_count) && p_.stops[stop] <= t_) ++stop;
      const bool last = stop == static_cast<std::size_t>(p_.stop_count);
      if (stop != pinned_) {  // forces may jump at a stop
        rhs_.pin(t_, last ? p_.t1 : p_.stops[stop]);
        rhs_.latest = last ? p_.latest : std::nextafter(p_.stops[stop], p_.t0);
        pinned_ = stop;
        if (!slope(t_, k_ + last_ * size_)) return Status::non_finite;
      }
      if (d_.given_steps && next_ > 0.6 * (bound - t_)) next_ = larger(next_, bound - t_);
      while (t_ < bound) {
        const Status status = advance(bound);
        if (status != Status::finished) return status;
        rows();
        if (!(++counts_.steps & 255) && record_.interrupted()) return Status::interrupted;
      }
      if (d_.marked[i]) scatter(y_ + first_, record_.mark(mark++), record_.mark_stride());
    }
    return Status::finished;
  }

 private:
  using Method = Dop853;
  using Polynomials = StepPolynomials<Method, OneRun, 0>;
  static constexpr int last_ = Method::stages;  // row of the slope at a step's end
  static constexpr double most_projected = 1e4, least_projected = 1e-7;  // tolerances; more than rounding

  const SensitivityProblem& d_;
  const Problem& p_;
  SensitivityRecord& record_;
  SensitivityCounts& counts_;
  Rhs rhs_;
  int m_, width_;
  std::size_t blocks_, first_, block_, size_;
  // x, then the blocks of S: entry i of lane l of a block is at [i * width + l]
  Buffer y_, old_, stage_, k_, errors_, kept_, largest_, changes_, tape_;
  Polynomials polynomials_;
  double t_ = 0, t_old_ = 0, next_ = 0;
  std::size_t next_row_ = 0, pinned_ = static_cast<std::size_t>(-1);
  bool dense_ready_ = false;
  std::int32_t status_ = 0;  // of the last evaluation at a point

  std::size_t lanes_of(int entries) const { return static_cast<std::size_t>(entries) * width_; }
  std::size_t largest_tape() const {
    int most = 1;
    for (const Directional* f : {&d_.rate, &d_.fallback, &d_.project, &d_.project_fallback})
      most = f->point && f->tape > most ? f->tape : most;
    return static_cast<std::size_t>(most);
  }

  void start() {
    t_ = p_.t0, next_ = d_.first_step;
    std::memcpy(y_, p_.x0, p_.n * sizeof(double));
    for (int i = m_; i < p_.n; ++i) y_[i] = 0;
    for (int j = 0; j < d_.directions; ++j) {
      const std::size_t block = j / width_, lane = j % width_;
      for (int i = 0; i < m_; ++i) y_[first_ + block * block_ + i * width_ + lane] = d_.seeds[j * m_ + i];
      for (int i = 0; i < d_.parameters; ++i)
        changes_[block * lanes_of(d_.parameters) + i * width_ + lane] = d_.changes[j * d_.parameters + i];
    }
    note_largest();
    while (next_row_ < d_.time_count && d_.times[next_row_] <= t_) take_row(y_ + first_);
  }

  // ---- evaluations

  // (x', S') at (time, y).
  bool slope(double time, double* out, const double* y) {
    time = smaller(time, rhs_.latest);
    if (p_.signal_count) rhs_.signals(time);
    ++counts_.evaluations;
    const Directional& f = at_point(time, y, out);
    std::int32_t status = status_;
    for (std::size_t b = 0; b < blocks_; ++b)
      status |= along(f, y + first_ + b * block_, b, out + first_ + b * block_);
    return status == 0;
  }
  bool slope(double time, double* out) { return slope(time, out, y_); }

  // The rate at a point and the tape of the derivative that holds there.
  const Directional& at_point(double time, const double* x, double* rate) {
    const double* const in[] = {&time, x, rhs_.u(), p_.p};
    double guard = 1;
    double* const out[] = {rate, &guard, tape_};
    status_ = d_.rate.point(in, out);
    if (guard > 0 || !d_.fallback.point) return d_.rate;
    double* const other[] = {rate, tape_};
    status_ = d_.fallback.point(in, other);
    return d_.fallback;
  }

  std::int32_t along(const Directional& f, const double* direction, std::size_t block, double* out) {
    const double* const in[] = {tape_, direction, changes_ + block * lanes_of(d_.parameters)};
    double* const result[] = {out};
    return f.along(in, result);
  }

  // Makes S satisfy the constraints' derivatives at a state that satisfies the constraints. False where that changes a
  // direction by far more than the tolerance.
  bool project(double time, const double* x, double* s) {
    for (int i = 0; i < p_.unit_count; ++i)
      for (std::size_t b = 0; b < blocks_; ++b) make_tangent(p_.units[i], x, s + b * block_);
    if (!d_.project.point) return true;
    time = smaller(time, rhs_.latest);
    if (p_.signal_count) rhs_.signals(time);
    const double* const in[] = {&time, x, rhs_.u(), p_.p};
    double guard = 1;
    double* const out[] = {&guard, tape_};
    const Directional* f = &d_.project;
    std::int32_t status = f->point(in, out);
    if (!(guard > 0)) {
      double* const other[] = {tape_};
      f = &d_.project_fallback;
      status = f->point(in, other);
    }
    bool near = true;
    for (std::size_t b = 0; b < blocks_; ++b) {
      double* block = s + b * block_;
      if ((status | along(*f, block, b, errors_)) != 0) return false;
      near &= small(b, block);
      for (std::size_t i = 0; i < block_; ++i) block[i] += errors_[i];
    }
    return near;
  }

  // Whether a correction of a block's directions (in errors_) is small beside their largest entries.
  bool small(std::size_t block, const double* s) const {
    const double most = larger(most_projected * d_.tolerance, least_projected);
    for (int l = 0; l < width_; ++l) {
      const std::size_t j = block * width_ + l;
      for (int part = 0; part < 2; ++part) {
        double largest = largest_[2 * j + part], moved = 0;
        for (int i = part ? p_.nq : 0; i < (part ? m_ : p_.nq); ++i) {
          largest = larger(largest, std::fabs(s[i * width_ + l]));
          moved = larger(moved, std::fabs(errors_[i * width_ + l]));
        }
        if (!(moved <= most * largest)) return false;
      }
    }
    return true;
  }

  // Takes out of S what would change the length of a unit vector.
  void make_tangent(const Unit& unit, const double* x, double* s) const {
    for (int l = 0; l < width_; ++l) {
      double sum = 0;
      for (int i = unit.start; i < unit.start + unit.length; ++i) sum += x[i] * s[i * width_ + l];
      for (int i = unit.start; i < unit.start + unit.length; ++i) s[i * width_ + l] -= sum * x[i];
    }
  }

  // ---- steps

  Status advance(double bound) {
    t_old_ = t_;
    dense_ready_ = false;
    std::memcpy(old_, y_, size_ * sizeof(double));
    std::memcpy(k_, k_ + last_ * size_, size_ * sizeof(double));
    bool again = false;
    for (;; ++counts_.rejected, again = true) {
      const double left = bound - t_old_;
      double h = smaller(next_, p_.max_step);
      if (h >= left) h = left;
      else if (2 * h > left) h = 0.5 * left;
      if (!(h > 10 * spacing(t_old_)) && h < left) return Status::step_too_small;
      if (counts_.evaluations >= p_.max_evaluations) return Status::evaluations_spent;
      const double error = stages(h) ? error_square(h) : NAN;
      if (error < 1) {
        t_ = h == left ? bound : t_old_ + h;
        rhs_.normalise_and_project(t_, y_);
        project(t_, y_, y_ + first_);
        if (slope(t_, k_ + last_ * size_)) {
          next_ = size_after(h, size_factor<Method>(error), again, h == left, next_);
          note_largest();
          return Status::finished;
        }
        t_ = t_old_;
      }
      next_ = size_instead(h, size_factor<Method>(error), !(error < INFINITY));
      if (!(next_ > 10 * spacing(t_old_))) return error < INFINITY ? Status::step_too_small : Status::non_finite;
    }
  }

  template <int S>
  BELLCRANK_INLINE void sum(double h, double* to) {
    const double *y = old_, *k = k_;
    stage_argument<Method, S>(vectors(y), vectors(k), size_ / 4, h, vectors(to));
  }
  template <int S>
  BELLCRANK_INLINE bool stage(double h) {
    sum<S>(h, stage_);
    return slope(t_old_ + Method::c[S] * h, k_ + S * size_, stage_);
  }
  template <int... S>
  bool all(double h, std::integer_sequence<int, S...>) {
    return (stage<S + 1>(h) && ...);
  }
  bool stages(double h) {
    if (!all(h, std::make_integer_sequence<int, Method::stages - 1>{})) return false;
    sum<last_>(h, y_);
    return true;
  }

  // Square of the error norm: the largest of x and of the columns of S, each relative to its own tolerance.
  double error_square(double h) {
    double *fifth = errors_, *third = errors_ + size_;
    const double* k = k_;
    for (std::size_t i = 0; i < size_ / 4; ++i) {
      vectors(fifth)[i] = weighted<Weights<Error5Of<Method>>, last_ - 1>(vectors(k) + i, size_ / 4);
      vectors(third)[i] = weighted<Weights<Error3Of<Method>>, last_ - 1>(vectors(k) + i, size_ / 4);
    }
    double a = 0, b = 0;
    for (int i = 0; i < m_; ++i) {
      const double scale = 1 / (p_.atol + p_.rtol * larger(std::fabs(old_[i]), std::fabs(y_[i])));
      a += fifth[i] * fifth[i] * scale * scale, b += third[i] * third[i] * scale * scale;
    }
    double worst = norm_square<Method>(h, a, b, m_);
    for (int j = 0; j < d_.directions; ++j) {
      const std::size_t at = first_ + (j / width_) * block_ + j % width_;
      a = b = 0;
      for (int part = 0; part < 2; ++part) {
        const int from = part ? p_.nq : 0, to = part ? m_ : p_.nq;
        double most = part ? larger(largest_[2 * j + 1], largest_[2 * j] / (p_.t1 - p_.t0)) : largest_[2 * j];
        for (int i = from; i < to; ++i) most = larger(most, std::fabs(y_[at + i * width_]));
        if (!(most < INFINITY)) return NAN;
        double f = 0, g = 0;
        for (int i = from; i < to; ++i) {
          f += fifth[at + i * width_] * fifth[at + i * width_];
          g += third[at + i * width_] * third[at + i * width_];
        }
        const double scale = 1 / larger(d_.tolerance * most, d_.floors[j]);
        a += f * scale * scale, b += g * scale * scale;
      }
      const double error = norm_square<Method>(h, a, b, m_);
      if (!(error <= worst)) worst = error;
    }
    return worst;
  }

  // The largest position and velocity of each direction so far.
  void note_largest() {
    for (int j = 0; j < d_.directions; ++j) {
      const double* s = y_ + first_ + (j / width_) * block_ + j % width_;
      for (int i = 0; i < m_; ++i) {
        double& most = largest_[2 * j + (i >= p_.nq)];
        most = larger(most, std::fabs(s[i * width_]));
      }
    }
  }

  // ---- rows

  void rows() {
    const double ulp = 4 * spacing(t_);
    while (next_row_ < d_.time_count && d_.times[next_row_] <= t_ + ulp) {
      const double time = d_.times[next_row_];
      if (t_ - time <= ulp) {
        take_row(y_ + first_);
      } else if (time - t_old_ <= ulp) {
        take_row(old_ + first_);
      } else {
        if (!dense_ready_) prepare();
        interpolate((time - t_old_) / (t_ - t_old_));
        if (!project(time, d_.states + next_row_ * p_.n, stage_ + first_)) repeat(time);
        take_row(stage_ + first_);
      }
    }
  }

  // S at a time within the step as the end of a shorter step, where the dense output misses the constraints: near a
  // posture in which they lose rank, its stages may be wrong.
  void repeat(double time) {
    std::memcpy(kept_, y_, size_ * sizeof(double));
    std::memcpy(kept_ + size_, k_ + last_ * size_, size_ * sizeof(double));
    if (stages(time - t_old_)) {
      rhs_.normalise_and_project(time, y_);
      project(time, y_, y_ + first_);
      std::memcpy(stage_, y_, size_ * sizeof(double));
    }
    std::memcpy(y_, kept_, size_ * sizeof(double));
    std::memcpy(k_ + last_ * size_, kept_ + size_, size_ * sizeof(double));
  }

  void take_row(const double* s) { scatter(s, record_.row(next_row_++), record_.row_stride()); }

  void scatter(const double* s, double* to, std::size_t stride) const {
    for (int j = 0; j < d_.directions; ++j) {
      const double* from = s + (j / width_) * block_ + j % width_;
      for (int i = 0; i < m_; ++i) to[j * stride + i] = from[i * width_];
    }
  }

  // The polynomials hold S alone: x is known in the rows.
  typename Polynomials::Step last_step() const {
    const double *old = old_, *y = y_, *k = k_;
    return {vectors(old + first_), vectors(y + first_), vectors(k + first_), size_ / 4, t_ - t_old_};
  }

  // The dense output of order 7, by three more stages.
  void prepare() {
    const double h = t_ - t_old_;
    stage<13>(h), stage<14>(h), stage<15>(h);
    polynomials_.complete(last_step());
    dense_ready_ = true;
  }

  void interpolate(double s) {
    double* to = stage_;
    polynomials_.interpolate(last_step(), s, vectors(to + first_));
  }
};

Status propagate(const SensitivityProblem& problem, SensitivityRecord& record, SensitivityCounts& counts) {
  return SensitivityPass(problem, record, counts)();
}

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
