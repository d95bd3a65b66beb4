#include <piecework/collision/broad_phase.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

#include "box_blocks.hpp"
#include "box_kernels.hpp"
#include "pair_search.hpp"
#include "unit_frame.hpp"

namespace piecework::collision {
namespace {

/// Largest coordinate, m: differences of any two, and their products with scales, stay finite.
constexpr double kFarthest = 1e100;

/// Trees are built anew when their boxes have grown so much against those of their elements since
/// they were built (chosen: building takes as long as about half a search).
constexpr double kRebuildGrowth = 1.5;

bool is_valid(const VertexBox& box) {
  return (box.low.array() <= box.high.array()).all() && (box.low.array() >= -kFarthest).all() &&
         (box.high.array() <= kFarthest).all();
}

void check(std::span<const VertexBox> boxes, double gap) {
  if (!(gap >= 0 && gap <= kFarthest))
    throw SimulationError(fmt::format("broad phase: gap {} m is not in [0, {}]", gap, kFarthest));
  const auto bad = [&](std::size_t v) { return is_valid(boxes[v]) ? 0.0 : 1.0; };
  if (parallel_max(boxes.size(), bad) == 0) return;
  const auto first = std::find_if_not(boxes.begin(), boxes.end(), is_valid);
  throw SimulationError(
      fmt::format("broad phase: vertex {}: box from ({}, {}, {}) to ({}, {}, {}) is empty, not "
                  "finite or beyond "
                  "{} m",
                  first - boxes.begin(), first->low[0], first->low[1], first->low[2],
                  first->high[0], first->high[1], first->high[2], kFarthest));
}

VertexBox united(const VertexBox& a, const VertexBox& b) {
  return {a.low.cwiseMin(b.low), a.high.cwiseMax(b.high)};
}

VertexBox united(std::span<const VertexBox> boxes) {
  return parallel_reduce_blocks(
      boxes.size(), boxes.front(),
      [&](std::size_t begin, std::size_t end, VertexBox sum) {
        for (std::size_t v = begin; v < end; ++v) sum = united(sum, boxes[v]);
        return sum;
      },
      [](const VertexBox& a, const VertexBox& b) { return united(a, b); }, kParallelGrain);
}

/// Elements of one kind that belong to cloth, or to obstacles.
template <class List>
std::vector<Element> elements_of(const List& list, const Surface& surface, bool cloth) {
  std::vector<Element> result;
  for (std::size_t e = 0; e < list.size(); ++e) {
    const auto& vertices = list[e];
    if (surface.is_cloth(vertices[0]) != cloth) continue;
    Element element{static_cast<int>(e), {}};
    for (std::size_t k = 0; k < kMaxVertices; ++k)
      element.vertices[k] = vertices[std::min(k, vertices.size() - 1)];
    result.push_back(element);
  }
  return result;
}

std::vector<std::array<int, 1>> all_vertices(const Surface& surface) {
  std::vector<std::array<int, 1>> result;
  for (int v = 0; v < surface.num_vertices; ++v) result.push_back({v});
  return result;
}

/// Cloth or obstacles: what is built and refitted together.
struct Body {
  Body(const Surface& surface, bool cloth)
      : first(cloth ? 0 : static_cast<std::size_t>(surface.num_cloth_vertices)),
        end(static_cast<std::size_t>(cloth ? surface.num_cloth_vertices : surface.num_vertices)),
        vertices(elements_of(all_vertices(surface), surface, cloth), 0),
        edges(elements_of(surface.edges, surface, cloth), surface.edges.size()),
        triangles(elements_of(surface.triangles, surface, cloth), 0) {}

  std::array<BoxBlocks*, 3> kinds() { return {&vertices, &edges, &triangles}; }

  /// Returns whether any box of its vertices has changed.
  bool take_rows(std::span<const VertexBox> boxes, const UnitFrame& frame,
                 std::span<BoxRow> rows) const {
    const auto take = [&](std::size_t i) {
      const BoxRow row = frame.row(boxes[first + i]);
      BoxRow& old = rows[first + i];
      const bool same = std::equal(row.number, row.number + 8, old.number);
      old = row;
      return same ? 0.0 : 1.0;
    };
    return parallel_max(end - first, take) > 0;
  }

  Areas refit(std::span<const BoxRow> rows) {
    Areas areas;
    for (BoxBlocks* kind : kinds()) areas += kind->refit(rows);
    return areas;
  }

  void build(std::span<const BoxRow> rows) {
    BoxRow bounds = kEmptyRow;
    for (const BoxRow& row : rows.subspan(first, end - first))
      bounds = collision::united(bounds, row);
    for (BoxBlocks* kind : kinds()) kind->build(rows, bounds);
    areas_when_built = refit(rows);
    built = true;
  }

  /// Boxes after a motion; builds trees that there are not yet or that have become bad.
  /// Returns whether it built.
  bool update(std::span<const BoxRow> rows) {
    if (built) {
      const Areas now = refit(rows);
      if (now.tree * areas_when_built.elements <=
          kRebuildGrowth * areas_when_built.tree * now.elements)
        return false;
    }
    build(rows);
    return true;
  }

  std::size_t first, end;  // vertices
  BoxBlocks vertices, edges, triangles;
  bool built = false;
  Areas areas_when_built;
};

std::vector<SearchGroup> vertex_groups(const Body& cloth, const Body& obstacle, bool self) {
  SearchGroup of_cloth{&cloth.vertices, {}};
  if (self) of_cloth.others.push_back(&cloth.triangles);
  of_cloth.others.push_back(&obstacle.triangles);
  return {of_cloth, {&obstacle.vertices, {&cloth.triangles}}};
}

std::vector<SearchGroup> edge_groups(const Body& cloth, const Body& obstacle, bool self) {
  SearchGroup of_cloth{&cloth.edges, {}};
  if (self) of_cloth.others.push_back(&cloth.edges);
  of_cloth.others.push_back(&obstacle.edges);
  return {of_cloth};
}

}  // namespace

struct BroadPhase::Impl {
  explicit Impl(Surface s)
      : surface(std::move(s)),
        cloth(surface, true),
        obstacle(surface, false),
        rows(static_cast<std::size_t>(surface.num_vertices), kEmptyRow),
        vertices(vertex_groups(cloth, obstacle, surface.self),
                 static_cast<std::size_t>(surface.num_vertices)),
        edges(edge_groups(cloth, obstacle, surface.self), surface.edges.size()) {
    // Of two edges the lower one looks for the other, and those of obstacles do not look.
    PIECEWORK_ASSERT(std::is_partitioned(
        surface.edges.begin(), surface.edges.end(),
        [this](const std::array<int, 2>& edge) { return surface.is_cloth(edge[0]); }));
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() = default;

  void update(std::span<const VertexBox> boxes, const UnitFrame& frame) {
    for (Body* body : {&cloth, &obstacle})
      if (body->take_rows(boxes, frame, rows) || !body->built) report.rebuilt |= body->update(rows);
  }

  /// The definition of find(), axis by axis.
  template <class A, class B>
  [[nodiscard]] bool near(const A& a, const B& b) const {
    const auto range = [&](const auto& element, Eigen::Index axis) {
      const VertexBox& first = boxes_now[static_cast<std::size_t>(element[0])];
      double low = first.low[axis], high = first.high[axis];
      for (std::size_t k = 1; k < element.size(); ++k) {
        const VertexBox& box = boxes_now[static_cast<std::size_t>(element[k])];
        low = std::min(low, box.low[axis]);
        high = std::max(high, box.high[axis]);
      }
      return std::array{low, high};
    };
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const auto [low_a, high_a] = range(a, axis);
      const auto [low_b, high_b] = range(b, axis);
      if (low_a - high_b > gap_now || low_b - high_a > gap_now) return false;
    }
    return true;
  }
  static bool vertex_near_triangle(const void* context, int v, int t) {
    const Impl& self = *static_cast<const Impl*>(context);
    return self.near(std::array{v}, self.surface.triangles[static_cast<std::size_t>(t)]);
  }
  static bool edge_near_edge(const void* context, int e, int f) {
    const Impl& self = *static_cast<const Impl*>(context);
    return self.near(self.surface.edges[static_cast<std::size_t>(e)],
                     self.surface.edges[static_cast<std::size_t>(f)]);
  }

  Surface surface;
  Body cloth, obstacle;
  std::vector<BoxRow> rows;  // by vertex
  PairSearch vertices, edges;
  CandidatePairs pairs;
  BroadPhaseReport report;
  std::span<const VertexBox> boxes_now;  // during find()
  double gap_now = 0;
};

BroadPhase::BroadPhase(Surface surface) : impl_(std::make_unique<Impl>(std::move(surface))) {}
BroadPhase::~BroadPhase() = default;

const Surface& BroadPhase::surface() const { return impl_->surface; }
const BroadPhaseReport& BroadPhase::report() const { return impl_->report; }

const CandidatePairs& BroadPhase::find(std::span<const VertexBox> boxes, double gap) {
  PIECEWORK_ASSERT(boxes.size() == impl_->rows.size());
  check(boxes, gap);
  Impl& self = *impl_;
  self.report = {};
  if (self.surface.num_cloth_vertices == 0) return self.pairs;
  Stopwatch watch;
  const UnitFrame frame(united(boxes.first(self.cloth.end)), gap);
  self.update(boxes, frame);
  self.report.build_ms = watch.lap();

  self.boxes_now = boxes;
  self.gap_now = gap;
  const BoxKernels& kernels = box_kernels(best_isa());
  const Reach reach = frame.reach();
  self.report.box_tests =
      self.vertices.run(kernels.vertices_with_triangles, kernels, reach,
                        {&self, Impl::vertex_near_triangle}, self.pairs.vertex_triangle) +
      self.edges.run(kernels.edges_with_edges, kernels, reach, {&self, Impl::edge_near_edge},
                     self.pairs.edge_edge);
  self.report.query_ms = watch.lap();
  return self.pairs;
}

}  // namespace piecework::collision
