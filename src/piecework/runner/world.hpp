#pragma once

// A scene made real: meshes loaded and placed, constraints built, domains cut.

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <piecework/colliders/collider.hpp>
#include <piecework/decomposition/decomposition.hpp>
#include <piecework/mesh/triangle_mesh.hpp>
#include <piecework/model/constraints.hpp>
#include <piecework/model/forces.hpp>
#include <piecework/model/pins.hpp>
#include <piecework/scene/scene.hpp>
#include <piecework/untangle/untangle.hpp>

namespace piecework::runner {

/// Everything that is constant during a simulation. Not copied: solvers refer to `model`.
struct World {
  scene::Scene scene;
  std::vector<mesh::MeshDocument> documents;  ///< per cloth, placed; in the order of model.parts
  model::ClothModel model;
  std::vector<model::Pin> pins;                    ///< of sewn vertices: on what carries them
  std::vector<std::array<int, 2>> seam_neighbors;  ///< triangles that face each other across seams
  model::ExternalForces forces;
  std::vector<Vec3> part_velocity;                              ///< m/s, per cloth
  std::vector<colliders::AnalyticCollider> analytic_colliders;  ///< in the order of the scene
  std::vector<colliders::MeshCollider> mesh_colliders;          ///< in the order of the scene
  Positions untangled;  ///< where cloth starts if its start shape intersected, |V| x 3, m; or empty
  std::optional<untangle::UntangleReport> untangling;  ///< absent: nothing was to be done
  decomposition::Decomposition domains;
  decomposition::Summary domain_summary;
  std::vector<std::string> notes;  ///< repairs, colliders, reduced domain counts
  double load_ms = 0;              ///< meshes and constraints
  double partition_ms = 0;         ///< domains

  World() = default;
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  /// What the decomposition divides.
  [[nodiscard]] decomposition::Elements elements() const;
  /// Vertex of the model for a vertex of cloth `part` in the order of its file.
  /// \throws InputError if it is out of range or used by no face.
  [[nodiscard]] int vertex(std::size_t part, int file_vertex, const std::string& where) const;
  /// "vertex 12 of skirt" for a vertex of the model: its number in the cloth's file.
  [[nodiscard]] std::string vertex_name(int vertex) const;
};

/// Loads meshes, places cloths, resolves regions, builds constraints and domains.
/// \throws InputError that names scene, JSON pointer and remedy.
std::unique_ptr<World> build_world(const scene::Scene& scene);

/// The mesh that a scene's `mesh` object describes, in its own coordinates.
mesh::MeshDocument load_mesh(const scene::Mesh& mesh);

}  // namespace piecework::runner
