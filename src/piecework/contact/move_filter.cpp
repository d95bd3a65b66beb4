#include <piecework/contact/move_filter.hpp>

#include <algorithm>
#include <cmath>

#include <piecework/core/parallel.hpp>

namespace piecework::contact {
namespace {

constexpr std::size_t kPairsPerBlock = 1024;
/// Of the way to the first contact; the rest keeps a gap.
constexpr double kApproach = 0.8;
/// Of its way: less is not worth it for what is held.
constexpr double kWorthMoving = 0.05;
/// Rounds in which only those vertices are shortened that would hit; then all of them.
constexpr int kLocalRounds = 8;
/// Bounds are rounded: less of the distance must be closed than this part of it.
constexpr double kSurely = 0.99;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// Upper bound of how much closer a pair can come on its way: its motion without the mean of it.
double closing_on_way(collision::PairKind kind, const collision::PairPoints& a,
                      const collision::PairPoints& b) {
  const collision::PairPoints u{b[0] - a[0], b[1] - a[1], b[2] - a[2], b[3] - a[3]};
  const Vec3 mean = 0.25 * (u[0] + u[1] + u[2] + u[3]);
  const auto own = [&](std::size_t i) { return std::sqrt((u[i] - mean).squaredNorm()); };
  return closing_bound(kind, own(0), own(1), own(2), own(3));
}

}  // namespace

void MoveFilter::begin_step(const Held& held, double time) {
  held_ = held;
  time_ = time;
}

void MoveFilter::find_hits_in(const PairList& list, std::size_t block, const Points& from,
                              const Points& to, bool first) {
  std::vector<Hit>& hits = hit_blocks_[block];
  hits.clear();
  const std::size_t end = std::min(list.pairs.size(), (block + 1) * kPairsPerBlock);
  for (std::size_t i = block * kPairsPerBlock; i < end; ++i) {
    const NearPair& pair = list.pairs[i];
    const auto& v = pair.vertices;
    const auto is_changed = [&](int vertex) { return changed_[at(vertex)] != 0; };
    if (!first && std::none_of(v.begin(), v.end(), is_changed)) continue;
    const double apart = kSurely * (pair.distance - closing_bound(pair, moved_));
    if (closing_bound(pair, own_way_) < apart) continue;
    const collision::PairPoints a = from(v), b = to(v);
    if (closing_on_way(pair.kind, a, b) < apart) continue;
    const collision::CcdResult result = collision::first_contact(pair.kind, a, b, ccd_);
    if (result.hit) hits.push_back({i, result.time});
  }
}

void MoveFilter::find_hits(const PairList& list, const Points& from, const Points& to, bool first) {
  own_motion(from.count(), model_.num_vertices(), from, to, own_way_);
  hit_blocks_.resize((list.pairs.size() + kPairsPerBlock - 1) / kPairsPerBlock);
  parallel_for(
      hit_blocks_.size(), [&](std::size_t block) { find_hits_in(list, block, from, to, first); },
      1);
  hits_.clear();
  for (const auto& block : hit_blocks_) hits_.insert(hits_.end(), block.begin(), block.end());
}

void MoveFilter::begin_ways(const Points& from, const Points& to) {
  way_.resize(from.count(), 3);
  parallel_for(at(from.count()), [&](std::size_t v) {
    const int i = static_cast<int>(v);
    way_.row(static_cast<Eigen::Index>(v)) = (to(i) - from(i)).transpose();
  });
  scale_.assign(at(from.count()), 1.0);
  changed_.assign(at(from.count()), 0);
}

void MoveFilter::lower_scale(int vertex, double part) {
  const auto lower = [&](int v) {
    const bool held = held_(v);
    if (held && way_.row(v).isZero(0)) return;
    double scale = scale_[at(v)] * part;
    // What is held waits for the cloth, or their gap would shrink to nothing, bit by bit.
    if (held && scale < kWorthMoving) scale = 0;
    next_scale_[at(v)] = std::min(next_scale_[at(v)], scale);
  };
  // What is sewn goes as far as what carries it.
  if (vertex >= model_.num_vertices() || model_.sewing.empty())
    lower(vertex);
  else
    model_.sewing.map().visit_carriers(vertex, [&](int carrier, double) { lower(carrier); });
}

void MoveFilter::lower_scales(const PairList& list, bool vertex_by_vertex) {
  next_scale_ = scale_;
  if (vertex_by_vertex) {
    for (const Hit& hit : hits_)
      for (const int v : list.pairs[hit.pair].vertices) lower_scale(v, kApproach * hit.time);
  } else {
    double least = 1;
    for (const Hit& hit : hits_) least = std::min(least, hit.time);
    for (double& scale : next_scale_) scale *= kApproach * least;
  }
  take_scales();
}

void MoveFilter::take_scales() {
  parallel_for(scale_.size(), [&](std::size_t v) { changed_[v] = next_scale_[v] != scale_[v]; });
  std::swap(scale_, next_scale_);
  if (model_.sewing.empty()) return;
  for (int v = 0; v < model_.num_vertices(); ++v)
    model_.sewing.map().visit_carriers(v, [&](int carrier, double) {
      if (changed_[at(carrier)]) changed_[at(v)] = 1;
    });
}

void MoveFilter::go(const Points& from, Positions& to, Positions& obstacles) const {
  const auto n = at(model_.num_vertices());
  parallel_for(scale_.size(), [&](std::size_t i) {
    if (!changed_[i]) return;
    const auto v = static_cast<Eigen::Index>(i);
    const Vec3 end = from(static_cast<int>(i)) + scale_[i] * way_.row(v).transpose();
    if (i < n)
      to.row(v) = end.transpose();
    else
      obstacles.row(v - static_cast<Eigen::Index>(n)) = end.transpose();
  });
  model_.sewing.follow(time_, to);
}

Shortening MoveFilter::held_ways() const {
  const auto of_held = [&](const auto& value) {
    return parallel_max(scale_.size(), [&](std::size_t v) {
      const bool moves =
          held_(static_cast<int>(v)) && !way_.row(static_cast<Eigen::Index>(v)).isZero(0);
      return moves ? value(scale_[v]) : 0.0;
    });
  };
  const double missing = of_held([](double scale) { return 1 - scale; });
  return {true, 1 - missing, missing > 0 ? of_held([](double scale) { return scale; }) : 1};
}

Shortening MoveFilter::shorten(NearPairs& near, const Points& from, Positions& to,
                               Positions& obstacles) {
  const Points end{to, obstacles};
  const bool short_way = near.valid_at(from) && near.valid_at(end);
  const PairList& list = short_way ? near.near(from) : near.candidates();
  list.moved(from, moved_);
  find_hits(list, from, end, true);
  if (hits_.empty()) return {};
  begin_ways(from, end);
  for (int round = 0; !hits_.empty(); ++round) {
    const bool vertex_by_vertex = round < kLocalRounds;
    lower_scales(list, vertex_by_vertex);
    go(from, to, obstacles);
    if (!vertex_by_vertex) break;  // safe by itself
    find_hits(list, from, end, false);
  }
  return held_ways();
}

}  // namespace piecework::contact
