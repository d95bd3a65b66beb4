#pragma once

// One time step of a small cloth, for the tests of every minimiser.

#include <optional>
#include <utility>
#include <vector>

#include <piecework/core/parallel.hpp>
#include <piecework/model/stepper.hpp>
#include <piecework/testing/newton_oracle.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::baselines {

inline constexpr double kTestH = 1.0 / 120.0;  // s
inline constexpr double kTestGravity = 9.81;   // m/s^2

/// A cloth whose prediction is its rest shape with every vertex off by up to `jolt` m; vertices 0
/// and 1 are held.
struct TestStep {
  mesh::TriangleMesh rest;
  model::Material material;
  model::ClothModel model;
  Positions z;
  std::vector<char> fixed;

  TestStep(mesh::TriangleMesh mesh, model::Material m, double jolt)
      : rest(std::move(mesh)),
        material(m),
        model(testing::cloth_model(rest, material)),
        z(rest.positions + testing::random_positions(rest.num_vertices(), jolt, 11)),
        fixed(static_cast<std::size_t>(rest.num_vertices()), 0) {
    hold({0, 1});
  }

  void hold(const std::vector<int>& vertices) {
    for (const int v : vertices) {
      fixed[static_cast<std::size_t>(v)] = 1;
      z.row(v) = rest.positions.row(v);
    }
  }

  [[nodiscard]] model::StepProblem problem() const { return {&z, &fixed, &model.start}; }

  /// The oracle's minimum next to x.
  [[nodiscard]] Positions oracle(const Positions& x) const {
    return testing::oracle_minimize({&rest, material, kTestH, z, fixed}, x);
  }

  /// A minimiser of type M from x = z.
  template <class M, class... Options>
  model::StepReport solve(model::StopOptions stop, Positions& x, const Options&... options) const {
    x = z;
    return M(model, kTestH, kTestGravity, stop, options...).minimize(problem(), x);
  }
};

/// Flat without bending, flat with, curved at rest: membrane of 20 N/m.
inline TestStep small_step(int kind) {
  return {
      kind == 2 ? testing::sphere_mesh(1, 0.3) : testing::grid_mesh(5, 5, 0.3),
      {.density = 0.5, .stretching = 20, .bending = kind == 0 ? std::nullopt : std::optional(1e-3)},
      0.01};
}

/// Largest distance between two vertices of the same number, m.
inline double largest_distance(const Positions& a, const Positions& b) {
  return (a - b).rowwise().norm().maxCoeff();
}

}  // namespace piecework::baselines
