#pragma once

// The second derivative of the incremental potential on the unknowns, as a block matrix with a
// fixed pattern.

#include <cstdint>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/model/hessian.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::model {

/// H = K~ (x) I_3 - T_f^T (softening of triangles and curved hinges) T_f, n_f x n_f blocks of 3 x
/// 3, N/m. Projected, it lies between M / h^2 and K~ (x) I_3, so it is positive definite.
///
/// Blocks are gathered in parallel, each in a fixed order: the same bits for every number of
/// threads.
class HessianMatrix {
 public:
  /// \param model  must outlive this object
  explicit HessianMatrix(const ClothModel& model);

  /// Takes the pattern: who contributes where. \param system  K~ of `reduction`
  void set_pattern(const Reduction& reduction, SparseMatrix system);

  /// Evaluates at x (|V| x 3, m).
  void assemble(const Positions& x, const StepProblem& problem, HessianForm form);

  /// The same but for the blocks: gathered() makes them one by one, complete() all.
  void evaluate(const Positions& x, const StepProblem& problem, HessianForm form);

  /// After evaluate(): what assemble() would have made.
  void complete();

  /// After evaluate(): block k.
  [[nodiscard]] Mat3 gathered(int k) const;

  /// Block k is the entry of K~ times the identity, whatever the positions.
  [[nodiscard]] bool is_scalar(int k) const;

  /// Number of block rows, n_f.
  [[nodiscard]] int count() const { return static_cast<int>(system_.cols()); }
  /// K~: its pattern is the pattern of the blocks, both triangles stored.
  [[nodiscard]] const SparseMatrix& system() const { return system_; }
  /// Block k belongs to entry k of system(), column by column.
  [[nodiscard]] const Mat3& block(int k) const { return blocks_[static_cast<std::size_t>(k)]; }

  /// y = H x; both n_f x 3. After assemble().
  void multiply(const Positions& x, Positions& y) const;

  /// The blocks as 3 n_f x 3 n_f scalars, lower triangle: row 3 i + c is coordinate c of unknown i.
  /// The reference is valid until the next call; its pattern stays as it is until set_pattern().
  const SparseMatrix& scalars();

 private:
  /// What adds to an entry of K~: a pair of corners of an element, times weights of seams.
  struct Use {
    std::int64_t source;  ///< triangle: 9 t + 3 a + b; hinge: its number in curved_
    double factor;
  };
  struct Uses {
    std::vector<std::int64_t> begin;  ///< per entry of K~: offsets into use
    std::vector<Use> use;
  };
  /// An entry of K~ and what is added to it.
  struct Addition {
    int entry;
    Use use;
  };

  [[nodiscard]] int entry(int row, int column) const;
  void add_pair(const Reduction& reduction, int row_vertex, int column_vertex, Use use,
                std::vector<Addition>& additions) const;
  [[nodiscard]] Uses sorted(const std::vector<Addition>& additions) const;
  void make_scalar_pattern();

  const ClothModel& model_;
  std::vector<int> curved_;  ///< bending constraints with a curved rest shape
  SparseMatrix system_;
  Uses triangle_uses_, hinge_uses_;
  std::vector<StretchSoftening> stretch_;  ///< per triangle
  std::vector<Mat3> bend_;                 ///< per curved hinge
  std::vector<Mat3> blocks_;
  SparseMatrix scalars_;
};

}  // namespace piecework::model
