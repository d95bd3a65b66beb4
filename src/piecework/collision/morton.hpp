#pragma once

// Points along a space-filling curve. Private to `collision`.

#include <cstdint>
#include <span>
#include <vector>

namespace piecework::collision {

/// Bits of x, y, z interleaved, 10 each: neighbours in this order are neighbours in space
/// [Morton 1966]. \param x,y,z  in [0, 1], clamped
std::uint32_t morton_code(float x, float y, float z);

/// Sorts keys by their upper 32 bits, of which 30 are used; equal ones keep their order. Parallel.
/// \param spare  room of the same size, contents lost
void sort_by_code(std::vector<std::uint64_t>& keys, std::vector<std::uint64_t>& spare);

}  // namespace piecework::collision
