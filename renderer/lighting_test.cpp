#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include <renderer/depth_map.hpp>
#include <renderer/lighting.hpp>

#include <piecework/core/parallel.hpp>
#include <piecework/core/random.hpp>

namespace piecework::render {
namespace {

/// Horizontal square of n x n vertices at height y with half side `half`.
void add_square(int n, double half, double y, Positions& positions, Triangles& triangles) {
  const auto base = static_cast<int>(positions.rows());
  positions.conservativeResize(base + n * n, 3);
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      positions.row(base + j * n + i) << half * (2.0 * i / (n - 1) - 1), y,
          half * (2.0 * j / (n - 1) - 1);
    }
  }
  for (int j = 0; j + 1 < n; ++j) {
    for (int i = 0; i + 1 < n; ++i) {
      const int a = base + j * n + i;
      triangles.push_back({a, a + n, a + n + 1});
      triangles.push_back({a, a + n + 1, a + 1});
    }
  }
}

DisplayMesh display(const Positions& positions, const Triangles& triangles) {
  Frame frame;
  frame.positions = &positions;
  frame.triangles = triangles;
  return build_display_mesh(frame, 0);
}

/// Whether a ray from p along d hits triangle (a, b, c): Moeller-Trumbore in double.
bool hits(const Vec3& p, const Vec3& d, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a;
  const Vec3 ac = c - a;
  const Vec3 q = d.cross(ac);
  const double det = ab.dot(q);
  if (std::abs(det) < 1e-12) return false;
  const double u = (p - a).dot(q) / det;
  const Vec3 r = (p - a).cross(ab);
  const double v = d.dot(r) / det;
  return u >= 0 && v >= 0 && u + v <= 1 && ac.dot(r) / det > 1e-6;
}

// Oracle: rays against every triangle. Points whose visibility changes within a cell or two of
// the grid are allowed to differ, so a small share of disagreement is.
TEST(DepthMap, AgreesWithRays) {
  Random random(5);
  Positions positions(90, 3);
  for (Eigen::Index i = 0; i < positions.rows(); i += 3) {
    const Vec3 centre(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    for (Eigen::Index k = 0; k < 3; ++k) {
      for (Eigen::Index c = 0; c < 3; ++c) {
        positions(i + k, c) = centre[c] + random.uniform(-0.35, 0.35);
      }
    }
  }
  Triangles triangles;
  for (int i = 0; i < 90; i += 3) triangles.push_back({i, i + 1, i + 2});
  const DisplayMesh mesh = display(positions, triangles);
  const Vec3 direction = Vec3(0.3, 0.8, -0.5).normalized();
  DepthMap map;
  map.draw(mesh, direction.cast<float>(), 512);
  int differing = 0;
  int hidden = 0;
  constexpr int kPoints = 2000;
  for (int i = 0; i < kPoints; ++i) {
    const Vec3 p(random.uniform(-0.7, 0.7), random.uniform(-0.7, 0.7), random.uniform(-0.7, 0.7));
    for (double sign : {1.0, -1.0}) {
      const bool blocked = std::any_of(triangles.begin(), triangles.end(), [&](const Triangle& t) {
        return hits(p, sign * direction, mesh.positions[t[0]].cast<double>(),
                    mesh.positions[t[1]].cast<double>(), mesh.positions[t[2]].cast<double>());
      });
      const float visible = sign > 0 ? map.visible_from_front(p.cast<float>(), 0)
                                     : map.visible_from_back(p.cast<float>(), 0);
      hidden += blocked ? 1 : 0;
      differing += std::abs(visible - (blocked ? 0.0F : 1.0F)) > 0.5F ? 1 : 0;
    }
  }
  EXPECT_GT(hidden, kPoints / 10);
  EXPECT_LT(differing, kPoints / 50);
}

LightOptions from_above() {
  LightOptions options;
  options.key_direction = {0, 1, 0};
  return options;
}

TEST(Lighting, AnOpenSheetIsUnshadowed) {
  Positions positions(0, 3);
  Triangles triangles;
  add_square(20, 1, 0, positions, triangles);
  for (bool occlusion : {false, true}) {
    LightOptions options = from_above();
    options.ambient_occlusion = occlusion;
    const Lighting light = compute_lighting(display(positions, triangles), options);
    for (const VertexLight& v : light.vertices) {
      EXPECT_EQ(v.key, 255);
      EXPECT_NEAR(v.ambient[0], 255, 2);  // sky on the upper side
      EXPECT_NEAR(v.ambient[1], 0, 2);
      EXPECT_NEAR(v.ambient[2], 0, 2);
      EXPECT_NEAR(v.ambient[3], 255, 2);  // ground on the lower side
    }
    EXPECT_TRUE(light.ground.texels.empty());
  }
}

TEST(Lighting, ARoofTakesTheLight) {
  Positions positions(0, 3);
  Triangles triangles;
  add_square(21, 1, 0, positions, triangles);
  add_square(21, 0.5, 0.3, positions, triangles);
  const Lighting light = compute_lighting(display(positions, triangles), from_above());
  const VertexLight& centre = light.vertices[10 * 21 + 10];
  const VertexLight& corner = light.vertices[0];
  EXPECT_LT(centre.key, 10);
  EXPECT_LT(centre.ambient[0], 130);
  EXPECT_GT(corner.key, 245);
  EXPECT_GT(corner.ambient[0], 220);
  const VertexLight& roof = light.vertices[21 * 21 + 10 * 21 + 10];
  EXPECT_EQ(roof.key, 255);
  EXPECT_GT(roof.ambient[0], 250);
  EXPECT_LT(roof.ambient[3], 130) << "the floor hides the ground from the roof's lower side";
}

int ground_value(const GroundLight& ground, float x, float z, int channel) {
  const int i = static_cast<int>((x - ground.low.x()) / (ground.high.x() - ground.low.x()) *
                                 GroundLight::kSize);
  const int j = static_cast<int>((z - ground.low.y()) / (ground.high.y() - ground.low.y()) *
                                 GroundLight::kSize);
  return ground.texels[static_cast<std::size_t>(2 * (j * GroundLight::kSize + i) + channel)];
}

TEST(Lighting, TheGroundIsDarkUnderTheSheetAndOpenAtTheRim) {
  Positions positions(0, 3);
  Triangles triangles;
  add_square(20, 1, 0, positions, triangles);
  LightOptions options = from_above();
  options.ground_height = -0.4F;
  const GroundLight ground = compute_lighting(display(positions, triangles), options).ground;
  ASSERT_FALSE(ground.texels.empty());
  EXPECT_LT(ground_value(ground, 0, 0, 0), 10);
  EXPECT_LT(ground_value(ground, 0, 0, 1), 130);
  for (int i = 0; i < GroundLight::kSize; ++i) {
    EXPECT_GT(ground.texels[2 * i], 250);
    EXPECT_GT(ground.texels[2 * i + 1], 250);
  }
}

TEST(Lighting, ShadowFallsAwayFromTheLight) {
  Positions positions(0, 3);
  Triangles triangles;
  add_square(20, 1, 0, positions, triangles);
  LightOptions options;
  options.key_direction = Vec3f(1, 1, 0).normalized();
  options.ambient_occlusion = false;
  options.ground_height = -1.0F;
  const GroundLight ground = compute_lighting(display(positions, triangles), options).ground;
  EXPECT_LT(ground_value(ground, -1, 0, 0), 20);
  EXPECT_GT(ground_value(ground, 0.4F, 0, 0), 240);
  EXPECT_EQ(ground_value(ground, -1, 0, 1), 255) << "no ambient occlusion was asked for";
}

TEST(Lighting, SameBitsForEveryThreadCount) {
  Positions positions(0, 3);
  Triangles triangles;
  add_square(40, 1, 0, positions, triangles);
  add_square(30, 0.6, 0.2, positions, triangles);
  const DisplayMesh mesh = display(positions, triangles);
  LightOptions options = from_above();
  options.ground_height = -0.2F;
  const Lighting reference = ThreadPool(1).run([&] { return compute_lighting(mesh, options); });
  for (int threads : {2, 8}) {
    const Lighting other = ThreadPool(threads).run([&] { return compute_lighting(mesh, options); });
    EXPECT_TRUE(other.ground.texels == reference.ground.texels);
    ASSERT_EQ(other.vertices.size(), reference.vertices.size());
    for (std::size_t v = 0; v < other.vertices.size(); ++v) {
      EXPECT_EQ(other.vertices[v].key, reference.vertices[v].key);
      EXPECT_EQ(other.vertices[v].ambient, reference.vertices[v].ambient);
    }
  }
}

}  // namespace
}  // namespace piecework::render
