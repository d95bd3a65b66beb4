#pragma once

// Which rows of a domain-decomposed system are internal, duplicate (dual) or corner (primal), and
// the numbering of each domain that follows from it [Lu25, Sec. 4.1].

#include <array>
#include <span>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/decomposition/decomposition.hpp>

namespace piecework::global {

using decomposition::DofClass;

/// Which rows of two domains become corners although they need not (docs/architecture.md, D12).
struct CornerOptions {
  /// Share of the two-domain rows that is promoted, spread evenly along each interface curve, in
  /// [0, 1]. 0: none (chosen). In [Lu25, Table 1] half of all boundary vertices are corners.
  double corner_fraction = 0;
  /// Corners given to a connected part of a domain that has duplicates but no corner: only its mass
  /// holds such a part, so its matrix is close to singular. 0 leaves it so. 3 is chosen: one is
  /// enough for regularity, three that lie apart hold the part as well as its neighbours do.
  int floating_corners = 3;
};

/// A row's place in one domain.
struct DofCopy {
  int domain;
  int local;  ///< in the domain's own numbering, see DomainDofs::rows
};

/// One domain's own numbering [internal | duplicates | corners].
struct DomainDofs {
  std::vector<int> rows;  ///< local -> row of K; ascending within each of the three classes
  int num_internal = 0;
  int num_duplicates = 0;
  int num_corners = 0;
  std::vector<int> multiplier;  ///< per duplicate: its multiplier; ascending
  std::vector<double> sign;     ///< per duplicate: its entry of S_D^j, +1 in the lower domain, -1
  std::vector<int> corner;      ///< per corner: its number among all corners; ascending

  [[nodiscard]] int num_remainder() const { return num_internal + num_duplicates; }  ///< N_R^j
  [[nodiscard]] int num_interface() const { return num_duplicates + num_corners; }
  [[nodiscard]] int size() const { return num_remainder() + num_corners; }
};

/// The classes of all rows. A promoted corner has two domains, any other corner more.
struct InterfaceDofs {
  int num_rows = 0;
  std::vector<DofClass> dof_class;  ///< per row
  std::vector<DomainDofs> domains;
  std::vector<int> duplicate_rows;  ///< per multiplier: its row, ascending
  std::vector<int> corner_rows;     ///< per corner: its row, ascending
  /// Per multiplier: the row in its two domains, the lower one (sign +) first [Lu25, Eq. 5].
  std::vector<std::array<DofCopy, 2>> duplicate_copies;
  std::vector<int> corner_copies_begin;  ///< per corner: range in corner_copies
  std::vector<DofCopy> corner_copies;    ///< per corner: its domains, ascending
  int num_promoted = 0;                  ///< corners due to corner_fraction
  int num_floating_promoted = 0;         ///< corners due to floating_corners

  [[nodiscard]] int num_multipliers() const { return static_cast<int>(duplicate_rows.size()); }
  [[nodiscard]] int num_corners() const { return static_cast<int>(corner_rows.size()); }
};

/// Classifies the rows of a system given as a sum of domain matrices. A row belongs to the domains
/// that list it; what hangs together is read from the patterns of the domains' own matrices, which
/// may hang together less than the whole does. Interface curves are the connected groups of rows
/// that the same two domains share, walked breadth first from an end. A function of the patterns
/// only.
/// \param num_rows  n, rows of the whole; 0 is allowed.
/// \throws InputError if an option is out of range, a matrix does not fit its rows, rows are not
///         ascending in [0, num_rows), or a row belongs to no domain.
InterfaceDofs classify_dofs(std::span<const DomainMatrix> domains, int num_rows,
                            const CornerOptions& options = {});

}  // namespace piecework::global
