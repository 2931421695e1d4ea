// The stages of an explicit Runge-Kutta step and its error norm. `V`: a vector of entries, `T`: the numbers of a run
// (simd_lanes.hpp); slopes are in rows, one a stage, of n vectors.
#pragma once

#include "right_hand_side.hpp"
#include "runge_kutta_tableaus.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// The argument of stage S of a step of size h from y; after the last stage, the step's end.
template <class Method, int S, bool Fresh = false, class V, class T>
BELLCRANK_INLINE void stage_argument(const V* y, const V* k, std::size_t n, T h, V* to) {
  for (std::size_t i = 0; i < n; ++i) to[i] = y[i] + h * weighted<Weights<RowOf<Method, S>>, S - 1, Fresh>(k + i, n);
}

// The square of the error norm of a step of size h, from sums over `size` entries of squares of the error estimates.
template <class Method, class T>
BELLCRANK_INLINE T norm_square(T h, T fifth, T third, int size) {
  const T e = h * h * fifth / static_cast<double>(size);
  if constexpr (Method::fsal) return e;
  const T both = fifth + 0.01 * third;
  return both == 0.0 ? T{} : e * (fifth / both);
}

// These sums. scale: 1 / the tolerance of the entries.
template <class Method, class V, bool Fresh = false>
struct ErrorSums {
  V fifth = {}, third = {};

  BELLCRANK_INLINE void add(const V* k, std::size_t n, V scale) {
    constexpr int last = Method::stages;
    if constexpr (Method::fsal) {
      const V e = scale * weighted<Weights<ErrorOf<Method>>, last, Fresh>(k, n);
      fifth += e * e;
    } else if constexpr (Method::extra == 3) {
      const V e = scale * weighted<Weights<Error5Of<Method>>, last - 1, Fresh>(k, n);
      const V g = scale * weighted<Weights<Error3Of<Method>>, last - 1, Fresh>(k, n);
      fifth += e * e;
      third += g * g;
    }
  }
};

// Zeroed memory within the object itself, so that its address needs no load; of a size at run time for `Count` 0.
template <class T, int Count>
class Room {
 public:
  explicit Room(std::size_t) {}
  Room(const Room&) = delete;
  operator T*() { return data_; }
  operator const T*() const { return data_; }

 private:
  alignas(64) T data_[Count] = {};
};
template <class T>
class Room<T, 0> : public Array<T> {
  using Array<T>::Array;
};

// Of one run.
template <class Method, int Blocks>
struct Stages {
  int run_time_blocks;
  Room<double, 4 * Blocks * Method::rows> k;
  Room<double, 4 * Blocks> x;
  Inputs in;
  const double* first = k;  // the first stage's slope, where it was written last
  double* out[Method::rows];

  Stages(int count, const Rhs& rhs)
      : run_time_blocks(count), k(lanes() * Method::rows), x(lanes()), in(x, rhs) {
    for (int s = 0; s < Method::rows; ++s) out[s] = k + s * lanes();
  }

  int blocks() const { return Blocks ? Blocks : run_time_blocks; }
  std::size_t lanes() const { return 4 * static_cast<std::size_t>(blocks()); }

  template <int S>
  BELLCRANK_INLINE void sum(const double* y, double h, double* to) {
    const double* slopes = k;
    stage_argument<Method, S, (Blocks > 0)>(vectors(y), vectors(slopes), blocks(), h, vectors(to));
  }

  // The same without its newest slope, which the kernel adds.
  template <int S>
  BELLCRANK_INLINE void but_newest(const double* y, double h) {
    const std::size_t w = lanes();
    double *to = x, *slopes = k;
    for (int b = 0; b < blocks(); ++b) {
      if constexpr (Weights<RowOf<Method, S>>::first(S - 1)) at(to + 4 * b) = at(y + 4 * b);
      else at(to + 4 * b) = at(y + 4 * b) + h * weighted<Weights<RowOf<Method, S>>, S - 2>(vectors(slopes) + b, blocks());
    }
    in.at(S == 1 ? first : slopes + (S - 1) * w, h * Method::a[S][S - 1]);
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
