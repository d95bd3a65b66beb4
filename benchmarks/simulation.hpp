#pragma once

#include <memory>

#include <piecework/model/integrator.hpp>
#include <piecework/runner/methods.hpp>
#include <piecework/runner/world.hpp>

namespace piecework::bench {

/// A scene with what simulates it.
struct Simulation {
  std::unique_ptr<runner::World> world;
  std::unique_ptr<model::Integrator> integrator;

  explicit Simulation(const scene::Scene& scene)
      : world(runner::build_world(scene)), integrator(runner::make_integrator(*world)) {}

  [[nodiscard]] model::State start() const {
    model::State state = integrator->initial_state(world->part_velocity);
    integrator->prepare(state);
    return state;
  }
};

}  // namespace piecework::bench
