// The broad phase: microseconds per triangle to refit or rebuild the trees and to find all pairs of
// vertices and triangles and of edges, for sheets folded in four layers and draped over a sphere,
// with every vertex moving by an edge length. Validation: at the smallest size the number of pairs
// is that of brute force; refits are refits and rebuilds are rebuilds.

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <piecework/collision/broad_phase.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/core/statistics.hpp>
#include <piecework/mesh/generate.hpp>

#include "bench.hpp"
#include "power_law.hpp"

namespace piecework::bench {
namespace {

using collision::BroadPhase;
using collision::CandidatePairs;
using collision::Surface;
using collision::VertexBox;
using Boxes = std::vector<VertexBox>;

constexpr double kPi = std::numbers::pi;
constexpr int kSmallest = 2500;

/// Smooth, of size 1, with no period in common with the mesh.
double noise(double u, double v) {
  return 0.4 * std::sin(9.1 * u + 3.7 * v) + 0.35 * std::sin(17.3 * v - 5.9 * u + 1) +
         0.25 * std::sin(31.7 * (u + v) + 2);
}

/// A sheet of 1 m x 1 m folded in four along u: layers an edge length apart, wavy all alike and
/// each a little on its own.
Vec3 folded(double u, double v, double edge) {
  const double fold = std::min(4 * u, 4 - 1e-9), within = fold - std::floor(fold);
  const bool back = static_cast<int>(fold) % 2 != 0;
  const double x = (back ? 1 - within : within) / 4;
  const double turn = std::max(0.0, within - 0.95) / 0.05;  // climbs to the next layer at its end
  const double layer = std::floor(fold) + turn;
  return {x, layer * edge + 0.02 * noise(x, v) + 0.3 * edge * noise(7 * u, 5 * v), v};
}

/// A sheet of 1 m x 1 m over a sphere of radius 0.2 m; what hangs down has folds.
Vec3 draped(double u, double v, double edge) {
  constexpr double radius = 0.2;
  const double r = std::hypot(u - 0.5, v - 0.5), angle = std::atan2(v - 0.5, u - 0.5);
  const double down = std::max(0.0, r - radius * kPi / 2);
  const double tilt = std::min(r / radius, kPi / 2);
  const double around = radius * std::sin(tilt) + edge + 0.6 * down * std::sin(11 * angle) +
                        0.05 * down * noise(3 * u, 3 * v);
  return {around * std::cos(angle), (radius + edge) * std::cos(tilt) - down,
          around * std::sin(angle)};
}

/// Boxes of vertices that fall by an edge length and drift a little apart.
void add_swept(const Vec3& x, double u, double v, double edge, Boxes& boxes) {
  const Vec3 end = x + edge * Vec3(0.2 * noise(2 * v, u), -1 + 0.2 * noise(u, 3 * v), 0.2);
  boxes.push_back({x.cwiseMin(end), x.cwiseMax(end)});
}

struct Scene {
  Surface surface;
  Boxes boxes, later_boxes;  // the same, moved on
  Boxes other_boxes;         // folded the other way
  double gap = 0;            // m, a quarter of an edge length
  [[nodiscard]] double num_triangles() const {
    return static_cast<double>(surface.triangles.size());
  }
};

/// The cloth a tenth of an edge length further; obstacles rest.
void move_on(Scene& scene, double edge) {
  scene.later_boxes = scene.boxes;
  for (int v = 0; v < scene.surface.num_cloth_vertices; ++v) {
    VertexBox& box = scene.later_boxes[static_cast<std::size_t>(v)];
    box.low[0] += edge / 10;
    box.high[0] += edge / 10;
  }
}

mesh::TriangleMesh sheet(int side) {
  return mesh::generate(mesh::GeneratorKind::Sheet,
                        {.columns = side, .rows = side, .pattern = mesh::SheetPattern::Delaunay})
      .mesh;
}

Scene folded_scene(int side) {
  const mesh::TriangleMesh flat = sheet(side);
  const double edge = 1.0 / (side - 1);
  Scene scene{.surface = collision::make_surface(flat.triangles, flat.num_vertices(), {}, 0, true),
              .gap = edge / 4};
  for (Eigen::Index i = 0; i < flat.positions.rows(); ++i) {
    const double u = flat.positions(i, 0), v = flat.positions(i, 2);
    add_swept(folded(u, v, edge), u, v, edge, scene.boxes);
    add_swept(folded(v, u, edge), u, v, edge, scene.other_boxes);
  }
  move_on(scene, edge);
  return scene;
}

/// A sphere of longitudes and latitudes with about as many vertices as a quarter of the cloth.
Scene draped_scene(int side, bool self) {
  const mesh::TriangleMesh flat = sheet(side), grid = sheet(side / 2);
  const double edge = 1.0 / (side - 1);
  Scene scene{.surface = collision::make_surface(flat.triangles, flat.num_vertices(),
                                                 grid.triangles, grid.num_vertices(), self),
              .gap = edge / 4};
  for (Eigen::Index i = 0; i < flat.positions.rows(); ++i) {
    const double u = flat.positions(i, 0), v = flat.positions(i, 2);
    add_swept(draped(u, v, edge), u, v, edge, scene.boxes);
  }
  for (Eigen::Index i = 0; i < grid.positions.rows(); ++i) {
    const double longitude = 2 * kPi * grid.positions(i, 0), latitude = kPi * grid.positions(i, 2);
    const Vec3 x = 0.2 * Vec3(std::cos(longitude) * std::sin(latitude), std::cos(latitude),
                              std::sin(longitude) * std::sin(latitude));
    scene.boxes.push_back({x, x});
  }
  move_on(scene, edge);
  return scene;
}

/// Pairs counted by looking at all of them.
std::size_t count_pairs(const Scene& scene) {
  const Surface& s = scene.surface;
  const auto near = [&](const auto& a, const auto& b) {
    for (const int v : a)
      if (std::find(b.begin(), b.end(), v) != b.end()) return false;
    const bool cloth_a = s.is_cloth(a[0]), cloth_b = s.is_cloth(b[0]);
    if (cloth_a == cloth_b && !(cloth_a && s.self)) return false;
    const auto bound = [&](const auto& element) {
      VertexBox box = scene.boxes[static_cast<std::size_t>(element[0])];
      for (const int v : element) {
        box.low = box.low.cwiseMin(scene.boxes[static_cast<std::size_t>(v)].low);
        box.high = box.high.cwiseMax(scene.boxes[static_cast<std::size_t>(v)].high);
      }
      return box;
    };
    const VertexBox p = bound(a), q = bound(b);
    return (p.low - q.high).maxCoeff() <= scene.gap && (q.low - p.high).maxCoeff() <= scene.gap;
  };
  std::size_t count = 0;
  for (int v = 0; v < s.num_vertices; ++v)
    for (const Triangle& t : s.triangles) count += near(std::array{v}, t) ? 1 : 0;
  for (std::size_t e = 0; e < s.edges.size(); ++e)
    for (std::size_t f = e + 1; f < s.edges.size(); ++f)
      count += near(s.edges[e], s.edges[f]) ? 1 : 0;
  return count;
}

std::size_t size(const CandidatePairs& pairs) {
  return pairs.vertex_triangle.size() + pairs.edge_edge.size();
}

/// Growth of time by n through the rows of one kind that have run so far; NaN: of one alone.
double growth(const std::string& kind, double n, double ms) {
  static std::map<std::string, std::pair<std::vector<double>, std::vector<double>>> rows;
  auto& [sizes, times] = rows[kind];
  sizes.push_back(n);
  times.push_back(ms);
  return power_exponent(sizes, times);
}

struct Times {
  std::vector<double> refit, rebuild, query;  // ms
};

/// Finds pairs with a tree that is refitted and, in turns, with one that is rebuilt in each call.
Times measure(benchmark::State& state, const Scene& scene, BroadPhase& broad, bool rebuilds) {
  BroadPhase other(scene.surface);
  Times times;
  bool back = false;
  const auto rebuild = [&] {
    back = !back;
    other.find(back ? scene.other_boxes : scene.boxes, scene.gap);
  };
  broad.find(scene.boxes, scene.gap);
  if (rebuilds) rebuild();
  bool later = false;
  for (auto _ : state) {
    later = !later;
    broad.find(later ? scene.later_boxes : scene.boxes, scene.gap);
    times.refit.push_back(broad.report().build_ms);
    times.query.push_back(broad.report().query_ms);
    bool valid = !broad.report().rebuilt;
    if (rebuilds) {
      rebuild();
      times.rebuild.push_back(other.report().build_ms);
      valid &= other.report().rebuilt;
    }
    state.SetIterationTime(1e-3 * (broad.report().build_ms + broad.report().query_ms));
    if (!valid) {
      fail(state, "a refit rebuilt, or a rebuild did not");
      break;
    }
  }
  return times;
}

double median_ms(const std::vector<double>& times) { return median_interval(times).median; }

/// \param kind  what is timed: refit, rebuild, query_self, query_obstacle, all
void broad_phase(benchmark::State& state, const std::string& kind) {
  const auto n = state.range(0);
  const auto threads = static_cast<int>(state.range(1));
  if (threads > available_threads()) {
    skip(state, fmt::format("{} threads on {} cores", threads, available_threads()));
    return;
  }
  const bool builds = kind == "refit" || kind == "rebuild";
  const Scene scene = builds || kind == "query_self" ? folded_scene(side_of(n))
                                                     : draped_scene(side_of(n), kind == "all");
  BroadPhase broad(scene.surface);
  ThreadPool pool(threads);
  const Times times = pool.run([&] { return measure(state, scene, broad, builds); });
  const CandidatePairs& pairs = broad.find(scene.boxes, scene.gap);
  if (size(pairs) == 0 || (n == kSmallest && size(pairs) != count_pairs(scene))) {
    fail(state, fmt::format("{} pairs", size(pairs)));
    return;
  }
  double ms =
      builds ? median_ms(kind == "refit" ? times.refit : times.rebuild) : median_ms(times.query);
  if (kind == "all") ms += median_ms(times.refit);
  const auto count = static_cast<double>(size(pairs));
  state.counters["us_per_triangle"] = 1e3 * ms / scene.num_triangles();
  state.counters["pairs"] = count;
  state.counters["pairs_per_triangle"] = count / scene.num_triangles();
  state.counters["box_tests"] = static_cast<double>(broad.report().box_tests);
  state.counters["exponent"] =
      growth(fmt::format("{}/{}", kind, threads), static_cast<double>(n), ms);
  if (kind == "rebuild") state.counters["refits"] = ms / median_ms(times.refit);
}

const Registration registration([] {
  for (const char* kind : {"refit", "rebuild", "query_self", "query_obstacle", "all"}) {
    auto* rows =
        benchmark::RegisterBenchmark(fmt::format("broad_phase/{}", kind).c_str(),
                                     [kind](benchmark::State& state) { broad_phase(state, kind); });
    rows->Unit(benchmark::kMillisecond)->UseManualTime()->ArgNames({"n", "threads"});
    rows->Iterations(quick() ? 6 : 15);
    for (const std::int64_t threads : {1, 2})
      for (const std::int64_t n : {kSmallest, 19881, 60025, 199809})
        if (!quick() || n == kSmallest) rows->Args({n, threads});
  }
});

}  // namespace
}  // namespace piecework::bench
