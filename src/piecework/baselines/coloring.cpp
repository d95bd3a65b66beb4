#include <piecework/baselines/coloring.hpp>

#include <algorithm>
#include <numeric>

namespace piecework::baselines {

Coloring color_greedily(std::span<const int> vertices_begin, std::span<const int> vertices,
                        const std::vector<char>& blocks) {
  const std::size_t count = vertices_begin.size() - 1;
  std::vector<std::vector<int>> taken(blocks.size());  // per vertex: colours of its items so far
  std::vector<int> color(count);
  std::vector<int> near;
  for (std::size_t i = 0; i < count; ++i) {
    near.clear();
    const auto mine =
        vertices.subspan(static_cast<std::size_t>(vertices_begin[i]),
                         static_cast<std::size_t>(vertices_begin[i + 1] - vertices_begin[i]));
    for (const int v : mine) {
      const auto& of_vertex = taken[static_cast<std::size_t>(v)];
      near.insert(near.end(), of_vertex.begin(), of_vertex.end());
    }
    std::sort(near.begin(), near.end());
    int first = 0;
    for (const int other : near) {
      if (other > first) break;
      if (other == first) ++first;
    }
    color[i] = first;
    for (const int v : mine)
      if (blocks[static_cast<std::size_t>(v)]) taken[static_cast<std::size_t>(v)].push_back(first);
  }
  const int num_colors = count > 0 ? *std::max_element(color.begin(), color.end()) + 1 : 0;
  Coloring result;
  result.begin.assign(static_cast<std::size_t>(num_colors) + 1, 0);
  for (const int c : color) ++result.begin[static_cast<std::size_t>(c) + 1];
  std::partial_sum(result.begin.begin(), result.begin.end(), result.begin.begin());
  result.item.resize(count);
  std::vector<int> cursor(result.begin.begin(), result.begin.end() - 1);
  for (std::size_t i = 0; i < count; ++i)
    result.item[static_cast<std::size_t>(cursor[static_cast<std::size_t>(color[i])]++)] =
        static_cast<int>(i);
  return result;
}

}  // namespace piecework::baselines
