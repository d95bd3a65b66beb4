#pragma once

// The contact systems that bench_contact solves: a sheet of cotton with a quarter of its vertices
// in contact.

#include <cstdint>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/global/tree_solver.hpp>
#include <piecework/testing/contact_sets.hpp>

namespace piecework::bench {

/// K of the unit sheet at h = 1/120 s with its 32-bit factor, as the engine keeps it.
struct ContactSheet {
  explicit ContactSheet(std::int64_t vertices);

  Positions X;  ///< rest positions, m
  SparseMatrix K;
  double stretching = 0;  ///< k_s, N/m: the paper's w_i
  global::TreeSolver tree;
};

/// (K + D) x = b with its exact solution, x = 0 being the answer without contacts.
struct ContactProblem {
  std::vector<double> D;
  Positions b;
  Positions exact;  ///< CHOLMOD's, refined
  double largest = 0;

  /// \param ratio  w_k over the stretching stiffness
  ContactProblem(const ContactSheet& sheet, testing::ContactSet set, double ratio);

  /// max |x - exact| / max |exact|.
  [[nodiscard]] double error(const Positions& x) const;
};

/// D with `count` of its contacts changed at random places: half of them gone, half of them new;
/// one: gone.
std::vector<double> changed_contacts(const std::vector<double>& D, int count);

}  // namespace piecework::bench
