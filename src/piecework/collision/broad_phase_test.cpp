#include <piecework/collision/broad_phase.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include <piecework/core/error.hpp>
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

/// A sheet of 1 m, crumpled by waves: `turn` changes which parts of it are close to each other.
Boxes crumpled(const mesh::TriangleMesh& sheet, double turn) {
  Boxes boxes;
  for (Eigen::Index v = 0; v < sheet.positions.rows(); ++v) {
    const double a = sheet.positions(v, 0), b = sheet.positions(v, 2);
    const Vec3 x(0.2 * std::sin(9 * a + turn) + 0.1 * std::cos(7 * b),
                 0.2 * std::cos(8 * b * (1 + turn) - 3 * a),
                 0.2 * std::sin(6 * (a - b) * (1 + turn) + 1));
    boxes.push_back({x - Vec3::Constant(1e-3), x + Vec3(0.004, 0.001, 0.002)});
  }
  return boxes;
}

mesh::TriangleMesh sheet_of(int side) {
  return mesh::generate(mesh::GeneratorKind::Sheet, {.columns = side, .rows = side}).mesh;
}

Surface cloth_alone(const mesh::TriangleMesh& sheet) {
  return make_surface(sheet.triangles, sheet.num_vertices(), {}, 0, true);
}

TEST(BroadPhase, RefitsWhileThatIsGoodAndRebuildsWhenItIsNot) {
  const mesh::TriangleMesh sheet = sheet_of(40);
  BroadPhase broad(cloth_alone(sheet));
  int refits = 0, rebuilds = 0;
  for (int call = 0; call < 24; ++call) {
    SCOPED_TRACE(call);
    const double turn = call < 12 ? 0.001 * call : 0.4 * (call - 11);
    EXPECT_GT(expect_brute_force(broad, crumpled(sheet, turn), 0.01), 1000U);
    ++(broad.report().rebuilt ? rebuilds : refits);
    if (call < 12) {
      EXPECT_EQ(broad.report().rebuilt, call == 0);
    }
  }
  EXPECT_GE(refits, 11);
  EXPECT_GE(rebuilds, 3);
}

TEST(BroadPhase, GoesByTheBoxesOfThisCallWhicheverBodyMoved) {
  const mesh::TriangleMesh sheet = sheet_of(12);
  BroadPhase broad(make_surface(sheet.triangles, sheet.num_vertices(), sheet.triangles,
                                sheet.num_vertices(), true));
  std::size_t fewest = 1000000, most = 0;
  for (int call = 0; call < 30; ++call) {
    SCOPED_TRACE(call);
    // Cloth moves, obstacle moves, both rest, both jump.
    const double cloth = call / 4 * 0.05, obstacle = (call + 3) / 4 % 7 * 0.1;
    Boxes boxes = crumpled(sheet, 0.1 * cloth);
    for (const VertexBox& box : crumpled(sheet, 0)) {
      const Vec3 shift(call < 20 ? obstacle : 100 * obstacle, 0, 0);
      boxes.push_back({box.low + shift, box.high + shift});
    }
    const std::size_t pairs = expect_brute_force(broad, boxes, 0.02);
    fewest = std::min(fewest, pairs);
    most = std::max(most, pairs);
  }
  EXPECT_GT(most, fewest + 1000);
}

TEST(BroadPhase, SamePairsForEveryNumberOfThreads) {
  const mesh::TriangleMesh sheet = sheet_of(90);
  CandidatePairs first;
  std::size_t tests = 0;
  for (const int threads : {1, 2, 3, 8}) {
    SCOPED_TRACE(threads);
    ThreadPool pool(threads);
    BroadPhase broad(cloth_alone(sheet));
    for (const double turn : {0.0, 0.001, 1.5}) {
      const Boxes boxes = crumpled(sheet, turn);
      pool.run([&] { broad.find(boxes, 0.005); });
    }
    const CandidatePairs& pairs = broad.find(crumpled(sheet, 1.5), 0.005);
    if (threads == 1) first = pairs, tests = broad.report().box_tests;
    EXPECT_TRUE(pairs.vertex_triangle == first.vertex_triangle);
    EXPECT_TRUE(pairs.edge_edge == first.edge_edge);
    EXPECT_EQ(broad.report().box_tests, tests);
  }
  EXPECT_GT(first.vertex_triangle.size(), 10000U);
  EXPECT_TRUE(std::is_sorted(first.edge_edge.begin(), first.edge_edge.end()));
  EXPECT_TRUE(std::is_sorted(first.vertex_triangle.begin(), first.vertex_triangle.end()));
}

// Boxes on a lattice whose cells are as wide as the gap: every comparison is a tie, or one rounding
// away from it, so that single precision can decide none of them.
TEST(BroadPhase, DecidesTiesAsDoublesDo) {
  Random random(17);
  std::size_t pairs = 0;
  for (const double far : {0.0, 1.0, 1e3, 1e7})
    for (int scene = 0; scene < 25; ++scene) {
      SCOPED_TRACE(scene);
      const Surface surface = random_surface(random);
      const double gap = 1e-3;
      Boxes boxes;
      for (int v = 0; v < surface.num_vertices; ++v) {
        VertexBox box;
        for (int axis = 0; axis < 3; ++axis) {
          double x = far + gap * std::floor(random.uniform(0, 6));
          const double kind = random.uniform();
          if (kind < 0.3) x = std::nextafter(x, -1e30);
          if (kind > 0.7) x = std::nextafter(x, 1e30);
          box.low[axis] = box.high[axis] = x;
        }
        boxes.push_back(box);
      }
      BroadPhase broad(surface);
      pairs += expect_brute_force(broad, boxes, gap);
    }
  EXPECT_GT(pairs, 10000U);
}

Boxes points(const std::vector<Vec3>& places) {
  Boxes boxes;
  for (const Vec3& x : places) boxes.push_back({x, x});
  return boxes;
}

TEST(BroadPhase, HandlesCoincidentVertices) {
  Random random(23);
  const Surface surface =
      make_surface(random_triangles(random, 60, 30), 30, random_triangles(random, 20, 9), 9, true);
  for (const double x : {0.0, 0.3, -1e7, 1e30, 1e100}) {
    SCOPED_TRACE(x);
    BroadPhase broad(surface);
    const Boxes boxes = points(std::vector<Vec3>(39, Vec3::Constant(x)));
    EXPECT_GT(expect_brute_force(broad, boxes, 0), 1000U);
    EXPECT_GT(expect_brute_force(broad, boxes, 1e-300), 1000U);
  }
}

TEST(BroadPhase, HandlesTheFewestElements) {
  const Vec3 o(0, 0, 0), a(1, 0, 0), b(0, 1, 0), near(0.3, 0.3, 0.1);
  BroadPhase nothing(make_surface({}, 0, {}, 0, true));
  EXPECT_EQ(expect_brute_force(nothing, {}, 1), 0U);
  BroadPhase vertices(make_surface({}, 2, {}, 0, true));
  EXPECT_EQ(expect_brute_force(vertices, points({o, a}), 1), 0U);
  BroadPhase triangle(make_surface({{0, 1, 2}}, 3, {}, 0, true));
  EXPECT_EQ(expect_brute_force(triangle, points({o, a, b}), 10), 0U);
  BroadPhase with_vertex(make_surface({{0, 1, 2}}, 4, {}, 0, true));
  EXPECT_EQ(expect_brute_force(with_vertex, points({o, a, b, near}), 0.2), 1U);
  BroadPhase on_obstacle(make_surface({}, 1, {{0, 1, 2}}, 3, false));
  EXPECT_EQ(expect_brute_force(on_obstacle, points({near, o, a, b}), 0.2), 1U);
  BroadPhase obstacles(make_surface({}, 0, {{0, 1, 2}, {1, 2, 3}, {1, 2, 3}}, 4, true));
  EXPECT_EQ(expect_brute_force(obstacles, points({o, a, b, near}), 10), 0U);
}

TEST(BroadPhase, FindsNoPairsOfClothWithoutSelf) {
  const mesh::TriangleMesh sheet = sheet_of(10);
  Surface surface = make_surface(sheet.triangles, 100, {{0, 1, 2}}, 3, false);
  Boxes boxes = crumpled(sheet, 0);
  for (std::size_t v : {std::size_t{40}, std::size_t{50}, std::size_t{60}})
    boxes.push_back(boxes[v]);
  BroadPhase broad(surface);
  const std::size_t without = expect_brute_force(broad, boxes, 0.05);
  surface.self = true;
  BroadPhase with(surface);
  EXPECT_GT(without, 10U);
  EXPECT_GT(expect_brute_force(with, boxes, 0.05), without + 100);
}

// A floor is far larger than the cloth, and far from the origin; single precision must not suffer.
TEST(BroadPhase, HandlesObstaclesOfAnySize) {
  const mesh::TriangleMesh sheet = sheet_of(15);
  for (const double size : {1e-9, 1.0, 1e6, 1e99}) {
    SCOPED_TRACE(size);
    BroadPhase broad(make_surface(sheet.triangles, 225, {{0, 1, 2}, {0, 2, 3}}, 4, true));
    Boxes boxes = crumpled(sheet, 0);
    for (const auto& [x, z] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
      const Vec3 corner(size * x, -0.1, size * z);
      boxes.push_back({corner, corner});
    }
    EXPECT_GT(expect_brute_force(broad, boxes, 0.01), 500U);
    EXPECT_GT(expect_brute_force(broad, boxes, 1e50), 500U);
  }
}

// More elements than there are ranks: several ids share one. Cloth and obstacle must agree on them.
TEST(BroadPhase, FindsPairsOfElementsWithLargeNumbers) {
  const mesh::TriangleMesh large = sheet_of(200), small = sheet_of(12);
  const Surface surface =
      make_surface(large.triangles, large.num_vertices(), small.triangles, 144, true);
  ASSERT_GT(surface.edges.size(), 100000U);
  Boxes boxes;
  for (Eigen::Index v = 0; v < large.positions.rows(); ++v) {
    const Vec3 x = large.positions.row(v);
    boxes.push_back({x, x + Vec3(0, 0.01, 0)});
  }
  for (Eigen::Index v = 0; v < small.positions.rows(); ++v) {
    const Vec3 x = Vec3(0.7, 0.012, 0.6) + 0.1 * small.positions.row(v).transpose();
    boxes.push_back({x, x});
  }
  // Brute force among what comes near the small one.
  Surface part = surface;
  part.triangles.clear();
  part.edges.clear();
  std::vector<int> number;
  for (std::size_t e = 0; e < surface.edges.size(); ++e) {
    const VertexBox& box = boxes[static_cast<std::size_t>(surface.edges[e][0])];
    const bool near = box.low[0] > 0.65 && box.low[0] < 0.85 && box.low[2] > 0.55;
    if (near) part.edges.push_back(surface.edges[e]), number.push_back(static_cast<int>(e));
  }
  const auto is_cross = [](const Surface& s, const PairIndex& pair) {
    return s.is_cloth(s.edges[static_cast<std::size_t>(pair.a)][0]) !=
           s.is_cloth(s.edges[static_cast<std::size_t>(pair.b)][0]);
  };
  std::vector<PairIndex> expected, found;
  part.self = false;
  for (const PairIndex& pair : BruteForce{part, boxes, 0.003}.find().edge_edge)
    expected.push_back(
        {number[static_cast<std::size_t>(pair.a)], number[static_cast<std::size_t>(pair.b)]});
  BroadPhase broad(surface);
  for (const PairIndex& pair : broad.find(boxes, 0.003).edge_edge)
    if (is_cross(surface, pair)) found.push_back(pair);
  EXPECT_GT(expected.size(), 1000U);
  EXPECT_TRUE(found == expected) << found.size() << " pairs, " << expected.size();
}

std::string error_of(const Boxes& boxes, double gap) {
  BroadPhase broad(make_surface({{0, 1, 2}}, 3, {}, 0, true));
  try {
    broad.find(boxes, gap);
  } catch (const SimulationError& error) {
    return error.what();
  }
  return "";
}

TEST(BroadPhase, RefusesBoxesThatAreNone) {
  const double inf = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Boxes good = points({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)});
  EXPECT_EQ(error_of(good, 0.1), "");
  for (const double bad : {inf, -inf, nan, 1.1e100})
    for (int axis = 0; axis < 3; ++axis) {
      Boxes low = good, high = good;
      low[2].low[axis] = bad;
      high[1].high[axis] = bad;
      EXPECT_NE(error_of(low, 0.1).find("vertex 2"), std::string::npos) << error_of(low, 0.1);
      EXPECT_NE(error_of(high, 0.1).find("vertex 1"), std::string::npos) << error_of(high, 0.1);
    }
  Boxes inverted = good;
  inverted[0] = {Vec3(0, 1, 0), Vec3(0, 0, 0)};
  EXPECT_NE(error_of(inverted, 0.1).find("vertex 0"), std::string::npos);
  for (const double gap : {-1e-9, nan, inf})
    EXPECT_NE(error_of(good, gap).find("gap"), std::string::npos);
}

TEST(BroadPhase, KeepsItsBuffers) {
  const mesh::TriangleMesh sheet = sheet_of(30);
  BroadPhase broad(cloth_alone(sheet));
  const Boxes boxes = crumpled(sheet, 0), moved = crumpled(sheet, 1e-6);
  broad.find(boxes, 0.02);
  const CandidatePairs& pairs = broad.find(moved, 0.02);
  const PairIndex* vertex_triangle = pairs.vertex_triangle.data();
  const PairIndex* edge_edge = pairs.edge_edge.data();
  broad.find(boxes, 0.01);
  broad.find(moved, 0.02);
  EXPECT_EQ(pairs.vertex_triangle.data(), vertex_triangle);
  EXPECT_EQ(pairs.edge_edge.data(), edge_edge);
}

}  // namespace
}  // namespace piecework::collision
