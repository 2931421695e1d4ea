// The zero of a function between two samples of a step, and its correction by steps that end there. `T`: double, or a vector
// with a function in each lane, and then `M` is a mask. Only functions that are `active` count; the others may take any value.
#pragma once

#include "lane_vector.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// Rounding of the time of a step of size h that ends at t, as a fraction of the step.
template <class T>
T rounding_of_time(T t, T h) {
  return larger(2.0 * spacing(t) / h, T{} + 1e-16);
}

// A bracketed root of `along`(s): T. R. Chandrupatla, Adv. Eng. Software 28 (1997) 145-149. Where `along` is zero or not a
// number at the root, `value` becomes that, elsewhere NaN.
template <class T, class M, class Along>
T bracketed_root(const Along& along, T a, T at_a, T b, T at_b, T rounding, M active, T* value) {
  T c = a, at_c = at_a, fraction = T{} + 0.5, found = {};
  *value = T{} + NAN;
  for (int k = 0; k < 100 && any(active); ++k) {
    const T s = a + fraction * (b - a), at_s = along(s);
    const M hit = active & ((at_s == 0.0) | (at_s != at_s));
    found = hit ? s : found, *value = hit ? at_s : *value;
    active &= !hit;
    const M same = (at_s > 0.0) == (at_a > 0.0);
    c = same ? a : b, at_c = same ? at_a : at_b;
    b = same ? b : a, at_b = same ? at_b : at_a;
    a = s, at_a = at_s;
    found = active ? (absolute(at_a) < absolute(at_b) ? a : b) : found;
    const T tolerance = rounding / absolute(b - a);
    active &= tolerance <= 0.5;
    const T xi = (a - b) / (c - b), phi = (at_a - at_b) / (at_c - at_b);
    const T inverse = at_a / (at_b - at_a) * at_c / (at_b - at_c) +
                      (c - a) / (b - a) * at_a / (at_c - at_a) * at_b / (at_c - at_b);
    const M good = (phi * phi < xi) & ((1.0 - phi) * (1.0 - phi) < 1.0 - xi);
    fraction = good ? inverse : T{} + 0.5;
    fraction = smaller(1.0 - tolerance, larger(tolerance, fraction));
  }
  return found;
}

// Corrects a root at the share s of a step from `start` to t, found on its dense output between places that lie `interval`
// apart, by secant iterations over steps that end there. `repeat`(h, active, &value) makes such a step, keeps its state
// and gives the function there; it returns where the step is finite. `time` becomes the time of the last one to rounding.
// Returns where the iterations fail.
template <class T, class M, class Along, class Repeat>
M corrected_root(const Along& along, const Repeat& repeat, T start, T t, T s, T interval, M active, T* time) {
  const T h = t - start, ulp = spacing(t), first = s * h;
  const T width = smaller(smaller(T{} + 1e-3, larger(0.05 * interval, T{} + 1e-7)), smaller(s, 1.0 - s));
  const T most = smaller(T{} + 0.1, larger(interval, T{} + 1e-5)) * h;
  T slope = (along(s + width) - along(s - width)) / (2.0 * width * h);
  T now = first, before = {}, at_before = {};
  M failed = {};
  const auto apart = [&] { return !(absolute(now - before) <= 4.0 * ulp); };  // by more than rounding allows
  for (int k = 0; k < 8 && any(active); ++k) {
    T at_now = {};
    M out = active & !repeat(now, active, &at_now);
    if (k > 0) slope = at_now != at_before ? (at_now - at_before) / (now - before) : slope;
    const T next = now - at_now / slope;
    const M done = (!out) & ((at_now == 0.0) | (absolute(next - now) <= 0.5 * ulp));
    active &= !done;
    out |= active & ((!(absolute(next - first) < most)) | (next <= 0.0) | (next >= h));
    failed |= out & apart();
    active &= !out;
    before = active ? now : before, at_before = active ? at_now : at_before;
    now = active ? next : now;
  }
  *time = start + now;
  return failed | (active & apart());
}

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
