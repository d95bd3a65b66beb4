// Exact solids and their triangles as what cloth meets: what is cut by edges, and what waits.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <piecework/scene/scene_io.hpp>

#include "course_test_util.hpp"

namespace piecework::runner {
namespace {

/// A square sheet of side 0.6 m in the plane y = 0 about the origin, and one collider.
scene::Scene sheet_and(const std::string& collider, int side, const std::string& pins) {
  return scene::parse_scene(fmt::format(R"({{"name": "s", "solver": {{"domains": 2}},
      "self_collision": true, "friction": 0.3,
      "materials": {{"m": {{"stretching": 261, "bending": 1e-5}}}},
      "cloths": [{{"material": "m", "translate": [-0.3, 0, -0.3], "pins": [{}],
        "mesh": {{"generator": "sheet", "width": 0.6, "height": 0.6, "columns": {}, "rows": {}}}}}],
      "colliders": [{}]}})",
                                        pins, side, side, collider),
                            "s.json");
}

/// How long the part of a segment is that lies inside of the cube of half side `half` about the
/// origin, by slabs [Kay and Kajiya 1986].
double length_inside(const Vec3& a, const Vec3& b, double half) {
  double begin = 0, end = 1;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double way = b[axis] - a[axis];
    if (way == 0 && std::abs(a[axis]) > half) return 0;
    if (way == 0) continue;
    const double t0 = (-half - a[axis]) / way, t1 = (half - a[axis]) / way;
    begin = std::max(begin, std::min(t0, t1));
    end = std::min(end, std::max(t0, t1));
  }
  return std::max(0.0, end - begin) * (b - a).norm();
}

/// A cube that stands on a corner, the opposite one 2 mm below the middle of a cell of the sheet.
constexpr double kHalf = 0.1;

std::string cube(const std::string& surface) {
  return fmt::format(R"({{"name": "cube", "shape": "box", "size": [{0}, {0}, {0}],
                          "rotate": [-45, 0, {1}], "translate": [0, {2}, 0], "surface": "{3}"}})",
                     2 * kHalf, std::atan(std::sqrt(0.5)) * 180 / std::numbers::pi,
                     -0.002 - std::sqrt(3.0) * kHalf, surface);
}

/// Edges of cloth that pass through the cube when the sheet has fallen on it.
int edges_through_cube(const std::string& surface) {
  const auto exact = build_world(sheet_and(cube("exact"), 6, ""));
  const Eigen::Isometry3d to_cube = exact->analytic_colliders.at(0).pose(0).inverse();
  EXPECT_NEAR((to_cube.inverse() * Vec3::Constant(kHalf)).y(), -0.002, 1e-12) << "on its corner";
  const auto world = build_world(sheet_and(cube(surface), 6, ""));
  const Course course = run(*world, 25);
  EXPECT_GT(course.most_pairs, 0);
  int through = 0;
  for (const Triangle& t : world->model.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 a = course.end.x.row(t[k]).transpose();
      const Vec3 b = course.end.x.row(t[(k + 1) % 3]).transpose();
      through += length_inside(to_cube * a, to_cube * b, kHalf) > 1e-6;
    }
  return through;
}

TEST(BodySurfaces, CoarseClothIsCutByTheCornerOfAnExactBoxButNotByItsTriangles) {
  EXPECT_GT(edges_through_cube("exact"), 3) << "the limit that docs/contact.md states";
  EXPECT_EQ(edges_through_cube("triangles"), 0);
}

/// A ball rises into a sheet that is pinned at its border, in a frame too narrow for the ball.
Course push(const std::string& surface) {
  const std::string ball = R"({"name": "ball", "shape": "sphere", "center": [0, -0.41, 0],
      "radius": 0.4, "motion": {"velocity": [0, 0.8, 0]}, "surface": ")" +
                           surface + (surface == "triangles" ? R"(", "segments": 6})" : R"("})");
  const auto world = build_world(sheet_and(ball, 13, R"({"region": {"sets": ["border"]}})"));
  const Course course = run(*world, 30);
  EXPECT_GT(course.most_pairs, 20);
  return course;
}

TEST(BodySurfaces, ABallOfTrianglesWaitsWhereAnExactOneGoesOn) {
  EXPECT_GT(push("exact").interpenetrations, 0) << "the limit that docs/contact.md states";
  const Course waiting = push("triangles");
  EXPECT_EQ(waiting.interpenetrations, 0);
  EXPECT_GT(waiting.waits, 0);
  EXPECT_GT(waiting.end.x.col(1).maxCoeff(), 0.05) << "it pushed the cloth up";
}

}  // namespace
}  // namespace piecework::runner
