#pragma once

// Tangled cloths, and an account of them that shares no code with what untangles them.

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include <piecework/collision/intersections.hpp>
#include <piecework/testing/small_cloths.hpp>
#include <piecework/untangle/untangle.hpp>

namespace piecework::untangle {

struct TangledCloth {
  model::ClothModel model;
  std::vector<colliders::AnalyticCollider> bodies;
  std::vector<colliders::MeshCollider> meshes;
  std::vector<char> held;
  UntangleOptions options{.distance = 2e-3, .self = true};
  Positions x;

  explicit TangledCloth(const mesh::TriangleMesh& cloth)
      : model(testing::cloth_model(cloth, testing::cotton())),
        held(static_cast<std::size_t>(model.num_vertices()), 0),
        x(model.start) {}

  UntangleReport untangle() {
    return piecework::untangle::untangle(model, {bodies, meshes}, held, options, x);
  }

  void add(const mesh::TriangleMesh& body, const Vec3& at) {
    Eigen::Affine3d placement = Eigen::Affine3d::Identity();
    placement.translation() = at;
    meshes.emplace_back(colliders::Traits{.name = "body"}, body, placement,
                        colliders::RigidMotion{});
  }

  /// Edges through triangles, by exact arithmetic.
  [[nodiscard]] std::size_t intersections() const {
    Positions all = x, one;
    Triangles triangles;
    for (const auto& mesh : meshes) {
      mesh.positions_at(0, one);
      const int first = static_cast<int>(all.rows() - x.rows());
      for (const Triangle& t : mesh.triangles())
        triangles.push_back({first + t[0], first + t[1], first + t[2]});
      all.conservativeResize(all.rows() + one.rows(), Eigen::NoChange);
      all.bottomRows(one.rows()) = one;
    }
    const auto surface =
        collision::make_surface(model.triangles, model.num_vertices(), triangles,
                                static_cast<int>(all.rows() - x.rows()), options.self);
    return collision::find_intersections(surface, all).size();
  }

  /// The shortest and the longest that an edge has become, as parts of its length in `start`.
  [[nodiscard]] std::array<double, 2> stretches() const {
    std::array<double, 2> range{1e300, 0};
    for (const Triangle& t : model.triangles)
      for (std::size_t k = 0; k < 3; ++k) {
        const int v = t[k], w = t[(k + 1) % 3];
        const double ratio =
            (x.row(v) - x.row(w)).norm() / (model.start.row(v) - model.start.row(w)).norm();
        range = {std::min(range[0], ratio), std::max(range[1], ratio)};
      }
    return range;
  }
};

}  // namespace piecework::untangle
