#include <piecework/collision/distance.hpp>

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include <piecework/core/random.hpp>

namespace piecework::collision {
namespace {

/// The distance as the minimum over a grid of combinations, refined about the best point: shares no
/// formula with what it tests.
double sampled_distance(PairKind kind, const PairPoints& x) {
  double best = 1e300, cs = 0.5, cu = 0.5, width = 0.5;
  for (int round = 0; round < 40; ++round) {
    const double s0 = cs, u0 = cu;
    for (int i = -10; i <= 10; ++i)
      for (int j = -10; j <= 10; ++j) {
        const double s = std::clamp(s0 + width * i / 10, 0.0, 1.0);
        const double u = std::clamp(u0 + width * j / 10, 0.0, 1.0);
        Vec3 offset;
        if (kind == PairKind::VertexTriangle)
          offset = x[0] - (x[1] + s * (x[2] - x[1]) + std::min(u, 1 - s) * (x[3] - x[1]));
        else
          offset = x[0] + s * (x[1] - x[0]) - (x[2] + u * (x[3] - x[2]));
        if (offset.norm() < best) best = offset.norm(), cs = s, cu = u;
      }
    width *= 0.7;
  }
  return best;
}

void expect_consistent(const Closest& c, const PairPoints& x) {
  Vec3 sum = Vec3::Zero();
  double total = 0;
  for (std::size_t i = 0; i < 4; ++i) sum += c.beta[i] * x[i], total += c.beta[i];
  EXPECT_NEAR((sum - c.offset).norm(), 0, 1e-12);
  EXPECT_NEAR(total, 0, 1e-12);
  EXPECT_NEAR(c.offset.squaredNorm(), c.distance_sq, 1e-14);
}

TEST(Distance, IsTheMinimumOverTheElementsForRandomPairs) {
  Random random(7);
  for (int i = 0; i < 400; ++i)
    for (const PairKind kind : {PairKind::VertexTriangle, PairKind::EdgeEdge}) {
      PairPoints x;
      for (Vec3& p : x)
        p = Vec3(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-0.3, 0.3));
      const Closest c = closest(kind, x);
      expect_consistent(c, x);
      EXPECT_NEAR(std::sqrt(c.distance_sq), sampled_distance(kind, x), 2e-5);
    }
}

TEST(Distance, HandlesDegenerateElements) {
  const Vec3 o(0, 0, 0), a(1, 0, 0), b(2, 0, 0), p(0.5, 1, 0), up(0, 0, 1);
  EXPECT_DOUBLE_EQ(closest_vertex_triangle({p, o, a, b}).distance_sq, 1);          // collinear
  EXPECT_DOUBLE_EQ(closest_vertex_triangle({p, o, o, o}).distance_sq, 1.25);       // a point
  EXPECT_DOUBLE_EQ(closest_edge_edge({o, a, o + up, a + up}).distance_sq, 1);      // parallel
  EXPECT_DOUBLE_EQ(closest_edge_edge({o, a, b + up, 2 * b + up}).distance_sq, 2);  // ends apart
  EXPECT_DOUBLE_EQ(closest_edge_edge({o, o, p, p}).distance_sq, 1.25);             // two points
  EXPECT_DOUBLE_EQ(closest_edge_edge({o, b, a, a + up}).distance_sq, 0);           // touching
  EXPECT_DOUBLE_EQ(closest_edge_edge({o, b, p, p}).distance_sq, 1);  // second: a point
  EXPECT_DOUBLE_EQ(closest_edge_edge({p, p, o, b}).distance_sq, 1);  // first: a point
}

TEST(Distance, EdgesThatBecomeParallelKeepTheirDistance) {
  // Above each other by 1, with ends that stick out; turned by ever less about the middle.
  int checked = 0;
  for (double angle = 1; angle > 1e-12; angle *= 0.1)
    for (const double shift : {-0.9, 0.0, 0.4, 1.7}) {
      const Vec3 along(std::cos(angle), std::sin(angle), 0), middle(shift, 0, 1);
      const PairPoints x{Vec3(-1, 0, 0), Vec3(1, 0, 0), middle - along, middle + along};
      EXPECT_NEAR(closest_edge_edge(x).distance_sq,
                  std::pow(sampled_distance(PairKind::EdgeEdge, x), 2), 1e-5)
          << angle << ' ' << shift;
      ++checked;
    }
  EXPECT_GE(checked, 48);
}

TEST(Distance, ItsGradientIsBetaTimesTheDirection) {
  Random random(11);
  int checked = 0;
  for (int i = 0; i < 200; ++i)
    for (const PairKind kind : {PairKind::VertexTriangle, PairKind::EdgeEdge}) {
      PairPoints x;
      for (Vec3& p : x)
        p = Vec3(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
      const Closest c = closest(kind, x);
      const double d = std::sqrt(c.distance_sq);
      if (d < 0.05) continue;
      for (std::size_t v = 0; v < 4; ++v)
        for (int k = 0; k < 3; ++k) {
          constexpr double step = 1e-6;
          PairPoints plus = x, minus = x;
          plus[v][k] += step, minus[v][k] -= step;
          const double slope = (std::sqrt(closest(kind, plus).distance_sq) -
                                std::sqrt(closest(kind, minus).distance_sq)) /
                               (2 * step);
          EXPECT_NEAR(slope, c.beta[v] * c.offset[k] / d, 2e-5);
          ++checked;
        }
    }
  EXPECT_GT(checked, 1000);
}

}  // namespace
}  // namespace piecework::collision
