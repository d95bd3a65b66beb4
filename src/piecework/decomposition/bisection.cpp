#include "bisection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <piecework/core/error.hpp>

namespace piecework::decomposition {
namespace {

/// Below this size METIS coarsening has nothing to work with, and growing is as good.
constexpr std::size_t kSmallSet = 24;

/// Above this, METIS's short border is given up for a better balance.
constexpr double kPoorBalance = 1.05;

constexpr double kUnsplit = std::numeric_limits<double>::infinity();

}  // namespace

Bisector::Bisector(const TriangleGraph& graph, int seed)
    : graph_(graph), seed_(seed), local_(graph.neighbors.size(), -1) {}

void Bisector::extract(std::span<const int> set) {
  for (std::size_t i = 0; i < set.size(); ++i)
    local_[static_cast<std::size_t>(set[i])] = static_cast<int>(i);
  set_.begin.assign(1, 0);
  set_.neighbor.clear();
  weight_.clear();
  for (const int triangle : set) {
    graph_.visit_neighbors(triangle, [&](int other) {
      if (local_[static_cast<std::size_t>(other)] >= 0)
        set_.neighbor.push_back(local_[static_cast<std::size_t>(other)]);
    });
    set_.begin.push_back(static_cast<std::int32_t>(set_.neighbor.size()));
    weight_.push_back(graph_.weight[static_cast<std::size_t>(triangle)]);
  }
  for (const int triangle : set) local_[static_cast<std::size_t>(triangle)] = -1;
}

/// Fills queue_ with the whole set, nearest to `start` first, and returns the farthest triangle.
int Bisector::breadth_first(int start) {
  visited_.assign(weight_.size(), 0);
  queue_.assign(1, start);
  visited_[static_cast<std::size_t>(start)] = 1;
  for (std::size_t head = 0; head < queue_.size(); ++head)
    for (auto k = set_.begin[static_cast<std::size_t>(queue_[head])];
         k < set_.begin[static_cast<std::size_t>(queue_[head]) + 1]; ++k) {
      const int next = set_.neighbor[static_cast<std::size_t>(k)];
      if (visited_[static_cast<std::size_t>(next)]) continue;
      visited_[static_cast<std::size_t>(next)] = 1;
      queue_.push_back(next);
    }
  return queue_.back();
}

/// Side 0 grows from `start` until it has its share.
void Bisector::split_by_growing(int start, double share) {
  breadth_first(start);
  const double target = share * std::accumulate(weight_.begin(), weight_.end(), 0.0);
  side_.assign(weight_.size(), 1);
  double grown = 0;
  for (std::size_t i = 0; i + 1 < queue_.size() && (i == 0 || grown < target); ++i) {
    side_[static_cast<std::size_t>(queue_[i])] = 0;
    grown += weight_[static_cast<std::size_t>(queue_[i])];
  }
}

/// Tries growing from both ends of the set; keeps what is there unless that is balanced better.
void Bisector::improve_by_growing(double share) {
  const int one_end = breadth_first(0);
  const int other_end = breadth_first(one_end);
  for (const int start : {one_end, other_end}) {
    const std::vector<std::int32_t> before = side_;
    const double imbalance_before = before.empty() ? kUnsplit : imbalance(share);
    split_by_growing(start, share);
    make_connected();
    rebalance(share);
    if (imbalance(share) >= imbalance_before) side_ = before;
  }
}

/// Leaves only the heaviest connected part of `side` on it. The others go to the other side, to
/// which each of them is adjacent because the whole set is connected.
void Bisector::keep_largest_part(int side) {
  visited_.assign(weight_.size(), -1);
  std::vector<double> part_weight;
  for (std::size_t start = 0; start < weight_.size(); ++start) {
    if (side_[start] != side || visited_[start] >= 0) continue;
    const int part = static_cast<int>(part_weight.size());
    part_weight.push_back(0);
    queue_.assign(1, static_cast<int>(start));
    visited_[start] = part;
    while (!queue_.empty()) {
      const auto current = static_cast<std::size_t>(queue_.back());
      queue_.pop_back();
      part_weight.back() += weight_[current];
      for (auto k = set_.begin[current]; k < set_.begin[current + 1]; ++k) {
        const auto next = static_cast<std::size_t>(set_.neighbor[static_cast<std::size_t>(k)]);
        if (side_[next] != side || visited_[next] >= 0) continue;
        visited_[next] = part;
        queue_.push_back(static_cast<int>(next));
      }
    }
  }
  if (part_weight.size() < 2) return;
  const auto largest = static_cast<int>(std::max_element(part_weight.begin(), part_weight.end()) -
                                        part_weight.begin());
  for (std::size_t i = 0; i < weight_.size(); ++i)
    if (side_[i] == side && visited_[i] != largest) side_[i] = 1 - side;
}

/// METIS may return sides in several pieces. After the second call both are connected: the second
/// side's pieces are adjacent to the first side, which thereby stays connected.
void Bisector::make_connected() {
  keep_largest_part(0);
  keep_largest_part(1);
}

/// The heavier side's weight over its target, at least 1.
double Bisector::imbalance(double share) const {
  double weight[2] = {0, 0};
  for (std::size_t i = 0; i < weight_.size(); ++i) weight[side_[i]] += weight_[i];
  const double total = weight[0] + weight[1];
  return std::max(weight[0] / (share * total), weight[1] / ((1.0 - share) * total));
}

/// Moves triangles across the border to `side`, nearest first, until `missing` weight has come.
void Bisector::grow(int side, double missing) {
  std::size_t left = 0;  // on the other side
  queue_.clear();
  visited_.assign(weight_.size(), 0);
  const auto reach = [&](std::size_t from) {
    for (auto k = set_.begin[from]; k < set_.begin[from + 1]; ++k) {
      const auto next = static_cast<std::size_t>(set_.neighbor[static_cast<std::size_t>(k)]);
      if (side_[next] == side || visited_[next]) continue;
      visited_[next] = 1;
      queue_.push_back(static_cast<int>(next));
    }
  };
  for (std::size_t i = 0; i < weight_.size(); ++i) {
    if (side_[i] == side)
      reach(i);
    else
      ++left;
  }
  for (std::size_t head = 0; head < queue_.size() && left > 1; ++head, --left) {
    const auto current = static_cast<std::size_t>(queue_[head]);
    if (0.5 * weight_[current] > missing) return;
    side_[current] = side;
    missing -= weight_[current];
    reach(current);
  }
}

/// Making sides connected can unbalance them (limbs of a body come back to the trunk). The lighter
/// side then grows across the border; pieces that this cuts off follow. The best state is kept.
void Bisector::rebalance(double share) {
  constexpr double kBalanced = 1.01;
  constexpr int kRounds = 12;
  std::vector<std::int32_t> best = side_;
  double best_imbalance = imbalance(share);
  for (int round = 0; round < kRounds && best_imbalance > kBalanced; ++round) {
    double weight[2] = {0, 0};
    for (std::size_t i = 0; i < weight_.size(); ++i) weight[side_[i]] += weight_[i];
    const double missing = share * (weight[0] + weight[1]) - weight[0];
    const int light = missing > 0 ? 0 : 1;
    grow(light, std::abs(missing));
    keep_largest_part(1 - light);
    if (const double now = imbalance(share); now < best_imbalance) {
      best_imbalance = now;
      best = side_;
    }
  }
  side_ = std::move(best);
}

std::size_t Bisector::split(std::span<int> set, double share) {
  PIECEWORK_ASSERT(set.size() >= 2);
  extract(set);
  if (set.size() >= kSmallSet && graph::bisect(set_, weight_, share, seed_, side_)) {
    make_connected();
    rebalance(share);
  } else {
    side_.clear();
  }
  if (side_.empty() || imbalance(share) > kPoorBalance) improve_by_growing(share);
  std::vector<int> second;
  std::size_t first_size = 0;
  for (std::size_t i = 0; i < set.size(); ++i) {
    if (side_[i] == 0)
      set[first_size++] = set[i];
    else
      second.push_back(set[i]);
  }
  std::copy(second.begin(), second.end(), set.begin() + static_cast<std::ptrdiff_t>(first_size));
  return first_size;
}

}  // namespace piecework::decomposition
