// Radau IIA of order 5: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, sec. IV.8.
#pragma once

#include "last_step.hpp"
#include "simplified_newton.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <int Blocks>
class Radau final : public LastStep {
 public:
  static constexpr bool switches = false;

  explicit Radau(Rhs& rhs)
      : rhs_(rhs), p_(rhs.problem), equations_(rhs), x_(lanes()), old_(lanes()), f_(lanes()), start_f_(lanes()),
        end_f_(lanes()), base_(lanes()), q_(3 * lanes()), between_(lanes()), rates_(2 * lanes()),
        quadratures_(4 * lanes()) {
    std::memcpy(x_, p_.x0, p_.n * sizeof(double));
    rhs_.normalise(x_);
    t = t_old = p_.t0;
  }

  std::int64_t rejected = 0;
  void add_counts(Counts& counts) const {
    counts.rejected = rejected;
    counts.jacobians = equations_.jacobians;
    counts.factorisations = equations_.factorisations;
    counts.implicit_steps = counts.accepted, counts.implicit_evaluations = rhs_.evaluations;
  }
  const double* state() const override { return x_; }
  const double* old_state() const override { return old_; }

  bool begin() {
    if (!equations_.slope(x_, t, f_)) return false;
    dense_h_ = 0;  // what lies before a stop says nothing of what follows
    return equations_.renew_jacobian(t, x_);
  }

  // Goes on at a state that another method reached, with steps of size h at first. False: its slope is not finite.
  bool resume(double time, const double* x, double h) {
    t = t_old = time, next_ = h, last_h_ = 0;
    copy(x_, x);
    return begin();
  }
  double next_step() const { return next_; }
  const StageEquations<Blocks>& equations() const { return equations_; }
  const double* slope() const { return f_; }  // at the current time

  void choose_step(double bound) {
    next_ = p_.first_step > 0 ? p_.first_step : first_step(rhs_, t, x_, f_, bound, RadauIIA::estimator);
  }

  Outcome advance(double bound) {
    begin_step();
    const double least = 10 * spacing(t_old);
    double h = next_;
    if (h > p_.max_step || h < least) {
      h = h < least ? least : p_.max_step;
      last_h_ = 0;
    }
    const double planned = h;
    bool again = false, bad = false;
    for (;; ++rejected) {
      if (h < least) return give_up(bad ? Outcome::non_finite : Outcome::too_small);
      if (rhs_.out_of_evaluations()) return give_up(Outcome::out_of_evaluations);
      double end = t_old + h;
      if (end > bound) end = bound;
      h = end - t_old;
      equations_.tolerances(old_, old_);
      const Newton newton = solve(h, [&] { return equations_.iterate(t_old, h, old_); });
      bad = newton.bad;
      if (!newton.converged) {
        h *= 0.5;
        continue;
      }
      sum(x_, old_, equations_.last());
      equations_.tolerances(old_, x_);
      double error = equations_.estimate(h, f_);
      if (again && error > 1) {  // damp the stiff parts of the estimate once more
        sum(between_, old_, equations_.error());
        error = equations_.slope(between_, t_old, end_f_) ? equations_.estimate(h, end_f_) : NAN;
      }
      constexpr int most = StageEquations<Blocks>::most_iterations;
      const double careful = safety * (2 * most + 1) / (2 * most + newton.iterations);
      const double factor = careful * predicted(h, error);
      rhs_.normalise_and_project(end, x_);
      if (error <= 1 && equations_.slope(x_, end, end_f_)) {
        accept(end, h, error, planned, factor, newton, end == bound && !again);
        return Outcome::accepted;
      }
      bad = !(error > 1 && error < INFINITY);
      h *= bad ? least_factor : larger(least_factor, factor);
      again = true;
    }
  }

  Outcome fixed(double end) {
    begin_step();
    if (rhs_.out_of_evaluations()) return give_up(Outcome::out_of_evaluations);
    const double h = end - t_old;
    const Newton newton = solve(h, [&] { return equations_.iterate_fully(t_old, h, old_); });
    if (!newton.converged) return give_up(newton.bad ? Outcome::non_finite : Outcome::too_small);
    sum(x_, old_, equations_.last());
    rhs_.normalise_and_project(end, x_);
    if (!equations_.slope(x_, end, end_f_)) return give_up(Outcome::non_finite);
    keep_dense(h);
    equations_.jacobian_is_new = false;
    t = end;
    if (newton.iterations > 10 && !equations_.renew_jacobian(t, x_)) return give_up(Outcome::non_finite);
    return Outcome::accepted;
  }

  void approximate(double s, double* x, bool = true) override { interpolate(s, x); }
  void interpolate(double s, double* x) {
    for (int b = 0; b < blocks(); ++b) at(x + 4 * b) = at(base_ + 4 * b) + polynomial(s, b);
    if (quadratures_ready_)
      for (int i = p_.norm_size; i < p_.n; ++i) {
        const double* c = quadratures_ + 4 * i;
        x[i] = base_[i] + s * (c[0] + s * (c[1] + s * (c[2] + s * c[3])));
      }
    rhs_.normalise(x);
  }

  // The cubic through the stages is too inaccurate for quadratures, whose rates may be cubics of time. Their dense output
  // is the integral of the cubic through the rates at the start, the end and the two stages between them, evaluated
  // anew there; at the step's end that is the method's own weights again.
  bool prepare() override {
    if (prepared_ || p_.norm_size == p_.n) return true;
    prepared_ = true;
    const double h = dense_h_;
    constexpr auto& c = RadauIIA::c;
    for (int j = 0; j < 2; ++j) {
      interpolate(c[j], between_);
      if (!equations_.slope(between_, dense_t_ + c[j] * h, rates_ + j * lanes())) return true;
    }
    for (int i = p_.norm_size; i < p_.n; ++i) {
      // divided differences on 0, c0, c1, 1
      const double at_0 = start_f_[i], at_1 = rates_[i], at_2 = rates_[lanes() + i], at_3 = f_[i];
      const double d1 = (at_1 - at_0) / c[0], d12 = (at_2 - at_1) / (c[1] - c[0]), d23 = (at_3 - at_2) / (1 - c[1]);
      const double dd1 = (d12 - d1) / c[1], dd2 = (d23 - d12) / (1 - c[0]), ddd = dd2 - dd1;
      double* power = quadratures_ + 4 * i;
      power[0] = h * at_0;
      power[1] = h / 2 * (d1 - c[0] * dd1 + c[0] * c[1] * ddd);
      power[2] = h / 3 * (dd1 - (c[0] + c[1]) * ddd);
      power[3] = h / 4 * ddd;
    }
    quadratures_ready_ = true;
    return true;
  }

  // From the same start and with the same Jacobian.
  bool redo(double h, double* x) override {
    extrapolate(h, base_);
    if (!equations_.factors(h) || !equations_.iterate_fully(dense_t_, h, base_).converged) return false;
    sum(x, base_, equations_.last());
    rhs_.normalise_and_project(dense_t_ + h, x);
    return true;
  }

 private:
  Rhs& rhs_;
  const Problem& p_;
  StageEquations<Blocks> equations_;
  // base_, q_: the start of the last step and its collocation polynomial
  Buffer x_, old_, f_, start_f_, end_f_, base_, q_, between_, rates_, quadratures_;
  double next_ = 0, last_h_ = 0, last_error_ = 0, dense_t_ = 0, dense_h_ = 0;
  bool prepared_ = false, quadratures_ready_ = false;

  int blocks() const { return equations_.blocks(); }
  std::size_t lanes() const { return equations_.lanes(); }
  void copy(double* to, const double* from) const {
    for (int b = 0; b < blocks(); ++b) at(to + 4 * b) = at(from + 4 * b);
  }
  void sum(double* to, const double* x, const double* y) const {
    for (int b = 0; b < blocks(); ++b) at(to + 4 * b) = at(x + 4 * b) + at(y + 4 * b);
  }

  void begin_step() {
    t_old = t;
    copy(old_, x_);
  }
  Outcome give_up(Outcome outcome) {
    copy(x_, old_);
    t = t_old;
    return outcome;
  }

  // The stages of a step of size h, with a new Jacobian where the kept one does not serve.
  template <class Iterate>
  BELLCRANK_INLINE Newton solve(double h, const Iterate& iterate) {
    for (;;) {
      extrapolate(h, old_);
      const Newton newton = equations_.factors(h) ? iterate() : Newton{};
      if (newton.converged || equations_.jacobian_is_new) return newton;
      if (!equations_.renew_jacobian(t_old, old_)) return newton;
    }
  }

  BELLCRANK_INLINE Lanes polynomial(double s, int b) const {
    const std::size_t w = lanes();
    const double* q = q_ + 4 * b;
    return s * (at(q) + s * (at(q + w) + s * at(q + 2 * w)));
  }
  // The step just taken: its polynomial and the slopes at its ends.
  void keep_dense(double h) {
    const std::size_t w = lanes();
    const auto& d = RadauIIA::dense;
    for (int b = 0; b < blocks(); ++b) {
      const double* z = equations_.stages() + 4 * b;
      at(base_ + 4 * b) = at(old_ + 4 * b);
      at(start_f_ + 4 * b) = at(f_ + 4 * b);
      at(f_ + 4 * b) = at(end_f_ + 4 * b);
      for (int j = 0; j < 3; ++j)
        at(q_ + j * w + 4 * b) = d[0][j] * at(z) + d[1][j] * at(z + w) + d[2][j] * at(z + 2 * w);
    }
    dense_t_ = t_old;
    dense_h_ = h;
    prepared_ = quadratures_ready_ = false;
  }

  // First guess of the stages from the last step's polynomial, less the start.
  void extrapolate(double h, const double* start) {
    const std::size_t w = lanes();
    double* z = equations_.stages();
    if (dense_h_ == 0) return static_cast<void>(std::memset(z, 0, 3 * w * sizeof(double)));
    for (int j = 0; j < 3; ++j) {
      const double s = (t_old - dense_t_ + RadauIIA::c[j] * h) / dense_h_;
      for (int b = 0; b < blocks(); ++b)
        at(z + j * w + 4 * b) = at(base_ + 4 * b) - at(start + 4 * b) + polynomial(s, b);
    }
  }

  // The controller that extrapolates the error from the last step and this one.
  double predicted(double h, double error) const {
    if (error == 0) return INFINITY;
    const double own = 1 / std::sqrt(std::sqrt(error));
    if (!(last_h_ > 0 && last_error_ > 0)) return own;
    return own * smaller(1, h / last_h_ * std::sqrt(std::sqrt(last_error_)) * own);
  }

  void accept(double end, double h, double error, double planned, double factor, const Newton& newton, bool clipped) {
    keep_dense(h);
    t = end;
    const bool renew = newton.iterations > 2 && newton.rate > 1e-3;
    factor = smaller(largest_factor, factor);
    if (!renew && factor < 1.2) factor = 1;
    // not finite: the next step fails, halves, and says so
    if (renew && t < p_.t1) equations_.renew_jacobian(t, x_);
    else equations_.jacobian_is_new = false;
    last_h_ = h;
    last_error_ = error;
    next_ = h * factor;
    if (clipped) next_ = larger(next_, planned);
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
