#pragma once

// Runs of worlds in which things touch, for this folder's tests.

#include <algorithm>

#include <gtest/gtest.h>

#include <piecework/runner/methods.hpp>
#include <piecework/runner/world.hpp>

namespace piecework::runner {

/// What happened in a run.
struct Course {
  int most_pairs = 0;         ///< largest number of pairs in contact
  int interpenetrations = 0;  ///< sum over the steps
  int waits = 0;              ///< steps in which something was held back
  int converged = 0;          ///< steps
  model::State end;
};

/// \pre something may touch
inline Course run(const World& world, int steps) {
  const auto integrator = make_integrator(world);
  model::State state = integrator->initial_state(world.part_velocity);
  Course course;
  for (int k = 0; k < steps; ++k) {
    const model::StepReport report = integrator->step(state);
    course.most_pairs = std::max(course.most_pairs, report.contact->pairs);
    course.interpenetrations += report.contact->interpenetrations;
    course.converged += report.converged;
    course.waits += report.contact->held_back > 0;
    EXPECT_TRUE(state.x.allFinite());
  }
  course.end = state;
  return course;
}

}  // namespace piecework::runner
