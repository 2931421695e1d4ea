// What stages of a step say of the motion within it, before any evaluation is spent on a dense output.
#pragma once

#include "runge_kutta_tableaus.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

// The inverses of w_j'(c_i), w_j = s^2 (1 - s)^2 s^j, at the abscissae c_i of two or three stages: from what slopes there
// lack to the coefficients of a polynomial. The stages are those of DOP853 whose arguments satisfy sum_j a_ij c_j^k =
// c_i^(k + 1) / (k + 1) up to k = 4, far apart.
template <class Method>
struct StagePolynomialTerms {
  static constexpr int stage[3] = {7, 10, 9};
  double two[2][2] = {}, three[3][3] = {};

  constexpr StagePolynomialTerms() {
    double a[3][3] = {};
    for (int i = 0; i < 3; ++i) {
      const double s = Method::c[stage[i]], r = 1 - s;
      double power = 1;
      for (int j = 0; j < 3; ++j, power *= s) a[i][j] = s * r * power * (2 * (1 - 2 * s) + j * r);
    }
    const double d = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    two[0][0] = a[1][1] / d, two[0][1] = -a[0][1] / d, two[1][0] = -a[1][0] / d, two[1][1] = a[0][0] / d;
    double all = 0;
    for (int j = 0; j < 3; ++j)
      all += a[0][j] * (a[1][(j + 1) % 3] * a[2][(j + 2) % 3] - a[1][(j + 2) % 3] * a[2][(j + 1) % 3]);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        three[j][i] = (a[(i + 1) % 3][(j + 1) % 3] * a[(i + 2) % 3][(j + 2) % 3] -
                       a[(i + 1) % 3][(j + 2) % 3] * a[(i + 2) % 3][(j + 1) % 3]) / all;
  }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
