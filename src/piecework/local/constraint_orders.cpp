#include <piecework/local/constraint_orders.hpp>

#include <algorithm>
#include <numeric>

#include <piecework/core/random.hpp>

namespace piecework::local {
namespace {

using Vertices = std::span<const std::array<int, 4>>;

/// Uses of each vertex, vertices numbered by first use: the graph without its edges.
class Incidence {
 public:
  explicit Incidence(Vertices vertices) : number_(vertices.size()) {
    std::vector<int> all;
    for (const auto& v : vertices) all.insert(all.end(), v.begin(), v.end());
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    uses_.resize(all.size());
    for (std::size_t c = 0; c < vertices.size(); ++c)
      for (std::size_t k = 0; k < 4; ++k) {
        const auto it = std::lower_bound(all.begin(), all.end(), vertices[c][k]);
        number_[c][k] = vertices[c][k] < 0 ? -1 : static_cast<int>(it - all.begin());
        if (vertices[c][k] >= 0)
          uses_[static_cast<std::size_t>(number_[c][k])].push_back(static_cast<int>(c));
      }
  }

  void shuffle(Random& random) {
    for (auto& list : uses_)
      for (std::size_t i = list.size(); i > 1; --i) std::swap(list[i - 1], list[random.next() % i]);
  }

  /// The cursor-th use of a vertex of constraint c, -1 when there is none left.
  [[nodiscard]] int neighbor(int c, std::size_t cursor) const {
    for (const int v : number_[static_cast<std::size_t>(c)]) {
      if (v < 0) continue;
      const auto& list = uses_[static_cast<std::size_t>(v)];
      if (cursor < list.size()) return list[cursor];
      cursor -= list.size();
    }
    return -1;
  }

 private:
  std::vector<std::array<int, 4>> number_;
  std::vector<std::vector<int>> uses_;
};

/// Visits what is connected to `start`.
void traverse(const Incidence& graph, int start, std::vector<char>& seen, std::vector<int>& order) {
  struct Visit {
    int constraint;
    std::size_t cursor;
  };
  std::vector<Visit> path;
  const auto enter = [&](int c) {
    seen[static_cast<std::size_t>(c)] = 1;
    order.push_back(c);
    path.push_back({c, 0});
  };
  enter(start);
  while (!path.empty()) {
    const int next = graph.neighbor(path.back().constraint, path.back().cursor++);
    if (next < 0)
      path.pop_back();
    else if (seen[static_cast<std::size_t>(next)] == 0)
      enter(next);
  }
}

/// Constraints in the order in which they are tried as starts: those with a prescribed vertex, from
/// another one for each order, then the others.
std::vector<int> starts(Vertices vertices, const std::vector<char>& prescribed, int order) {
  std::vector<int> result(vertices.size());
  std::iota(result.begin(), result.end(), 0);
  const auto end = std::stable_partition(result.begin(), result.end(), [&](int c) {
    const auto& v = vertices[static_cast<std::size_t>(c)];
    return std::any_of(v.begin(), v.end(), [&](int vertex) {
      return vertex >= 0 && prescribed[static_cast<std::size_t>(vertex)] != 0;
    });
  });
  const auto count = end - result.begin();
  if (count > 0) std::rotate(result.begin(), result.begin() + order % count, end);
  return result;
}

}  // namespace

std::vector<std::vector<int>> depth_first_orders(Vertices vertices,
                                                 const std::vector<char>& prescribed, int count,
                                                 std::uint64_t seed) {
  Incidence graph(vertices);
  Random random(seed);
  std::vector<std::vector<int>> orders(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    if (i > 0) graph.shuffle(random);
    auto& order = orders[static_cast<std::size_t>(i)];
    order.reserve(vertices.size());
    std::vector<char> seen(vertices.size(), 0);
    for (const int start : starts(vertices, prescribed, i))
      if (seen[static_cast<std::size_t>(start)] == 0) traverse(graph, start, seen, order);
  }
  return orders;
}

}  // namespace piecework::local
