#pragma once

// The unknowns of a step: vertices that are neither held nor slaves of a seam.

#include <span>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::model {

/// |unknowns| x 3, one column per coordinate.
using Unknowns = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::ColMajor>;

/// x = T_f x_f + constant: T_f is T of the seams without the columns of held vertices, |V| x n_f.
/// Every solver works on
///     K~ = T_f^T K T_f,   T_f^T grad E,   dx = T_f dx_f        [Lu25, Eq. 3; Sec. 4.4, D17]
/// Without seams these are rows and columns of K and rows of grad E, as they stand.
class Reduction {
 public:
  Reduction() = default;
  /// \param model  must outlive this object
  /// \param fixed  per vertex: held; slaves whose carriers are all held are marked as well
  ///               (Sewing::mark_held)
  Reduction(const ClothModel& model, const std::vector<char>& fixed);

  /// n_f.
  [[nodiscard]] int count() const { return free_.count(); }
  /// Vertex of unknown i, ascending in i.
  [[nodiscard]] int vertex(int i) const { return free_.vertex[static_cast<std::size_t>(i)]; }
  /// The same for all unknowns.
  [[nodiscard]] const std::vector<int>& vertices() const { return free_.vertex; }
  /// Unknown of a vertex, -1 if it has none.
  [[nodiscard]] int number(int vertex) const {
    return free_.number[static_cast<std::size_t>(vertex)];
  }

  /// K~, n_f x n_f, N/m. \param K  assemble_system(), |V| x |V|.
  [[nodiscard]] SparseMatrix system(const SparseMatrix& K) const;

  /// The same of each domain's share of K: together they sum to K~.
  /// \param shares  assemble_domain_systems()
  [[nodiscard]] std::vector<DomainMatrix> systems(std::span<const DomainMatrix> shares) const;

  /// Row i of T_f^T f; f is |V| x 3.
  [[nodiscard]] Eigen::RowVector3d row(const Positions& f, int i) const {
    return model_->sewing.folded(f, vertex(i));
  }

  /// x += T_f dx_f, m. Parallel over unknowns and slaves.
  void advance(const Unknowns& increment, Positions& x) const;

  /// out = x + step T_f dx_f, m; dx_f is n_f x 3.
  void advance(const Positions& x, double step, const Positions& increment, Positions& out) const;

  /// T_f^T f, n_f x 3; f is |V| x 3.
  void gather(const Positions& f, Positions& reduced) const;

 private:
  template <class Increment>
  void advance_slaves(double step, const Increment& increment, Positions& x) const;
  [[nodiscard]] DomainMatrix folded_share(const DomainMatrix& share) const;

  const ClothModel* model_ = nullptr;
  FreeVertices free_;
};

}  // namespace piecework::model
