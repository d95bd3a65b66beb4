#include <piecework/collision/intersections.hpp>

#include <gmpxx.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

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

}  // namespace
}  // namespace piecework::collision
