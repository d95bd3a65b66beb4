#pragma once

// The out-of-plane stiffness of cloth as one scalar matrix. The matrix K of projective dynamics
// resists motion along the normals with the full membrane stiffness k_s, where real cloth resists
// it with mass, bending and tension only. This gap, 1e3 to 1e6, is why projective dynamics
// converges slowly; the metric K^-1 + N Kn^-1 N^T closes it (docs/convergence.md).

#include <memory>
#include <span>

#include <piecework/core/isa.hpp>
#include <piecework/core/types.hpp>
#include <piecework/model/constraints.hpp>
#include <piecework/model/reduction.hpp>

namespace piecework::pd {

/// Kn = N^T H N on the pattern of K~: H is the projected Hessian of the incremental potential,
/// 3 n_f x 3 n_f, and N, 3 n_f x n_f, holds the unit normal of each unknown. Positive semidefinite
/// stretch plus K's mass and bending, so positive definite. With the constant K~ split off,
///     Kn_ab = K~_ab (n_a . n_b)
///             - sum_t w [c_T (t_a . n_a)(t_b . n_b) + (G_a^T B G_b)(n . n_a)(n . n_b)],
/// where for each triangle F = [F_1 F_2] = R S, n its normal, t_a = (R_1 G_a2 - R_2 G_a1) / sqrt 2,
/// c_T = min(1, 2 / tr S), B = S^-1 with eigenvalues clamped to 1. No 3 x 3 block is ever formed.
/// With seams, G_a sums over what unknown a carries.
class NormalMatrix {
 public:
  /// \param model  must outlive this object, as must `reduction`
  /// \param K      K~ = Reduction::system(), compressed, n_f x n_f, N/m; must outlive this object
  NormalMatrix(const model::ClothModel& model, const model::Reduction& reduction,
               const SparseMatrix& K, Isa isa = best_isa());
  ~NormalMatrix();

  /// Turns N with the cloth at x (|V| x 3, m).
  void find_normals(const Positions& x);

  /// Kn at x with the N of find_normals() there, N/m: one value per entry of K~, those above the
  /// diagonal 0. Valid until the next call. Fixed order of sums: the same bits for every number of
  /// threads. \param extra_diagonal  n_f, N/m, or empty: what else resists along the normals
  std::span<const double> assemble(const Positions& x, const Eigen::VectorXd& extra_diagonal = {});

  /// N: n_f x 3, unit rows.
  [[nodiscard]] Eigen::Map<const Positions> normals() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace piecework::pd
