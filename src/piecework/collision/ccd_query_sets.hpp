#pragma once

// Queries on which continuous collision detection goes wrong if it can: for tests and benchmarks.

#include <array>
#include <cstdint>
#include <string_view>

#include <piecework/collision/ccd.hpp>

namespace piecework::collision {

enum class QuerySet : std::uint8_t {
  Random,         ///< unit box, both ends of the motion anywhere
  Candidates,     ///< as a broad phase finds them: 1 cm apart or less, moving 1 mm or less
  Cloth,          ///< edges of 1 cm, gaps of 1 mm, approaching or receding by a few mm
  NearCoplanar,   ///< all within 1e-2 ... 1e-10 of a plane
  DoubleRoot,     ///< grazing: contact without crossing, or missed by a hair
  SmallIntegers,  ///< coordinates -2 ... 2: every degeneracy, exactly
  Parallel,       ///< parallel edges, collinear triangles, exactly or nearly
  ZeroLength,     ///< edges and triangles that are points or have two equal vertices
  Far,            ///< common translation by 1e4 ... 1e9
  Scales,         ///< random times 1e-6 ... 1e6
  Fast,           ///< motion of 1e2 ... 1e4 times the size, aimed
};

struct NamedQuerySet {
  QuerySet set;
  std::string_view name;
};

inline constexpr std::array<NamedQuerySet, 11> kQuerySets{{
    {QuerySet::Random, "random"},
    {QuerySet::Candidates, "candidates"},
    {QuerySet::Cloth, "cloth"},
    {QuerySet::NearCoplanar, "near_coplanar"},
    {QuerySet::DoubleRoot, "double_root"},
    {QuerySet::SmallIntegers, "small_integers"},
    {QuerySet::Parallel, "parallel"},
    {QuerySet::ZeroLength, "zero_length"},
    {QuerySet::Far, "far"},
    {QuerySet::Scales, "scales"},
    {QuerySet::Fast, "fast"},
}};

/// Query `index` of a set, always the same one; even ones VT, odd ones EE.
CcdQuery make_query(QuerySet set, std::uint64_t index);

}  // namespace piecework::collision
