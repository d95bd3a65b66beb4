#pragma once

// One step's problem for tests of minimisers: a cloth, two of its vertices held, the others jolted.

#include <vector>

#include <piecework/model/stepper.hpp>
#include <piecework/testing/newton_oracle.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::testing {

struct JoltedCloth {
  static constexpr double kH = 1.0 / 120.0;  // s
  static constexpr double kGravity = 9.81;   // m/s^2

  mesh::TriangleMesh rest;
  model::Material material;
  model::ClothModel model;
  Positions z;              ///< rest shape + random offsets
  std::vector<char> fixed;  ///< vertices 0 and 1

  /// \param jolt  largest offset, m
  JoltedCloth(mesh::TriangleMesh mesh, const model::Material& m, double jolt)
      : rest(std::move(mesh)),
        material(m),
        model(cloth_model(rest, material)),
        z(rest.positions + random_positions(rest.num_vertices(), jolt, 11)),
        fixed(static_cast<std::size_t>(rest.num_vertices()), 0) {
    for (const int v : {0, 1}) {
      fixed[static_cast<std::size_t>(v)] = 1;
      z.row(v) = rest.positions.row(v);
    }
  }

  [[nodiscard]] model::StepProblem problem() const {
    return {.predicted = &z, .fixed = &fixed, .previous = &model.start};
  }
  [[nodiscard]] OracleProblem oracle() const { return {&rest, material, kH, z, fixed}; }

  /// From z. \returns the report; x is the result.
  model::StepReport solve(model::Minimizer& minimizer, Positions& x) const {
    x = z;
    return minimizer.minimize(problem(), x);
  }
};

}  // namespace piecework::testing
