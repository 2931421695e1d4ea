// The search for a posture that satisfies a scene's constraints, of one design: that of a start, whose rules
// dynamics/postures/consistent_start.py states, or those along a motion (dynamics/postures/posture_search.py). Corrections are damped
// Gauss-Newton steps of minimum norm, lengths in units of the characteristic length.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "damped_least_squares.hpp"
#include "least_squares.hpp"
#include "problem.hpp"

namespace bellcrank {

enum class JointKind { one, planar, floating, spherical };

inline int lengths_of(JointKind kind) { return kind == JointKind::planar ? 2 : kind == JointKind::floating ? 3 : 0; }

struct StartJoint {
  JointKind kind;
  int q, v;
  bool position_in_parent, velocity_in_parent;  // its vectors are held or left along the parent's axes, not the body's
};

// What the designs share.
struct StartModel {
  int nq, nv, size, heights, rows;  // of q, v, x; of φ; of (φ̇, ψ)
  Kernel linearised;                // (t, x, u, p) -> φ, (φ̇, ψ), entries of J
  std::vector<int> entry_row, entry_column;
  Kernel cosines, aligned;  // of welds and hinges: cosines; their alignment residual and its derivative by v; or 0
  int cosine_count, aligned_count;
  std::vector<int> aligned_of;  // (aligned_count) whose cosine each row of the alignment residual belongs to
  std::vector<bool> sine;  // (heights) rows that `aligned` replaces
  std::vector<bool> far;   // (nv) in metres
  std::vector<StartJoint> joints;
  double t;         // the time (s) and the inputs at which the constraints are to be satisfied
  const double* u;
};

// A motion to follow. Its first row is where it begins; of the leading joints there, those of the first posture count.
struct FollowedRows {
  int count, inputs, leaders;      // rows after the first; entries of u; joints
  const double *t, *u, *wanted;    // (count + 1), (count + 1, inputs), (count + 1, leaders): the joints' positions
  const int *q, *v;                // (leaders) their coordinates
  double longest, rounded;         // of a first step; of the residual that rounding leaves
};

// How many rows were followed, and to which share of the way to the next one no step led; 0: its joints are too far.
struct FollowedCount {
  int rows;
  double share;
};

// How a posture is searched: `nearest` takes Gauss-Newton steps of minimum norm from the given posture; `damped` takes
// Levenberg-Marquardt steps, which do not stop where J loses rank; `continued` closes the gaps of the given posture
// gradually, in such steps.
enum class StartMethod { nearest, damped, continued };

// Which constraints a search satisfies; the others stay open. Null: all.
struct StartSelection {
  const bool *rows = nullptr, *cosines = nullptr;  // (heights), (cosine_count)
};

// A design: its parameters, the unit of each row, and the characteristic length.
struct StartDesign {
  const double *p, *unit;
  double length;
};

enum class StartCode : int { consistent, undefined, unsatisfied, turned_around, violated };

// Which row or constraint is to blame, and its value.
struct StartVerdict {
  StartCode code = StartCode::consistent;
  int index = 0;
  double value = 0;
};

class StartSearch {
 public:
  explicit StartSearch(const StartModel& model)
      : m_(model), x_(model.size), phi_(model.heights), psi_(model.rows), entries_(model.entry_row.size() + 1),
        cosines_(model.cosine_count), found_(model.aligned_count), slope_(model.aligned_count * model.nv),
        step_(model.nv), there_(model.nq), reduced_(model.nv) {}

  // Moves q (nq) to the nearest posture that satisfies φ = 0 with the degrees of freedom `held` (nv) held, or, by the
  // other methods, to one that may be further away.
  StartVerdict posture(const StartDesign& design, const bool* held, double* q, StartMethod method = StartMethod::nearest,
                       StartSelection selection = {}) {
    design_ = &design, t_ = m_.t, u_ = m_.u;
    selection_ = selection;
    target_.clear();
    linearise(q, nullptr);
    StartVerdict verdict = undefined(phi_.data(), m_.heights);
    if (verdict.code != StartCode::consistent) return verdict;
    free_.assign(m_.nv, false);
    for (int j = 0; j < m_.nv; ++j) free_[j] = !held[j];
    double largest = method == StartMethod::nearest ? closed(q) : reached(q, method);
    if (largest > CLOSED && largest <= ROUNDED) {
      free_.assign(m_.nv, true);
      largest = closed(q);
    }
    if (largest > 1e3 * CLOSED) return worst_row(q);
    return turned_around(q);
  }

  // Changes v (nv) to the nearest velocity at q that satisfies φ̇ = 0 and ψ = 0 with the components `held` held.
  StartVerdict velocity(const StartDesign& design, const bool* held, const double* q, double* v) {
    design_ = &design, t_ = m_.t, u_ = m_.u;
    selection_ = {};
    target_.clear();
    linearise(q, v);
    StartVerdict verdict = undefined(psi_.data(), m_.rows);
    if (verdict.code != StartCode::consistent) return verdict;
    free_.assign(m_.nv, false);
    for (int j = 0; j < m_.nv; ++j) free_[j] = !held[j];
    residual_.resize(m_.rows);
    for (int i = 0; i < m_.rows; ++i) residual_[i] = psi_[i] / design.unit[i];
    jacobian_.assign(static_cast<std::size_t>(m_.rows) * m_.nv, 0.0);
    for (std::size_t e = 0; e < m_.entry_row.size(); ++e)
      jacobian(m_.entry_row[e], m_.entry_column[e]) = scaled(e);
    minimum_norm_step(q, false);
    double most = 1;
    for (int i = 0; i < m_.rows; ++i)
      for (int j = 0; j < m_.nv; ++j) residual_[i] += jacobian(i, j) * step_[j];
    const int worst = worst_of(residual_);
    const double left = m_.rows ? std::fabs(residual_[worst]) : 0;
    for (int j = 0; j < m_.nv; ++j) most = std::max(most, std::fabs(v[j] / column(j)));
    for (int j = 0; j < m_.nv; ++j) v[j] += column(j) * step_[j];
    if (!(left <= 1e-9 * most)) return {StartCode::violated, worst, left * design.unit[worst]};
    return {};
  }

  // The postures (count, nq) of a motion on the branch of q (nq), by steps of continuation: a tangent step and corrections
  // of minimum norm, which keep close to it. Where they do not, a step is halved. All degrees of freedom but those of the
  // leading joints follow. Past the last row that was followed stands the last posture that was reached.
  FollowedCount follow(const StartDesign& design, const FollowedRows& rows, double* q, double* postures) {
    design_ = &design, rows_ = &rows;
    selection_ = {};
    target_.clear();
    free_.assign(m_.nv, true);
    for (int k = 0; k < rows.leaders; ++k) free_[rows.v[k]] = false;
    goal_.resize(rows.leaders), begun_.resize(rows.leaders), inputs_.resize(rows.inputs + 1);
    FollowedCount done{0, 0};
    for (; done.rows < rows.count; ++done.rows, postures += m_.nq) {
      row_ = done.rows;
      double away = 0;
      for (int k = 0; k < rows.leaders; ++k) {
        begun_[k] = q[rows.q[k]];
        const double moved = std::fabs(wanted(k) - begun_[k]) / column(rows.v[k]);
        if (!(moved <= away)) away = moved;
      }
      done.share = 0;
      const bool near = away <= FARTHEST;
      const int steps = near ? std::max(1, static_cast<int>(std::ceil(away / STRIDE))) : 0;
      bool reached = near;
      for (int j = 1; j <= steps && reached; ++j)
        reached = reach(q, static_cast<double>(j - 1) / steps, static_cast<double>(j) / steps, FINEST, done.share);
      std::copy(q, q + m_.nq, postures);
      if (!reached) break;
    }
    return done;
  }

  // Rotates the parts of a velocity (nv) that are given along the parents' axes into the bodies' axes at q.
  void velocity_in_body(const double* q, double* v) const { rotate(q, false, v, true); }

 private:
  static constexpr double CLOSED = 1e-13;   // rad, or of the characteristic length: the search ends below it
  static constexpr double ROUNDED = 1e-6;   // the residual that rounded digits of held values may leave; then all move
  static constexpr double ASIDE = 0.05;     // a step away from half a turn, where both ways back are equally long
  static constexpr double LARGEST = 1e100;  // of a value that counts as defined
  static constexpr double RANK = 1e-10;     // of the largest singular value
  static constexpr double LONGEST = 0.5;    // rad: a longer step may reach another branch
  static constexpr int STEPS = 200, HALVINGS = 30;
  static constexpr int STAGES = 20, STAGE_STEPS = 10;  // of a continuation
  static constexpr double DAMPING = 1e-3;   // of the largest diagonal entry of the normal equations, at first
  static constexpr double FLAT = 1e-5;      // of the residual's square: damped steps that promise less end the search
  static constexpr double NEAR = 1e-3;      // a residual from which steps of minimum norm are worth their cost
  static constexpr double STRIDE = 0.05;    // rad or of the length: that leading joints move in one step of continuation
  static constexpr double FARTHEST = 5000;  // the same, from one row to the next
  static constexpr double LEAP = 0.1;       // the same, between a posture and its prediction: more is another branch
  static constexpr double SINGULAR = 1e-8;  // the same as RANK, along a motion
  static constexpr int CORRECTIONS = 13, FINEST = 14;  // after a prediction; halvings of a step

  const StartModel& m_;
  const StartDesign* design_ = nullptr;
  std::vector<double> x_, phi_, psi_, entries_, cosines_, found_, slope_;  // arguments and values of the kernels
  std::vector<double> residual_, jacobian_;                               // of the search, in its units
  std::vector<double> step_, there_, reduced_, right_, damped_step_;
  std::vector<double> target_;  // subtracted from the residual, where not empty
  double t_ = 0;
  const double* u_ = nullptr;
  StartSelection selection_;
  const FollowedRows* rows_ = nullptr;  // of `follow`: the motion, its row, and where its leading joints were before it
  int row_ = 0;
  std::vector<double> begun_, goal_, inputs_, next_, strayed_;
  std::vector<int> place_;
  std::vector<bool> free_;
  LeastSquares least_squares_;
  DampedLeastSquares damped_;

  double& jacobian(int row, int column) { return jacobian_[static_cast<std::size_t>(row) * m_.nv + column]; }
  double column(int j) const { return m_.far[j] ? design_->length : 1; }
  double scaled(std::size_t e) const {
    return entries_[e] / design_->unit[m_.entry_row[e]] * column(m_.entry_column[e]);
  }

  void evaluate(Kernel kernel, const double* q, const double* v, double* const* out) {
    std::fill(x_.begin(), x_.end(), 0.0);
    std::copy(q, q + m_.nq, x_.begin());
    if (v) std::copy(v, v + m_.nv, x_.begin() + m_.nq);
    const double* in[] = {&t_, x_.data(), u_, design_->p};
    kernel(in, out);
  }

  double wanted(int k) const { return rows_->wanted[(row_ + 1) * rows_->leaders + k]; }

  // Sets time, inputs and the leading joints' positions to those at a share of the way from the row before.
  void advance(double share) {
    const FollowedRows& rows = *rows_;
    const auto between = [share](double a, double b) { return share == 1 ? b : a + share * (b - a); };
    t_ = between(rows.t[row_], rows.t[row_ + 1]);
    const double *before = rows.u + static_cast<std::size_t>(row_) * rows.inputs, *after = before + rows.inputs;
    for (int k = 0; k < rows.inputs; ++k) inputs_[k] = between(before[k], after[k]);
    u_ = inputs_.data();
    for (int k = 0; k < rows.leaders; ++k) goal_[k] = between(begun_[k], wanted(k));
  }

  // Moves q from one share of the way to another, in smaller steps where one fails; `failed`: where the smallest led.
  bool reach(double* q, double from, double to, int halvings, double& failed) {
    if (stepped(q, to)) return true;
    failed = to;
    if (halvings == 0) return false;
    const double middle = 0.5 * (from + to);
    return reach(q, from, middle, halvings - 1, failed) && reach(q, middle, to, halvings - 1, failed);
  }

  // A step of continuation to a share of the way; q is left where it fails.
  bool stepped(double* q, double share) {
    const FollowedRows& rows = *rows_;
    advance(share);
    residual_at(q, false);
    bool rests = largest_residual() <= CLOSED;
    for (int k = 0; k < rows.leaders; ++k) rests = rests && q[rows.q[k]] == goal_[k];
    if (rests) return true;
    if (!finite(residual_) || !finite(jacobian_)) return false;
    for (int k = 0; k < rows.leaders; ++k) {
      const int j = rows.v[k];
      const double change = (goal_[k] - q[rows.q[k]]) / column(j);
      for (std::size_t i = 0; i < residual_.size(); ++i) residual_[i] += jacobian(static_cast<int>(i), j) * change;
    }
    minimum_norm_step(q, true, SINGULAR);
    if (!(longest(step_) <= rows.longest)) return false;
    next_.resize(m_.nq);
    displace(q, 1, there_.data());
    strayed_.assign(m_.nv, 0.0);
    double before = INFINITY;
    for (int count = 0; count < CORRECTIONS; ++count) {
      for (int k = 0; k < rows.leaders; ++k) there_[rows.q[k]] = goal_[k];
      residual_at(there_.data(), false);
      const double largest = largest_residual();
      if (largest <= CLOSED || (largest <= rows.rounded && largest >= before)) {
        std::copy(there_.begin(), there_.end(), q);
        return true;
      }
      if (!finite(residual_) || !finite(jacobian_)) return false;
      before = largest;
      minimum_norm_step(there_.data(), true, SINGULAR);
      for (int j = 0; j < m_.nv; ++j) strayed_[j] += step_[j];
      if (!(longest(strayed_) <= LEAP)) return false;
      displace(there_.data(), 1, next_.data());
      std::swap(there_, next_);
    }
    return false;
  }

  static double longest(const std::vector<double>& step) {
    return step.empty() ? 0 : std::fabs(step[worst_of(step)]);
  }

  void linearise(const double* q, const double* v) {
    double* out[] = {phi_.data(), psi_.data(), entries_.data()};
    evaluate(m_.linearised, q, v, out);
  }

  static bool defined(double value) { return std::fabs(value) <= LARGEST; }

  // The first row of `values`, or of J, that is undefined or too large.
  StartVerdict undefined(const double* values, int count) const {
    if (std::all_of(values, values + count, defined) && std::all_of(entries_.begin(), entries_.end(), defined)) return {};
    for (int i = 0; i < count; ++i) {
      bool wrong = !defined(values[i]);
      double value = values[i];
      if (!wrong)
        for (std::size_t e = 0; e < m_.entry_row.size(); ++e)
          if (m_.entry_row[e] == i && !defined(entries_[e])) wrong = true, value = entries_[e];
      if (wrong) return {StartCode::undefined, i, value};
    }
    return {};
  }

  // The position residual at q, which also vanishes where a weld or hinge is turned by half a turn; or else the
  // alignment residual in place of its sines.
  void residual_at(const double* q, bool aligned) {
    linearise(q, nullptr);
    residual_.clear();
    jacobian_.clear();
    place_.assign(m_.rows, -1);  // which row of the residual each row of φ is
    for (int i = 0; i < m_.heights; ++i) {
      if ((aligned && m_.sine[i]) || !counts(i)) continue;
      place_[i] = static_cast<int>(residual_.size());
      residual_.push_back(phi_[i] / design_->unit[i]);
    }
    jacobian_.assign((residual_.size() + (aligned ? m_.aligned_count : 0)) * m_.nv, 0.0);
    for (std::size_t e = 0; e < m_.entry_row.size(); ++e) {
      const int row = place_[m_.entry_row[e]];
      if (row >= 0) jacobian(row, m_.entry_column[e]) = scaled(e);
    }
    if (aligned) append_alignment(q);
    for (std::size_t k = 0; k < target_.size(); ++k) residual_[k] -= target_[k];
  }

  void append_alignment(const double* q) {
    double* out[] = {found_.data(), slope_.data()};
    evaluate(m_.aligned, q, nullptr, out);
    for (int k = 0; k < m_.aligned_count; ++k) {
      if (!faces(m_.aligned_of[k])) continue;
      const int row = static_cast<int>(residual_.size());
      residual_.push_back(found_[k]);
      for (int j = 0; j < m_.nv; ++j) jacobian(row, j) = slope_[j * m_.aligned_count + k] * column(j);
    }
    jacobian_.resize(residual_.size() * m_.nv);
  }

  bool counts(int row) const { return !selection_.rows || selection_.rows[row]; }

  static bool finite(const std::vector<double>& values) {
    for (double value : values)
      if (!std::isfinite(value)) return false;
    return true;
  }

  // The entry that is not a number, or else the largest in size.
  static int worst_of(const std::vector<double>& values) {
    std::size_t worst = 0;
    for (std::size_t i = 1; i < values.size(); ++i)
      if (!std::isnan(values[worst]) && !(std::fabs(values[i]) <= std::fabs(values[worst]))) worst = i;
    return static_cast<int>(worst);
  }

  double largest_residual() const {
    const double largest = residual_.empty() ? 0 : std::fabs(residual_[worst_of(residual_)]);
    return std::isfinite(largest) ? largest : INFINITY;
  }

  // The Euclidean norm, without overflow or underflow of squares; NaN where an entry is.
  static double norm(const std::vector<double>& values) {
    const double largest = values.empty() ? 0 : std::fabs(values[worst_of(values)]);
    if (!(largest > 0) || !std::isfinite(largest)) return largest;
    const double scale = largest < 1e-100 || largest > LARGEST ? largest : 1;
    double sum = 0;
    for (double value : values) sum += (value / scale) * (value / scale);
    return scale * std::sqrt(sum);
  }

  // The posture nearest to q with the smallest residual, welds and hinges the right way round, and that residual. Where
  // the sines lead to half a turn, or from beyond a quarter turn to no solution, the search starts again from the
  // posture that minimises a residual that does not vanish there.
  double closed(double* q) {
    const std::vector<double> begun(q, q + m_.nq);
    double largest = gauss_newton(q, false);
    const double* astray = largest <= ROUNDED ? q : begun.data();
    if (!m_.cosine_count || least_cosine(astray) > 0) return largest;
    const double least = least_cosine(begun.data());
    std::copy(begun.begin(), begun.end(), q);
    if (least < -1 + ASIDE * ASIDE) {
      for (int j = 0; j < m_.nv; ++j) step_[j] = free_[j] ? ASIDE * std::cos(1.0 + 2.0 * j * j) : 0;
      into_body_axes(begun.data(), true);
      displace(begun.data(), 1, q);
    }
    gauss_newton(q, true);
    return gauss_newton(q, false);
  }

  // Damped steps from q; the largest residual that is left.
  double gauss_newton(double* q, bool aligned) {
    residual_at(q, aligned);
    for (int count = 0; count < STEPS; ++count) {
      if (largest_residual() <= CLOSED || !any_free() || !finite(residual_) || !finite(jacobian_)) break;
      minimum_norm_step(q, true);
      double longest = 1e-300;
      for (double value : step_) longest = std::max(longest, std::fabs(value));
      double factor = std::min(1.0, LONGEST / longest);
      const double before = norm(residual_);
      bool better = false;
      for (int halving = 0; halving < HALVINGS && !better; ++halving, factor *= 0.5) {
        displace(q, factor, there_.data());
        residual_at(there_.data(), aligned);
        better = norm(residual_) < before;
      }
      if (!better) {
        residual_at(q, aligned);
        break;
      }
      std::copy(there_.begin(), there_.end(), q);
    }
    return largest_residual();
  }

  // A posture that may be far from q, and its largest residual: by damped steps, of which those of a residual that does
  // not vanish where welds and hinges are half a turn apart come first.
  double reached(double* q, StartMethod method) {
    const bool aligned = m_.cosine_count > 0;
    if (method == StartMethod::continued) {
      residual_at(q, aligned);
      const std::vector<double> apart = residual_;
      for (int stage = 1; stage < STAGES; ++stage) {
        target_ = apart;
        for (double& value : target_) value *= 1.0 - static_cast<double>(stage) / STAGES;
        levenberg_marquardt(q, aligned, STAGE_STEPS);
      }
      target_.clear();
    }
    levenberg_marquardt(q, aligned, STEPS);
    const double largest = largest_residual();
    return largest <= NEAR ? gauss_newton(q, false) : largest;
  }

  // Damped steps from q, with the damping controlled by the gain ratio (Madsen, Nielsen and Tingleff, Methods for
  // Non-Linear Least Squares Problems, 2004, algorithm 3.16).
  void levenberg_marquardt(double* q, bool aligned, int steps) {
    residual_at(q, aligned);
    double mu = -1, growth = 2;
    bool fresh = true;
    for (int count = 0; count < steps && any_free(); ++count) {
      if (largest_residual() <= ROUNDED * ROUNDED || !finite(residual_) || !finite(jacobian_)) break;
      if (fresh) {
        free_jacobian(q, true, damped_);
        const double largest = damped_.form(right_.data());
        if (mu < 0) mu = DAMPING * largest;
        if (!(largest > 0)) break;
        mu = std::max(mu, 1e-15 * largest);
      }
      const double before = norm(residual_);
      damped_step_.assign(m_.nv, 0.0);
      if (!damped_.solve(mu, damped_step_.data())) break;
      double promised = 0;  // of the square
      for (std::size_t j = 0; j < damped_.gradient().size(); ++j)
        promised += damped_step_[j] * (mu * damped_step_[j] + damped_.gradient()[j]);
      if (!(promised > FLAT * before * before)) break;
      double longest = 1e-300;
      for (int j = 0, k = 0; j < m_.nv; ++j) {
        step_[j] = free_[j] ? damped_step_[k++] : 0;
        longest = std::max(longest, std::fabs(step_[j]));
      }
      into_body_axes(q, true);
      displace(q, 1, there_.data());
      residual_at(there_.data(), aligned);
      const double after = norm(residual_), gain = (before * before - after * after) / promised;
      fresh = longest <= LONGEST && gain > 0;
      if (fresh) {
        std::copy(there_.begin(), there_.end(), q);
        mu *= std::max(1.0 / 3.0, 1 - std::pow(2 * gain - 1, 3));
        growth = 2;
      } else {
        residual_at(q, aligned);
        mu *= growth;
        growth *= 2;
      }
    }
  }

  bool any_free() const {
    for (bool one : free_)
      if (one) return true;
    return false;
  }

  // The columns of J of the free components, along the axes that they are meant in, and the right side -residual.
  template <class Matrix>
  void free_jacobian(const double* q, bool of_position, Matrix& matrix) {
    const int rows = static_cast<int>(residual_.size());
    int free = 0;
    for (int j = 0; j < m_.nv; ++j) free += free_[j];
    matrix.resize(rows, free);
    for (int i = 0; i < rows; ++i) {
      std::copy_n(&jacobian_[static_cast<std::size_t>(i) * m_.nv], m_.nv, reduced_.begin());
      rotate(q, of_position, reduced_.data(), false);
      for (int j = 0, k = 0; j < m_.nv; ++j)
        if (free_[j]) matrix.a(i, k++) = reduced_[j];
    }
    right_.resize(rows);
    for (int i = 0; i < rows; ++i) right_[i] = -residual_[i];
  }

  // The step (nv) of least norm among the free components that takes the linearised residual to 0 or near it.
  void minimum_norm_step(const double* q, bool of_position, double rank = RANK) {
    free_jacobian(q, of_position, least_squares_);
    reduced_.assign(m_.nv, 0.0);
    least_squares_.solve(right_.data(), reduced_.data(), rank);
    for (int j = 0, k = 0; j < m_.nv; ++j) step_[j] = free_[j] ? reduced_[k++] : 0;
    into_body_axes(q, of_position);
  }

  void into_body_axes(const double* q, bool of_position) { rotate(q, of_position, step_.data(), true); }

  // Rotates the parts of a vector (nv) that are meant along the parents' axes: from the bodies' axes to the parents', or
  // back. Rows of a Jacobian transform as velocities do.
  void rotate(const double* q, bool of_position, double* v, bool back) const {
    for (const StartJoint& joint : m_.joints) {
      if (joint.kind == JointKind::one || !(of_position ? joint.position_in_parent : joint.velocity_in_parent)) continue;
      const int size = lengths_of(joint.kind);
      double r[9];
      rotation(joint, q, r);
      turn(r, size, v + joint.v, back);
      if (!of_position && joint.kind != JointKind::planar) turn(r, 3, v + joint.v + size, back);
    }
  }

  static void turn(const double* r, int size, double* v, bool back) {
    double turned[3];
    for (int i = 0; i < size; ++i) {
      turned[i] = 0;
      for (int j = 0; j < size; ++j) turned[i] += (back ? r[j * size + i] : r[i * size + j]) * v[j];
    }
    std::copy(turned, turned + size, v);
  }

  // Body to parent, row by row.
  static void rotation(const StartJoint& joint, const double* q, double* r) {
    if (joint.kind == JointKind::planar) {
      const double cosine = q[joint.q + 2], sine = q[joint.q + 3];
      r[0] = cosine, r[1] = -sine, r[2] = sine, r[3] = cosine;
      return;
    }
    const double* unit = q + joint.q + lengths_of(joint.kind);
    const double x = unit[0], y = unit[1], z = unit[2], w = unit[3];
    r[0] = 1 - 2 * (y * y + z * z), r[1] = 2 * (x * y - w * z), r[2] = 2 * (x * z + w * y);
    r[3] = 2 * (x * y + w * z), r[4] = 1 - 2 * (x * x + z * z), r[5] = 2 * (y * z - w * x);
    r[6] = 2 * (x * z - w * y), r[7] = 2 * (y * z + w * x), r[8] = 1 - 2 * (x * x + y * y);
  }

  // there = q + E(q) factor step, step in units of the search, with rotations normalised.
  void displace(const double* q, double factor, double* there) const {
    for (const StartJoint& joint : m_.joints) {
      const double* at = q + joint.q;
      double *to = there + joint.q, d[6], r[9];
      const int freedoms = joint.kind == JointKind::one ? 1 : joint.kind == JointKind::floating ? 6 : 3;
      for (int k = 0; k < freedoms; ++k) d[k] = column(joint.v + k) * (factor * step_[joint.v + k]);
      if (joint.kind == JointKind::one) {
        to[0] = at[0] + d[0];
        continue;
      }
      const int size = lengths_of(joint.kind);
      rotation(joint, q, r);
      turn(r, size, d, false);
      for (int k = 0; k < size; ++k) to[k] = at[k] + d[k];
      const double *from = at + size, *o = d + size;
      double* unit = to + size;
      if (joint.kind == JointKind::planar) {
        unit[0] = from[0] - from[1] * o[0], unit[1] = from[1] + from[0] * o[0];
      } else {  // ½ q ⊗ ω
        const double x = from[0], y = from[1], z = from[2], w = from[3];
        unit[0] = x + 0.5 * (w * o[0] + y * o[2] - z * o[1]), unit[1] = y + 0.5 * (w * o[1] + z * o[0] - x * o[2]);
        unit[2] = z + 0.5 * (w * o[2] + x * o[1] - y * o[0]), unit[3] = w - 0.5 * (x * o[0] + y * o[1] + z * o[2]);
      }
      double square = 0;
      const int entries = joint.kind == JointKind::planar ? 2 : 4;
      for (int k = 0; k < entries; ++k) square += unit[k] * unit[k];
      for (int k = 0; k < entries; ++k) unit[k] /= std::sqrt(square);
    }
  }

  bool faces(int cosine) const { return !selection_.cosines || selection_.cosines[cosine]; }

  void cosines_at(const double* q) {
    double* out[] = {cosines_.data()};
    evaluate(m_.cosines, q, nullptr, out);
  }

  double least_cosine(const double* q) {
    cosines_at(q);
    double least = INFINITY;
    for (int k = 0; k < m_.cosine_count; ++k)
      if (faces(k) && !(cosines_[k] >= least)) least = cosines_[k];
    return least;
  }

  StartVerdict worst_row(const double* q) {
    residual_at(q, false);
    const int worst = worst_of(residual_);
    const int row = static_cast<int>(std::find(place_.begin(), place_.end(), worst) - place_.begin());
    return {StartCode::unsatisfied, row, std::fabs(residual_[worst]) * design_->unit[row]};
  }

  StartVerdict turned_around(const double* q) {
    if (!m_.cosine_count) return {};
    cosines_at(q);
    for (int k = 0; k < m_.cosine_count; ++k)
      if (faces(k) && !(cosines_[k] > 0)) return {StartCode::turned_around, k, cosines_[k]};
    return {};
  }
};

}  // namespace bellcrank
