// How far a move may go: continuous collision detection, vertex by vertex.

#include <algorithm>
#include <cmath>

#include <piecework/contact/contact.hpp>
#include <piecework/core/clock.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/model/stepper.hpp>

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

void Contact::find_hits(const PairList& list, const std::vector<double>& moved, const Points& from,
                        const Points& to, bool first) {
  const std::vector<NearPair>& pairs = list.pairs;
  hit_blocks_.resize((pairs.size() + kPairsPerBlock - 1) / kPairsPerBlock);
  parallel_for(
      hit_blocks_.size(),
      [&](std::size_t block) {
        hit_blocks_[block].clear();
        const std::size_t end = std::min(pairs.size(), (block + 1) * kPairsPerBlock);
        for (std::size_t i = block * kPairsPerBlock; i < end; ++i) {
          const NearPair& pair = pairs[i];
          const auto& v = pair.vertices;
          if (!first && !changed_[at(v[0])] && !changed_[at(v[1])] && !changed_[at(v[2])] &&
              !changed_[at(v[3])])
            continue;
          const auto bound = [&](const std::vector<double>& by) {
            return closing_bound(pair.kind, by[at(v[0])], by[at(v[1])], by[at(v[2])], by[at(v[3])]);
          };
          const double apart = kSurely * (pair.distance - bound(moved));
          if (bound(own_way_) < apart) continue;
          const collision::PairPoints a = from(v), b = to(v);
          if (closing_on_way(pair.kind, a, b) < apart) continue;
          const collision::CcdResult result =
              collision::first_contact(pair.kind, a, b, options_.ccd);
          if (result.hit) hit_blocks_[block].push_back({i, result.time});
        }
      },
      1);
  hits_.clear();
  for (const auto& block : hit_blocks_) hits_.insert(hits_.end(), block.begin(), block.end());
}

void Contact::lower_scale(int vertex, double part) {
  const auto lower = [&](int v) {
    const bool held = is_held(v);
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

void Contact::take_scales() {
  parallel_for(scale_.size(), [&](std::size_t v) { changed_[v] = next_scale_[v] != scale_[v]; });
  std::swap(scale_, next_scale_);
  if (model_.sewing.empty()) return;
  for (int v = 0; v < model_.num_vertices(); ++v)
    model_.sewing.map().visit_carriers(v, [&](int carrier, double) {
      if (changed_[at(carrier)]) changed_[at(v)] = 1;
    });
}

Contact::HeldWay Contact::held_way() const {
  const auto of_held = [&](const auto& value) {
    return parallel_max(scale_.size(), [&](std::size_t v) {
      const bool moves =
          is_held(static_cast<int>(v)) && !way_.row(static_cast<Eigen::Index>(v)).isZero(0);
      return moves ? value(scale_[v]) : 0.0;
    });
  };
  const double missing = of_held([](double scale) { return 1 - scale; });
  return {1 - missing, missing > 0 ? of_held([](double scale) { return scale; }) : 1};
}

void Contact::go(const Points& from, Positions& to, Positions& obstacles) {
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
  model_.sewing.follow(end_time_, to);
}

Contact::HeldWay Contact::shorten(const Points& from, Positions& to, Positions& obstacles) {
  Stopwatch watch;
  // Obstacles that stay are both ends of the way at once: keep the first apart from the second.
  const Points end{to, obstacles};
  if (near_.cover(from, end)) report_.cull_ms += watch.lap();
  const bool short_way = near_.valid_at(from) && near_.valid_at(end);
  const PairList& list = short_way ? near_.near(from) : near_.candidates();
  list.moved(from, moved_);
  own_motion(from.count(), model_.num_vertices(), from, end, own_way_);
  find_hits(list, moved_, from, end, true);
  HeldWay held;
  const bool any = !hits_.empty();
  if (any) {
    ++report_.shortened;
    way_.resize(from.count(), 3);
    parallel_for(at(from.count()), [&](std::size_t v) {
      way_.row(static_cast<Eigen::Index>(v)) =
          (end(static_cast<int>(v)) - from(static_cast<int>(v))).transpose();
    });
    scale_.assign(at(from.count()), 1.0);
    changed_.assign(at(from.count()), 0);
  }
  for (int round = 0; !hits_.empty(); ++round) {
    next_scale_ = scale_;
    if (round < kLocalRounds) {
      for (const Hit& hit : hits_)
        for (const int v : list.pairs[hit.pair].vertices) lower_scale(v, kApproach * hit.time);
    } else {
      double least = 1;
      for (const Hit& hit : hits_) least = std::min(least, hit.time);
      for (double& scale : next_scale_) scale *= kApproach * least;
    }
    take_scales();
    go(from, to, obstacles);
    if (round >= kLocalRounds) break;
    own_motion(from.count(), model_.num_vertices(), from, end, own_way_);
    find_hits(list, moved_, from, end, false);
  }
  if (any) held = held_way();
  report_.narrow_ms += watch.lap();
  return held;
}

}  // namespace piecework::contact
