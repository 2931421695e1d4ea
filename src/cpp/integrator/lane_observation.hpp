// Extremes of observed quantities in lanes. The rules are those of observed_extremes.hpp: in most steps samples show that
// no quantity leaves its extremes. In the others, extrema between samples that a polynomial fits are found in all lanes
// at once; a step that needs more samples goes to the integrator of single runs.
#pragma once

#include "lane_runge_kutta.hpp"
#include "lane_single_step.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <class Method>
class LaneObservation {
 public:
  LaneObservation(LaneEquations& equations, LaneDenseOutput<Method>& dense)
      : ensemble_(equations.ensemble), equations_(equations), dense_(dense), count_(ensemble_.observed),
        within_(ensemble_.observed_within), y_((parts + 1) * count_), cheap_(within_ ? (parts + 1) * count_ : 0),
        value_(count_), x_(ensemble_.common.n), plain_(ensemble_.common.n),
        noise_(within_), calm_(within_), constant_(within_) {}

  bool within() const { return within_ > 0; }

  // The quantities at the starts (t_old, old) of a block's runs; after a jump of forces `again`.
  void begin(LaneBlock& starts) {
    equations_.observe(starts, starts.t_old, starts.old, starts.y);
    for (int j = 0; j < count_; ++j) starts.least[j] = starts.largest[j] = starts.y[j];
    for (int j = 0; j < within_; ++j) starts.noise[j] = starts.calm[j] = starts.exhausted[j] = Vec{};
  }
  void begin_again(LaneBlock& block, Mask lanes) {
    equations_.observe(block, block.t_old, block.old, value_);
    take(block, value_, count_, lanes);
    for (int j = 0; j < count_; ++j) block.y[j] = lanes ? value_[j] : block.y[j];
  }

  // Samples of steps that end at a time and state: at both ends, and at place i between them.
  void sample_ends(LaneBlock& block, Vec time, const Vec* x) {
    for (int j = 0; j < count_; ++j) y_[j] = block.y[j];
    sample(block, parts, time, x);
  }
  void sample(LaneBlock& block, int i, Vec time, const Vec* x) { equations_.observe(block, time, x, y_ + i * count_); }

  // Whether surely no quantity leaves its extremes between the ends of the step, by every other of these samples.
  Mask stays_within(const LaneBlock& block) const {
    Mask clear = Mask{} == 0;
    for (int j = 0; j < within_; ++j) {
      Vec v[parts + 1], least = block.least[j], largest = block.largest[j];
      take_in(y_[parts * count_ + j], least, largest);
      const Vec span = samples_of<2, Vec>(y_, count_, j, v);
      clear &= stays_between(v, span, least, largest, tolerance(block, least, largest), history(block, j));
    }
    return clear;
  }

  // The steps are done with: the next ones begin where these end.
  void accept(LaneBlock& block, Mask lanes) {
    const Vec* end = y_ + parts * count_;
    take(block, end, count_, lanes);
    for (int j = 0; j < count_; ++j) block.y[j] = lanes ? end[j] : block.y[j];
  }

  // The extremes in the steps in `lanes` of a block up to a time and state, whose dense output is prepared.
  void search(LaneBlock& block, Bits lanes, Vec time, const Vec* x) {
    sample_ends(block, time, x);
    const Vec h = block.t - block.t_old, part = (time - block.t_old) / h;
    const auto approximate = [&](int first) {
      for (int i = first; i < parts; i += 2) {
        dense_.approximate(block, part * place[i], x_, i % 2 == 0);
        sample(block, i, block.t_old + part * place[i] * h, x_);
      }
    };
    if (within_) approximate(2);
    const Bits doubtful = within_ ? lanes & ~bits(stays_within(block)) : 0;
    take(block, y_ + parts * count_, count_, mask(lanes));
    if (!doubtful) return;
    approximate(1);
    for (int i = 0; i < (parts + 1) * count_; ++i) cheap_[i] = y_[i];
    for (int i = 1; i < parts; ++i) between(block, part * place[i], y_ + i * count_, doubtful);
    learn(block);
    const Bits hard = list(block, doubtful);
    each(hard, [&](int l) { LaneSingleStep<Method>(ensemble_, block, l).observe(time[l], x); });
    const Mask easy = mask(doubtful & ~hard);
    for (int j = 0; j < within_; ++j) {
      block.noise[j] = easy ? noise_[j] : block.noise[j];
      block.calm[j] = easy ? calm_[j] : block.calm[j];
    }
    for (int i = 1; i < parts; ++i) take(block, y_ + i * count_, within_, easy);
    climb_listed(block, part, doubtful & ~hard);
  }

 private:
  // The search for an extremum of quantity `j` between samples i and i + 1.
  struct Climb {
    int j, i;
  };

  const Ensemble& ensemble_;
  LaneEquations& equations_;
  LaneDenseOutput<Method>& dense_;
  const int count_, within_;
  Vectors y_, cheap_, value_;  // y_: a row for each sample; cheap_: those that are not on the dense output
  Vectors x_, plain_;          // plain_: a state before it is projected
  Vectors noise_, calm_;    // what the steps show of quantities that are constant but for the error of that polynomial
  Array<Bits> constant_;    // in which lanes they are
  Growing<Climb> jobs_[width];
  int jobs_count_[width] = {};

  static Vec tolerance(const LaneBlock& block, Vec least, Vec largest) {
    return allowed_error(block.atol, block.rtol, least, largest);
  }

  static ObservedHistory<Vec> history(const LaneBlock& block, int j) {
    ObservedHistory<Vec> known;
    known.noise = block.noise[j], known.calm = block.calm[j];
    return known;
  }

  static void take(LaneBlock& block, const Vec* values, int count, Mask lanes) {
    for (int j = 0; j < count; ++j) {
      Vec least = block.least[j], largest = block.largest[j];
      take_in(values[j], least, largest);
      block.least[j] = lanes ? least : block.least[j], block.largest[j] = lanes ? largest : block.largest[j];
    }
  }

  // Quantities at states of the dense output, projected as those of outputs (keep_velocity).
  void between(LaneBlock& block, Vec s, Vec* values, Bits lanes) {
    const Vec time = block.t_old + s * (block.t - block.t_old);
    const Problem& p = ensemble_.common;
    dense_.interpolate(block, s, x_);
    for (int i = p.nq; i < p.nq + p.nv; ++i) plain_[i] = x_[i];
    equations_.normalise_and_project(block, time, x_, mask(lanes));
    keep_velocity<Vec, Mask>(p, block.atol, block.rtol, block.step > 0.0, plain_, x_);
    equations_.observe(block, time, x_, values);
  }

  void learn(const LaneBlock& block) {
    for (int j = 0; j < within_; ++j) {
      Vec cheap[parts + 1], v[parts + 1], least = block.least[j], largest = block.largest[j];
      const Vec span = samples_of<1, Vec>(cheap_, count_, j, cheap);
      samples_of<1, Vec>(y_, count_, j, v);
      ObservedHistory<Vec> known = history(block, j);
      known.learn(cheap, v, span, least, largest, tolerance(block, least, largest));
      noise_[j] = known.noise, calm_[j] = known.calm, constant_[j] = bits(known.constant);
    }
  }

  // Lists the intervals between samples that may hold an extremum, for each lane; lanes that need more samples are
  // returned.
  Bits list(const LaneBlock& block, Bits lanes) {
    Bits hard = 0;
    each(lanes, [&](int l) { jobs_count_[l] = 0; });
    for (int j = 0; j < within_; ++j) {
      Vec v[parts + 1], least = block.least[j], largest = block.largest[j];
      samples_of<1, Vec>(y_, count_, j, v);
      for (int i = 1; i < parts; ++i) least = smaller(v[i], least), largest = larger(v[i], largest);
      const Vec allowed = tolerance(block, least, largest);
      const ShapeToEnds<Vec> shape(v);
      const Bits sampled = lanes & ~constant_[j] & bits(shape.miss < INFINITY);
      for (int i = 0; sampled && i < parts; ++i) {
        const Mask may = may_exceed(shape, i, v, least, largest, allowed);
        const Mask smooth = shape.parabola(i) | (shape.miss <= allowed);
        hard |= sampled & bits(may & ~smooth);
        const Bits found = sampled & bits(may & smooth);
        if (found) each(found & bits(turns_within(i, v)), [&](int l) {
          jobs_[l].reserve(jobs_count_[l] + 1);
          jobs_[l][jobs_count_[l]++] = {j, i};
        });
      }
    }
    return hard;
  }

  // Finds the extrema that are listed, one of each lane at a time.
  void climb_listed(LaneBlock& block, Vec part, Bits lanes) {
    for (int round = 0;; ++round) {
      Bits busy = 0;
      int j[width] = {};
      Vec left = {}, right = {}, node[near] = {}, value[near] = {};
      each(lanes, [&](int l) {
        if (round >= jobs_count_[l]) return;
        busy |= 1u << l;
        const Climb job = jobs_[l][round];
        j[l] = job.j, left[l] = place[job.i], right[l] = place[job.i + 1];
        for (int k = 0, first = first_near(job.i); k < near; ++k)
          node[k][l] = place[first + k], value[k][l] = y_[(first + k) * count_ + job.j][l];
      });
      if (!busy) return;
      ExtremumPolynomial<Vec> polynomial;
      for (int k = 0; k < near; ++k) polynomial.add(node[k], value[k]);
      const auto chosen = [&](const Vec* quantities) {
        Vec of;
        for (int l = 0; l < width; ++l) of[l] = quantities[j[l]][l];
        return of;
      };
      const auto extremes = [&](Vec* least, Vec* largest) {
        *least = chosen(block.least), *largest = chosen(block.largest);
        return tolerance(block, *least, *largest);
      };
      climb(polynomial, left, right, mask(busy), extremes, [&](Vec s, Mask active) {
        between(block, part * s, value_, bits(active));
        take(block, value_, within_, active);
        return chosen(value_);
      });
    }
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
