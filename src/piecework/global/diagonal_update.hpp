#pragma once

// (K + D) x = b with K constant and D >= 0 diagonal and changing: the global step with contacts,
// whose matrix follows the contact set [Lu25, Sec. 6]. Ways to solve it, from refactoring what has
// changed to the paper's own, behind one face. Linear algebra only: nothing here knows a contact.

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/global/status.hpp>
#include <piecework/global/tree_solver.hpp>

namespace piecework::global {

enum class DiagonalMethod {
  Refactor,     ///< factor K + D anew where D has changed
  LastFactor,   ///< CG with the factor of the first D that is not zero
  Adaptive,     ///< the two above, chosen by counts; see DiagonalOptions
  LowRank,      ///< the last factor with Woodbury's formula for the few rows that have changed
  FrozenSchur,  ///< CG with exact interiors of domains and the interface's S_K + D_BB
  InverseK,     ///< CG with K^-1
  /// CG with K^-1 from a steepest-descent step on the contacts [Lu25, Eq. 23-24].
  SteepestDescent,
  Jacobi,  ///< CG with the diagonal
  Hybrid,  ///< CG with K^-1 between two corrections on the contacts, which make it SPD
  Dual,    ///< CG on the contact forces, preconditioned by K's contact block
};

/// "refactor", "pcg_last_factor", "adaptive", ..., "kinv_pcg", ...
std::string_view to_string(DiagonalMethod method);
inline constexpr int kNumDiagonalMethods = 10;

struct DiagonalOptions {
  /// Of the factors that methods keep beside K's. 32 bits lose nothing here: every method iterates
  /// on residuals. A matrix that is not positive definite in 32 bits is factored in 64.
  Precision precision = Precision::Single;
  /// Adaptive: a row has changed if D_v has by more than this factor, from or to zero included.
  /// CG on the last factor takes about one iteration for each such row; all others together leave
  /// a condition of its square at most.
  double mild_change = 1.5;
  /// Adaptive: refactor if more rows than this have changed, or if CG has taken so many iterations
  /// since the last factor, the first of each solve not counted. Counts, not clocks: the choice is
  /// the same on every machine. Measured: one isolated change costs CG what refactoring costs
  /// (results/tables/contact.md).
  int refactor_changes = 1;
  int refactor_iterations = 8;
  /// LowRank: rows at most; with more it refactors. Three rows cost a solve.
  int max_rank = 12;
  /// FrozenSchur: number of interiors (subtrees of the elimination tree) at least.
  int domains = 16;
  /// SteepestDescent: steps on the contacts, and the paper's w_i (N/m) in 1 + w_i / D_v. Without
  /// `recompute` all steps use the first residual's model, as printed: they then equal one.
  int steps = 1;
  bool recompute = false;
  double elastic_weight = 0;
};

struct DiagonalLimits {
  /// Of DiagonalReport::residual.
  double tolerance = 1e-6;
  int max_iterations = 1000;
  /// Called with the start (0) and after every iteration; false stops.
  std::function<bool(int iteration, const Positions& x)> observer;
};

enum class DiagonalStatus {
  Converged,
  NotConverged,  ///< out of iterations, or rounding allows no more; x is the best known
  Stopped,       ///< by the observer
  NoFactor,      ///< update() failed or never came; x is not written
};

struct DiagonalReport {
  int iterations = 0;
  /// Solves with a factor, three right-hand sides each; in the first solve after an update() with
  /// those that it took.
  int applications = 0;
  int refactored_rows = 0;  ///< rows of the fronts that the update() before this solve redid
  /// max_v |b - (K + D) x|_v / (K + D)_vv over max_v |b_v| / (K + D)_vv: both as displacements, so
  /// that stiff contacts weigh as much as cloth. (In the 2-norm of forces they hide an error of
  /// 80 %.) A smooth error is larger than it by up to the condition of the scaled matrix.
  double residual = 0;
  DiagonalStatus status = DiagonalStatus::NoFactor;
};

/// Solves with K + D for three right-hand sides together, always in residual form from the x that
/// it is given, so that a truncated solve moves no fixed point.
///
/// One object is used by one caller at a time. Parallel as TreeSolver; results do not depend on
/// the number of threads.
class DiagonalUpdateSolver {
 public:
  virtual ~DiagonalUpdateSolver() = default;

  /// \param K     |V| x |V|, both triangles stored (N/m); outlives this object
  /// \param tree  a factor of K, shared by all who solve with it; outlives this object
  [[nodiscard]] SolveStatus prepare(const SparseMatrix& K, TreeSolver& tree);

  /// Takes over a new D. Not Ok: solve() refuses until an update() succeeds.
  /// \param diagonal  |V| numbers >= 0, N/m
  /// \throws InputError if the size is wrong, or a number is negative or not finite.
  [[nodiscard]] SolveStatus update(std::span<const double> diagonal);

  /// (K + D) x = b, from the given x.
  /// \throws InputError if b's or x's number of rows is wrong.
  DiagonalReport solve(const Positions& b, Positions& x, const DiagonalLimits& limits);

 protected:
  DiagonalUpdateSolver() = default;

  /// Called by prepare() and update(), which have set the members below.
  virtual SolveStatus prepare_method() { return SolveStatus::Ok; }
  virtual SolveStatus update_method() { return SolveStatus::Ok; }
  /// Improves the start before the first residual.
  virtual void start(const Positions&, Positions&) {}
  /// One run of a method from r = b - (K + D) x until the residual is met or it has to end.
  virtual void iterate(Positions& x, Positions& r, const DiagonalLimits& limits);
  /// z = M^-1 r with M symmetric positive definite.
  virtual void precondition(const Positions& r, Positions& z) = 0;

  /// z = K^-1 r.
  void apply_inverse(const Positions& r, Positions& z);
  /// y = (K + D) p.
  void multiply(const Positions& p, Positions& y) const;
  /// Row v of K p.
  [[nodiscard]] Eigen::RowVector3d elastic_row(const Positions& p, int v) const;
  /// Counts an iteration, measures r and calls the observer; true: go on.
  bool go_on(const Positions& x, const Positions& r, const DiagonalLimits& limits);
  [[nodiscard]] double measure(const Positions& r) const;

  const SparseMatrix* K_ = nullptr;
  TreeSolver* tree_ = nullptr;
  Eigen::VectorXd diagonal_;   ///< D
  Eigen::VectorXd inverse_;    ///< 1 / (K + D)_vv
  std::vector<int> contacts_;  ///< rows with D > 0, ascending
  DiagonalReport report_;      ///< of the next solve; update() may begin it
  int last_iterations_ = 0;    ///< of the newest solve

 private:
  void run(const Positions& b, Positions& x, const DiagonalLimits& limits);

  bool ready_ = false;
  double scale_ = 0;  ///< max |b_v| / (K + D)_vv
  Positions residual_, z_, p_, Ap_;
};

std::unique_ptr<DiagonalUpdateSolver> make_diagonal_solver(DiagonalMethod method,
                                                           const DiagonalOptions& options = {});

}  // namespace piecework::global
