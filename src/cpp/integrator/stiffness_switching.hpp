// Method "auto": DOP853 where the problem is not stiff, Radau IIA where it is.
//
// It begins with DOP853. When stiffness_detection.hpp finds the problem stiff, Radau goes on from the state reached. The
// other way the criterion is that of L. Petzold, Automatic selection of methods for solving stiff and nonstiff systems of
// ordinary differential equations, SIAM J. Sci. Stat. Comput. 4 (1983) 136-148: the method with the lower cost per time
// is used. DOP853's cost at its limit of stability is known from before the switch and grows with the spectral radius of
// the Jacobian; Radau's is counted over some steps. Both are in evaluations of the right-hand side, not in seconds, so that
// runs are the same on every machine and at every load.
//
// A run that DOP853 ends soon is left to it, stiff or not: the derivatives that Radau needs may have to be compiled first,
// which takes as long as some ten thousand evaluations, whatever their size.
//
// A switch to Radau that did not pay, less than halving the cost, makes the next one harder: it takes four times as many
// tests. One back to DOP853 that did not last does so too: the next takes twice as many of Radau's steps.
#pragma once

#include "explicit_runge_kutta.hpp"
#include "radau_iia.hpp"
#include "spectral_radius.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <int Blocks>
class StiffnessSwitching final : public LastStep {
  using Explicit = ExplicitRungeKutta<Dop853, Blocks>;
  using Implicit = Radau<(Blocks <= 3 ? Blocks : 0)>;

 public:
  static constexpr bool switches = true;

  explicit StiffnessSwitching(Rhs& rhs) : rhs_(rhs), p_(rhs.problem), explicit_(rhs), radius_(p_) {
    explicit_.stiffness.restart(series_);
    take_times();
  }
  ~StiffnessSwitching() { delete implicit_; }
  StiffnessSwitching(const StiffnessSwitching&) = delete;
  StiffnessSwitching& operator=(const StiffnessSwitching&) = delete;

  std::int64_t rejected = 0;
  bool implicit() const { return is_implicit_; }  // the method of the last step

  void add_counts(Counts& counts) const {
    explicit_.add_counts(counts);
    if (implicit_) {
      const std::int64_t stiff = counts.stiff_steps;
      implicit_->add_counts(counts);
      counts.stiff_steps = stiff;
    }
    counts.rejected = rejected;
    counts.implicit_steps = implicit_steps_;
    counts.implicit_evaluations = implicit_evaluations_ + (is_implicit_ ? rhs_.evaluations - entered_ : 0);
  }
  const double* state() const override { return is_implicit_ ? implicit_->state() : explicit_.state(); }
  const double* old_state() const override { return is_implicit_ ? implicit_->old_state() : explicit_.old_state(); }

  bool begin() { return is_implicit_ ? implicit_->begin() : explicit_.begin(); }
  void choose_step(double bound) { explicit_.choose_step(bound); }

  Outcome advance(double bound) {
    if (is_implicit_ ? explicit_pays() : implicit_may_pay()) change();
    if (!is_implicit_) return explicit_step(bound);
    const Outcome outcome = implicit_step(bound);
    if (outcome == Outcome::accepted || outcome == Outcome::out_of_evaluations) return outcome;
    change();  // DOP853 may pass a jump of a slope at which Newton's method fails
    return is_implicit_ ? outcome : explicit_step(bound);
  }

  // Goes on at another state with the method of the last step, with steps of size h at first.
  bool resume(double time, const double* x, double h) {
    const bool sound = is_implicit_ ? implicit_->resume(time, x, h) : explicit_.resume(time, x, h);
    take_times();
    return sound;
  }
  double next_step() const { return is_implicit_ ? implicit_->next_step() : explicit_.next_step(); }

  Outcome fixed(double end) {
    const Outcome outcome = is_implicit_ ? implicit_->fixed(end) : explicit_.fixed(end);
    take_times();
    return outcome;
  }

  void approximate(double s, double* x, bool finer = true) override {
    is_implicit_ ? implicit_->approximate(s, x, finer) : explicit_.approximate(s, x, finer);
  }
  bool prepare() override { return is_implicit_ ? implicit_->prepare() : explicit_.prepare(); }
  void interpolate(double s, double* x) { is_implicit_ ? implicit_->interpolate(s, x) : explicit_.interpolate(s, x); }
  bool redo(double h, double* x) override { return is_implicit_ ? implicit_->redo(h, x) : explicit_.redo(h, x); }

 private:
  static constexpr int first_window = 10;
  static constexpr double margin = 1.2;  // by which DOP853 has to be cheaper

  // What a method took to go on by so much time.
  struct Effort {
    double time = 0, cost = 0;
    int steps = 0;
    double rate() const { return cost > 0 ? time / cost : 0; }
  };

  Rhs& rhs_;
  const Problem& p_;
  Explicit explicit_;
  Implicit* implicit_ = nullptr;  // made at the first switch, because its derivatives may have to be compiled
  SpectralRadius radius_;
  bool is_implicit_ = false;
  Effort effort_;              // of the steps since the series of stiff steps began, or of Radau's window
  Effort phase_;               // of Radau's steps since the last switch
  double explicit_rate_ = 0;   // DOP853's time per cost before that
  double limit_ = 0;           // DOP853's time per cost at its limit of stability, times the spectral radius there
  double limit_step_ = 0;      // its step there, times the spectral radius
  int series_ = quick_series, window_ = first_window;
  std::int64_t explicit_steps_ = 0;  // since the last switch
  std::int64_t measured_ = 0;        // the number of the Jacobian whose spectral radius is known
  double known_radius_ = 0;
  std::int64_t implicit_steps_ = 0, implicit_evaluations_ = 0, entered_ = 0;

  void take_times() {
    t = is_implicit_ ? implicit_->t : explicit_.t, t_old = is_implicit_ ? implicit_->t_old : explicit_.t_old;
    rejected = explicit_.rejected + (implicit_ ? implicit_->rejected : 0);
  }

  Outcome explicit_step(double bound) {
    const std::int64_t begun = rhs_.evaluations;
    const Outcome outcome = explicit_.advance(bound);
    take_times();
    if (outcome != Outcome::accepted) return outcome;
    ++explicit_steps_;
    if (explicit_.stiffness.suspicions() == 0) effort_ = {};
    effort_.time += t - t_old, effort_.cost += rhs_.evaluations - begun, ++effort_.steps;
    return outcome;
  }

  // Cost of Radau beside evaluations: a Jacobian is about n / 3 of them, two factorisations are about one.
  double overhead() const {
    Counts counts;
    implicit_->add_counts(counts);
    return counts.jacobians * (p_.n / 3.0) + 0.5 * counts.factorisations;
  }

  Outcome implicit_step(double bound) {
    const std::int64_t begun = rhs_.evaluations;
    const double before = overhead();
    const Outcome outcome = implicit_->advance(bound);
    take_times();
    if (outcome != Outcome::accepted) return outcome;
    ++implicit_steps_;
    for (Effort* effort : {&effort_, &phase_}) {
      effort->time += t - t_old, effort->cost += rhs_.evaluations - begun + overhead() - before, ++effort->steps;
    }
    return outcome;
  }

  // Where the equations are stiff, and DOP853 would take many evaluations to the end.
  bool implicit_may_pay() const {
    return explicit_.stiffness.stiff() && p_.t1 - t > costly * effort_.rate();
  }

  // After each window of Radau's steps: whether DOP853 at its limit of stability would go on faster.
  bool explicit_pays() {
    if (effort_.steps < window_) return false;
    const double radius = spectral_radius(), rate = effort_.rate();
    effort_ = {};
    return radius > 0 && limit_ > margin * rate * radius;
  }

  double spectral_radius() {
    if (measured_ != implicit_->equations().jacobians) {
      measured_ = implicit_->equations().jacobians;
      known_radius_ = radius_(implicit_->equations().jacobian());
    }
    return known_radius_;
  }

  // Goes on with the other method; where that fails, with this one.
  void change() {
    if (is_implicit_ ? to_explicit() : to_implicit()) {
      if (is_implicit_) implicit_evaluations_ += rhs_.evaluations - entered_;
      is_implicit_ = !is_implicit_;
      entered_ = rhs_.evaluations;
      effort_ = {};
    }
  }

  bool to_implicit() {
    const bool lasted = explicit_steps_ >= 10 * series_ || phase_.steps == 0;
    window_ = lasted ? first_window : window_ < 640 ? 2 * window_ : window_;
    if (!implicit_) implicit_ = new Implicit(rhs_);
    const double h = effort_.time / effort_.steps, rate = effort_.rate();
    explicit_.stiffness.restart(series_);
    explicit_steps_ = 0;
    effort_ = phase_ = {};
    if (!implicit_->resume(t, explicit_.state(), h)) return false;
    explicit_rate_ = rate;
    limit_ = rate * spectral_radius(), limit_step_ = h * spectral_radius();
    return true;
  }

  bool to_explicit() {
    const bool paid = phase_.rate() > 2 * explicit_rate_;
    series_ = paid ? quick_series : series_ < 100000 ? 4 * series_ : series_;
    explicit_.stiffness.restart(series_);
    return explicit_.resume(t, implicit_->state(), smaller(limit_step_ / spectral_radius(), implicit_->next_step()));
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
