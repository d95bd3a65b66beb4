#include "contact_scenes.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include <piecework/runner/methods.hpp>

namespace piecework::bench {
namespace {

TEST(ContactScenes, CoulombDistanceIsThatOfUniformAcceleration) {
  const double a = 9.81 * (std::sin(kSlope) - 0.2 * std::cos(kSlope));
  // Fine steps approach v t + a t^2 / 2.
  EXPECT_NEAR(coulomb_distance(0.3, 0.2, 1e-6, 500000), 0.3 * 0.5 + a * 0.125, 1e-5);
  // A few of them: h v_1 + h v_2.
  EXPECT_NEAR(coulomb_distance(0.3, 0.2, 0.01, 2), 0.01 * (2 * 0.3 + 0.03 * a), 1e-12);
}

TEST(ContactScenes, WhatSticksStopsAndStays) {
  const double a = 9.81 * (0.6 * std::cos(kSlope) - std::sin(kSlope));
  EXPECT_GT(a, 0);
  EXPECT_EQ(coulomb_distance(0, 0.6, 0.01, 100), 0);
  EXPECT_NEAR(coulomb_distance(0.3, 0.6, 1e-6, 500000), 0.3 * 0.3 / (2 * a), 1e-5);
}

/// Mean way of the first cloth in a while, m, from rest.
double way(scene::Scene scene) {
  const auto world = runner::build_world(scene);
  const auto integrator = runner::make_integrator(*world);
  model::State state = integrator->initial_state(world->part_velocity);
  int pairs = 0;
  const auto first =
      world->model.start.topRows(scene.cloths[0].mesh.rows * scene.cloths[0].mesh.columns);
  for (int k = 0; k < 30; ++k) {
    const auto report = integrator->step(state);
    if (report.contact) pairs = report.contact->pairs;
  }
  EXPECT_GT(pairs, 0);
  return (state.x.topRows(first.rows()) - first).col(0).mean();
}

TEST(ContactScenes, ClothSlidesFartherWithLessFriction) {
  for (const Support support : {Support::Rigid, Support::Elastic})
    EXPECT_GT(way(support_scene(support, 10, kSlides)),
              1.5 * way(support_scene(support, 10, kSticks)));
}

TEST(ContactScenes, WithoutContactNothingTouches) {
  const auto world =
      runner::build_world(without_contact(support_scene(Support::Rigid, 8, kSlides)));
  EXPECT_EQ(runner::make_contact(*world), nullptr);
  const auto two =
      runner::build_world(without_contact(support_scene(Support::Elastic, 8, kSlides)));
  EXPECT_EQ(runner::make_contact(*two), nullptr);
}

}  // namespace
}  // namespace piecework::bench
