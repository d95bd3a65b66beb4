#pragma once

// What really happens to a pair in motion, in exact arithmetic: the measure of first_contact() in
// tests and benchmarks. It shares no formula with it.

#include <optional>

#include <piecework/collision/ccd.hpp>

namespace piecework::collision {

/// The first t in [0, 1], rounded down to a double, at which the distance of the pair is at most
/// `min_separation`; nothing if there is none. All numbers are taken as they are, none is rounded
/// on the way, and no degenerate case is left out. Some 0.1 ms where the answer is close.
///
/// The distance of two elements is that of two of their features (a face, an edge, a vertex) whose
/// closest points lie inside them. It reaches `min_separation` at t = 0 or at a root of one of the
/// polynomials (distance^2 - min_separation^2) * (denominator), where the other polynomials that
/// say "inside" must have the right signs.
std::optional<double> exact_first_contact(const CcdQuery& query, double min_separation = 0);

enum class CcdVerdict : std::uint8_t { Right, Missed, Late, FalsePositive };

/// \param exact  from exact_first_contact()
CcdVerdict judge(const CcdResult& result, const std::optional<double>& exact);

}  // namespace piecework::collision
