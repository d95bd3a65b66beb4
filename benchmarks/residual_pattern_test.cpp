// Measures of patterns on fields whose values are known.

#include "residual_pattern.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace piecework::bench {
namespace {

/// A strip of two triangles: 0-1, 0-2, 1-2, 1-3, 2-3.
const Triangles kStrip{{0, 1, 2}, {1, 3, 2}};

TEST(ResidualPattern, EdgesAppearOnce) {
  EXPECT_EQ(edges_of(kStrip), (Edges{{0, 1}, {0, 2}, {1, 2}, {1, 3}, {2, 3}}));
}

TEST(ResidualPattern, NeighboursThatAgreeHavePositiveMoransI) {
  const Edges chain{{0, 1}, {1, 2}, {2, 3}};
  const std::vector<char> free(4, 0);
  Eigen::VectorXd halves(4), alternating(4);
  halves << 1, 1, 0, 0;
  alternating << 1, 0, 1, 0;
  EXPECT_NEAR(moran(halves, chain, free), 1.0 / 3, 1e-12);
  EXPECT_NEAR(moran(alternating, chain, free), -1.0, 1e-12);
  EXPECT_EQ(moran(Eigen::VectorXd::Ones(4), chain, free), 0);
}

TEST(ResidualPattern, HeldVerticesDoNotCount) {
  const Edges chain{{0, 1}, {1, 2}, {2, 3}, {3, 4}};
  Eigen::VectorXd values(5);
  values << 1, 1, 0, 0, 1e6;
  EXPECT_NEAR(moran(values, chain, {0, 0, 0, 0, 1}), 1.0 / 3, 1e-12);
  EXPECT_NEAR(correlation(values, -values, {0, 0, 0, 0, 1}), -1, 1e-12);
}

TEST(ResidualPattern, IsRelativeToTheRootMeanSquare) {
  Positions gradient = Positions::Zero(3, 3);
  gradient(0, 0) = 3;
  gradient(1, 1) = -6;  // twice the mass: the same acceleration
  gradient(2, 2) = 1e9;
  const Eigen::VectorXd pattern = residual_pattern(gradient, Eigen::Vector3d(1, 2, 1), {0, 0, 1});
  EXPECT_NEAR(pattern[0], std::log10(1.001), 1e-12);
  EXPECT_NEAR(pattern[1], pattern[0], 1e-12);
  EXPECT_EQ(pattern[2], 0);
}

}  // namespace
}  // namespace piecework::bench
