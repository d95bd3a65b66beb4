#pragma once

// Constraints in groups within which no two move the same vertex.

#include <span>
#include <vector>

namespace piecework::baselines {

/// Items sorted by colour, ascending within each.
struct Coloring {
  std::vector<int> item;
  std::vector<int> begin;  ///< per colour: offsets into item, one more

  [[nodiscard]] int num_colors() const { return static_cast<int>(begin.size()) - 1; }
};

/// Each item takes the first colour that none of its vertices has, in the order of the items.
/// \param vertices_begin  per item: offsets into vertices, one more
/// \param blocks          per vertex: items that share it need different colours
Coloring color_greedily(std::span<const int> vertices_begin, std::span<const int> vertices,
                        const std::vector<char>& blocks);

}  // namespace piecework::baselines
