// What several tests share: random numbers, vectors, and the order of convergence.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <doctest/doctest.h>

namespace bellcrank {

using Numbers = std::vector<double>;

// Random numbers that are the same with every library, which std::uniform_real_distribution are not.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double between(double low, double high) {
    return low + (high - low) * std::ldexp(static_cast<double>(engine_() >> 11), -53);
  }
  int integer(int low, int high) {
    return low + static_cast<int>(engine_() % static_cast<std::uint64_t>(high - low + 1));
  }
  Numbers vector(int size, double low = -1, double high = 1) {
    Numbers v(size);
    for (double& entry : v) entry = between(low, high);
    return v;
  }

 private:
  std::mt19937_64 engine_;
};

inline double dot(const Numbers& a, const Numbers& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}
inline double norm(const Numbers& v) { return std::sqrt(dot(v, v)); }
inline double largest(const Numbers& v) {
  double most = 0;
  for (double entry : v) most = std::isnan(entry) ? INFINITY : std::max(most, std::fabs(entry));
  return most;
}
inline double distance(const Numbers& a, const Numbers& b) {
  REQUIRE(a.size() == b.size());
  Numbers difference(a);
  for (std::size_t i = 0; i < a.size(); ++i) difference[i] -= b[i];
  return largest(difference);
}

// The least order that errors show at steps of which each is half the one before.
inline double order(const Numbers& errors) {
  double least = INFINITY;
  for (std::size_t i = 1; i < errors.size(); ++i) least = std::min(least, std::log2(errors[i - 1] / errors[i]));
  return least;
}

}  // namespace bellcrank
