#pragma once

// Vertices that hang together. Private to `untangle`.

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace piecework::untangle {

/// Disjoint sets of vertices, each named by its lowest vertex whatever the order of the calls.
class Groups {
 public:
  explicit Groups(int count) : parent_(static_cast<std::size_t>(count)) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  int find(int v) {
    while (parent(v) != v) v = parent(v) = parent(parent(v));
    return v;
  }
  void join(int v, int w) {
    v = find(v);
    w = find(w);
    parent(std::max(v, w)) = std::min(v, w);
  }
  /// Per vertex the name of its set.
  std::vector<int> all() {
    std::vector<int> names(parent_.size());
    for (std::size_t v = 0; v < names.size(); ++v) names[v] = find(static_cast<int>(v));
    return names;
  }

 private:
  int& parent(int v) { return parent_[static_cast<std::size_t>(v)]; }

  std::vector<int> parent_;
};

}  // namespace piecework::untangle
