#pragma once

// Orders in which the constraints of a domain are projected one after the other [Lu25, Sec. 5].

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace piecework::local {

/// Depth-first traversals of a constraint graph: nodes are constraints, neighbours share a vertex
/// [Lu25, Fig. 6]. Each order visits every constraint once, along a spanning tree of each connected
/// part, which starts at a constraint with a prescribed vertex if the part has one. The first order
/// takes neighbours by number, every other one shuffles them and starts elsewhere.
/// \param vertices    per constraint up to four vertices, -1 for none
/// \param prescribed  per vertex
/// \param count       number of orders, at least 1
std::vector<std::vector<int>> depth_first_orders(std::span<const std::array<int, 4>> vertices,
                                                 const std::vector<char>& prescribed, int count,
                                                 std::uint64_t seed);

}  // namespace piecework::local
