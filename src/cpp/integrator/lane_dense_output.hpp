// The motion within the steps of a block, one step a lane.
#pragma once

#include "dense_output.hpp"
#include "lane_runge_kutta.hpp"

namespace bellcrank {
namespace BELLCRANK_ISA {

template <class Method>
class LaneDenseOutput {
 public:
  LaneDenseOutput(LaneEquations& equations, LaneRungeKutta<Method>& method)
      : equations_(equations), method_(method), n_(equations.problem.n), polynomials_(n_), between_(n_), rate_(n_) {}

  // The polynomials that need no evaluations, of the steps in a block.
  void begin(const LaneBlock& block) { polynomials_.begin(step(block)); }

  // x at t_old + s (t - t_old) by these: with DOP853 of degree 6, or 5 where not `finer`.
  void approximate(const LaneBlock& block, Vec s, Vec* x, bool finer = true) const {
    polynomials_.approximate(step(block), s, x, finer);
    equations_.normalise(x);
  }

  // Computes the dense output, which may cost evaluations; false in lanes where that fails.
  Mask prepare(LaneBlock& block, Mask wanted) {
    const Vec h = block.t - block.t_old;
    if constexpr (Method::fsal) return Mask{} == 0;
    block.evaluations += wanted ? splat(Method::extra) : Vec{};
    if constexpr (Method::extra == 3) {
      method_.template stage<13>(block, h);
      method_.template stage<14>(block, h);
      method_.template stage<15>(block, h);
      const int size = equations_.problem.norm_size;
      const auto scale = [&](std::size_t i) { return 1.0 / (block.atol + block.rtol * absolute(block.x[i])); };
      return polynomials_.complete(step(block), scale, size, size);
    } else {
      approximate(block, splat(Polynomials::corrected), between_);
      equations_.rhs(block, block.t_old + Polynomials::corrected * h, between_, rate_);
      return polynomials_.correct(step(block), rate_);
    }
  }

  // x at t_old + s (t - t_old) by the dense output.
  void interpolate(const LaneBlock& block, Vec s, Vec* x) const {
    polynomials_.interpolate(step(block), s, x);
    equations_.normalise(x);
  }

 private:
  using Polynomials = StepPolynomials<Method, RunsInLanes, 0>;

  LaneEquations& equations_;
  LaneRungeKutta<Method>& method_;
  const std::size_t n_;
  Polynomials polynomials_;
  Vectors between_, rate_;

  typename Polynomials::Step step(const LaneBlock& b) const { return {b.old, b.x, b.k, n_, b.t - b.t_old}; }
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
