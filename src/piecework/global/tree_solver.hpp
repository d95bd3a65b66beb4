#pragma once

// The exact global solve as a tree: nested dissection, whose top cuts may be the borders of cloth
// domains, gives an elimination tree; subtrees and tiles of large separators are worked on in
// parallel. This is the recursive primal form at which [Lu25, Sec. 8 and Fig. 24] hints, with a
// factor in block LDL^T form that both sweeps stream through.

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include <piecework/global/isa.hpp>
#include <piecework/global/pattern.hpp>
#include <piecework/global/status.hpp>
#include <piecework/global/tree_schedule.hpp>

namespace piecework::global {

enum class Precision {
  Double,
  /// The factor is stored in 32 bits. A solve is then a contraction, not an exact inverse: use it
  /// on residuals (K dx = r, x += dx), whose error it reduces by TreeReport::contraction.
  Single,
};

struct TreeOptions {
  Precision precision = Precision::Double;
  /// With Precision::Single: compute the factor in 32 bits as well: twice as fast, for matrices
  /// that are refactored in every step.
  bool factor_in_single = false;
  /// With Precision::Single: the factor is redone in 64 bits if the estimated contraction of a
  /// solve is worse (TreeReport::fallback says so). Not positive: no estimate.
  double contraction_limit = 1e-2;
  /// Pivot blocks D with a larger condition (estimated: largest diagonal entry of D times 1-norm of
  /// D^-1) are solved by substitution, not inverted: explicit inverses are not backward stable.
  /// Default by precision: 1e4 and 1e3.
  std::optional<double> condition_limit;
  /// Keep what refactor_rows() needs between factorisations.
  bool partial_refactor = false;
  /// With partial_refactor: the tree's top is seen as the interface of at least so many interiors,
  /// and refactor_rows() leaves what eliminating them does to it as the last factor() had it: the
  /// result is the factor of an approximation, a preconditioner. 0: exact.
  int frozen_interiors = 0;
  std::optional<Isa> isa;  ///< default: the best one of this processor
  int seed = 1;            ///< of METIS
};

struct TreeReport : FactorReport {
  double stored_numbers = 0;  ///< of the factor: nnz(L), explicit inverses and padding
  double read_bytes = 0;      ///< that one solve reads of the factor: both sweeps
  int fronts = 0;
  int subtrees = 0;  ///< parallel tasks below the top of the tree
  int levels = 0;    ///< of the top: barriers per sweep
  int panels = 0;
  int factored_rows = 0;       ///< whose columns the newest factorisation computed
  int substituted_panels = 0;  ///< ill-conditioned, see TreeOptions::condition_limit
  double max_condition = 0;    ///< largest condition of an inverted pivot block, estimated
  Precision precision = Precision::Double;  ///< in use
  double contraction = 0;  ///< estimated energy-norm error of one 32-bit solve; 0 in 64 bits
  std::string fallback;    ///< why 64 bits are in use although 32 were asked for
};

/// A X = B with A symmetric positive definite, |V| x |V|, any number of right-hand sides, three
/// at a time. One object is used by one caller at a time; no allocation in solve().
///
/// Parallel loops run in the oneTBB task arena of the calling thread: call from within
/// tbb::task_arena::execute() or ThreadPool::run() (core/parallel.hpp) to choose the number of
/// threads, else all cores are used. Results do not depend on it. factor() sets OpenBLAS to one
/// thread, for the whole process.
class TreeSolver {
 public:
  explicit TreeSolver(const TreeOptions& options = {});
  ~TreeSolver();
  TreeSolver(TreeSolver&&) noexcept;
  TreeSolver& operator=(TreeSolver&&) noexcept;

  /// Orders and plans; the spans are not needed afterwards. Drops any factor.
  /// \param domains   optional: domains whose borders become the top separators
  /// \param boundary  optional: rows that are kept to the end and not eliminated; see condense()
  /// \throws InputError if the pattern, the domains or the boundary are malformed (sizes, numbers
  /// out
  ///         of range or named twice).
  void analyze(const SymmetricPattern& pattern, const DomainTree* domains = nullptr,
               std::span<const int> boundary = {});

  /// Factors values on the analysed pattern, one for each entry of its row_index. Afterwards the
  /// solver has this factor, or none if the status is not Ok (NotPositiveDefinite: indefinite,
  /// singular or not finite).
  [[nodiscard]] SolveStatus factor(std::span<const double> values);

  /// Orders like `other`, whose pattern this matrix has too: nothing is analysed again, and
  /// solve_with() can take both together. Drops any factor.
  void share_analysis(const TreeSolver& other);

  /// Factors anew where values have changed since the last factorisation: in the given rows and
  /// their columns. The same numbers as factor(), which it becomes without
  /// TreeOptions::partial_refactor (see frozen_interiors for the exception). In 32 bits the
  /// contraction is not estimated again. \throws InputError as factor(), and if a row is out of
  /// range.
  [[nodiscard]] SolveStatus refactor_rows(std::span<const double> values,
                                          std::span<const int> rows);

  /// X = A^-1 B; number c of row i at b[i * row_stride + c * column_stride]. b and x may be the
  /// same. NotFactored: x is not written. With a boundary use condense() and expand().
  [[nodiscard]] SolveStatus solve(const double* b, double* x, int columns,
                                  std::ptrdiff_t row_stride, std::ptrdiff_t column_stride);

  /// Both X = A^-1 B and, with other's matrix, Y = C^-1 D, row-major with the given strides. If the
  /// two share their analysis and precision they are traversed together, which halves the waits.
  [[nodiscard]] SolveStatus solve_with(const double* b, double* x, int columns, TreeSolver& other,
                                       const double* other_b, double* other_x, int other_columns,
                                       std::ptrdiff_t row_stride, std::ptrdiff_t other_row_stride);

  /// Schur complement of the boundary, lower triangle of |boundary|^2, column-major.
  [[nodiscard]] std::span<const double> schur() const;

  /// First half of a solve with up to three right-hand sides: adds to `boundary` (|boundary| x
  /// columns, column-major) what eliminating the other rows leaves there: -A_bi A_ii^-1 b_i.
  [[nodiscard]] SolveStatus condense(const double* b, int columns, std::ptrdiff_t row_stride,
                                     std::ptrdiff_t column_stride, double* boundary);

  /// Second half, after condense(): given the boundary's x, all other rows of x.
  [[nodiscard]] SolveStatus expand(const double* boundary, double* x, int columns,
                                   std::ptrdiff_t row_stride, std::ptrdiff_t column_stride);

  /// Times of the parts of a solve with three right-hand sides, on the calling thread.
  /// \pre factored, no boundary; b and x row-major, |V| x 3.
  [[nodiscard]] TreeSchedule profile(const double* b, double* x);

  [[nodiscard]] int size() const;
  [[nodiscard]] const TreeReport& report() const;

  /// Reads the stored factor once and returns a checksum: the bandwidth limit of a sweep.
  [[nodiscard]] double read_factor() const;

  /// "tree, 32-bit factor, AVX-512, METIS 5.1.0".
  [[nodiscard]] std::string description() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace piecework::global
