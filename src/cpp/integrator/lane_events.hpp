// Events in lanes: where event functions change sign in the steps that were just accepted. The rules are those of
// event_detection.hpp. Most steps surely have no event, by their samples. In the others, crossings that are bracketed by
// samples are refined in all lanes at once; a step that needs more goes to the integrator of single runs.
#pragma once

#include "lane_runge_kutta.hpp"
#include "lane_single_step.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// How the runs of some lanes go on.
struct LaneEnds {
  Bits ended = 0, lost = 0;  // by an event; those that only the integrator of single runs can do
  Vec time = {};             // where the step ends, by an event or not
  int event[width] = {};     // which
};

template <class Method>
class LaneEvents {
 public:
  LaneEvents(LaneEquations& equations, LaneRungeKutta<Method>& method, LaneDenseOutput<Method>& dense)
      : ensemble_(equations.ensemble), problem_(equations.problem), equations_(equations), method_(method),
        dense_(dense), repeated_(ensemble_, Method::stages), count_(problem_.event_count), n_(problem_.n),
        samples_(problem_.event_samples == 2 ? 2 : parts), g_((parts + 1) * count_), value_(count_), x_(n_), found_(n_),
        jobs_(count_ ? static_cast<std::size_t>(width) * count_ * parts : 0) {}

  bool few() const { return samples_ == 2; }

  // The event functions at the starts (t_old, old) of a block's runs.
  void begin(LaneBlock& starts) {
    equations_.events(starts, starts.t_old, starts.old, starts.g);
    for (int e = 0; e < count_; ++e) {
      starts.sign[e] = signs(starts.g[e]);
      starts.hint[e] = starts.unresolved[e] = Vec{};
    }
  }

  // Samples of steps: at both ends, and at place i between them.
  void sample_ends(LaneBlock& block) {
    for (int e = 0; e < count_; ++e) g_[e] = block.g[e];
    sample(block, samples_, block.t, block.x);
  }
  void sample(LaneBlock& block, int i, Vec time, const Vec* x) { equations_.events(block, time, x, g_ + i * count_); }

  // Whether no event can be in the step, by these samples.
  Mask has_no_zero(const LaneBlock& block) const {
    Mask clear = Mask{} == 0;
    for (int e = 0; e < count_; ++e) {
      Vec v[parts + 1];
      for (int i = 0; i <= samples_; ++i) v[i] = g_[i * count_ + e];
      clear &= (block.hint[e] <= 0.0) & keeps_sign(v, block.sign[e], few());
    }
    return clear;
  }

  // The steps are done with: the next ones begin where these end.
  void accept(LaneBlock& block, Mask lanes) {
    for (int e = 0; e < count_; ++e) block.g[e] = lanes ? g_[samples_ * count_ + e] : block.g[e];
  }

  // The events of the steps in `lanes` of a block, whose dense output is prepared; they go to the rows of the runs. Where
  // an event ends a step, its time goes to `ends`, and the state there to `end`.
  void search(LaneBlock& block, Bits lanes, LaneEnds& ends, Vec* end) {
    sample_ends(block);
    if (!lanes) return;
    const Vec h = block.t - block.t_old;
    for (int i = 1; i < parts && !few(); ++i) {
      dense_.interpolate(block, splat(place[i]), x_);
      sample(block, i, block.t_old + place[i] * h, x_);
    }
    Bits hard = 0;
    each(lanes, [&](int l) {
      count(l) = next(l) = 0;
      if (few() || !list(block, l)) hard |= 1u << l;
    });
    hard |= refine(block, lanes & ~hard);
    each(lanes & ~hard, [&](int l) { report(block, l, ends, end); });
    each(hard, [&](int l) { single(block, l, ends, end); });
  }

 private:
  // A crossing between two samples of a lane's step.
  struct Crossing {
    int event;
    double a, b, at_a, at_b, time;
    bool wanted;  // its time and state
    std::size_t state;
  };

  const Ensemble& ensemble_;
  const Problem& problem_;
  LaneEquations& equations_;
  LaneRungeKutta<Method>& method_;
  LaneDenseOutput<Method>& dense_;
  LaneBlock repeated_;  // steps of other sizes from the same starts
  const int count_, n_, samples_;
  Vectors g_, value_, x_, found_;  // g_: a row of event functions for each sample, the last at the end
  Array<Crossing> jobs_;
  int counts_[width] = {}, next_[width] = {};  // of jobs_ of a lane; which of them is next
  Growing<double> states_;
  std::size_t used_ = 0;  // of states_
  int event_[width] = {};  // whose zero is looked for

  int& count(int lane) { return counts_[lane]; }
  int& next(int lane) { return next_[lane]; }
  Crossing* jobs(int lane) { return jobs_ + static_cast<std::size_t>(lane) * count_ * parts; }
  static Vec signs(Vec v) { return v > 0.0 ? splat(1) : v < 0.0 ? splat(-1) : Vec{}; }

  std::int64_t row(const LaneBlock& block, int lane) const { return static_cast<std::int64_t>(block.design[lane]); }

  // Lists the crossings of a lane's step; false where more samples are needed.
  bool list(const LaneBlock& block, int lane) {
    double v[parts + 1];
    bool ends = false;
    for (int e = 0; e < count_; ++e) {
      for (int i = 0; i <= parts; ++i) v[i] = g_[i * count_ + e][lane];
      if (!simple(block, e, lane, v)) return false;
      int now = static_cast<int>(block.sign[e][lane]);
      for (int i = 0; i < parts; ++i) {
        const int before = now;
        now = sign(v[i + 1]);
        if (before == 0 || now == before || problem_.direction[e] == before) continue;
        jobs(lane)[count(lane)++] = {e, place[i], place[i + 1], v[i], v[i + 1], 0, false, 0};
        if (!problem_.terminal[e]) continue;
        ends = true;
        break;  // later crossings do not matter
      }
    }
    // the time of a crossing matters where it is the first of its function, or another one may end the run before
    const std::int64_t* counts = ensemble_.columns.event_count + row(block, lane) * count_;
    for (int i = 0, last = -1; i < count(lane); ++i) {
      const int e = jobs(lane)[i].event;
      jobs(lane)[i].wanted = ends || (counts[e] == 0 && e != last);
      last = e;
    }
    return true;
  }

  bool simple(const LaneBlock& block, int e, int lane, const double* v) const {
    if (block.hint[e][lane] > 0) return false;
    const Shape shape(v);
    if (!(shape.miss < INFINITY)) return false;
    for (int i = 0; i < parts; ++i)
      if (v[i + 1] == 0 || doubtful(shape, i, v, 0)) return false;
    return v[0] != 0 || block.sign[e][lane] == 0;
  }

  // Times and states of the crossings that are wanted, one of each lane at a time. Returns lanes that need other rules.
  Bits refine(LaneBlock& block, Bits lanes) {
    Bits hard = 0;
    used_ = 0;
    bool copied = false;
    for (;;) {
      Bits busy = 0;
      Vec a = {}, b = {}, at_a = {}, at_b = {};
      each(lanes & ~hard, [&](int l) {
        while (next(l) < count(l) && !jobs(l)[next(l)].wanted) ++next(l);
        if (next(l) == count(l)) return;
        const Crossing& c = jobs(l)[next(l)];
        a[l] = c.a, b[l] = c.b, at_a[l] = c.at_a, at_b[l] = c.at_b, event_[l] = c.event;
        busy |= 1u << l;
      });
      if (!busy) return hard;
      if (!copied) repeated_.copy_starts(block), copied = true;
      Vec value = {}, time = {};
      const Vec least = rounding_of_time(block.t, block.t - block.t_old);
      const auto along = [&](Vec share) { return this->along(block, share); };
      const Vec s = bracketed_root(along, a, at_a, b, at_b, least, mask(busy), &value);
      Bits failed = bits(mask(busy) & (value == 0.0));
      if (failed) failed &= bits((s > 8.0 * least) & (along(s - 8.0 * least) == 0.0));  // it stays at zero, as max(x, 0) does
      failed |= correct(block, s, b - a, mask(busy & ~failed), &time);
      hard |= failed;
      states_.reserve(used_ + static_cast<std::size_t>(width) * n_);
      each(busy & ~failed, [&](int l) {
        Crossing& c = jobs(l)[next(l)++];
        c.time = time[l], c.state = used_;
        for (int i = 0; i < n_; ++i) states_[used_++] = found_[i][l];
      });
    }
  }

  // One event function in each lane, on the dense output.
  Vec along(LaneBlock& block, Vec s) {
    dense_.interpolate(block, s, x_);
    return at(block, block.t_old + s * (block.t - block.t_old), x_);
  }
  Vec at(LaneBlock& block, Vec time, const Vec* x) {
    equations_.events(block, time, x, value_);
    Vec chosen;
    for (int l = 0; l < width; ++l) chosen[l] = value_[event_[l]][l];
    return chosen;
  }

  // Corrects roots on the dense output (event_detection.hpp, refined); the states there go to found_. Returns lanes where that
  // fails.
  Bits correct(LaneBlock& block, Vec s, Vec interval, Mask active, Vec* time) {
    const Vec start = block.t_old, h = block.t - start, ulp = spacing(block.t);
    const Mask at_end = active & ((1.0 - s) * h <= ulp), at_start = active & ~at_end & (s * h <= ulp);
    *time = at_end ? block.t : start;
    for (int i = 0; i < n_; ++i) found_[i] = at_end ? block.x[i] : block.old[i];
    active &= ~(at_end | at_start);
    if (!any(active)) return 0;
    const auto repeat = [&](Vec now, Mask wanted, Vec* value) {
      const Mask sound = method_.redo(repeated_, now, x_, wanted);
      block.evaluations += wanted ? splat(Method::stages - 1) : Vec{};
      for (int i = 0; i < n_; ++i) found_[i] = wanted & sound ? x_[i] : found_[i];
      return *value = at(block, start + now, x_), sound;
    };
    Vec corrected;
    const auto along = [&](Vec share) { return this->along(block, share); };
    const Mask failed = corrected_root(along, repeat, start, block.t, s, interval, active, &corrected);
    *time = active ? corrected : *time;
    return bits(failed);
  }

  // Writes a lane's crossings up to the first terminal one and those at the same instant.
  void report(LaneBlock& block, int lane, LaneEnds& ends, Vec* end) {
    Crossing* const found = jobs(lane);
    const int count = counts_[lane];
    const std::int64_t design = row(block, lane);
    int last = -1;
    for (int i = 0; i < count; ++i)
      if (problem_.terminal[found[i].event] && (last < 0 || found[i].time < found[last].time)) last = i;
    if (last < 0) {  // those of each function are in the order of time
      for (int i = 0; i < count; ++i) write(found[i], design);
      for (int e = 0; e < count_; ++e) block.sign[e][lane] = sign(g_[parts * count_ + e][lane]);
      return;
    }
    const double time = found[last].time, until = time + 4 * spacing(time);
    for (int i = 0; i < count; ++i)
      if (found[i].time <= until) write(found[i], design);
    const double* x = states_ + found[last].state;
    ends.ended |= 1u << lane, ends.time[lane] = time, ends.event[lane] = found[last].event;
    for (int i = 0; i < n_; ++i) end[i][lane] = x[i];
  }

  void write(const Crossing& c, std::int64_t design) {
    if (c.wanted) write_event(ensemble_.columns, ensemble_, design, c.event, c.time, states_ + c.state);
    else ++ensemble_.columns.event_count[design * count_ + c.event];
  }

  void single(LaneBlock& block, int lane, LaneEnds& ends, Vec* end) {
    LaneSingleStep<Method> step(ensemble_, block, lane);
    const Found found = step.events();
    if (found == Found::failed) ends.lost |= 1u << lane;
    if (found != Found::terminal) return;
    ends.ended |= 1u << lane, ends.time[lane] = step.end_time(), ends.event[lane] = step.end_event();
    for (int i = 0; i < n_; ++i) end[i][lane] = step.end_state()[i];
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
