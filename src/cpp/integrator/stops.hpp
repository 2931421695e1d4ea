// Where steps of a run have to end.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace bellcrank {

// The jumps inside a run; those closer than rounding are one. `latest` becomes the time just before the first that is t1
// itself, to rounding, so that the last step sees the side before it.
inline std::vector<double> stops_within(const std::vector<double>& jumps, double t0, double t1, double* latest) {
  std::vector<double> kept;
  const double least = 1e-14 * std::max(std::fabs(t0), std::fabs(t1));
  *latest = HUGE_VAL;
  for (double t : jumps) {
    if (std::fabs(t - t1) <= least) *latest = std::min(*latest, std::nextafter(std::min(t, t1), t0));
    if (t > t0 + least && t < t1 - least && (kept.empty() || t > kept.back() + least)) kept.push_back(t);
  }
  return kept;
}

}  // namespace bellcrank
