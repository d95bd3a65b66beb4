#include "regions.hpp"

#include <utility>

#include "groups.hpp"

namespace piecework::untangle {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

constexpr int kBridge = 1;  // edges around a cut that do not join regions

/// Uncut edges of cloth.
mesh::Adjacency uncut_neighbours(const Setting& setting, const std::vector<char>& cut) {
  const int count = setting.model.num_vertices();
  mesh::Adjacency neighbours;
  neighbours.begin.assign(at(count) + 1, 0);
  const auto for_uncut = [&](const auto& visit) {
    for (std::size_t e = 0; e < cut.size(); ++e) {
      const auto& [v, w] = setting.surface.edges[e];
      if (cut[e] || !setting.surface.is_cloth(v)) continue;
      visit(v, w);
      visit(w, v);
    }
  };
  for_uncut([&](int v, int) { ++neighbours.begin[at(v) + 1]; });
  for (int v = 0; v < count; ++v) neighbours.begin[at(v) + 1] += neighbours.begin[at(v)];
  neighbours.item.resize(at(neighbours.begin.back()));
  std::vector<int> next(neighbours.begin.begin(), neighbours.begin.end() - 1);
  for_uncut([&](int v, int w) { neighbours.item[at(next[at(v)]++)] = w; });
  return neighbours;
}

/// Goes outward from the vertices in `front`, ring by ring, up to `rings`; calls visit(from, to)
/// for every edge to a vertex and goes on from there if that is true.
template <class Visit>
void flood(const mesh::Adjacency& neighbours, std::vector<int> front, int rings,
           const Visit& visit) {
  for (int ring = 0; ring < rings && !front.empty(); ++ring) {
    std::vector<int> next;
    for (const int v : front)
      for (int i = neighbours.begin[at(v)]; i < neighbours.begin[at(v) + 1]; ++i)
        if (visit(v, neighbours.item[at(i)])) next.push_back(neighbours.item[at(i)]);
    front = std::move(next);
  }
}

/// Vertices at most kBridge edges from a cut.
std::vector<char> near_cuts(const Setting& setting, const std::vector<char>& cut,
                            const mesh::Adjacency& neighbours) {
  std::vector<char> near(at(setting.model.num_vertices()), 0);
  std::vector<int> front;
  for (std::size_t e = 0; e < cut.size(); ++e)
    for (const int v : setting.surface.edges[e])
      if (cut[e] && setting.surface.is_cloth(v) && !near[at(v)]) {
        near[at(v)] = 1;
        front.push_back(v);
      }
  flood(neighbours, front, kBridge, [&](int, int to) { return !std::exchange(near[at(to)], 1); });
  return near;
}

}  // namespace

Regions::Regions(const Setting& setting, const std::vector<collision::Intersection>& crossings)
    : size_(at(setting.model.num_vertices()), 0) {
  const int count = setting.model.num_vertices();
  std::vector<char> cut(setting.surface.edges.size(), 0);
  for (const collision::Intersection& c : crossings) cut[at(c.edge)] = 1;
  const mesh::Adjacency neighbours = uncut_neighbours(setting, cut);
  const std::vector<char> near = near_cuts(setting, cut, neighbours);

  Groups far(count), close(count);
  for (int v = 0; v < count; ++v)
    for (int i = neighbours.begin[at(v)]; i < neighbours.begin[at(v) + 1]; ++i) {
      const int w = neighbours.item[at(i)];
      if (near[at(v)] == near[at(w)]) (near[at(v)] ? close : far).join(v, w);
    }
  region_ = far.all();
  std::vector<int> front;
  for (int v = 0; v < count; ++v)
    if (near[at(v)])
      region_[at(v)] = -1;
    else
      front.push_back(v);
  flood(neighbours, front, count, [&](int from, int to) {
    if (region_[at(to)] >= 0) return false;
    region_[at(to)] = region_[at(from)];
    return true;
  });
  // What has come through by a few vertices only.
  for (int v = 0; v < count; ++v)
    if (region_[at(v)] < 0) region_[at(v)] = close.find(v);
  for (const int name : region_) ++size_[at(name)];
}

std::optional<std::size_t> Regions::smaller_end(const std::array<int, 2>& edge) const {
  const int a = region_[at(edge[0])], b = region_[at(edge[1])];
  if (a == b) return std::nullopt;
  return std::pair(size_[at(a)], -a) < std::pair(size_[at(b)], -b) ? 0 : 1;
}

}  // namespace piecework::untangle
