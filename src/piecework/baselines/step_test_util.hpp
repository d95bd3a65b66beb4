#pragma once

// One time step of a small cloth, for the tests of every minimiser.

#include <optional>
#include <vector>

#include <piecework/core/parallel.hpp>
#include <piecework/model/stepper.hpp>
#include <piecework/testing/jolted_cloth.hpp>

namespace piecework::baselines {

inline constexpr double kTestH = testing::JoltedCloth::kH;
inline constexpr double kTestGravity = testing::JoltedCloth::kGravity;

/// With what the tests of baselines do with it.
struct TestStep : testing::JoltedCloth {
  using JoltedCloth::JoltedCloth;

  void hold(const std::vector<int>& vertices) {
    for (const int v : vertices) {
      fixed[static_cast<std::size_t>(v)] = 1;
      z.row(v) = rest.positions.row(v);
    }
  }

  /// The oracle's minimum next to x.
  [[nodiscard]] Positions oracle(const Positions& x) const {
    return testing::oracle_minimize(JoltedCloth::oracle(), x);
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
