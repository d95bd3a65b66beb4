#include "nearest_surface.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include <piecework/colliders/audit.hpp>
#include <piecework/collision/distance.hpp>

namespace piecework::untangle {
namespace {

constexpr int kLeaf = 4;  // triangles

Vec3 corner(const Triangle& t, const Positions& x, std::size_t k) { return x.row(t[k]); }

Vec3 center(const Triangle& t, const Positions& x) {
  return (corner(t, x, 0) + corner(t, x, 1) + corner(t, x, 2)) / 3;
}

/// Per triangle whether a point just above its middle is inside; `side` -1: just below.
std::vector<char> inside_beside(const Triangles& triangles, const Positions& x, double side) {
  constexpr double kOfSize = 1e-4;  // of a triangle: far above rounding, far below its neighbours
  Positions points(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const Vec3 middle = center(triangles[t], x);
    const double size = (corner(triangles[t], x, 0) - middle).norm();
    points.row(static_cast<Eigen::Index>(t)) =
        middle + side * kOfSize * size * area_normal(triangles[t], x).stableNormalized();
  }
  std::vector<char> inside(triangles.size(), 0);
  for (const int t : colliders::points_inside(triangles, x, points))
    inside[static_cast<std::size_t>(t)] = 1;
  return inside;
}

}  // namespace

NearestSurface::NearestSurface(const Triangles& triangles, const Positions& x) : x_(x) {
  const std::vector<char> above = inside_beside(triangles, x, 1);
  const std::vector<char> below = inside_beside(triangles, x, -1);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    if (above[t] == below[t]) continue;
    triangles_.push_back(triangles[t]);
    if (above[t]) std::swap(triangles_.back()[1], triangles_.back()[2]);
  }
  if (!triangles_.empty()) build(0, static_cast<int>(triangles_.size()));
}

int NearestSurface::build(int begin, int end) {
  const int index = static_cast<int>(nodes_.size());
  Node node{Vec3::Constant(std::numeric_limits<double>::infinity()), {}, begin, end, 0};
  node.high = -node.low;
  for (int t = begin; t < end; ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 p = corner(triangles_[static_cast<std::size_t>(t)], x_, k);
      node.low = node.low.cwiseMin(p);
      node.high = node.high.cwiseMax(p);
    }
  nodes_.push_back(node);
  if (end - begin <= kLeaf) return index;
  Eigen::Index axis = 0;
  (node.high - node.low).maxCoeff(&axis);
  const int middle = (begin + end) / 2;
  // Equal middles are ordered by their vertices: the tree depends on nothing else.
  std::nth_element(triangles_.begin() + begin, triangles_.begin() + middle,
                   triangles_.begin() + end, [&](const Triangle& a, const Triangle& b) {
                     return std::pair(center(a, x_)[axis], a) < std::pair(center(b, x_)[axis], b);
                   });
  build(begin, middle);
  const int right = build(middle, end);
  nodes_[static_cast<std::size_t>(index)].right = right;
  return index;
}

double NearestSurface::box_distance_sq(int node, const Vec3& p) const {
  const Node& n = nodes_[static_cast<std::size_t>(node)];
  return (p - p.cwiseMax(n.low).cwiseMin(n.high)).squaredNorm();
}

NearestSurface::Foot NearestSurface::nearest(const Vec3& p) const {
  double best = std::numeric_limits<double>::infinity();
  Vec3 offset = Vec3::Zero();
  std::size_t where = 0;
  std::vector<int> open{0};
  while (!open.empty()) {
    const int index = open.back();
    open.pop_back();
    if (box_distance_sq(index, p) >= best) continue;
    const Node& node = nodes_[static_cast<std::size_t>(index)];
    if (node.right != 0) {
      std::pair<int, int> near{index + 1, node.right};
      if (box_distance_sq(near.second, p) < box_distance_sq(near.first, p))
        std::swap(near.first, near.second);
      open.insert(open.end(), {near.second, near.first});
      continue;
    }
    for (auto t = static_cast<std::size_t>(node.begin); t < static_cast<std::size_t>(node.end);
         ++t) {
      const Triangle& v = triangles_[t];
      const collision::Closest closest = collision::closest_vertex_triangle(
          {p, corner(v, x_, 0), corner(v, x_, 1), corner(v, x_, 2)});
      if (!(closest.distance_sq < best)) continue;
      best = closest.distance_sq;
      offset = closest.offset;
      where = t;
    }
  }
  return {p - offset, area_normal(triangles_[where], x_).stableNormalized()};
}

}  // namespace piecework::untangle
