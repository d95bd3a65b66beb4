#include <piecework/contact/near_pairs.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <piecework/core/parallel.hpp>

namespace piecework::contact {
namespace {

constexpr std::size_t kPairsPerBlock = 2048;
/// The margin of the whereabouts doubles each time that they had to be moved, up to so many slacks.
constexpr double kWidestMargin = 2;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// Distance of the two elements' boxes, m: a cheap lower bound.
double box_distance(collision::PairKind kind, const collision::PairPoints& x) {
  const bool edges = kind == collision::PairKind::EdgeEdge;
  const Vec3 low_a = edges ? x[0].cwiseMin(x[1]) : x[0],
             high_a = edges ? x[0].cwiseMax(x[1]) : x[0];
  Vec3 low_b = x[2].cwiseMin(x[3]), high_b = x[2].cwiseMax(x[3]);
  if (!edges) {
    low_b = low_b.cwiseMin(x[1]);
    high_b = high_b.cwiseMax(x[1]);
  }
  const Vec3 gap = (low_a - high_b).cwiseMax(low_b - high_a).cwiseMax(Vec3::Zero());
  return std::sqrt(gap.squaredNorm());
}

}  // namespace

void Points::copy_to(Positions& out) const {
  out.resize(count(), 3);
  parallel_for(at(count()), [&](std::size_t v) {
    out.row(static_cast<Eigen::Index>(v)) = (*this)(static_cast<int>(v)).transpose();
  });
}

NearPairs::NearPairs(collision::Surface surface, double reach, double slack)
    : broad_phase_(std::move(surface)), reach_(reach), slack_(slack) {}

void PairList::moved(const Points& x, std::vector<double>& distance) const {
  const auto before = [&](int v) -> Vec3 {
    return made_at.row(static_cast<Eigen::Index>(v)).transpose();
  };
  own_motion(x.count(), static_cast<int>(x.cloth.rows()), before, x, distance);
}

void NearPairs::begin() {
  boxes_.clear();
  margin_ = slack_;
  near_.made_at.resize(0, 3);
}

bool NearPairs::contains(const Points& x) const {
  if (boxes_.empty()) return false;
  return parallel_max(boxes_.size(), [&](std::size_t v) {
           const Vec3 p = x(static_cast<int>(v));
           const bool inside =
               (p.array() >= boxes_[v].low.array() && p.array() <= boxes_[v].high.array()).all();
           return inside ? 0.0 : 1.0;
         }) == 0;
}

bool NearPairs::cover(const Points& from, const Points& to) {
  if (contains(from) && contains(to)) return false;
  if (!boxes_.empty()) margin_ = std::min(2 * margin_, kWidestMargin * slack_);
  boxes_.resize(at(from.count()));
  parallel_for(boxes_.size(), [&](std::size_t v) {
    const Vec3 a = from(static_cast<int>(v)), b = to(static_cast<int>(v));
    boxes_[v].low = a.cwiseMin(b).array() - margin_;
    boxes_[v].high = a.cwiseMax(b).array() + margin_;
  });
  list_candidates(from);
  near_.made_at.resize(0, 3);
  return true;
}

collision::PairVertices NearPairs::vertex_triangle(collision::PairIndex pair) const {
  const Triangle& t = surface().triangles[at(pair.b)];
  return {pair.a, t[0], t[1], t[2]};
}

collision::PairVertices NearPairs::edge_edge(collision::PairIndex pair) const {
  const auto &a = surface().edges[at(pair.a)], &b = surface().edges[at(pair.b)];
  return {a[0], a[1], b[0], b[1]};
}

void NearPairs::list_candidates(const Points& x) {
  const collision::CandidatePairs& found = broad_phase_.find(boxes_, reach_);
  const std::size_t vt = found.vertex_triangle.size();
  candidates_.pairs.resize(vt + found.edge_edge.size());
  parallel_for(candidates_.pairs.size(), [&](std::size_t i) {
    using enum collision::PairKind;
    NearPair& pair = candidates_.pairs[i];
    pair = i < vt ? NearPair{vertex_triangle(found.vertex_triangle[i]), VertexTriangle, 0}
                  : NearPair{edge_edge(found.edge_edge[i - vt]), EdgeEdge, 0};
    pair.distance = box_distance(pair.kind, x(pair.vertices));
  });
  x.copy_to(candidates_.made_at);
}

bool NearPairs::valid_at(const Points& x) const {
  if (near_.made_at.rows() == 0) return false;
  const double farthest_sq = parallel_max(at(x.count()), [&](std::size_t v) {
    return (x(static_cast<int>(v)) - near_.made_at.row(static_cast<Eigen::Index>(v)).transpose())
        .squaredNorm();
  });
  return farthest_sq <= slack_ * slack_;
}

const PairList& NearPairs::near(const Points& x) {
  if (valid_at(x)) return near_;
  ++generation_;
  const double within = reach_ + 2 * slack_;
  candidates_.moved(x, moved_);
  const std::vector<NearPair>& all = candidates_.pairs;
  blocks_.resize((all.size() + kPairsPerBlock - 1) / kPairsPerBlock);
  parallel_for(
      blocks_.size(),
      [&](std::size_t block) {
        blocks_[block].clear();
        const std::size_t end = std::min(all.size(), (block + 1) * kPairsPerBlock);
        for (std::size_t i = block * kPairsPerBlock; i < end; ++i) {
          NearPair pair = all[i];
          if (pair.distance - closing_bound(pair, moved_) >= within) continue;
          pair.distance = std::sqrt(collision::closest(pair.kind, x(pair.vertices)).distance_sq);
          if (pair.distance < within) blocks_[block].push_back(pair);
        }
      },
      1);
  near_.pairs.clear();
  for (const auto& block : blocks_)
    near_.pairs.insert(near_.pairs.end(), block.begin(), block.end());
  x.copy_to(near_.made_at);
  return near_;
}

}  // namespace piecework::contact
