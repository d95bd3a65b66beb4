#pragma once

// Sewn vertices during a simulation: x = T x_free + o(t) [Lu25, Sec. 4.4, by elimination;
// docs/architecture.md D16 to D18].

#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/mesh/seams.hpp>

namespace piecework::model {

/// The seams of a model. Without any, nothing is stored and every call does nothing.
///
/// A seam that starts open closes over its close time c along
///     o(t) = s(t / c) (x_start - T x_start),   s(u) = 1 - 3 u^2 + 2 u^3 on [0, 1], 0 after,
/// in the frame of the world; o changes the right-hand side only, never the matrix.
class Sewing {
 public:
  Sewing() = default;
  /// \param start  start shape, |V| x 3, m
  Sewing(mesh::SeamMap map, const Positions& start);

  [[nodiscard]] bool empty() const { return map_.empty(); }
  [[nodiscard]] const mesh::SeamMap& map() const { return map_; }

  /// Puts every slave where its carriers and the time (s) want it; x is |V| x 3, m.
  void follow(double time, Positions& x) const;

  /// Turns a prediction z, in which every vertex moves for itself, into a start for the iterations
  /// on the seams: carriers that are not held take up, by mass, what their slaves wanted,
  ///     x_c = z_c + sum_s T_sc m_s (z_s - (T z)_s - o_s) / (m_c + sum_s T_sc m_s),
  /// then slaves follow. Where vertices coincide this is their common centre of mass, so that a
  /// seam of coinciding vertices moves as if it were none. \param mass  |V|, kg   \param fixed  per
  /// vertex: held   \param[in,out] x  z, |V| x 3, m
  void settle(double time, const Eigen::VectorXd& mass, const std::vector<char>& fixed,
              Positions& x) const;

  /// f <- T^T f in place: what acts on slaves is passed to their carriers, and the rows of slaves
  /// become zero. |V| x 3.
  void fold(Positions& f) const;

  /// Sum over column `vertex` of T of w_s rows.row(s), the unit row of the vertex included: one row
  /// of T^T `rows`. In the order of the vertices: the same bits for every number of threads.
  template <class Rows>
  [[nodiscard]] Eigen::RowVector3d folded(const Rows& rows, int vertex) const {
    Eigen::RowVector3d sum = rows.row(vertex);
    if (empty()) return sum;
    const auto v = static_cast<std::size_t>(vertex);
    for (int k = load_begin_[v]; k < load_begin_[v + 1]; ++k) {
      const Load& load = load_[static_cast<std::size_t>(k)];
      sum += load.weight * rows.row(load.slave);
    }
    return sum;
  }

  /// Marks the slaves all of whose carriers are marked: they cannot move freely either.
  void mark_held(std::vector<char>& fixed) const;

  /// Largest |x_s - (T x)_s| of a slave: how far the seams are open, m. 0 without seams.
  [[nodiscard]] double gap(const Positions& x) const;

  /// Of one slave (by its number in map()), m.
  [[nodiscard]] double gap(const Positions& x, int slave) const;

 private:
  struct Load {
    int slave;  ///< vertex
    double weight;
  };
  [[nodiscard]] Eigen::RowVector3d carried(const Positions& x, int slave) const;
  /// (T x + o(t))_s.
  [[nodiscard]] Eigen::RowVector3d place(double time, const Positions& x, int slave) const;

  mesh::SeamMap map_;
  Positions start_gap_;  ///< per slave, x_start - T x_start, m; zero if closed from the start
  std::vector<int> load_begin_;  ///< per vertex: offsets into load_, columns of T
  std::vector<Load> load_;       ///< ascending slaves
};

}  // namespace piecework::model
