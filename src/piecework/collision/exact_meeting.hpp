#pragma once

// Whether a segment and a triangle have a point in common, decided exactly. Private to `collision`.

#include <array>

#include <piecework/core/types.hpp>

namespace piecework::collision {

/// Largest coordinate, m, for which a determinant of three differences stays finite.
inline constexpr double kFarthest = 1e100;

using Segment = std::array<Vec3, 2>;
using Corners = std::array<Vec3, 3>;

/// Sign of det(b - a, c - a, d - a): 1 if d is on the side of the triangle a b c from which a, b, c
/// run counter-clockwise, -1 on the other, 0 in its plane. Exact: floating point where its error
/// bound [Shewchuk 1997] leaves no doubt, rational numbers otherwise. \pre coordinates up to
/// kFarthest
int orientation(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d);

/// True if the closed segment and the closed triangle, either of them possibly degenerate, have a
/// point in common. \pre coordinates up to kFarthest
bool meet(const Segment& segment, const Corners& triangle);

}  // namespace piecework::collision
