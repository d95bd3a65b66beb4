#include <piecework/contact/carry.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <piecework/core/parallel.hpp>

namespace piecework::contact {
namespace {

/// Of the gap, how much a vertex may close by itself.
constexpr double kApproach = 0.5;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// The vertices of a pair's first element come first, so many.
std::size_t first_size(const NearPair& pair) {
  return pair.kind == collision::PairKind::VertexTriangle ? 1 : 2;
}

/// 0 or 1: that element of the pair is held, and the other is not; -1: neither is so.
int held_element(const NearPair& pair, const Held& is_held) {
  const std::size_t first = first_size(pair);
  int held[2] = {0, 0};
  for (std::size_t k = 0; k < 4; ++k) held[k < first ? 0 : 1] += is_held(pair.vertices[k]);
  const bool all_first = held[0] == static_cast<int>(first);
  const bool all_second = held[1] == static_cast<int>(4 - first);
  if (all_first == all_second) return -1;
  return all_first ? 0 : 1;
}

/// For each vertex of cloth the pair with the nearest held element, or -1.
std::vector<int> nearest_held(const std::vector<NearPair>& pairs, const Held& is_held,
                              const Points& x) {
  std::vector<int> nearest(at(is_held.num_cloth), -1);
  std::vector<double> nearest_sq(nearest.size(), std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const int held = held_element(pairs[i], is_held);
    if (held < 0) continue;
    const double distance_sq = collision::closest(pairs[i].kind, x(pairs[i].vertices)).distance_sq;
    for (std::size_t k = 0; k < 4; ++k) {
      const int v = pairs[i].vertices[k];
      if ((k < first_size(pairs[i]) ? 0 : 1) == held || is_held(v)) continue;
      if (!(distance_sq < nearest_sq[at(v)])) continue;
      nearest_sq[at(v)] = distance_sq;
      nearest[at(v)] = static_cast<int>(i);
    }
  }
  return nearest;
}

}  // namespace

void carry(const std::vector<NearPair>& pairs, const Held& is_held, const Points& from,
           Positions& x, const Positions& obstacles) {
  const Points to{x, obstacles};
  const std::vector<int> nearest = nearest_held(pairs, is_held, from);
  parallel_for(nearest.size(), [&](std::size_t v) {
    if (nearest[v] < 0) return;
    const auto row = static_cast<Eigen::Index>(v);
    const NearPair& pair = pairs[at(nearest[v])];
    const collision::Closest closest = collision::closest(pair.kind, from(pair.vertices));
    const double gap = std::sqrt(closest.distance_sq);
    if (!(gap > 0)) return;
    const int held = held_element(pair, is_held);
    Vec3 carried = Vec3::Zero();
    for (std::size_t k = 0; k < 4; ++k)
      if ((k < first_size(pair) ? 0 : 1) == held)
        carried += std::abs(closest.beta[k]) * (to(pair.vertices[k]) - from(pair.vertices[k]));
    const Vec3 normal = (held == 0 ? -1 : 1) * closest.offset / gap;
    const Vec3 relative = x.row(row).transpose() - from(static_cast<int>(v)) - carried;
    const double too_close = -relative.dot(normal) - kApproach * gap;
    if (too_close > 0) x.row(row) += too_close * normal.transpose();
  });
}

}  // namespace piecework::contact
