#include <piecework/contact/activation.hpp>

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace piecework::contact {
namespace {

using enum Barrier;

constexpr double kDistance = 2e-3, kStiffness = 30;

class EveryBarrier : public ::testing::TestWithParam<Barrier> {
 protected:
  const Activation b{GetParam(), kDistance, kStiffness};
};

TEST_P(EveryBarrier, DerivativesAreThoseOfTheEnergy) {
  for (const double part : {0.01, 0.1, 0.3, 0.49, 0.51, 0.7, 0.95}) {
    const double d = part * kDistance, e = 1e-4 * d;
    const double slope = (b(d + e).energy - b(d - e).energy) / (2 * e);
    const double curvature = (b(d + e).slope - b(d - e).slope) / (2 * e);
    EXPECT_NEAR(b(d).slope, slope, 1e-5 * std::abs(slope)) << part;
    EXPECT_NEAR(b(d).curvature, curvature, 1e-5 * curvature) << part;
  }
}

TEST_P(EveryBarrier, RepelsMoreTheCloserItIs) {
  ActivationValue last = b(kDistance * (1 - 1e-9));
  for (double part = 0.99; part > 1e-6; part *= 0.9) {
    const ActivationValue now = b(part * kDistance);
    EXPECT_GT(now.energy, last.energy) << part;
    EXPECT_LT(now.slope, last.slope) << part;
    EXPECT_GE(now.curvature, last.curvature * (1 - 1e-12)) << part;
    last = now;
  }
}

TEST_P(EveryBarrier, BeginsAtNothingAndContinuesAtHalfTheDistance) {
  const ActivationValue begin = b(kDistance * (1 - 1e-10));
  EXPECT_NEAR(begin.energy / (kStiffness * kDistance * kDistance), 0, 1e-9);
  EXPECT_NEAR(begin.slope / (kStiffness * kDistance), 0, 1e-9);
  const double tau = 0.5 * kDistance;
  const ActivationValue below = b(tau * (1 - 1e-12)), above = b(tau * (1 + 1e-12));
  EXPECT_NEAR(below.energy, above.energy, 1e-10 * above.energy);
  EXPECT_NEAR(below.slope, above.slope, -1e-10 * above.slope);
  EXPECT_NEAR(below.curvature, above.curvature, 1e-10 * above.curvature);
}

TEST_P(EveryBarrier, HasItsStiffnessAtHalfTheDistance) {
  EXPECT_NEAR(b(0.5 * kDistance).curvature, kStiffness, 1e-12 * kStiffness);
}

TEST_P(EveryBarrier, IsABarrierOnlyIfItsEnergyGrowsWithoutBound) {
  const double near = b(1e-100).energy / b(1e-50).energy;
  EXPECT_EQ(b.is_barrier(), near > 1.5);
  if (b.is_barrier()) return;
  EXPECT_LT(b(-kDistance).slope, b(0).slope) << "has an inside as well";
  EXPECT_NEAR((b(1e-7).energy - b(-1e-7).energy) / 2e-7, b(0).slope, -1e-6 * b(0).slope);
}

INSTANTIATE_TEST_SUITE_P(All, EveryBarrier, ::testing::Values(None, TwoStage, Ipc, Exponential));

class EveryFriction : public ::testing::TestWithParam<double> {
 protected:
  static constexpr double kSlip = 1e-5;
  [[nodiscard]] FrictionValue f(double y) const { return smoothed_friction(y, kSlip, GetParam()); }
};

TEST_P(EveryFriction, ForceIsTheSlopeOfTheEnergyAndSaturates) {
  for (const double part : {0.01, 0.5, 0.99, 1.01, 1.3, 1.7, 1.99, 2.01, 3.0, 1000.0}) {
    const double y = part * kSlip, e = 1e-4 * std::min(y, kSlip);
    const double slope = (f(y + e).energy - f(y - e).energy) / (2 * e);
    const double force = f(y).force_ratio * y;
    EXPECT_NEAR(force, slope, 1e-7) << part;
    EXPECT_LE(force, 1 + 1e-12);
    if (part > 2) {
      EXPECT_NEAR(force, GetParam(), 1e-12) << "of what slides";
    }
  }
  EXPECT_EQ(f(0).energy, 0);
  EXPECT_NEAR(f(0).force_ratio, 2 / kSlip, 1e-9 / kSlip) << "stiffness at rest";
  EXPECT_NEAR(f(kSlip).force_ratio * kSlip, 1, 1e-12) << "all that sticking can hold";
}

TEST_P(EveryFriction, ContinuesAtItsSeams) {
  for (const double seam : {kSlip, 2 * kSlip}) {
    const FrictionValue below = f(seam * (1 - 1e-12)), above = f(seam * (1 + 1e-12));
    EXPECT_NEAR(below.energy, above.energy, 1e-10 * kSlip);
    EXPECT_NEAR(below.force_ratio, above.force_ratio, 1e-10 / kSlip);
  }
}

TEST_P(EveryFriction, LiesBelowTheParabolaThatTheHessianTakesForIt) {
  for (double at = 0.05; at < 4; at += 0.05)
    for (double y = 0; y < 5; y += 0.05) {
      const FrictionValue here = f(at * kSlip);
      const double parabola =
          here.energy + 0.5 * here.force_ratio * kSlip * kSlip * (y * y - at * at);
      EXPECT_LE(f(y * kSlip).energy, parabola + 1e-12 * kSlip) << at << " " << y;
      EXPECT_GE(here.force_ratio, 0);
    }
}

INSTANTIATE_TEST_SUITE_P(All, EveryFriction, ::testing::Values(1.0, 0.6, 0.0));

TEST(SmoothedFriction, OfOneCoefficientIsThatOfLiAndOthersToTheLastBit) {
  constexpr double kSlip = 1e-5;
  for (const double y : {1e-5, 1.2e-5, 1.9e-5, 2e-5, 2.3e-5, 0.7}) {
    EXPECT_EQ(smoothed_friction(y, kSlip, 1).energy, y - kSlip / 3);
    EXPECT_EQ(smoothed_friction(y, kSlip, 1).force_ratio, 1 / y);
  }
}

}  // namespace
}  // namespace piecework::contact
