// A lower bound of the time of every motion along a path that keeps the limits.
//
// At each place and speed the accelerations that the limits allow are replaced by the interval from the least to the
// most of them (their convex hull), which contains them. Along any motion dx/dr = 2 u ds/dr then lies between
// least'(r, x) and most'(r, x), x = y². A function X(r) with X(0) >= x(0) and X' >= most'(r, X) everywhere is nowhere
// below x: where they met, x could not grow faster (comparison of solutions of differential equations; W. Walter,
// Ordinary Differential Equations, 1998, §9). The same holds from the end backwards with least', and x is at most the
// largest one at which an acceleration is allowed at all. The time of the motion is at least that of the smallest of the
// three, ∫ ds / √X.
//
// X is a cubic in each cell. Its slope is found from five places of the cell and raised until it exceeds most' there by
// more than the largest second difference of what it lacks, over neighbouring places: between places most' may differ
// from a line by half of it, where its slope jumps, and by an eighth where it is smooth.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "reachability.hpp"

namespace bellcrank {

class LowerBound {
 public:
  static constexpr std::size_t parts = 4;  // of a cell

  // `limits` are those at the 4 cells + 1 places, in each cell at equal distances of r; `ds` is ds/dr there.
  LowerBound(const PathLimits& limits, const double* r, const double* ds, std::size_t cells)
      : limits_(limits), r_(r), ds_(ds), cells_(cells), top_(parts * cells + 1), ahead_(cells), back_(cells),
        node_(cells + 1), sources_(cells) {}

  // The bound of the time, s, between given speeds at the ends.
  double time(double begin, double end) {
    for (std::size_t p = 0; p < top_.size(); ++p) {
      std::pair<int, int> ignored;
      double largest = unlimited;  // of both sides, which the motion passes
      for (const std::size_t side : {p - (p > 0), std::min(p + 1, top_.size() - 1)}) {
        const LimitsAtPlace place(limits_, p, side);
        const double y = largest_allowed(place, Goal{}, ignored);
        largest = std::min(largest, std::isnan(y) ? place.fastest() : y);
        if (!limits_.may_split()) break;
      }
      top_[p] = largest * largest;
    }
    node_[cells_] = std::min(end * end, top_.back());
    for (std::size_t i = cells_; i-- > 0;) {
      back_[i] = slope_of_cell(i, node_[i + 1], false);
      node_[i] = back_[i].end(node_[i + 1], width(i));
      sources_[i].back_begins = node_[i] > top_[parts * i];
      if (sources_[i].back_begins) node_[i] = top_[parts * i];
    }
    double from = std::min(begin * begin, node_[0]), sum = 0;
    for (std::size_t i = 0; i < cells_; ++i) {
      ahead_[i] = slope_of_cell(i, from, true);
      sum += time_of_cell(i, from, node_[i + 1]);
      from = ahead_[i].end(from, width(i));
      sources_[i].ahead_ends = from > node_[i + 1];
      if (sources_[i].ahead_ends) from = node_[i + 1];
    }
    return sum;
  }

  // After `time`: the time, s, by about which each cell (cells) loosens the bound: half of the share by which X is raised
  // there, of the time of the cells that the raised curve reaches.
  std::vector<double> looseness() const {
    std::vector<double> found(cells_, 0.0);
    const auto largest = [&](std::size_t i) { return std::max(node_[i], node_[i + 1]); };
    double reached = 0;
    for (std::size_t i = 0; i < cells_; ++i) {
      if (sources_[i].back_begins) reached = 0;
      reached += sources_[i].time[1];
      found[i] = 0.5 * back_[i].raised_by(width(i), largest(i)) * reached;
    }
    reached = 0;
    for (std::size_t i = cells_; i-- > 0;) {
      if (sources_[i].ahead_ends) reached = 0;
      reached += sources_[i].time[0];
      found[i] += 0.5 * (ahead_[i].raised_by(width(i), largest(i)) * reached + sources_[i].bent);
    }
    return found;
  }

 private:
  // dX/dr in a cell, in the direction in which it is integrated: q0 + q1 z + q2 z² at the share z of the cell.
  struct Slope {
    double q0 = unlimited, q1 = 0, q2 = 0, raised = 0;
    bool known() const { return std::isfinite(q0); }
    double at(double z) const { return q0 + z * (q1 + z * q2); }
    double change(double z, double width) const { return width * z * (q0 + z * (q1 / 2 + z * q2 / 3)); }
    double end(double from, double width) const { return known() ? from + change(1, width) : unlimited; }
    double raised_by(double width, double x) const { return known() && x > 0 ? std::min(1.0, raised * width / x) : 1.0; }
  };
  // What makes X in a cell: the time in which each of the three curves is the least, whether the backward one ends at its
  // begin and the forward one at its end, and the time times the share of x that the largest one is raised by.
  struct Source {
    double time[3] = {0, 0, 0};
    bool back_begins = false, ahead_ends = false;
    double bent = 0;
  };
  using Samples = std::array<double, parts + 1>;

  double width(std::size_t i) const { return r_[parts * (i + 1)] - r_[parts * i]; }

  static double share(std::size_t j) { return static_cast<double>(j) / parts; }

  // The steepest slope at part j of a cell, in the direction of integration.
  double steepest(std::size_t i, std::size_t j, double x, bool ahead) const {
    const std::size_t place = parts * i + (ahead ? j : parts - j);
    const Bounds b = LimitsAtPlace(limits_, place, parts * i + parts / 2).bounds(std::sqrt(std::max(0.0, x)));
    return 2 * ds_[place] * (ahead ? b.most.value : -b.least.value);
  }

  static Slope through(double first, double middle, double last) {
    return {first, 4 * middle - 3 * first - last, 2 * (first + last) - 4 * middle};
  }

  static double bend(const Samples& value) {
    double largest = 0;
    for (std::size_t j = 1; j < parts; ++j)
      largest = std::max(largest, std::abs(value[j - 1] - 2 * value[j] + value[j + 1]));
    return largest;
  }

  // By how much more than the slope X would have to rise at the places of a cell, and what may be missing between them.
  std::pair<double, double> lacking(std::size_t i, double from, bool ahead, const Slope& slope) const {
    Samples lack;
    for (std::size_t j = 0; j <= parts; ++j) {
      const double x = from + slope.change(share(j), width(i));
      lack[j] = steepest(i, j, x, ahead) - slope.at(share(j));
    }
    const double worst = *std::max_element(lack.begin(), lack.end());
    return {worst, bend(lack)};
  }

  Slope slope_of_cell(std::size_t i, double from, bool ahead) const {
    const double first = steepest(i, 0, from, ahead);
    if (!std::isfinite(first)) return {};
    Slope slope{first, 0, 0};
    for (int turn = 0; turn < 3; ++turn) {
      const double middle = steepest(i, parts / 2, from + slope.change(0.5, width(i)), ahead);
      const double last = steepest(i, parts, from + slope.change(1, width(i)), ahead);
      slope = through(first, middle, last);
    }
    double raised = 0;
    for (int turn = 0; turn < 8; ++turn) {
      const Slope tried{slope.q0 + raised, slope.q1, slope.q2, raised};
      const auto [worst, between] = lacking(i, from, ahead, tried);
      if (!std::isfinite(worst) || !std::isfinite(between)) return {};
      if (worst + between <= 0) return tried;
      raised += (turn < 3 ? 1.0 : 2.0) * (worst + between) + 1e-14 * std::abs(first);
    }
    return {};
  }

  // By how much the largest x at which an acceleration is allowed may exceed a line between the place p and the next.
  double bent(std::size_t p) const {
    const double step = r_[p + 1] - r_[p];
    const auto by_place = [&](std::size_t k) {
      if (k == 0 || k + 1 >= top_.size()) return 0.0;
      return step * std::abs((top_[k + 1] - top_[k]) / (r_[k + 1] - r_[k]) - (top_[k] - top_[k - 1]) / (r_[k] - r_[k - 1]));
    };
    return std::max(by_place(p), by_place(p + 1));
  }

  double time_of_cell(std::size_t i, double from, double to) {
    const Slope& ahead = ahead_[i];
    Source& source = sources_[i];
    const double width = this->width(i);
    static constexpr double nodes[3] = {0.11270166537925831, 0.5, 0.88729833462074169};  // of Gauss and Legendre
    static constexpr double weights[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    double sum = 0;
    for (std::size_t j = 0; j < parts; ++j) {
      double all = 0, alone[3] = {0, 0, 0};
      int which[3];
      const double raised = bent(parts * i + j);
      for (int k = 0; k < 3; ++k) {
        const double z = nodes[k], share_of_cell = (static_cast<double>(j) + z) / parts;
        const std::size_t p = parts * i + j;
        const double x[3] = {ahead.known() ? from + ahead.change(share_of_cell, width) : unlimited,
                             back_[i].known() ? to + back_[i].change(1 - share_of_cell, width) : unlimited,
                             (1 - z) * top_[p] + z * top_[p + 1] + raised};
        const double way = weights[k] * width / parts * slope_of_way(p, z);
        which[k] = static_cast<int>(std::min_element(x, x + 3) - x);
        source.time[which[k]] += way / std::sqrt(std::max(x[which[k]], std::numeric_limits<double>::min()));
        if (which[k] == 2 && x[2] > 0) source.bent += raised / x[2] * way / std::sqrt(x[2]);
        all += way / std::sqrt(std::max(x[which[k]], std::numeric_limits<double>::min()));
        for (int m = 0; m < 3; ++m) alone[m] += way / std::sqrt(std::max(x[m], std::numeric_limits<double>::min()));
      }
      const bool one = which[0] == which[1] && which[1] == which[2];
      sum += one ? all : *std::max_element(alone, alone + 3);  // each alone is a bound, whatever happens between nodes
    }
    return sum;
  }

  // ds/dr between two places.
  double slope_of_way(std::size_t p, double z) const { return (1 - z) * ds_[p] + z * ds_[p + 1]; }

  const PathLimits& limits_;
  const double *r_, *ds_;
  std::size_t cells_;
  std::vector<double> top_;
  std::vector<Slope> ahead_, back_;
  std::vector<double> node_;
  std::vector<Source> sources_;
};

}  // namespace bellcrank
