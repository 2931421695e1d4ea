// Explicit Runge-Kutta methods: RK4, RK45 and DOP853, whose tables are in runge_kutta_tableaus.hpp. The state is stored
// in blocks of four lanes, padded with zeros; `Blocks` fixes their number at compile time (0: any number), and the sums
// over stages are unrolled from the table without its zeros.
#pragma once

#include "dense_output.hpp"
#include "last_step.hpp"
#include "step_size_control.hpp"
#include "stiffness_detection.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <class Method, int Blocks>
class ExplicitRungeKutta final : public LastStep {
 public:
  static constexpr bool switches = false;

  explicit ExplicitRungeKutta(Rhs& rhs)
      : rhs_(rhs), p_(rhs.problem), blocks_((p_.n + 3) / 4), main_(blocks_, rhs), redo_(blocks_, rhs), x_(lanes()),
        old_(lanes()), tolerance_(lanes()), polynomials_(blocks()) {
    for (int i = 0; i < static_cast<int>(lanes()); ++i) tolerance_[i] = i < p_.norm_size ? p_.atol : INFINITY;
    std::memcpy(x_, p_.x0, p_.n * sizeof(double));
    rhs_.normalise(x_);
    t = t_old = p_.t0;
  }

  std::int64_t rejected = 0;
  void add_counts(Counts& counts) const {
    counts.rejected = rejected;
    counts.stiff_steps = stiffness.steps(), counts.stiff_since = stiffness.since();
  }
  StiffnessDetector stiffness;
  const double* state() const override { return x_; }
  const double* old_state() const override { return old_; }

  // First stage at the current time, from the side after a jump there.
  bool begin() {
    ++rhs_.evaluations;
    std::memcpy(main_.x, x_, lanes() * sizeof(double));
    main_.in.at(rhs_.rest(), 0);
    return rhs_(main_.in, t, main_.out + last) == 0 && finite(main_.k + last * lanes());
  }

  void choose_step(double bound) {
    next_ = p_.first_step > 0 ? p_.first_step
                              : first_step(rhs_, t, x_, main_.k + last * lanes(), bound, Method::estimator);
  }

  // Takes over a step that was made elsewhere: its ends, and the slopes of its stages (last + 1 rows of n).
  void take_over(double from, double to, const double* old, const double* x, const double* slopes) {
    const std::size_t bytes = p_.n * sizeof(double);
    t_old = from, t = to;
    polynomials_ready_ = dense_ready_ = false;
    std::memcpy(old_, old, bytes), std::memcpy(x_, x, bytes);
    for (int s = 0; s <= last; ++s) std::memcpy(main_.k + s * lanes(), slopes + s * p_.n, bytes);
    main_.first = main_.k;
  }

  // One accepted step that does not cross `bound`.
  Outcome advance(double bound) {
    begin_step();
    const double least = 10 * spacing(t_old);
    double h = larger(smaller(next_, p_.max_step), least);
    bool again = false, bad = false;
    for (;; ++rejected, again = true) {
      if (h < least) return give_up(bad ? Outcome::non_finite : Outcome::too_small);
      if (rhs_.out_of_evaluations()) return give_up(Outcome::out_of_evaluations);
      const double proposed = h;
      double end = t_old + h;
      if (end > bound) end = bound;
      h = end - t_old;
      const bool sound = step(main_, h, x_);
      const double error = sound ? error_square(h) : NAN;
      if (error < 1 && finish(end)) {
        next_ = size_after(h, size_factor<Method>(error), again, end == bound, proposed);
        if (stiffness.due()) test_stiffness(h);
        return Outcome::accepted;
      }
      main_.first = main_.k;
      bad = !(error < INFINITY) || error < 1;
      h = size_instead(h, size_factor<Method>(error), bad);
    }
  }

  // Goes on at a state that another method reached, with steps of size h at first. False: its slope is not finite.
  bool resume(double time, const double* x, double h) {
    t = t_old = time, next_ = h;
    std::memcpy(x_, x, p_.n * sizeof(double));
    return begin();
  }
  double next_step() const { return next_; }
  const double* slope() const { return main_.k + last * lanes(); }  // at the current time

  // One step of fixed size.
  Outcome fixed(double end) {
    begin_step();
    if (rhs_.out_of_evaluations()) return give_up(Outcome::out_of_evaluations);
    const bool sound = step(main_, end - t_old, x_) && (!Method::fsal || finite(x_));
    if (!sound || !finish(end)) return give_up(Outcome::non_finite);
    return Outcome::accepted;
  }

  // x at t_old + s (t - t_old) without new evaluations: by the dense output if it is there, or by a polynomial through
  // both ends and slopes of stages, of degree 6, or 5 where not `finer`.
  void approximate(double s, double* x, bool finer = true) override {
    if (dense_ready_) return interpolate(s, x);
    begin_polynomials();
    polynomials_.approximate(last_step(), s, vectors(x), finer);
    rhs_.normalise(x);
  }

  bool prepare() override {
    if (dense_ready_) return true;
    begin_polynomials();
    if constexpr (Method::fsal) return true;
    else if constexpr (Method::extra == 3) evaluate_stages();
    else evaluate_slope();
    return dense_ready_;
  }

  void interpolate(double s, double* x) {
    polynomials_.interpolate(last_step(), s, vectors(x));
    rhs_.normalise(x);
  }

  bool redo(double h, double* x) override {
    std::memcpy(redo_.k, main_.k, lanes() * sizeof(double));
    const bool sound = step<Method::fsal>(redo_, h, x);  // else both are the same, compiled once
    rhs_.normalise_and_project(t_old + h, x);
    return sound && finite(x);
  }

 private:
  static constexpr int last = Method::stages;  // row of the first stage of the next step
  using Polynomials = StepPolynomials<Method, OneRun, Blocks>;

  Rhs& rhs_;
  const Problem& p_;
  int blocks_;
  Stages<Method, Blocks> main_, redo_;
  Room<double, 4 * Blocks> x_, old_, tolerance_;
  Polynomials polynomials_;
  double next_ = 0;
  bool polynomials_ready_ = false, dense_ready_ = false;  // what polynomials_ holds of the last step

  int blocks() const { return Blocks ? Blocks : blocks_; }
  std::size_t lanes() const { return 4 * static_cast<std::size_t>(blocks()); }

  void begin_step() {
    t_old = t;
    polynomials_ready_ = dense_ready_ = false;
    const double* f = main_.k + last * lanes();
    for (int b = 0; b < blocks(); ++b) {
      at(old_ + 4 * b) = at(x_ + 4 * b);
      at(main_.k + 4 * b) = Blocks ? fresh(f + 4 * b) : at(f + 4 * b);
    }
    main_.first = f;
  }

  Outcome give_up(Outcome outcome) {
    std::memcpy(x_, old_, lanes() * sizeof(double));
    return outcome;
  }

  template <int S>
  BELLCRANK_INLINE std::int32_t stage(Stages<Method, Blocks>& stages, double h) {
    if (Blocks && p_.staged) stages.template but_newest<S>(old_, h);
    else stages.template sum<S>(old_, h, stages.x);
    return rhs_(stages.in, t_old + Method::c[S] * h, stages.out + S);
  }

  template <int... S>
  BELLCRANK_INLINE std::int32_t all_stages(Stages<Method, Blocks>& stages, double h, std::integer_sequence<int, S...>) {
    std::int32_t status = 0;
    ((status |= stage<S + 1>(stages, h)), ...);
    return status;
  }

  // All stages after the first, and the new state; for a first-same-as-last method also its slope, for the error.
  template <bool Redo = false>
  bool step(Stages<Method, Blocks>& stages, double h, double* x) {
    std::int32_t status = all_stages(stages, h, std::make_integer_sequence<int, Method::stages - 1>{});
    rhs_.evaluations += Method::stages - 1;
    stages.template sum<last>(old_, h, x);
    if constexpr (Method::fsal && !Redo) {
      rhs_.normalise_and_project(t_old + h, x);
      status |= slope(t_old + h, h);
    }
    return status == 0;
  }

  // The slope at the end of a step of size h.
  std::int32_t slope(double time, double h) {
    if (Blocks && p_.staged && !p_.unit_count && !p_.project) {
      main_.template but_newest<last>(old_, h);
    } else {
      for (int b = 0; b < blocks(); ++b) at(main_.x + 4 * b) = at(x_ + 4 * b);
      main_.in.at(rhs_.rest(), 0);
    }
    ++rhs_.evaluations;
    return rhs_(main_.in, time, main_.out + last);
  }

  // After the error test: projection and the slope at the end. False where that or the state is not finite.
  bool finish(double end) {
    if constexpr (!Method::fsal) {
      rhs_.normalise_and_project(end, x_);
      if (slope(end, end - t_old) != 0 || !finite(main_.k + last * lanes(), x_)) return false;
    }
    t = end;
    return true;
  }

  __attribute__((noinline)) void test_stiffness(double h) {
    if constexpr (Method::estimator > 0) {
      constexpr int stage = last - 1;  // at the step's end as well
      double* argument = redo_.x;
      main_.template sum<stage>(old_, h, argument);
      const double *x = x_, *old = old_, *k = main_.k;
      stiffness.note(step_held_short<Method>(p_, h, {old, k}, {argument, k + stage * lanes()}, {x, slope()}), t_old);
    }
  }

  bool finite(const double* x) const { return finite(x, rhs_.rest()); }
  // Both; f may just have been written.
  BELLCRANK_INLINE bool finite(const double* f, const double* x) const {
    Lanes sum = {};
    for (int b = 0; b < blocks(); ++b) sum += (Blocks ? fresh(f + 4 * b) : at(f + 4 * b)) * 0.0 + at(x + 4 * b) * 0.0;
    return total(sum) == 0;
  }

  // Square of the error norm: entries outside it have an infinite tolerance.
  double error_square(double h) const {
    const double *k = main_.k, *old = old_, *x = x_, *tolerance = tolerance_;
    ErrorSums<Method, Lanes, (Blocks > 0)> sums;
    for (int b = 0; b < blocks(); ++b) {
      const Lanes y = magnitude(vectors(old)[b]), z = magnitude(vectors(x)[b]);
      sums.add(vectors(k) + b, blocks(), 1.0 / (vectors(tolerance)[b] + p_.rtol * (y > z ? y : z)));
    }
    return norm_square<Method>(h, total(sums.fifth), total(sums.third), p_.norm_size);
  }

  typename Polynomials::Step last_step() const {
    const double *old = old_, *x = x_, *k = main_.k;
    return {vectors(old), vectors(x), vectors(k), static_cast<std::size_t>(blocks()), t - t_old};
  }

  void begin_polynomials() {
    if (!polynomials_ready_) make_polynomials();
  }
  __attribute__((noinline)) void make_polynomials() {
    polynomials_.begin(last_step());
    polynomials_ready_ = true;
  }

  void evaluate_stages() {
    const double h = t - t_old;
    std::int32_t status = stage<13>(main_, h);
    status |= stage<14>(main_, h);
    status |= stage<15>(main_, h);
    rhs_.evaluations += 3;
    const double *x = x_, *tolerance = tolerance_;
    const auto scale = [&](std::size_t b) { return 1.0 / (vectors(tolerance)[b] + p_.rtol * magnitude(vectors(x)[b])); };
    dense_ready_ = polynomials_.complete(last_step(), scale, blocks(), p_.norm_size) && status == 0;
  }

  void evaluate_slope() {
    constexpr double s = Polynomials::corrected;
    approximate(s, redo_.x);
    redo_.in.at(rhs_.rest(), 0);
    ++rhs_.evaluations;
    double* slope = redo_.out[1];
    const std::int32_t status = rhs_(redo_.in, t_old + s * (t - t_old), &slope);
    dense_ready_ = polynomials_.correct(last_step(), vectors(slope)) && status == 0;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
