// SIMD: four doubles at a time, and weighted sums of stages unrolled from a table. Formulas are written once, for a vector and
// the numbers of a run: four entries of one state with a double, or one entry of one run a lane with a vector as well.
#pragma once

#ifdef __AVX2__
#include <immintrin.h>
#endif

#include <cstddef>

namespace bellcrank {
namespace BELLCRANK_ISA {

typedef double Lanes __attribute__((vector_size(32)));

#define BELLCRANK_INLINE inline __attribute__((always_inline))
#define BELLCRANK_INLINED __attribute__((always_inline))  // after the parameters of a lambda

BELLCRANK_INLINE Lanes& at(double* p) { return *reinterpret_cast<Lanes*>(p); }
BELLCRANK_INLINE const Lanes& at(const double* p) { return *reinterpret_cast<const Lanes*>(p); }
BELLCRANK_INLINE Lanes* vectors(double* p) { return reinterpret_cast<Lanes*>(p); }
BELLCRANK_INLINE const Lanes* vectors(const double* p) { return reinterpret_cast<const Lanes*>(p); }
BELLCRANK_INLINE Lanes magnitude(Lanes v) { return v < 0 ? -v : v; }
BELLCRANK_INLINE double total(Lanes v) { return (v[0] + v[2]) + (v[1] + v[3]); }

// The state of one run in vectors; of one run a lane: RunsInLanes (lane_vector.hpp).
struct OneRun {
  using Vector = Lanes;
  using Number = double;
  static double sum(Lanes v) { return total(v); }
};

// Loads lanes that were just stored one by one: a vector load would wait until the stores have left the store buffer.
BELLCRANK_INLINE Lanes fresh(const double* p) {
#ifdef __AVX2__
  __m128d low = _mm_load_sd(p), high = _mm_load_sd(p + 2);
  asm("" : "+x"(low), "+x"(high));  // or the compiler merges the loads again
  return static_cast<Lanes>(_mm256_set_m128d(_mm_loadh_pd(high, p + 3), _mm_loadh_pd(low, p + 1)));
#else
  return at(p);
#endif
}

// sum over j <= J of table(j) k_j, the latest stage last, which is `Fresh` where it was just stored one by one
template <class Table, int J, bool Fresh = false, bool Latest = true, class V>
BELLCRANK_INLINE V weighted(const V* k, std::size_t stride) {
  constexpr double weight = Table::at(J);
  if constexpr (weight == 0) {
    return weighted<Table, J - 1, Fresh, false>(k, stride);
  } else {
    V value;
    if constexpr (Fresh && Latest) value = fresh(reinterpret_cast<const double*>(k + J * stride));
    else value = k[J * stride];
    if constexpr (Table::first(J)) return weight * value;
    else return weighted<Table, J - 1, Fresh, false>(k, stride) + weight * value;
  }
}

template <class Numbers>
struct Weights {
  static constexpr double at(int j) { return Numbers::at(j); }
  static constexpr bool first(int j) {
    for (int i = 0; i < j; ++i)
      if (Numbers::at(i) != 0) return false;
    return true;
  }
};
template <class Method, int S>
struct RowOf {
  static constexpr double at(int j) { return Method::a[S][j]; }
};
template <class Method>
struct ErrorOf {
  static constexpr double at(int j) { return Method::e[j]; }
};
template <class Method>
struct Error5Of {
  static constexpr double at(int j) { return Method::e5[j]; }
};
template <class Method>
struct Error3Of {
  static constexpr double at(int j) { return Method::e3[j]; }
};
template <class Method, int Power>
struct DenseOf {
  static constexpr double at(int j) {
    if constexpr (Method::fsal) return Method::dense[j][Power];
    else return Method::dense[Power][j];
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
