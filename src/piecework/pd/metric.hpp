#pragma once

// The metric in which the outer loop measures gradients: P = K~^-1, or K~^-1 + N Kn^-1 N^T.

#include <memory>
#include <optional>
#include <string>

#include <piecework/global/exact_solver.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/pd/normal_matrix.hpp>

namespace piecework::pd {

class Metric {
 public:
  /// \param K  assemble_system(), |V| x |V|, N/m.  \param solver  of K~
  Metric(const model::ClothModel& model, SparseMatrix K,
         std::unique_ptr<global::ExactSolver> solver);
  ~Metric();

  /// Factors K~ for a set of held vertices and forgets Kn.
  /// \throws SimulationError if K~ is not positive definite or its factor does not fit into memory.
  void prepare(const std::vector<char>& fixed);

  /// As given to the constructor.
  [[nodiscard]] const SparseMatrix& K() const { return K_; }
  [[nodiscard]] const model::Reduction& reduction() const { return reduction_; }
  [[nodiscard]] const global::ExactSolver& solver() const { return *solver_; }

  /// Adds the normal part with Kn at x (|V| x 3, m). False, and without it, if Kn could not be
  /// factored.
  bool refresh_normals(const Positions& x);

  /// Back to P = K~^-1.
  void drop_normals() { normals_in_use_ = false; }
  [[nodiscard]] bool normals_in_use() const { return normals_in_use_; }

  /// d = P g, both n_f x 3 (N -> m).
  /// \throws SimulationError if memory runs out.
  void apply(const Positions& g, Positions& d);

 private:
  void solve_stretch(const Positions& g, Positions& d);

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
};

}  // namespace piecework::pd
