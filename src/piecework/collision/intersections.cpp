#include <piecework/collision/intersections.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

#include "exact_meeting.hpp"

namespace piecework::collision {
namespace {

struct Extent {
  Vec3 low, high;

  [[nodiscard]] bool overlaps(const Extent& other) const {
    return (low.array() <= other.high.array()).all() && (other.low.array() <= high.array()).all();
  }
};

template <class Element>
Extent extent(const Element& element, const Positions& x) {
  Extent e{x.row(element[0]), x.row(element[0])};
  for (const int v : element) {
    e.low = e.low.cwiseMin(x.row(v).transpose());
    e.high = e.high.cwiseMax(x.row(v).transpose());
  }
  return e;
}

/// Triangles by the cells of a uniform grid that their extents touch; cells share buckets by hash.
class TriangleGrid {
 public:
  TriangleGrid(const Triangles& triangles, const Positions& x) : extents_(triangles.size()) {
    parallel_for(triangles.size(), [&](std::size_t t) { extents_[t] = extent(triangles[t], x); });
    choose_cells(x);
    fill();
  }

  [[nodiscard]] const Extent& of(int triangle) const {
    return extents_[static_cast<std::size_t>(triangle)];
  }

  /// Calls visit(triangle) for all whose extents overlap `box`; for some more than once.
  template <class Visit>
  void visit_overlapping(const Extent& box, const Visit& visit) const {
    const Cell low = cell(box.low), high = cell(box.high);
    if (is_large(low, high)) {
      for (std::size_t t = 0; t < extents_.size(); ++t)
        if (extents_[t].overlaps(box)) visit(static_cast<int>(t));
      return;
    }
    for (const int t : large_)
      if (of(t).overlaps(box)) visit(t);
    for_cells(low, high, [&](const Cell& c) {
      const std::size_t b = bucket(c);
      for (std::size_t i = begin_[b]; i < begin_[b + 1]; ++i)
        // Of the cells that the two share, one reports them.
        if (of(items_[i]).overlaps(box) && cell(of(items_[i]).low.cwiseMax(box.low)) == c)
          visit(items_[i]);
    });
  }

 private:
  using Cell = std::array<std::int64_t, 3>;
  static constexpr std::int64_t kMostCells = 64;  // an element in more of them is looked at apart

  void choose_cells(const Positions& x) {
    if (x.rows() == 0) return;
    origin_ = x.colwise().minCoeff().transpose();
    const double size = (x.colwise().maxCoeff().transpose() - origin_).maxCoeff();
    const double sum = parallel_sum<double>(extents_.size(), [&](std::size_t t) {
      return (extents_[t].high - extents_[t].low).maxCoeff();
    });
    const double mean = sum / static_cast<double>(std::max<std::size_t>(extents_.size(), 1));
    const double width = std::max(mean, size * 0x1.0p-40);  // numbers of cells stay integers
    per_metre_ = width > 1e-250 ? 1 / width : 0;            // 0: one cell
    buckets_ = std::bit_ceil(extents_.size() + 1);
  }

  void fill() {
    begin_.assign(buckets_ + 1, 0);
    for_all_cells([&](std::size_t b, int) { ++begin_[b + 1]; });
    for (std::size_t b = 0; b < buckets_; ++b) begin_[b + 1] += begin_[b];
    items_.resize(begin_.back());
    std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
    for_all_cells([&](std::size_t b, int t) { items_[next[b]++] = t; });
    for (std::size_t t = 0; t < extents_.size(); ++t)
      if (is_large(cell(extents_[t].low), cell(extents_[t].high)))
        large_.push_back(static_cast<int>(t));
  }

  template <class Visit>
  void for_all_cells(const Visit& visit) const {
    for (std::size_t t = 0; t < extents_.size(); ++t) {
      const Cell low = cell(extents_[t].low), high = cell(extents_[t].high);
      if (is_large(low, high)) continue;
      for_cells(low, high, [&](const Cell& c) { visit(bucket(c), static_cast<int>(t)); });
    }
  }

  template <class Visit>
  static void for_cells(const Cell& low, const Cell& high, const Visit& visit) {
    for (std::int64_t i = low[0]; i <= high[0]; ++i)
      for (std::int64_t j = low[1]; j <= high[1]; ++j)
        for (std::int64_t k = low[2]; k <= high[2]; ++k) visit(Cell{i, j, k});
  }

  [[nodiscard]] Cell cell(const Vec3& x) const {
    Cell c;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<Eigen::Index>(axis);
      c[axis] = static_cast<std::int64_t>((x[i] - origin_[i]) * per_metre_);
    }
    return c;
  }

  static bool is_large(const Cell& low, const Cell& high) {
    double cells = 1;
    for (std::size_t axis = 0; axis < 3; ++axis)
      cells *= static_cast<double>(high[axis] - low[axis] + 1);
    return cells > kMostCells;
  }

  [[nodiscard]] std::size_t bucket(const Cell& c) const {
    const auto h = static_cast<std::uint64_t>(c[0]) * 0x9e3779b97f4a7c15U ^
                   static_cast<std::uint64_t>(c[1]) * 0xc2b2ae3d27d4eb4fU ^
                   static_cast<std::uint64_t>(c[2]) * 0x165667b19e3779f9U;
    return (h >> 20) & (buckets_ - 1);
  }

  std::vector<Extent> extents_;
  Vec3 origin_ = Vec3::Zero();
  double per_metre_ = 0;
  std::size_t buckets_ = 1;
  std::vector<std::size_t> begin_;
  std::vector<int> items_;
  std::vector<int> large_;
};

void check_positions(const Positions& x) {
  for (Eigen::Index v = 0; v < x.rows(); ++v)
    if (!(x.row(v).cwiseAbs().maxCoeff() <= kFarthest) || x.row(v).hasNaN())
      throw SimulationError(
          fmt::format("vertex {}: position ({}, {}, {}) is not finite or beyond {} m", v, x(v, 0),
                      x(v, 1), x(v, 2), kFarthest));
}

bool may_collide(const Surface& surface, const std::array<int, 2>& edge, const Triangle& triangle) {
  for (const int v : edge)
    if (std::find(triangle.begin(), triangle.end(), v) != triangle.end()) return false;
  const bool edge_cloth = surface.is_cloth(edge[0]), triangle_cloth = surface.is_cloth(triangle[0]);
  return edge_cloth != triangle_cloth || (edge_cloth && surface.self);
}

}  // namespace

std::vector<Intersection> find_intersections(const Surface& surface, const Positions& x) {
  check_positions(x);
  const TriangleGrid grid(surface.triangles, x);
  const auto look_at = [&](int e, std::vector<Intersection>& found) {
    const std::array<int, 2>& edge = surface.edges[static_cast<std::size_t>(e)];
    const Segment segment{x.row(edge[0]), x.row(edge[1])};
    grid.visit_overlapping(extent(edge, x), [&](int t) {
      const Triangle& triangle = surface.triangles[static_cast<std::size_t>(t)];
      if (may_collide(surface, edge, triangle) &&
          meet(segment, {x.row(triangle[0]), x.row(triangle[1]), x.row(triangle[2])}))
        found.push_back({e, t});
    });
  };

  constexpr std::size_t kBlock = 256;
  std::vector<std::vector<Intersection>> blocks((surface.edges.size() + kBlock - 1) / kBlock);
  const auto look_at_block = [&](std::size_t b) {
    const std::size_t end = std::min((b + 1) * kBlock, surface.edges.size());
    for (std::size_t e = b * kBlock; e < end; ++e) look_at(static_cast<int>(e), blocks[b]);
  };
  parallel_for(blocks.size(), look_at_block, 1);

  std::vector<Intersection> all;
  for (const auto& block : blocks) all.insert(all.end(), block.begin(), block.end());
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

}  // namespace piecework::collision
