#pragma once

// The metric in which the outer loop measures gradients: P = K~^-1, or K~^-1 + N Kn^-1 N^T.
//
// Contact stiffens single vertices, along their normals as a rule. A diagonal D in K would resist
// sliding as much as pressing (the tangential locking of scalar contact weights, docs/contact.md).
// So contact along normals joins Kn, K keeps what acts across (friction, contact from aside), and
// for touching vertices K no longer speaks of normals:
//     P = S (K~ + D_across)^-1 S + N (Kn + D_along)^-1 N^T,   S_v = I - n_v n_v^T where v touches.
// Without normals all of it goes into K~ + D, as in [Lu25, Sec. 6].

#include <memory>
#include <optional>
#include <string>

#include <piecework/global/diagonal_update.hpp>
#include <piecework/global/exact_solver.hpp>
#include <piecework/model/contact_terms.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/pd/normal_matrix.hpp>

namespace piecework::pd {

/// How K~ + D is solved.
struct ContactSolve {
  /// Anything but Refactor needs a solver that is a tree.
  global::DiagonalMethod method = global::DiagonalMethod::Refactor;
  global::DiagonalOptions options;
  double tolerance = 1e-2;  ///< DiagonalLimits::tolerance
  int max_iterations = 50;
};

class Metric {
 public:
  /// \param K  assemble_system(), |V| x |V|, N/m.  \param solver  of K~
  Metric(const model::ClothModel& model, SparseMatrix K,
         std::unique_ptr<global::ExactSolver> solver, const ContactSolve& contact_solve = {});
  ~Metric();

  /// Factors K~ for a set of held vertices and forgets Kn.
  /// \throws SimulationError if K~ is not positive definite or its factor does not fit into memory.
  void prepare(const std::vector<char>& fixed);

  /// As given to the constructor.
  [[nodiscard]] const SparseMatrix& K() const { return K_; }
  [[nodiscard]] const model::Reduction& reduction() const { return reduction_; }
  [[nodiscard]] const global::ExactSolver& solver() const { return *solver_; }

  /// Adds the normal part with Kn at x (|V| x 3, m). False, and without it, if Kn could not be
  /// factored. \param contact  as evaluated at x, or null
  bool refresh_normals(const Positions& x, const model::ContactTerms* contact);

  /// K~ with contact and without a normal part; false, and without contact, if that could not be
  /// factored.
  bool refresh_contact(const model::ContactTerms& contact);

  /// Back to P = K~^-1.
  void drop_normals() { normals_in_use_ = contact_in_use_ = false; }
  [[nodiscard]] bool normals_in_use() const { return normals_in_use_; }

  /// d = P g, both n_f x 3 (N -> m).
  /// \throws SimulationError if memory runs out.
  void apply(const Positions& g, Positions& d);

 private:
  void solve_stretch(const Positions& g, Positions& d);
  void find_contact(const model::ContactTerms& contact);
  void factor_anew(const Eigen::VectorXd& D);
  /// Makes K~ + D ready to be solved, unless D is little beside it.
  bool factor_with(const Eigen::VectorXd& D);
  void split(const Positions& g, Positions& across, Eigen::VectorXd& along) const;
  void join(const Eigen::VectorXd& along, Positions& d) const;
  /// What S takes off an unknown that has `along` in the direction of its normal.
  [[nodiscard]] double removed(Eigen::Index unknown, double along) const {
    return along_[unknown] > 0 ? along : 0.0;
  }
  /// The tree of K~ + D; null: it is not solved by one.
  [[nodiscard]] global::TreeSolver* stretch_tree();

  const model::ClothModel& model_;
  SparseMatrix K_;
  SparseMatrix reduced_;  ///< K~
  model::Reduction reduction_;
  std::unique_ptr<global::ExactSolver> solver_;
  global::RightHandSides columns_;  ///< for solvers that take whole columns

  // The normal part; absent until it is first wanted.
  std::unique_ptr<NormalMatrix> normal_;
  global::TreeSolver normal_solver_;
  bool normals_in_use_ = false;
  Eigen::VectorXd along_normal_;  ///< N^T g, then Kn^-1 N^T g

  // Contact; absent until anything touches.
  model::ContactStiffness contact_;    ///< per vertex
  Eigen::VectorXd along_, across_;     ///< per unknown, N/m
  global::TreeSolver contact_solver_;  ///< of K~ + D
  bool contact_analysed_ = false;
  bool contact_in_use_ = false;
  ContactSolve contact_solve_;
  std::unique_ptr<global::DiagonalUpdateSolver> diagonal_;  ///< absent: K~ + D is refactored
  std::vector<double> contact_values_;                      ///< of K~ + D
  Positions vertex_normals_, tangential_;
};

}  // namespace piecework::pd
