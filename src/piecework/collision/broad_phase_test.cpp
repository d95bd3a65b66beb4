#include <piecework/collision/broad_phase.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include <piecework/core/parallel.hpp>
#include <piecework/core/random.hpp>
#include <piecework/mesh/generate.hpp>

namespace piecework::collision {
namespace {

using Boxes = std::vector<VertexBox>;

/// Every pair of elements looked at by its definition: nothing is shared with the trees.
struct BruteForce {
  const Surface& surface;
  const Boxes& boxes;
  double gap;

  template <class A, class B>
  [[nodiscard]] bool is_pair(const A& a, const B& b) const {
    for (const int v : a)
      if (std::find(b.begin(), b.end(), v) != b.end()) return false;
    const bool cloth_a = a[0] < surface.num_cloth_vertices;
    const bool cloth_b = b[0] < surface.num_cloth_vertices;
    if (cloth_a == cloth_b && !(cloth_a && surface.self)) return false;
    for (int axis = 0; axis < 3; ++axis) {
      const auto [low_a, high_a] = range(a, axis);
      const auto [low_b, high_b] = range(b, axis);
      if (low_a - high_b > gap || low_b - high_a > gap) return false;
    }
    return true;
  }

  template <class Element>
  [[nodiscard]] std::pair<double, double> range(const Element& element, int axis) const {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const int v : element) {
      low = std::min(low, boxes[static_cast<std::size_t>(v)].low[axis]);
      high = std::max(high, boxes[static_cast<std::size_t>(v)].high[axis]);
    }
    return {low, high};
  }

  [[nodiscard]] CandidatePairs find() const {
    CandidatePairs result;
    const auto num_edges = static_cast<int>(surface.edges.size());
    for (int v = 0; v < surface.num_vertices; ++v)
      for (std::size_t t = 0; t < surface.triangles.size(); ++t)
        if (is_pair(std::array{v}, surface.triangles[t]))
          result.vertex_triangle.push_back({v, static_cast<int>(t)});
    for (int e = 0; e < num_edges; ++e)
      for (int f = e + 1; f < num_edges; ++f)
        if (is_pair(surface.edges[static_cast<std::size_t>(e)],
                    surface.edges[static_cast<std::size_t>(f)]))
          result.edge_edge.push_back({e, f});
    return result;
  }
};

/// Looks for pairs and compares them with brute force, order included; returns how many there are.
std::size_t expect_brute_force(BroadPhase& broad, const Boxes& boxes, double gap) {
  const CandidatePairs expected = BruteForce{broad.surface(), boxes, gap}.find();
  const CandidatePairs& found = broad.find(boxes, gap);
  EXPECT_TRUE(found.vertex_triangle == expected.vertex_triangle)
      << found.vertex_triangle.size() << " pairs, " << expected.vertex_triangle.size();
  EXPECT_TRUE(found.edge_edge == expected.edge_edge)
      << found.edge_edge.size() << " pairs, " << expected.edge_edge.size();
  return expected.vertex_triangle.size() + expected.edge_edge.size();
}

Triangles random_triangles(Random& random, int count, int num_vertices) {
  const auto vertex = [&] { return static_cast<int>(random.uniform() * num_vertices); };
  Triangles result;
  for (int i = 0; i < count; ++i) result.push_back({vertex(), vertex(), vertex()});
  return result;
}

/// Boxes about points of a cube of the given side, some of no size.
Boxes random_boxes(Random& random, int count, double side, double size, const Vec3& centre) {
  Boxes boxes;
  const auto between = [&](double low, double high) {
    return Vec3(random.uniform(low, high), random.uniform(low, high), random.uniform(low, high));
  };
  for (int i = 0; i < count; ++i) {
    const Vec3 low = centre + between(0, side);
    const double width = random.uniform() < 0.3 ? 0 : size;
    boxes.push_back({low, low + between(0, width)});
  }
  return boxes;
}

Surface random_surface(Random& random) {
  const int cloth = 3 + static_cast<int>(random.uniform() * 60);
  const int obstacle = static_cast<int>(random.uniform() * 40);
  const int obstacle_triangles = obstacle > 0 ? static_cast<int>(random.uniform() * 40) : 0;
  return make_surface(random_triangles(random, static_cast<int>(random.uniform() * 80), cloth),
                      cloth, random_triangles(random, obstacle_triangles, obstacle), obstacle,
                      random.uniform() < 0.7);
}

// Random triangles repeat each other, name vertices twice and have edges with many triangles.
TEST(BroadPhase, FindsThePairsOfBruteForceInRandomScenes) {
  Random random(3);
  std::size_t pairs = 0;
  for (int scene = 0; scene < 1000; ++scene) {
    SCOPED_TRACE(scene);
    const Surface surface = random_surface(random);
    BroadPhase broad(surface);
    const double scale = std::pow(10.0, random.uniform(-6, 6));
    const Vec3 centre = scene % 3 == 0 ? Vec3(1e3 * scale, 0, -scale) : Vec3::Zero();
    const Boxes boxes = random_boxes(random, surface.num_vertices, scale, 0.2 * scale, centre);
    pairs += expect_brute_force(broad, boxes, scene % 4 == 0 ? 0.0 : 0.1 * scale);
  }
  EXPECT_GT(pairs, 100000U);
}

}  // namespace
}  // namespace piecework::collision
