#include <piecework/collision/intersections.hpp>

#include <gmpxx.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/core/random.hpp>
#include <piecework/mesh/generate.hpp>
#include <piecework/mesh/import.hpp>

namespace piecework::collision {
namespace {

using Rational = std::array<mpq_class, 3>;

mpq_class dot(const Rational& a, const Rational& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

Rational combination(const mpq_class& s, const Rational& a, const mpq_class& t, const Rational& b) {
  Rational sum;
  for (std::size_t k = 0; k < 3; ++k) sum[k] = s * a[k] + t * b[k];
  return sum;
}

/// Segment and triangle are apart if and only if the six differences of their points all lie in an
/// open half space with the origin on its border. The point of the differences' hull closest to the
/// origin gives its direction, and is the foot of the perpendicular on a point, line or plane
/// through one to three of them. All of that in rational numbers, without a case for any
/// degeneracy.
bool meet_by_definition(const std::array<Vec3, 2>& segment, const std::array<Vec3, 3>& triangle) {
  std::vector<Rational> d;
  for (const Vec3& p : segment)
    for (const Vec3& q : triangle)
      d.push_back({mpq_class(mpq_class(p[0]) - mpq_class(q[0])),
                   mpq_class(mpq_class(p[1]) - mpq_class(q[1])),
                   mpq_class(mpq_class(p[2]) - mpq_class(q[2]))});
  const auto separates = [&](const Rational& direction) {
    return std::all_of(d.begin(), d.end(),
                       [&](const Rational& x) { return dot(direction, x) > 0; });
  };
  for (const Rational& a : d)
    for (const Rational& b : d)
      for (const Rational& c : d) {
        const Rational u = combination(1, b, -1, a), v = combination(1, c, -1, a);
        // Gram-Schmidt, without divisions: a minus its parts along u and along v.
        const mpq_class uu = dot(u, u);
        const bool line = uu != 0;
        const Rational v1 = line ? combination(uu, v, -dot(u, v), u) : v;
        const Rational a1 = line ? combination(uu, a, -dot(u, a), u) : a;
        const mpq_class vv = dot(v1, v1);
        if (separates(vv != 0 ? combination(vv, a1, -dot(v1, a1), v1) : a1)) return false;
      }
  return true;
}

std::vector<Intersection> by_definition(const Surface& surface, const Positions& x) {
  std::vector<Intersection> found;
  for (std::size_t e = 0; e < surface.edges.size(); ++e)
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
      const auto& edge = surface.edges[e];
      const Triangle& corners = surface.triangles[t];
      const bool shared = std::any_of(edge.begin(), edge.end(), [&](int v) {
        return std::find(corners.begin(), corners.end(), v) != corners.end();
      });
      const bool cloth_e = edge[0] < surface.num_cloth_vertices;
      const bool cloth_t = corners[0] < surface.num_cloth_vertices;
      if (shared || (cloth_e == cloth_t && !(cloth_e && surface.self))) continue;
      if (meet_by_definition({x.row(edge[0]), x.row(edge[1])},
                             {x.row(corners[0]), x.row(corners[1]), x.row(corners[2])}))
        found.push_back({static_cast<int>(e), static_cast<int>(t)});
    }
  return found;
}

Surface random_surface(Random& random) {
  const auto triangles = [&](int count, int vertices) {
    const auto vertex = [&] { return static_cast<int>(random.uniform() * vertices); };
    Triangles result;
    for (int i = 0; i < count; ++i) result.push_back({vertex(), vertex(), vertex()});
    return result;
  };
  const int cloth = 6 + static_cast<int>(random.uniform() * 6);
  const int obstacle = static_cast<int>(random.uniform() * 5);
  return make_surface(triangles(4, cloth), cloth, triangles(obstacle > 0 ? 2 : 0, obstacle),
                      obstacle, random.uniform() < 0.7);
}

/// Points of a grid of `steps` per axis (0: anywhere); a flat scene has all its points in one
/// plane.
Positions random_positions(Random& random, int count, int steps, bool flat) {
  Positions x(count, 3);
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double r = random.uniform();
    x.data()[i] = steps > 0 ? std::floor(r * steps) : r;
  }
  if (flat) x.col(2) = x.col(0) + 2 * x.col(1);
  return x;
}

// On coarse grids most pairs touch at a vertex, lie in one plane or are degenerate; triangles that
// name a vertex twice are segments and points.
TEST(Intersections, AreThoseOfTheDefinitionInRationalNumbers) {
  Random random(5);
  std::size_t hits = 0, misses = 0;
  for (int scene = 0; scene < 200; ++scene) {
    SCOPED_TRACE(scene);
    const Surface surface = random_surface(random);
    const int steps = std::array{0, 2, 3, 5}[static_cast<std::size_t>(scene) % 4];
    Positions x = random_positions(random, surface.num_vertices, steps, scene % 8 >= 5);
    if (scene % 3 == 0) x *= std::pow(10.0, random.uniform(-12, 12));
    const auto expected = by_definition(surface, x);
    EXPECT_EQ(find_intersections(surface, x).size(), expected.size());
    EXPECT_TRUE(find_intersections(surface, x) == expected);
    hits += expected.size();
    misses += surface.edges.size() * surface.triangles.size() - expected.size();
  }
  EXPECT_GT(hits, 1000U);
  EXPECT_GT(misses, 1000U);
}

Surface alone(const mesh::TriangleMesh& mesh) {
  return make_surface(mesh.triangles, mesh.num_vertices(), {}, 0, true);
}

// One of everything that the exact decision knows, with coordinates that are no round numbers.
TEST(Intersections, KnowsEveryKindOfTouching) {
  const Vec3 a(0.1, 0.2, 0.3), b(1.1, 0.2, 0.3), c(0.1, 1.2, 0.3), up(0, 0, 0.7);
  const auto count = [](const std::array<Vec3, 2>& segment, const std::array<Vec3, 3>& triangle) {
    const Surface surface = make_surface({{0, 1, 1}}, 2, {{0, 1, 2}}, 3, false);
    Positions x(5, 3);
    x << segment[0].transpose(), segment[1].transpose(), triangle[0].transpose(),
        triangle[1].transpose(), triangle[2].transpose();
    std::size_t result = 0;
    for (const Intersection& i : find_intersections(surface, x)) result += i.edge == 0 ? 1 : 0;
    return result;
  };
  const std::array<Vec3, 3> t{a, b, c};
  const Vec3 inside = 0.25 * a + 0.25 * b + 0.5 * c;
  EXPECT_EQ(count({inside - up, inside + up}, t), 1U);      // through
  EXPECT_EQ(count({inside + up, inside + 2 * up}, t), 0U);  // above
  EXPECT_EQ(count({a - up, a + up}, t), 1U);                // through a corner
  EXPECT_EQ(count({a, a + up}, t), 1U);                     // an end on a corner
  EXPECT_EQ(count({b + Vec3(1e-16, 0, 0) + up, b + up}, t), 0U);
  EXPECT_EQ(count({c, b}, t), 1U);                                      // along a side
  EXPECT_EQ(count({a - (b - a), a}, t), 1U);                            // ahead of a side, touching
  EXPECT_EQ(count({a - (b - a), a - 0.5 * (b - a)}, t), 0U);            // ahead of a side, apart
  EXPECT_EQ(count({Vec3(0.2, 0.3, 0.3), Vec3(0.3, 0.4, 0.3)}, t), 1U);  // wholly inside
  EXPECT_EQ(count({Vec3(-1, 0.5, 0.3), Vec3(2, 0.5, 0.3)}, t), 1U);     // across, in the plane
  EXPECT_EQ(count({Vec3(1, 1, 0.3), Vec3(2, 1, 0.3)}, t), 0U);          // beside, in the plane
  EXPECT_EQ(count({a, a}, t), 1U);                                      // a point on a corner
  EXPECT_EQ(count({a, a}, {a, a, a}), 1U);                              // two points
  EXPECT_EQ(count({a - up, a + up}, {a, b, b}), 1U);  // triangle that is a segment
  EXPECT_EQ(count({a - up, a + up}, {b, c, c}), 0U);
}

// Triangles of very different sizes: some are kept outside the grid, some edges cross all of it.
TEST(Intersections, AreFoundAmongElementsOfAllSizes) {
  Random random(9);
  std::size_t hits = 0;
  for (int scene = 0; scene < 8; ++scene) {
    SCOPED_TRACE(scene);
    const int count = 60;
    Triangles triangles;
    for (int i = 0; i < count; ++i) triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    const Surface surface = make_surface(triangles, 3 * count, {}, 0, true);
    Positions x = random_positions(random, 3 * count, scene % 2 == 0 ? 0 : 9, false);
    if (scene % 2 != 0) x /= 9;
    for (Eigen::Index i = 0; i < count; ++i)
      if (i % 8 != 0)  // seven of eight are small
        for (Eigen::Index k = 1; k < 3; ++k)
          x.row(3 * i + k) = x.row(3 * i) + 0.02 * (x.row(3 * i + k) - x.row(3 * i));
    const auto expected = by_definition(surface, x);
    EXPECT_TRUE(find_intersections(surface, x) == expected);
    hits += expected.size();
  }
  EXPECT_GT(hits, 100U);
}

// All neighbours of an edge lie in its plane; that must not need rational numbers for each.
TEST(Intersections, FlatSheetHasNoneAndTwoHaveMany) {
  const mesh::TriangleMesh sheet =
      mesh::generate(mesh::GeneratorKind::Sheet, {.columns = 150, .rows = 150}).mesh;
  EXPECT_TRUE(find_intersections(alone(sheet), sheet.positions).empty());

  Surface twice = make_surface(sheet.triangles, 22500, sheet.triangles, 22500, false);
  Positions x(45000, 3);
  x << sheet.positions, sheet.positions;
  for (Eigen::Index v = 22500; v < 45000; ++v)  // upright, across the middle of the other
    x.row(v) = Eigen::RowVector3d(0.503, x(v, 0) - 0.5012, x(v, 2));
  const std::vector<Intersection> found = find_intersections(twice, x);
  EXPECT_GT(found.size(), 200U);
  for (const int threads : {1, 2, 3, 8}) {
    ThreadPool pool(threads);
    EXPECT_TRUE(pool.run([&] { return find_intersections(twice, x); }) == found);
  }
}

TEST(Intersections, RefusesPositionsThatAreNone) {
  const Surface surface = make_surface({{0, 1, 2}}, 3, {}, 0, true);
  Positions x = Positions::Zero(3, 3);
  EXPECT_TRUE(find_intersections(surface, x).empty());
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity(), -1.1e100}) {
    x(1, 2) = bad;
    try {
      find_intersections(surface, x);
      ADD_FAILURE() << bad;
    } catch (const SimulationError& error) {
      EXPECT_NE(std::string(error.what()).find("vertex 1"), std::string::npos) << error.what();
    }
  }
}

// Closed bodies that are known to be clean: none alone, many against a copy pushed into them.
TEST(Intersections, RealMeshes) {
  const auto folder = std::filesystem::path(PIECEWORK_SHARED_DATA) / "colliders";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << folder.string() << " is absent";
  for (const char* name : {"spot.obj", "bunny_watertight_simplified.obj"}) {
    SCOPED_TRACE(name);
    const mesh::TriangleMesh body = mesh::import_mesh(folder / name, {}).mesh;
    EXPECT_EQ(find_intersections(alone(body), body.positions).size(), 0U);

    const int n = body.num_vertices();
    const Surface both = make_surface(body.triangles, n, body.triangles, n, true);
    const Eigen::RowVector3d size =
        body.positions.colwise().maxCoeff() - body.positions.colwise().minCoeff();
    Positions x(2 * n, 3);
    x << body.positions, body.positions.rowwise() + 0.1234 * size;
    const std::vector<Intersection> found = find_intersections(both, x);
    EXPECT_GT(found.size(), 100U);
    for (const Intersection& i : found)
      EXPECT_NE(both.is_cloth(both.edges[static_cast<std::size_t>(i.edge)][0]),
                both.is_cloth(both.triangles[static_cast<std::size_t>(i.triangle)][0]));
    x.bottomRows(n) = body.positions.rowwise() + 1.01 * size;  // apart
    EXPECT_TRUE(find_intersections(both, x).empty());
  }
}

}  // namespace
}  // namespace piecework::collision
