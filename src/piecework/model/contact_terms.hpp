#pragma once

// What minimisers know of contact: its part of the incremental potential, and how far a step may
// go.

#include <array>
#include <vector>

#include <piecework/core/types.hpp>

namespace piecework::model {

struct StepProblem;

/// How stiffly contact holds each vertex, an upper bound by vertex, N/m.
struct ContactStiffness {
  Eigen::VectorXd along;   ///< |V|: in the direction of the vertex' normal
  Eigen::VectorXd across;  ///< |V|: in the others: friction, and contact from aside
};

/// Second derivative of one contact, positive semidefinite: block (i, j) is
/// beta_i beta_j stiffness.
struct ContactBlock {
  std::array<int, 4> vertices;  ///< of cloth that is not held
  int count;                    ///< of the vertices in use
  std::array<double, 4> beta;
  Mat3 stiffness;  ///< N/m
};

/// Counts and times of one step.
struct ContactReport {
  int pairs = 0;              ///< closer than the contact distance at the end of the step
  int candidates = 0;         ///< pairs that the broad phase proposed last
  int shortened = 0;          ///< moves that would have passed through something
  int interpenetrations = 0;  ///< after the step: edges through triangles, vertices inside bodies
  double held_back = 0;       ///< largest part of the way of a pin or obstacle that cloth barred
  double cull_ms = 0;         ///< Cull: broad phase
  double narrow_ms = 0;       ///< Nrw.: distances, forces, continuous detection
  double check_ms = -1;       ///< the independent check for interpenetrations; negative: off

  [[nodiscard]] double detection_ms() const { return cull_ms + narrow_ms; }
};

/// Contact during one step: an energy E_c(x) that rises as things come closer than the contact
/// distance, and a rule for moves that keeps them from passing through each other.
class ContactTerms {
 public:
  virtual ~ContactTerms() = default;

  /// A step from *problem.previous at time `begin` to `end`, s. \pre problem outlives the step
  /// \param obstacles  where they are at its begin if they lag behind, State::obstacles
  virtual void begin_step(const StepProblem& problem, double begin, double end,
                          const Positions& obstacles) = 0;

  /// Shortens the straight way from the start of the step to x, vertex by vertex, so that nothing
  /// passes through anything; pins and obstacles move along. Returns the least part of its way that
  /// any of these could go: 1 as a rule, less where cloth is caught between them.
  virtual double start(Positions& x) = 0;

  /// Puts obstacles back to where the start() before the last had brought them. \pre it returned 1
  virtual void take_back_start() = 0;

  /// Moves pins in x, and obstacles, on towards where the step wants them, as far as the cloth lets
  /// them. False: nothing has moved.
  virtual bool advance_held(Positions& x) = 0;

  /// Shortens the straight way from -> to, both after start(), in the same way; what is held stays.
  /// True if it had to. |V| x 3, m
  virtual bool limit(const Positions& from, Positions& to) = 0;

  /// Adds grad E_c to `gradient` (|V| x 3, N; nothing at held vertices); returns E_c, J.
  virtual double evaluate(const Positions& x, Positions& gradient) = 0;

  /// Takes the pressure that friction is proportional to from the last evaluate(). False: there is
  /// no friction, and E_c is the same as before.
  virtual bool renew_friction() = 0;

  /// Of the last evaluate(). \param normals  |V| x 3, unit
  virtual void stiffness(const Positions& normals, ContactStiffness& stiffness) const = 0;

  /// Of the last evaluate(), in a fixed order.
  virtual void hessian(std::vector<ContactBlock>& blocks) const = 0;

  /// Anything is closer than the contact distance, in the last evaluate().
  [[nodiscard]] virtual bool touching() const = 0;

  /// Where obstacles have come to, if that is not where they belong; else empty. |O| x 3, m
  [[nodiscard]] virtual Positions lagging_obstacles() const = 0;

  /// Counts what passes through what at the end of the step, x.
  virtual void end_step(const Positions& x) = 0;

  [[nodiscard]] virtual const ContactReport& report() const = 0;
};

}  // namespace piecework::model
