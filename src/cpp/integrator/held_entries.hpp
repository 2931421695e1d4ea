// Entries of u that are constant between the instants of a run (problem.hpp): updates at given times, switches, whose
// sides turn where their functions change sign, and modes of joints with dry friction, which are found anew where a stuck
// joint's force reaches its limit or a sliding joint comes to rest. Within a step the equations are those of one side and
// so are smooth; a step in which a function changes its sign is taken again up to that time, and the run goes on from there
// on the other side.
#pragma once

#include <utility>

#include "bounded_forces.hpp"
#include "event_detection.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

class Held {
 public:
  Held(Rhs& rhs, LastStep& last, Record& record)
      : rhs_(rhs), p_(rhs.problem), h_(p_.held), record_(record), view_(functions(p_)), changes_(rhs, last, view_),
        count_(h_.switch_count + h_.mode_count), terminal_(count_), direction_(count_), turned_(count_), quick_(count_),
        before_(count_), load_side_(count_), old_(p_.n + 16), turn_time_(count_), done_(h_.update_count), modes_(h_.mode_count),
        found_(h_.mode_count * (h_.response_rows + h_.mode_count + 9)), fastest_(h_.mode_count), resting_(h_.mode_count), closed_(h_.mode_count),
        struck_(h_.mode_count), met_(h_.mode_count), ways_(h_.mode_count), state_(p_.n + 16), after_(h_.mode_count) {
    for (int e = 0; e < count_; ++e) terminal_[e] = true, turn_time_[e] = -INFINITY;
    view_.terminal = terminal_, view_.direction = direction_;
    for (int j = 0; j < h_.mode_count; ++j)
      if (has_load_side(j)) load_side_[h_.mode_sides[j]] = true, gears_ = true;
  }

  bool exist() const { return h_.count > 0; }
  bool failed() const { return failed_; }  // an update did

  // The end of the steps from t on: `stop`, or the next update where that is earlier.
  double bound(double t, double stop) const {
    double next = stop;
    for (int k = 0; k < h_.update_count; ++k) next = smaller(next, due(k));
    return stop - next <= rounding(t) ? stop : next;
  }

  // At the start of the steps from t on: what updates are due, and the sides that follow. False: not finite.
  bool begin(double t, const double* x) {
    bool changed = !begun_;
    if (!begun_ && !first_modes(t, x)) return false;
    begun_ = true;
    for (int k = 0; k < h_.update_count; ++k)
      while (due(k) <= t + rounding(t)) {
        if (!update(k, t, x)) return false;
        changed = true, ++done_[k];
      }
    at_instant(t);
    return turn_switches(t, x, changed);
  }

  // Whether the step just taken stays on all sides. If not, it has to be taken again up to `turn_time`, and then `turn`.
  template <class Stepper>
  bool stays(Stepper& stepper) {
    if (!count_) return true;
    double fastest = 0;  // of all joints: a bound of the speed of a pin
    for (int j = 0; j < h_.mode_count; ++j)
      if (h_.mode_rows[j] >= 0) {
        fastest_[j] = larger(fastest_[j], std::fabs(stepper.state()[h_.mode_rows[j]]));
        fastest = larger(fastest, fastest_[j]);
      }
    for (int j = 0; j < h_.mode_count; ++j)
      if (h_.mode_rows[j] < 0) fastest_[j] = larger(fastest_[j], fastest);
    for (int e = 0; e < count_; ++e) {
      before_[e] = changes_.memory(e);
      // The load of a gear has the same sign on both sides, so that one which turned to and fro is rounding; it stays.
      terminal_[e] = !(load_side_[e] && quick_[e] && stepper.t_old - turn_time_[e] <= rounding(stepper.t_old));
    }
    Silent silent;
    const Found found = changes_.search(stepper, silent);
    if (found == Found::failed) return failed_ = true;
    turn_ = found == Found::terminal ? changes_.end_event() : -1;
    end_ = found == Found::terminal ? changes_.end_time() : stepper.t_old;
    for (int e = 0; e < count_; ++e)  // one that left zero for the other side, before any crossing
      if (terminal_[e] && before_[e].sign == 0 && changes_.leaves(e) * side(e) < 0) {
        const double end = stepper.t_old + (stepper.t - stepper.t_old) * changes_.comes_back(e, side(e) < 0 ? 1 : -1);
        if (end < end_ || turn_ < 0 || end == stepper.t_old) turn_ = e, end_ = end;
      }
    for (int e = 0; e < count_ && turn_ < 0; ++e)
      if (terminal_[e] && changes_.memory(e).sign * side(e) < 0) turn_ = e;
    for (int j = 0; j < h_.mode_count && turn_ < 0 && flight_ > stepper.t_old; ++j)  // it has come back, to the last digit
      if (is_stop(j) && mode(j).moves && changes_.value(h_.switch_count + j) == 0) turn_ = h_.switch_count + j, end_ = stepper.t;
    if (turn_ < 0) return true;
    if (end_ - stepper.t_old <= 2 * spacing(stepper.t_old)) end_ = stepper.t_old;
    std::memcpy(old_, stepper.old_state(), p_.n * sizeof(double));
    for (int e = 0; e < count_; ++e) changes_.remember(e, before_[e]);
    return false;
  }
  double turn_time() const { return end_; }
  const double* old_state() const { return old_; }

  // Goes over to the other side of the switch that `stays` found, at time t and state x. False: not finite, or it goes to
  // and fro without end.
  bool turn(double t, const double* x) {
    at_instant(t);
    return over(turn_, t, x) && turn_switches(t, x, true) && !chatters();
  }
  // The end of the next step from t on, up to `bound`: within the flight after an impact, whose end would not be seen if the
  // joint were back before the step is first sampled.
  double step_bound(double t, double bound) const { return flight_ > t ? smaller(flight_, bound) : bound; }
  // The state from which the run goes on after `begin` and `turn`, where it is not the one before: joints are at rest.
  const double* rested() { return std::exchange(rested_, false) ? static_cast<const double*>(state_) : nullptr; }
  // Whether a contact since the last call ends the run: a joint met its stop, or a brake brought it to rest.
  bool ends() {
    bool found = false;
    for (int j = 0; h_.mode_ends && j < h_.mode_count; ++j) {
      const Mode& m = mode(j);
      const bool met = is_stop(j) ? m.holds || m.impulse != 0 : !m.moves;
      found |= met && !met_[j] && h_.mode_ends[j];
      met_[j] = met;
    }
    return found;
  }
  bool chatters() const { return turn_ >= 0 && quick_[turn_] >= most_quick; }

 private:
  static constexpr double same_instant = 1e-9;  // of its largest speed: a joint that comes to rest with another one
  static constexpr double driven_along = 1e-6;  // of the accelerations that cancel: what others move, and do not hold
  static constexpr double started = 1e-9;       // rad/s or m/s: a joint of this speed has a direction of motion
  static constexpr double near_place = 1e-7;    // rad or m, or of the place: where a stop is that has been reached
  static constexpr double same_place = 1e-12;   // rad or m: a joint that reaches its stop with another one
  static constexpr double least_time = 1e-10;   // of the time: rebounds that would end sooner are not followed
  static constexpr double follows_exactly = 1e-9;  // of its own response: what a joint without friction may still move
  static constexpr int few_quick = 3, most_quick = 20;  // turns of a switch one after another, each as soon as rounding allows

  // What `changes_` finds is asked for directly.
  struct Silent final : Record {
    void more_steps() override {}
    void output(double, const double*) override {}
    void event(int, double, const double*) override {}
    void unresolved(int, double) override {}
    void undefined(int, double) override {}
    void end(double, const double*) override {}
    bool look(double, const double*, const Counts&, std::int64_t*) override { return false; }
  };

  Rhs& rhs_;
  const Problem& p_;
  const HeldEntries& h_;
  Record& record_;
  Problem view_;  // whose event functions are those of the switches
  Events changes_;
  const int count_;  // switches and modes
  Array<bool> terminal_;
  Array<int> direction_, turned_, quick_;
  Array<Events::Memory> before_;
  Array<bool> load_side_;  // which of the switches are sides of gears with losses by load
  Buffer old_, turn_time_;
  Array<std::int64_t> done_;  // updates so far
  int turn_ = -1;
  double end_ = 0, instant_ = -INFINITY, flight_ = -INFINITY;
  bool begun_ = false, failed_ = false, rested_ = false;
  BoundedForces modes_;
  Buffer found_, fastest_;  // what the kernel found; the largest speed of each joint since it was at rest
  Array<int> resting_, closed_, struck_, met_, ways_;
  bool gears_ = false;  // whether there are gears with losses by load
  int balanced_ = 0;  // of resting_
  Buffer state_, after_;  // after_: velocities of joints after an impact

  static Problem functions(const Problem& p) {
    Problem view = p;
    view.events = p.held.switches, view.event_count = p.held.switch_count + p.held.mode_count, view.event_samples = 8;
    return view;
  }
  static double rounding(double t) { return 1e-12 * larger(1, std::fabs(t)); }
  double due(int k) const { return h_.updates[k].first + static_cast<double>(done_[k]) * h_.updates[k].period; }
  double side(int e) { return e < h_.switch_count ? rhs_.held()[e] : 1.0; }
  // Of dry friction: the direction of motion, against which the force acts; whether the joint moves; whether its force
  // follows from rest; `slack`. Of a stop: 1 at the lower and -1 at the upper one, where it holds the joint; the impulse of an impact
  // at this instant.
  struct Mode {
    double direction, moves, holds, impulse;
  };
  Mode& mode(int j) { return reinterpret_cast<Mode*>(rhs_.held() + h_.switch_count)[j]; }

  bool update(int k, double t, const double* x) {
    const int skipped = h_.switch_count + 4 * h_.mode_count;
    double* values = rhs_.held() + skipped;
    const int count = h_.count - skipped;
    if (!h_.updates[k].kernel) return record_.update(k, t, x, values) || !(failed_ = true);
    if (p_.signal_count) rhs_.signals(t);
    Buffer found(count);
    const double* const in[] = {&t, x, rhs_.u(), p_.p};
    double* const out[] = {found};
    if (h_.updates[k].kernel(in, out) != 0) return false;
    double sum = 0;
    for (int i = 0; i < count; ++i) sum += found[i] * 0.0;
    if (sum != 0) return false;
    std::memcpy(values, found, count * sizeof(double));
    return true;
  }

  // Switches that turn together, such as those of x and -x, turn once at an instant, whatever the rounding of their
  // functions there.
  void at_instant(double t) {
    if (t - instant_ <= rounding(t)) return;
    instant_ = t;
    for (int e = 0; e < count_; ++e) turned_[e] = 0;
  }

  // Turns the switches whose functions are on the other side; those that turned at this instant stay as they are.
  bool turn_switches(double t, const double* x, bool changed) {
    for (bool again = count_ > 0; again;) {
      again = false;
      if (rested_) x = state_;
      if (!changes_.begin(t, x)) return false;
      for (int e = 0; e < count_ && !again; ++e)
        if (changes_.value(e) * side(e) < 0 && !turned_[e]) {
          if (load_side_[e] ? (turned_[e] = 1, !find_modes(-1, t, x)) : !over(e, t, x)) return false;
          again = changed = true;
        }
    }
    for (int e = 0; e < count_; ++e) {
      // The load of a gear that turned is 0 there up to the rounding of larger forces, which must not turn it back.
      const bool zero = changes_.value(e) == 0 || (load_side_[e] && turned_[e]);
      const int now = zero ? 0 : side(e) > 0 ? 1 : -1;
      changes_.remember(e, {now, changes_.memory(e).hint, changes_.memory(e).unresolved});
    }
    if (changed) record_.hold(t, rhs_.held());
    return true;
  }

  bool over(int e, double t, const double* x) {
    quick_[e] = t - turn_time_[e] <= rounding(t) ? quick_[e] + 1 : 0;
    turn_time_[e] = t;
    turned_[e] = 1;
    if (e >= h_.switch_count) return find_modes(e - h_.switch_count, t, x);
    rhs_.held()[e] = -rhs_.held()[e];
    return true;
  }

  // What the kernel `turn` finds at a state, for m contacts of a state with nv velocities.
  struct Turn {
    const double *velocity, *free, *response, *coupling, *low, *high, *sliding, *place_low, *place_high, *restitution, *inertia;
  };

  bool evaluate(double t, const double* x, Turn& found) {
    const int n = h_.mode_count;
    if (p_.signal_count) rhs_.signals(t);
    const double* const in[] = {&t, x, rhs_.u(), p_.p};
    double* const out[] = {found_};
    if (h_.turn(in, out) != 0) return false;
    const double* v = found_;
    const double* response = v + 2 * n;
    const double* coupling = response + n * h_.response_rows;
    const double* rest = coupling + n * n;
    found = {v, v + n, response, coupling, rest, rest + n, rest + 2 * n, rest + 3 * n, rest + 4 * n, rest + 5 * n,
             rest + 6 * n};
    double sum = 0;
    for (int k = 0; k < n * (2 + h_.response_rows); ++k) sum += found_[k] * 0.0;
    return sum == 0;
  }

  bool is_stop(int j) const { return h_.mode_kinds[j] == 1 || h_.mode_kinds[j] == 2; }
  bool is_latch(int j) const { return h_.mode_kinds[j] == 2; }
  bool is_pin(int j) const { return h_.mode_rows[j] < 0; }
  bool is_forceless(int j) const { return h_.mode_kinds[j] == 3; }
  bool has_load_side(int j) const { return h_.mode_kinds[j] == 4; }
  double response(const Turn& f, int j, int k) const { return f.coupling[k * h_.mode_count + j]; }

  // Whether constraints and prescribed motions alone determine how a joint moves, so that no force holds it.
  bool determined(const Turn& f, int j) const { return response(f, j, j) * f.inertia[j] <= 1e-9; }

  // At the start of a run: joints that move slide, the others stick or begin to slide.
  bool first_modes(double t, const double* x) {
    Turn f;
    const int n = h_.mode_count;
    if (n && !evaluate(t, x, f)) return false;  // whose velocities do not depend on modes
    double fastest = 0;
    for (int j = 0; j < n; ++j) fastest = larger(fastest, std::fabs(f.velocity[j]));
    for (int j = 0; j < n; ++j) {
      const int direction = is_pin(j) && std::fabs(f.velocity[j]) <= 1e-12 * fastest ? 0 : sign(f.velocity[j]);
      if (is_stop(j) || is_forceless(j)) mode(j) = {0, 1, 0, 0};
      else mode(j) = {1.0 * direction, direction ? 1.0 : 0.0, direction ? 0.0 : 1.0, 0};
    }
    return !n || find_modes(-1, t, x);
  }

  // New modes at an instant, which `cause` brings about: impacts at stops first, then the forces of the joints at rest.
  bool find_modes(int cause, double t, const double* x) {
    const int n = h_.mode_count;
    Turn f;
    if (!evaluate(t, x, f)) return false;
    if (x != state_) std::memcpy(state_, x, p_.n * sizeof(double));
    for (int j = 0; j < n; ++j)
      if (is_stop(j)) mode(j).impulse = 0;
    bool hits = false;
    for (int j = 0; j < n; ++j) {
      closed_[j] = is_stop(j) ? closed(j, j == cause, f) : 0;
      hits |= closed_[j] * f.velocity[j] < 0;
    }
    const bool gives_way = cause >= 0 && !mode(cause).moves;  // its force has reached its limit; that of a stop is 0
    if (hits) {
      if (!without_load_sides(t, f) || !impact(f) || !evaluate(t, state_, f)) return false;
      for (int j = 0; j < n; ++j)
        if (!is_stop(j) && !is_forceless(j) && f.velocity[j] != 0) mode(j) = {1.0 * sign(f.velocity[j]), 1, 0, 0};
    }
    if (!take_gears(t, cause, hits, f)) return false;
    balance(cause, gives_way, hits, f);
    if (rebounds(t, f)) {
      if (!evaluate(t, state_, f) || !take_gears(t, cause, hits, f)) return false;
      balance(cause, gives_way, hits, f);
      rebounds(t, f);
    }
    rested_ = true;
    return still_pins(t);
  }

  bool rests(int j, int cause, bool hits, const Turn& f) {
    return !mode(j).moves || (j == cause && !hits) || std::fabs(f.velocity[j]) <= same_instant * fastest_[j];
  }

  // What `balance` needs where there are gears with losses by load: what they would do if all motors drove their loads.
  bool take_gears(double t, int cause, bool hits, Turn& f) {
    if (!gears_) return true;
    for (int j = 0; j < h_.mode_count; ++j) {
      if (!has_load_side(j)) continue;
      rhs_.held()[h_.mode_sides[j]] = 1;
      if (rests(j, cause, hits, f)) mode(j) = {mode(j).direction != 0 ? mode(j).direction : 1, 1, 0, 0}, fastest_[j] = INFINITY;
    }
    return evaluate(t, state_, f);
  }

  // An impact passes gears with losses by load as if these were at rest, without losses.
  bool without_load_sides(double t, Turn& f) {
    bool any = false;
    for (int j = 0; j < h_.mode_count; ++j)
      if (has_load_side(j)) mode(j) = {0, 0, 0, 0}, any = true;
    return !any || evaluate(t, state_, f);
  }

  // Takes the pins that are at rest to velocity 0 exactly, with the joints that are.
  bool still_pins(double t) {
    bool pins = false;
    for (int j = 0; j < h_.mode_count; ++j) pins |= is_pin(j) && !mode(j).moves;
    Turn f;
    if (!pins) return true;
    if (!evaluate(t, state_, f)) return false;
    int count = 0;
    for (int j = 0; j < h_.mode_count; ++j)
      if (!mode(j).moves) struck_[count++] = j;
    for (int k = 0; k < count; ++k) {
      modes_.right[k] = f.velocity[struck_[k]], modes_.low[k] = -INFINITY, modes_.high[k] = INFINITY;
      for (int l = 0; l < count; ++l) modes_.matrix[k * count + l] = response(f, struck_[k], struck_[l]);
    }
    modes_.solve(count);
    for (int k = 0; k < count; ++k)
      for (int i = 0; i < h_.response_rows; ++i)
        state_[p_.nq + i] += f.response[struck_[k] * h_.response_rows + i] * modes_.force[k];
    for (int k = 0; k < count; ++k) rest(struck_[k]);
    return true;
  }

  void rest(int j) {
    if (!is_pin(j)) state_[h_.mode_rows[j]] = 0;
  }

  // The forces of the joints that are at rest, and their modes.
  void balance(int cause, bool gives_way, bool hits, const Turn& f) {
    const int n = h_.mode_count;
    int count = 0;
    for (int j = 0; j < n; ++j) {
      if (!is_stop(j) && f.low[j] == 0 && f.high[j] == 0) {  // a brake that is released, or no friction
        const bool follows = (!mode(j).moves || std::fabs(f.velocity[j]) <= same_instant * fastest_[j]) && !determined(f, j);
        mode(j) = {0, 1, 0, 0}, turned_[h_.switch_count + j] = 1;
        if (follows) resting_[count++] = j;
        continue;
      }
      if (!is_stop(j) && mode(j).moves && mode(j).direction == 0 && !determined(f, j) && std::fabs(f.velocity[j]) > started) {
        mode(j) = {1.0 * sign(f.velocity[j]), 1, 0, 0}, turned_[h_.switch_count + j] = 1;  // one that is engaged
        continue;
      }
      const bool rests = this->rests(j, cause, hits, f);
      if (!is_stop(j) && rests && determined(f, j)) {
        const bool starts = mode(j).moves && mode(j).direction == 0;  // it had neither velocity nor acceleration before
        const int direction = sign(f.velocity[j] != 0 && (starts || j != cause) ? f.velocity[j] : f.free[j]);
        mode(j) = {slack(j) > 0 && !starts ? 0.0 : direction, 1, 0, 0};
        turned_[h_.switch_count + j] = 1, fastest_[j] = 0;
        continue;
      }
      if (is_stop(j) ? closed_[j] && f.velocity[j] == 0 && !(j == cause && gives_way)
                     : rests)
        resting_[count++] = j;
      else if (is_stop(j)) mode(j) = {0, 1, 0, mode(j).impulse};
      if (closed_[j]) state_[h_.mode_places[j]] = closed_[j] > 0 ? f.place_low[j] : f.place_high[j];
      if (closed_[j] || hits) turned_[h_.switch_count + j] = 1;
    }
    for (int k = 0; k < count; ++k) {
      const int j = resting_[k];
      double value = f.free[j];
      for (int l = 0; l < count; ++l) {
        modes_.matrix[k * count + l] = response(f, j, resting_[l]);
        value -= response(f, j, resting_[l]) * f.sliding[resting_[l]];
      }
      modes_.right[k] = value;
      set_bounds(k, j, f, true);
    }
    int all = count;
    if (gears_) all = solve_gears(count, f);
    else modes_.solve(count);
    for (int k = 0; k < count; ++k) {
      const int j = resting_[k];
      if (has_load_side(j) && modes_.at_limit(k)) rhs_.held()[h_.mode_sides[j]] = modes_.driven(k) ? -1 : 1;
      const double direction = modes_.at_most(k) ? -1 : 1;
      Mode& m = mode(j);
      if (!is_stop(j) && f.low[j] == 0 && f.high[j] == 0) {
        if (modes_.can_move(k, all, follows_exactly)) continue;
        m = {0, 0, 0, 0};
      } else if (is_stop(j)) {
        const bool holds = !modes_.at_limit(k) && modes_.holds(k);
        m = {holds ? 1.0 * closed_[j] : 0.0, holds ? 0.0 : 1.0, holds ? 1.0 : 0.0, m.impulse};
      } else if (!modes_.at_limit(k)) m = {0, 0, modes_.holds(k) ? 1.0 : 0.0, slack(j)};
      else if (!modes_.can_move(k, all) && !modes_.moves(k, all, driven_along)) m = {direction, 0, 0, 0};
      else if (slack(j) > 0 && !modes_.moves(k, all)) m = {0, 0, 1, slack(j)};
      else if (modes_.moves(k, all) ? modes_.acceleration[k] * direction > 0 : gives_way && !is_stop(cause))
        m = {direction, 1, 0, 0};
      else m = {0, 0, 1, 0};  // also where the load is below the limit by a little more than rounding
      rest(j), fastest_[j] = 0;
      turned_[h_.switch_count + j] = 1;
    }
    for (int j = 0; j < n; ++j)  // friction that gives way towards the joint's own stop: from there on the stop holds
      for (int k = 0; k < n; ++k)
        if (!is_stop(j) && !is_forceless(j) && !is_pin(j) && mode(j).moves && state_[h_.mode_rows[j]] == 0 && closed_[k] &&
            h_.mode_rows[k] == h_.mode_rows[j] && mode(j).direction * closed_[k] < 0) {
          if (has_load_side(j) && k == cause && gives_way) mode(j) = {0, 0, 1, 0};  // by rounding: the stop has let go
          else mode(j).moves = 0, mode(k) = {1.0 * closed_[k], 0, 1, mode(k).impulse};
        }
    balanced_ = count;
  }

  // The forces of the joints at rest, with those of gears of joints that move after them; the number of all.
  int solve_gears(int count, const Turn& f) {
    int all = count;
    for (int j = 0; j < h_.mode_count; ++j) {
      bool is_listed = !has_load_side(j) || mode(j).direction == 0;
      for (int k = 0; k < count; ++k) is_listed |= resting_[k] == j;
      if (!is_listed) resting_[all++] = j;
    }
    for (int k = 0; k < all; ++k) {
      const int j = resting_[k];
      const bool gear = has_load_side(j);
      modes_.compliance[k] = gear ? f.place_low[j] : 0;
      modes_.forward[k] = gear ? f.place_high[j] : 0;
      modes_.backward[k] = gear ? f.restitution[j] : 0;
      ways_[k] = k < count ? 0 : mode(j).direction > 0 ? 1 : -1;
      if (k < count) continue;
      modes_.low[k] = modes_.high[k] = ways_[k] > 0 ? smaller(0, modes_.forward[k]) : larger(0, modes_.backward[k]);
      modes_.right[k] = f.free[j];
      for (int l = 0; l < count; ++l) modes_.right[k] -= response(f, j, resting_[l]) * f.sliding[resting_[l]];
    }
    for (int k = 0; k < all; ++k)
      for (int l = 0; l < all; ++l) modes_.matrix[k * all + l] = response(f, resting_[k], resting_[l]);
    modes_.solve_gears(all, ways_);
    for (int k = count; k < all; ++k) rhs_.held()[h_.mode_sides[resting_[k]]] = modes_.driven(k) ? -1 : 1;
    return all;
  }

  // Of joints that leave their stops with a small speed: the time of their flight, so that its end is seen; those whose
  // rebounds, one after another, would end within rounding of the time are brought to rest. Whether there are any.
  bool rebounds(double t, const Turn& f) {
    int count = 0;
    flight_ = INFINITY;
    for (int j = 0; j < h_.mode_count; ++j) {
      if (!closed_[j] || !(closed_[j] * state_[h_.mode_rows[j]] > 0)) continue;
      double v = state_[h_.mode_rows[j]];
      double pull = f.free[j];
      for (int l = 0; l < balanced_; ++l) pull += response(f, j, resting_[l]) * (modes_.force[l] - f.sliding[resting_[l]]);
      pull *= -closed_[j];
      v *= closed_[j];
      if (!(pull > 0)) continue;
      if (2 * v < least_time * larger(1, t) * pull * (1 - f.restitution[j])) {
        struck_[count++] = j;
      } else flight_ = smaller(flight_, t + 1.4 * v / pull);
    }
    if (flight_ == INFINITY) flight_ = -INFINITY;
    if (!count) return false;
    for (int l = 0; l < balanced_; ++l) struck_[count++] = resting_[l];  // which stay at rest
    double change = 0;
    for (int k = 0; k < count; ++k) {
      modes_.right[k] = is_pin(struck_[k]) ? 0 : state_[h_.mode_rows[struck_[k]]], modes_.low[k] = -INFINITY, modes_.high[k] = INFINITY;
      for (int l = 0; l < count; ++l) modes_.matrix[k * count + l] = response(f, struck_[k], struck_[l]);
    }
    modes_.solve(count);
    for (int k = 0; k < count; ++k) {
      change += 0.5 * modes_.force[k] * modes_.right[k];
      for (int i = 0; i < h_.response_rows; ++i) state_[p_.nq + i] += f.response[struck_[k] * h_.response_rows + i] * modes_.force[k];
    }
    for (int k = 0; k < count; ++k) rest(struck_[k]);
    if (h_.work_row >= 0) state_[h_.work_row] += change;
    return true;
  }

  // By how much the square of a friction force at rest may exceed that of its limit, relative to it. More than 0 only where
  // the load is the limit up to rounding, so that the joint would stick and slide without end.
  double slack(int j) const {
    const int quick = quick_[h_.switch_count + j];
    return quick < few_quick ? 0 : quick < few_quick + 4 ? std::pow(10.0, quick - few_quick - 9) : 1e-6;
  }

  // The stop at which a joint is: 1 the lower one, -1 the upper one, 0 none.
  int closed(int j, bool cause, const Turn& f) {
    if (mode(j).holds) return mode(j).direction > 0 ? 1 : -1;
    const double place = state_[h_.mode_places[j]], above = place - f.place_low[j], below = f.place_high[j] - place;
    // A joint that nearly touches its stop may seem to reach it, between the ends of a step, and does not.
    if (cause && smaller(above, below) <= near_place * larger(1, std::fabs(place))) return above < below ? 1 : -1;
    return above <= same_place ? 1 : below <= same_place ? -1 : 0;
  }

  // `caught`: a latch holds in both directions.
  void set_bounds(int k, int j, const Turn& f, bool caught) {
    caught = caught && is_latch(j);
    modes_.low[k] = caught ? -INFINITY : is_stop(j) ? (closed_[j] > 0 ? 0 : -INFINITY) : f.low[j];
    modes_.high[k] = caught ? INFINITY : is_stop(j) ? (closed_[j] > 0 ? INFINITY : 0) : f.high[j];
  }

  // The impact of the joints at stops that `state_` moves into them: impulses p with v+ = v + C p that leave no joint
  // moving into its stop. By Newton's law v+ = -e v; where that would raise the energy, by Poisson's (Pfeiffer & Glocker,
  // Multibody Dynamics with Unilateral Contacts, 1996, ch. 8).
  bool impact(const Turn& f) {
    int count = 0;
    for (int j = 0; j < h_.mode_count; ++j)
      if (closed_[j]) struck_[count++] = j;
    double change = strike(count, f, 1);
    if (change > 0) change = poisson(count, f);
    if (!(change - change == 0)) return false;
    for (int k = 0; k < count; ++k) {
      for (int i = 0; i < h_.response_rows; ++i) state_[p_.nq + i] += f.response[struck_[k] * h_.response_rows + i] * modes_.force[k];
      mode(struck_[k]).impulse = modes_.force[k];
    }
    for (int k = 0; k < count; ++k)
      if (after_[k] == 0) state_[h_.mode_rows[struck_[k]]] = 0;
    if (h_.work_row >= 0) state_[h_.work_row] += change;
    return true;
  }

  // Impulses with `share` of the restitution; the change of the kinetic energy.
  double strike(int count, const Turn& f, double share) {
    for (int k = 0; k < count; ++k) {
      const int j = struck_[k];
      const double e = closed_[j] * f.velocity[j] < 0 ? share * f.restitution[j] : 0;  // one that leaves does not rebound
      modes_.right[k] = (1 + e) * f.velocity[j];
      for (int l = 0; l < count; ++l) modes_.matrix[k * count + l] = response(f, j, struck_[l]);
      set_bounds(k, j, f, mode(j).holds);
    }
    modes_.solve(count);
    return energy(count, f);
  }

  // Compression without restitution, then at least the share e of its impulses.
  double poisson(int count, const Turn& f) {
    strike(count, f, 0);
    for (int k = 0; k < count; ++k) {
      if (is_latch(struck_[k]) && mode(struck_[k]).holds) continue;
      const double least = (1 + f.restitution[struck_[k]]) * modes_.force[k];
      (closed_[struck_[k]] > 0 ? modes_.low : modes_.high)[k] = least;
    }
    modes_.solve(count);
    return energy(count, f);
  }

  double energy(int count, const Turn& f) {
    double change = 0;
    for (int k = 0; k < count; ++k) {
      double size = std::fabs(after_[k] = f.velocity[struck_[k]]);
      for (int l = 0; l < count; ++l) {
        const double more = response(f, struck_[k], struck_[l]) * modes_.force[l];
        after_[k] += more, size += std::fabs(more);
      }
      if (std::fabs(after_[k]) <= 1e-12 * size) after_[k] = 0;  // rounding
      change += 0.5 * modes_.force[k] * (f.velocity[struck_[k]] + after_[k]);
    }
    return change;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
