// Colours of domains: well separated in OKLab, and the more so between neighbours.

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <renderer/color.hpp>

#include <piecework/core/error.hpp>

namespace piecework::render {
namespace {

constexpr int kMaxDistinct = 128;  // beyond, colours repeat, never between neighbours if avoidable
constexpr float kInfinity = std::numeric_limits<float>::infinity();

bool in_gamut(const Rgb& c) {
  constexpr float kSlack = 1e-3F;
  return std::min({c.r, c.g, c.b}) >= -kSlack && std::max({c.r, c.g, c.b}) <= 1.0F + kSlack;
}

/// Soft but saturated colours, neither neon nor mud. Limits chosen by eye on shaded cloth.
bool is_pleasant(float lightness, float chroma, int hue) {
  const float extreme = std::abs(lightness - 0.74F);
  if (chroma < 0.05F + 0.35F * extreme || chroma > 0.165F - 0.30F * extreme) return false;
  const bool yellow = hue >= 66 && hue <= 126;  // dark yellow is olive or mustard
  const bool orange = hue >= 44 && hue < 66;    // dark orange is brown
  if ((yellow && lightness < 0.79F) || (orange && lightness < 0.66F)) return false;
  const bool mint = hue >= 140 && hue <= 215;  // glows when it is light and strong
  return !(mint && chroma > 0.105F);
}

void add_hues(float lightness, float chroma, std::vector<Oklab>& colors) {
  for (int hue = 0; hue < 360; hue += 6) {
    const Oklab lab = oklab_from_lch(lightness, chroma, static_cast<float>(hue));
    if (is_pleasant(lightness, chroma, hue) && in_gamut(rgb_from_oklab(lab))) colors.push_back(lab);
  }
}

std::vector<Oklab> candidates() {
  std::vector<Oklab> result;
  for (float lightness : {0.56F, 0.62F, 0.68F, 0.74F, 0.80F, 0.86F}) {
    for (float chroma : {0.06F, 0.08F, 0.10F, 0.12F, 0.14F, 0.16F}) {
      add_hues(lightness, chroma, result);
    }
  }
  return result;
}

/// Farthest-point sampling: each colour is the candidate farthest from all before it.
std::vector<Oklab> spread_colors(int count) {
  const std::vector<Oklab> pool = candidates();
  std::vector<float> nearest(pool.size(), kInfinity);
  std::vector<Oklab> chosen;
  Oklab next = pool.front();
  const Oklab start = oklab_from_lch(0.68F, 0.12F, 250.0F);
  for (const Oklab& c : pool) {
    if (oklab_distance(c, start) < oklab_distance(next, start)) next = c;
  }
  while (static_cast<int>(chosen.size()) < count) {
    chosen.push_back(next);
    std::size_t best = 0;
    for (std::size_t i = 0; i < pool.size(); ++i) {
      nearest[i] = std::min(nearest[i], oklab_distance(pool[i], next));
      if (nearest[i] > nearest[best]) best = i;
    }
    next = pool[best];
  }
  return chosen;
}

using Neighbours = std::vector<std::vector<int>>;

Neighbours neighbour_lists(int count, std::span<const std::array<int, 2>> adjacent) {
  Neighbours lists(static_cast<std::size_t>(count));
  for (const auto& [a, b] : adjacent) {
    if (a < 0 || b < 0 || a >= count || b >= count) {
      throw InputError("domain_palette: pair (" + std::to_string(a) + ", " + std::to_string(b) +
                       ") names a domain outside of 0 ... " + std::to_string(count - 1));
    }
    if (a == b) continue;
    lists[a].push_back(b);
    lists[b].push_back(a);
  }
  for (std::vector<int>& list : lists) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return lists;
}

/// Assigns colours to domains so that neighbours are far apart.
class Assignment {
 public:
  Assignment(const Neighbours& neighbours, const std::vector<Oklab>& colors)
      : neighbours_(neighbours), colors_(colors), color_of_(neighbours.size(), -1) {}

  std::vector<int> run() {
    assign_greedily();
    constexpr int kSweeps = 6;  // converges in 3 or 4 on grids and METIS partitions
    for (int sweep = 0; sweep < kSweeps && improve_by_swaps(); ++sweep) {
    }
    return color_of_;
  }

 private:
  /// Domains with many neighbours first; each takes the colour, among the least used, that is
  /// farthest from those of its neighbours.
  void assign_greedily() {
    std::vector<int> order(neighbours_.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
    std::stable_sort(order.begin(), order.end(),
                     [&](int x, int y) { return neighbours_[x].size() > neighbours_[y].size(); });
    std::vector<int> uses(colors_.size(), 0);
    for (int domain : order) {
      int best = -1;
      float best_gap = -1;
      const int least = *std::min_element(uses.begin(), uses.end());
      for (std::size_t c = 0; c < colors_.size(); ++c) {
        if (uses[c] > least) continue;
        const float gap = std::min(gap_with(domain, static_cast<int>(c)), 10.0F);
        if (gap > best_gap) {
          best_gap = gap;
          best = static_cast<int>(c);
        }
      }
      color_of_[domain] = best;
      ++uses[best];
    }
  }

  float gap_with(int domain, int color) const {
    float gap = kInfinity;
    for (int other : neighbours_[domain]) {
      if (color_of_[other] < 0) continue;
      gap = std::min(gap, oklab_distance(colors_[color], colors_[color_of_[other]]));
    }
    return gap;
  }

  /// Repulsion of a domain's colour and its neighbours', steep so that the closest pair counts.
  float penalty(int domain, int ignored) const {
    float sum = 0;
    for (int other : neighbours_[domain]) {
      if (other == ignored) continue;
      const float d = oklab_distance(colors_[color_of_[domain]], colors_[color_of_[other]]);
      const float inverse = 0.1F / std::max(d, 1e-3F);
      sum += inverse * inverse * inverse * inverse;
    }
    return sum;
  }

  bool improve_by_swaps() {
    bool improved = false;
    const int count = static_cast<int>(color_of_.size());
    const int reach = count <= 512 ? count : 512;  // keeps thousands of domains fast
    for (int a = 0; a < count; ++a) {
      for (int step = 1; step < reach; ++step) {
        const int b = a + step;
        if (b >= count) break;
        const float before = penalty(a, b) + penalty(b, a);
        std::swap(color_of_[a], color_of_[b]);
        if (penalty(a, b) + penalty(b, a) < before * 0.999F) {
          improved = true;
        } else {
          std::swap(color_of_[a], color_of_[b]);
        }
      }
    }
    return improved;
  }

  const Neighbours& neighbours_;
  const std::vector<Oklab>& colors_;
  std::vector<int> color_of_;
};

}  // namespace

std::vector<Rgb> domain_palette(int count, std::span<const std::array<int, 2>> adjacent) {
  if (count < 0) throw InputError("domain_palette: count: must not be negative");
  if (count == 0) return {};
  const Neighbours neighbours = neighbour_lists(count, adjacent);
  const std::vector<Oklab> colors = spread_colors(std::min(count, kMaxDistinct));
  std::vector<Rgb> result;
  result.reserve(static_cast<std::size_t>(count));
  for (int color : Assignment(neighbours, colors).run()) {
    result.push_back(clamp_to_gamut(rgb_from_oklab(colors[color])));
  }
  return result;
}

}  // namespace piecework::render
