#pragma once

// What can be wrong with colliders before a simulation starts, as numbers and as words.

#include <optional>
#include <string>
#include <vector>

#include <piecework/colliders/collider.hpp>

namespace piecework::colliders {

struct AuditOptions {
  double h = 1.0 / 120;  ///< time step, s
  int steps = 0;         ///< steps of the simulation
};

struct Audit {
  int num_triangles = 0;
  Vec3 low = Vec3::Zero(), high = Vec3::Zero();  ///< bounding box at time 0, m
  bool bounded = true;           ///< false: a plane or half-spaces, of which the box says nothing
  bool closed = true;            ///< inside and outside are known
  double volume = 0;             ///< m^3, of closed meshes; negative: inside out
  int zero_area = 0;             ///< triangles without area at time 0
  int duplicates = 0;            ///< triangles on the vertices of an earlier one
  double step_displacement = 0;  ///< largest way of a vertex in the steps that were looked at, m
  std::vector<int> inside;       ///< cloth vertices that start inside, ascending
  double depth = 0;              ///< of the deepest of them, m
};

/// At most so many steps are looked at, evenly spread; motion between them goes unseen. Chosen.
inline constexpr int kMaxAuditedSteps = 240;

/// \param cloth  start positions of all cloth vertices, |V| x 3, m
Audit audit(const AnalyticCollider& collider, const Positions& cloth, const AuditOptions& options);

/// Inside of a closed mesh is where its winding number is not 0; of an open one nothing is.
Audit audit(const MeshCollider& collider, const Positions& cloth, const AuditOptions& options);

/// Volume that triangles enclose, m^3: negative if they face inward. \pre closed
double signed_volume(const Triangles& triangles, const Positions& x);

/// Which of the points (|P| x 3, m) lie inside of a closed mesh, whatever its orientation: by the
/// signed crossings of rays along +x, decided edge by edge so that no ray slips through an edge.
std::vector<int> points_inside(const Triangles& triangles, const Positions& x,
                               const Positions& points);

/// The audit in words: first a line on the body itself, then one per problem. What becomes of
/// vertices that start inside is told by who sees to them.
/// \param cloth_extent  largest extent of the cloths, m
std::vector<std::string> notes(const Audit& audit, const Traits& traits, double cloth_extent);

}  // namespace piecework::colliders
