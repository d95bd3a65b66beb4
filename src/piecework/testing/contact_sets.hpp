#pragma once

// Synthetic contact sets on a unit sheet in the xz plane, for solvers of (K + D) x = b.

#include <string_view>
#include <vector>

#include <piecework/core/types.hpp>

namespace piecework::testing {

enum class ContactSet { Disk, Patches, Folds, Scattered };
inline constexpr ContactSet kContactSets[] = {ContactSet::Disk, ContactSet::Patches,
                                              ContactSet::Folds, ContactSet::Scattered};

/// "disk", "patches", "folds", "scattered".
std::string_view to_string(ContactSet set);

/// `count` vertices of the set, those deepest inside first.
/// \pre count <= |V|
std::vector<int> contact_vertices(const Positions& X, ContactSet set, int count);

/// A force D (t - x) on every vertex, N: displacements t of some centimetres, smooth with noise.
/// \param D  |V| contact weights, N/m
Positions contact_forces(const Positions& X, const std::vector<double>& D);

}  // namespace piecework::testing
