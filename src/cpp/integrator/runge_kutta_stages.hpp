// The slopes of one explicit step, and their weighted sums.
#pragma once

#include "simd_lanes.hpp"
#include "right_hand_side.hpp"
#include "runge_kutta_tableaus.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// Zeroed memory within the object itself, so that its address needs no load; of a size at run time for `Doubles` 0.
template <int Doubles>
class Room {
 public:
  explicit Room(std::size_t) {}
  Room(const Room&) = delete;
  operator double*() { return data_; }
  operator const double*() const { return data_; }

 private:
  alignas(64) double data_[Doubles] = {};
};
template <>
class Room<0> : public Buffer {
  using Buffer::Buffer;
};

template <class Method, int Blocks>
struct Stages {
  int run_time_blocks;
  Room<4 * Blocks * Method::rows> k;
  Room<4 * Blocks> x;
  Inputs in;
  const double* first = k;  // the first stage's slope, where it was written last
  double* out[Method::rows];

  Stages(int count, const Rhs& rhs)
      : run_time_blocks(count), k(lanes() * Method::rows), x(lanes()), in(x, rhs) {
    for (int s = 0; s < Method::rows; ++s) out[s] = k + s * lanes();
  }

  int blocks() const { return Blocks ? Blocks : run_time_blocks; }
  std::size_t lanes() const { return 4 * static_cast<std::size_t>(blocks()); }

  // The argument of stage S of a step of size h from y; after the last stage, the step's end.
  template <int S>
  BELLCRANK_INLINE void sum(const double* y, double h, double* to) {
    const std::size_t w = lanes();
    const double* slopes = k;
    for (int b = 0; b < blocks(); ++b)
      at(to + 4 * b) =
          at(y + 4 * b) + h * weighted<Weights<RowOf<Method, S>>, S - 1, (Blocks > 0)>(slopes + 4 * b, w);
  }

  // The same without its newest slope, which the kernel adds.
  template <int S>
  BELLCRANK_INLINE void but_newest(const double* y, double h) {
    const std::size_t w = lanes();
    double *to = x, *slopes = k;
    for (int b = 0; b < blocks(); ++b) {
      if constexpr (Weights<RowOf<Method, S>>::first(S - 1)) at(to + 4 * b) = at(y + 4 * b);
      else at(to + 4 * b) = at(y + 4 * b) + h * weighted<Weights<RowOf<Method, S>>, S - 2, false>(slopes + 4 * b, w);
    }
    in.at(S == 1 ? first : slopes + (S - 1) * w, h * Method::a[S][S - 1]);
  }

  // Cubic through values and slopes at both ends of a step of size h from y to z, less y.
  Lanes hermite(const double* y, const double* z, double h, double s, int b) const {
    const Lanes f = h * at(k + 4 * b), g = h * at(k + Method::stages * lanes() + 4 * b);
    const Lanes d = at(z + 4 * b) - at(y + 4 * b);
    return s * (d + (1 - s) * ((1 - s) * (f - d) - s * (g - d)));
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
