#pragma once

// Which rows of a domain-decomposed system are internal, duplicate (dual) or corner (primal), and
// the numbering of each domain that follows from it [Lu25, Sec. 4.1].

#include <array>
#include <span>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/decomposition/decomposition.hpp>
#include <piecework/mesh/seams.hpp>

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

/// An entry of S_D^j in the row of a seam: 1 at the slave, -weight at what carries it.
struct SeamEntry {
  int multiplier;
  int dual;  ///< place among the domain's dual rows
  double coefficient;
};

/// One domain's own numbering [internal | duplicates | sewn | corners]. Multipliers act on the two
/// in the middle, the dual rows. Sewn: in the row of a seam, and in no other domain.
struct DomainDofs {
  std::vector<int> rows;  ///< local -> row of K; ascending within each of the four classes
  int num_internal = 0;
  int num_duplicates = 0;
  int num_sewn = 0;
  int num_corners = 0;
  std::vector<int> multiplier;  ///< per duplicate: its multiplier; ascending
  std::vector<double> sign;     ///< per duplicate: its entry of S_D^j, +1 in the lower domain, -1
  std::vector<SeamEntry> seam_entries;  ///< the rest of S_D^j; ascending multipliers
  std::vector<int> corner;              ///< per corner: its number among all corners; ascending

  [[nodiscard]] int num_dual() const { return num_duplicates + num_sewn; }       ///< N_D^j
  [[nodiscard]] int num_remainder() const { return num_internal + num_dual(); }  ///< N_R^j
  [[nodiscard]] int num_interface() const { return num_dual() + num_corners; }
  [[nodiscard]] int size() const { return num_remainder() + num_corners; }
  [[nodiscard]] std::vector<int> multipliers() const;  ///< those with an entry in S_D^j, ascending

  /// Calls visit(multiplier, dual row, coefficient) for the entries of S_D^j, multipliers
  /// ascending.
  template <class Visit>
  void visit_entries(const Visit& visit) const {
    for (std::size_t i = 0; i < multiplier.size(); ++i)
      visit(multiplier[i], static_cast<int>(i), sign[i]);
    for (const SeamEntry& entry : seam_entries)
      visit(entry.multiplier, entry.dual, entry.coefficient);
  }
};

/// An entry of E: a seam's multiplier and a corner that carries its slave.
struct SeamCorner {
  int multiplier;
  int corner;
  double coefficient;  ///< -weight
};

/// The classes of all rows. A promoted corner has two domains, any other corner more; with seams a
/// corner may have one.
///
/// With seams the rows of multipliers are sum_j S_D^j x_R^j + E x~_C = 0: first one per duplicate,
/// then one per slave that is no corner, x_s - sum_k T_sk x_k = 0. Slaves that are corners have no
/// multiplier: x_C = B_C x~_C gives them from what carries them, which is all corners too. So each
/// row of a seam has a dual row to itself, the slave's, and G_RR cannot become singular
/// (docs/architecture.md, D18).
struct InterfaceDofs {
  int num_rows = 0;
  std::vector<DofClass> dof_class;  ///< per row
  std::vector<DomainDofs> domains;
  std::vector<int> duplicate_rows;  ///< per duplicate's multiplier: its row, ascending
  std::vector<int> corner_rows;     ///< per corner: its row, ascending; x~_C
  /// Per duplicate's multiplier: its two domains, the lower one (sign +) first [Lu25, Eq. 5].
  std::vector<std::array<DofCopy, 2>> duplicate_copies;
  std::vector<int> corner_copies_begin;  ///< per corner: range in corner_copies
  std::vector<DofCopy> corner_copies;    ///< per corner: its domains, ascending
  int num_promoted = 0;                  ///< corners due to corner_fraction
  int num_floating_promoted = 0;         ///< corners due to floating_corners

  mesh::SeamMap seams;                    ///< of rows; empty: no seam has multipliers
  std::vector<int> seam_slaves;           ///< per seam's multiplier: its slave, ascending
  std::vector<int> seam_copies_begin;     ///< per seam's multiplier: range in seam_copies
  std::vector<DofCopy> seam_copies;       ///< rows that it acts on, the slave first
  std::vector<double> seam_coefficients;  ///< per item of seam_copies
  std::vector<SeamCorner> seam_corners;   ///< E, ascending multipliers
  std::vector<int> condensed_slaves;      ///< slaves that are corners, ascending
  int num_sewn_promoted = 0;              ///< corners because they carry one

  [[nodiscard]] int num_duplicates() const { return static_cast<int>(duplicate_rows.size()); }
  [[nodiscard]] int num_multipliers() const {
    return static_cast<int>(duplicate_rows.size() + seam_slaves.size());
  }
  [[nodiscard]] int num_corners() const { return static_cast<int>(corner_rows.size()); }

  /// Calls visit(copy, coefficient) for the entries of [S_D^1 ... S_D^D] in a multiplier's row.
  template <class Visit>
  void visit_copies(int multiplier, const Visit& visit) const {
    const int seam = multiplier - num_duplicates();
    if (seam < 0) {
      const auto& [plus, minus] = duplicate_copies[static_cast<std::size_t>(multiplier)];
      visit(plus, 1.0);
      visit(minus, -1.0);
      return;
    }
    const auto s = static_cast<std::size_t>(seam);
    for (int i = seam_copies_begin[s]; i < seam_copies_begin[s + 1]; ++i)
      visit(seam_copies[static_cast<std::size_t>(i)],
            seam_coefficients[static_cast<std::size_t>(i)]);
  }

  [[nodiscard]] bool is_condensed(int row) const {
    return seams.is_slave(row) && dof_class[static_cast<std::size_t>(row)] == DofClass::Corner;
  }
  /// Calls visit(row, weight) for the unknowns that give a row: itself, but for condensed slaves.
  template <class Visit>
  void visit_unknowns(int row, const Visit& visit) const {
    if (is_condensed(row))
      seams.visit_carriers(row, visit);
    else
      visit(row, 1.0);
  }
  /// The rows of a domain with condensed slaves replaced by what carries them, ascending.
  [[nodiscard]] std::vector<int> unknowns(const std::vector<int>& rows) const;
};

/// Classifies the rows of a system given as a sum of domain matrices. A row belongs to the domains
/// that list it; what hangs together is read from the patterns of the domains' own matrices, which
/// may hang together less than the whole does. Interface curves are the connected groups of rows
/// that the same two domains share, walked breadth first from an end. A function of the patterns
/// only.
/// \param num_rows  n, rows of the whole; 0 is allowed.
/// \param seams     of rows: slaves keep rows of their own, tied by multipliers to what carries
///                  them; weights need not sum to 1 (what is held has no row)
/// \throws InputError if an option is out of range, a matrix does not fit its rows, rows are not
///         ascending in [0, num_rows), a row belongs to no domain, or the seams are not of these
///         rows.
InterfaceDofs classify_dofs(std::span<const DomainMatrix> domains, int num_rows,
                            const CornerOptions& options = {}, mesh::SeamMap seams = {});

}  // namespace piecework::global
