#pragma once

// Starting states that intersect, taken apart before the first step: a preparation of the start
// positions by geometry alone. docs/contact.md says how.

#include <optional>
#include <vector>

#include <piecework/contact/contact.hpp>
#include <piecework/core/types.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::untangle {

struct UntangleOptions {
  int rounds = 100;        ///< at most so many
  double distance = 1e-3;  ///< contact distance of what has none of its own, m
  bool self = false;       ///< cloth collides with cloth
};

/// What is wrong with some positions.
struct Count {
  int edges = 0;   ///< passes of edges through triangles, decided exactly
  int inside = 0;  ///< vertices inside of bodies
  [[nodiscard]] int total() const { return edges + inside; }
};

struct UntangleReport {
  Count before, after;
  int rounds = 0;
  double largest_move = 0;  ///< of any vertex, m
  /// If anything is left: a vertex of cloth there.
  std::optional<int> left_at;
};

/// Moves cloth in x until nothing passes through anything, and is some way apart where it did; what
/// does not hang together with it stays. Each round gives vertices displacements that undo what is
/// wrong near them (local), and spreads these over the cloth by an exact solve (global). If the
/// rounds do not suffice x is the best state seen. Colliders are where they are at time 0. The same
/// bits for every number of threads.
///
/// Inside of a mesh is wrong where the mesh is closed and the same piece of cloth passes through
/// it: cloth that lies wholly inside may be meant to. Elements that are sewn together may touch.
/// \param held  per vertex: stays where it is
/// \param[in,out] x  |V| x 3, m; on pins and seams
/// \throws SimulationError if a position is not finite or the factor does not fit into memory
UntangleReport untangle(const model::ClothModel& model, const contact::Colliders& colliders,
                        const std::vector<char>& held, const UntangleOptions& options,
                        Positions& x);

}  // namespace piecework::untangle
