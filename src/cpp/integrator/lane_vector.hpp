// SIMD lanes: one double a lane, as many lanes as a register has. Nothing here lets one lane's value reach another lane.
#pragma once

#ifdef __SSE2__
#include <immintrin.h>
#endif

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "memory.hpp"
#include "simd_lanes.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

#if defined(__AVX512F__) && defined(__AVX512DQ__)
constexpr int width = 8;
#elif defined(__AVX2__)
constexpr int width = 4;
#else
constexpr int width = 2;
#endif

typedef double Vec __attribute__((vector_size(8 * width)));
typedef std::int64_t Mask __attribute__((vector_size(8 * width)));  // a comparison: all bits of a lane, or none
using Bits = unsigned;                                             // one bit a lane

constexpr Bits all_lanes = (1u << width) - 1;

inline double larger(double a, double b) { return a > b ? a : b; }
inline double smaller(double a, double b) { return a < b ? a : b; }
// From |t| to the next double.
inline double spacing(double t) {
  const double from = std::fabs(t);
  std::uint64_t bits;
  std::memcpy(&bits, &from, sizeof bits);
  ++bits;
  double next;
  std::memcpy(&next, &bits, sizeof next);
  return next - from;
}

BELLCRANK_INLINE Vec splat(double v) { return v - Vec{}; }
BELLCRANK_INLINE Vec larger(Vec a, Vec b) { return a > b ? a : b; }
BELLCRANK_INLINE Vec smaller(Vec a, Vec b) { return a < b ? a : b; }
BELLCRANK_INLINE double absolute(double v) { return std::fabs(v); }
BELLCRANK_INLINE Vec absolute(Vec v) { return (Vec)((Mask)v & INT64_MAX); }

BELLCRANK_INLINE Bits bits(Mask m) {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
  return _mm512_movepi64_mask((__m512i)m);
#elif defined(__AVX2__)
  return static_cast<Bits>(_mm256_movemask_pd((__m256d)m));
#elif defined(__SSE2__)
  return static_cast<Bits>(_mm_movemask_pd((__m128d)m));
#else
  Bits found = 0;
  for (int lane = 0; lane < width; ++lane) found |= static_cast<Bits>(m[lane] != 0) << lane;
  return found;
#endif
}
BELLCRANK_INLINE bool any(Mask m) { return bits(m) != 0; }
BELLCRANK_INLINE bool any(bool holds) { return holds; }
BELLCRANK_INLINE Mask mask(Bits lanes) {
  Mask m;
  for (int l = 0; l < width; ++l) m[l] = std::int64_t{1} << l;
  return (m & static_cast<std::int64_t>(lanes)) != 0;
}
BELLCRANK_INLINE Mask finite(Vec v) { return v * 0.0 == 0.0; }

// Calls f(lane) for each lane of `lanes`.
template <class Function>
BELLCRANK_INLINE void each(Bits lanes, Function f) {
  for (; lanes; lanes &= lanes - 1) f(__builtin_ctz(lanes));
}

BELLCRANK_INLINE double root(double v) { return std::sqrt(v); }
BELLCRANK_INLINE Vec root(Vec v) {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
  return (Vec)_mm512_sqrt_pd((__m512d)v);
#elif defined(__AVX2__)
  return (Vec)_mm256_sqrt_pd((__m256d)v);
#elif defined(__SSE2__)
  return (Vec)_mm_sqrt_pd((__m128d)v);
#else
  for (int lane = 0; lane < width; ++lane) v[lane] = std::sqrt(v[lane]);
  return v;
#endif
}

// From |t| to the next double.
inline Vec spacing(Vec t) {
  const Vec from = absolute(t);
  return (Vec)((Mask)from + 1) - from;
}

inline double power(double x, double y) { return std::pow(x, y); }
// x^y to 1e-9, for step sizes: |y log2 x| < 1000, and x positive and normal.
inline Vec power(Vec x, double y) {
  // x = 2^e m with m between sqrt(1/2) and sqrt(2); log2 m = 2 / ln 2 artanh((m - 1) / (m + 1))
  constexpr std::int64_t half = 0x3fe6a09e667f3bcd, bias = std::int64_t{1024} << 52, round = 0x4338000000000000;
  constexpr double to_nearest = 6755399441055744.0;  // 1.5 2^52: adding it leaves an integer in the low bits
  typedef std::uint64_t Unsigned __attribute__((vector_size(8 * width)));
  const Mask whole = (Mask)((Unsigned)((Mask)x - half + bias) >> 52) - 1024;
  const Vec e = (Vec)(whole + round) - to_nearest;
  const Vec m = (Vec)((Mask)x - (whole << 52));
  const Vec s = (m - 1) / (m + 1), z = s * s;
  const Vec artanh = s * (1 + z * (1. / 3 + z * (1. / 5 + z * (1. / 7 + z * (1. / 9 + z * (1. / 11))))));
  const Vec a = y * (e + 2.8853900817779268 * artanh);
  const Vec shifted = a + to_nearest, r = 0.6931471805599453 * (a - (shifted - to_nearest));
  constexpr double taylor[] = {1. / 362880, 1. / 40320, 1. / 5040, 1. / 720, 1. / 120, 1. / 24, 1. / 6, 0.5, 1, 1};
  Vec sum = {};
  for (double c : taylor) sum = sum * r + c;
  return (Vec)((Mask)sum + ((Mask)shifted << 52));
}

using Vectors = Array<Vec>;

// The states of one run a lane in vectors.
struct RunsInLanes {
  using Vector = Vec;
  using Number = Vec;
  static Vec sum(Vec v) { return v; }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
