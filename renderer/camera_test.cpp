#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include <renderer/renderer.hpp>

#include <piecework/core/error.hpp>

namespace piecework::render {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// Picture coordinates in [-1, 1] by rotation matrices and similar triangles: shares nothing with
/// the code under test.
Vec2 project(const Camera& camera, double aspect, const Vec3& p) {
  const Vec3 z = (camera.eye - camera.target).normalized();
  const Vec3 x = camera.up.cross(z).normalized();
  const Vec3 y = z.cross(x);
  const Vec3 d = p - camera.eye;
  const double depth = -d.dot(z);
  EXPECT_GT(depth, 0) << "behind the eye";
  const double half = std::tan(camera.fov_degrees * kPi / 360.0);
  return {d.dot(x) / depth / (half * aspect), d.dot(y) / depth / half};
}

double reach(const Camera& camera, double aspect, const Vec3& low, const Vec3& high) {
  double largest = 0;
  for (int i = 0; i < 8; ++i) {
    const Vec3 corner((i & 1) != 0 ? low.x() : high.x(), (i & 2) != 0 ? low.y() : high.y(),
                      (i & 4) != 0 ? low.z() : high.z());
    largest = std::max(largest, project(camera, aspect, corner).cwiseAbs().maxCoeff());
  }
  return largest;
}

TEST(FrameBox, FitsAllCornersTightly) {
  struct Box {
    Vec3 low, high;
  };
  for (const Box& box : {Box{{-1, -1, -1}, {1, 1, 1}}, Box{{0, 0, 0}, {4, 0.01, 1}},
                         Box{{100, 50, -3}, {101, 58, -2}}, Box{{-2e-3, 0, 0}, {1e-3, 1e-3, 0}}}) {
    for (double azimuth : {0.0, 35.0, -120.0, 270.0}) {
      for (double elevation : {-90.0, -20.0, 0.0, 30.0, 89.0, 90.0}) {
        for (double aspect : {0.5, 16.0 / 9.0}) {
          SCOPED_TRACE(testing::Message() << azimuth << " " << elevation << " " << aspect);
          const Camera camera = frame_box(box.low, box.high, aspect, azimuth, elevation, 35);
          const double filled = reach(camera, aspect, box.low, box.high);
          EXPECT_LE(filled, 0.95);
          EXPECT_GE(filled, 0.80);
        }
      }
    }
  }
}

TEST(FrameBox, LooksFromTheGivenDirection) {
  const Camera front = frame_box({-1, -1, -1}, {1, 1, 1}, 1, 0, 0, 40);
  EXPECT_GT(front.eye.z(), 1);
  EXPECT_NEAR(front.eye.x(), 0, 1e-12);
  const Camera right = frame_box({-1, -1, -1}, {1, 1, 1}, 1, 90, 0, 40);
  EXPECT_GT(right.eye.x(), 1);
  const Camera above = frame_box({-1, -1, -1}, {1, 1, 1}, 1, 0, 45, 40);
  EXPECT_GT(above.eye.y(), 1);
}

TEST(FrameBox, FramesAPoint) {
  const Camera camera = frame_box({1, 2, 3}, {1, 2, 3}, 1.5, 20, 10, 35);
  EXPECT_NEAR(project(camera, 1.5, {1, 2, 3}).norm(), 0, 1e-9);
  EXPECT_GT((camera.eye - camera.target).norm(), 0.1);
}

TEST(FrameBox, RejectsWhatCannotBeFramed) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_THROW(frame_box({0, 0, 0}, {-1, 1, 1}, 1, 0, 0, 35), InputError);
  EXPECT_THROW(frame_box({nan, 0, 0}, {1, 1, 1}, 1, 0, 0, 35), InputError);
  EXPECT_THROW(frame_box({0, 0, 0}, {inf, 1, 1}, 1, 0, 0, 35), InputError);
  EXPECT_THROW(frame_box({0, 0, 0}, {1, 1, 1}, 0, 0, 0, 35), InputError);
  EXPECT_THROW(frame_box({0, 0, 0}, {1, 1, 1}, 1, nan, 0, 35), InputError);
  EXPECT_THROW(frame_box({0, 0, 0}, {1, 1, 1}, 1, 0, 0, 0), InputError);
  EXPECT_THROW(frame_box({0, 0, 0}, {1, 1, 1}, 1, 0, 0, 180), InputError);
}

}  // namespace
}  // namespace piecework::render
