// The spectral radius of a Jacobian by the power method: the growth of y over pairs of products, which holds for complex
// pairs of eigenvalues too. Of a mechanism the positions alone are measured, because the units of velocities differ.
#pragma once

#include "right_hand_side.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

class SpectralRadius {
 public:
  explicit SpectralRadius(const Problem& p) : p_(p), y_(p.n), next_(p.n) {}

  // J (n, n) column by column. The start is fixed, so that the answer depends on J alone; accurate to about a tenth.
  double operator()(const double* jacobian) {
    constexpr int first = 4, last = 12;
    for (int i = 0; i < p_.n; ++i) y_[i] = 1 + 0.5 * std::cos(1.7 * i);
    double growth = 1;  // |J^last y| / |J^first y|
    for (int k = 1; k <= last; ++k) {
      for (int i = 0; i < p_.n; ++i) next_[i] = 0;
      for (int j = 0; j < p_.norm_size; ++j)
        for (int i = 0; i < p_.norm_size; ++i) next_[i] += jacobian[static_cast<std::size_t>(j) * p_.n + i] * y_[j];
      const double before = measured(y_), after = measured(next_);
      if (!(after > 0 && before > 0 && after < INFINITY)) return 0;
      if (k > first) growth *= after / before;
      for (int i = 0; i < p_.norm_size; ++i) y_[i] = next_[i] / after;
    }
    return std::pow(growth, 1.0 / (last - first));
  }

 private:
  const Problem& p_;
  Buffer y_, next_;

  double measured(const double* y) const {
    double sum = 0;
    for (int i = 0; i < (p_.nq ? p_.nq : p_.norm_size); ++i) sum += y[i] * y[i];
    return std::sqrt(sum);
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
