#pragma once

// Which elements of a surface pass through each other now: the check after every step. It shares
// no code with the detection that is to prevent them.

#include <vector>

#include <piecework/collision/surface.hpp>

namespace piecework::collision {

struct Intersection {
  int edge, triangle;  ///< numbers in the Surface
  bool operator==(const Intersection&) const = default;
  auto operator<=>(const Intersection&) const = default;
};

/// All edges that pass through triangles with which they share no vertex, at least one of them
/// cloth (with Surface::self off: exactly one), ascending by edge, then triangle. Decided exactly:
/// signs of determinants are certain. Mere touching counts as well.
/// \param x  num_vertices x 3, m
/// \throws SimulationError that names the vertex if a coordinate is not finite or beyond 1e100 m
std::vector<Intersection> find_intersections(const Surface& surface, const Positions& x);

}  // namespace piecework::collision
