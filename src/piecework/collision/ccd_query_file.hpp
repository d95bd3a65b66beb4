#pragma once

// Files of queries with known answers for continuous collision detection.

#include <filesystem>
#include <vector>

#include <piecework/collision/ccd.hpp>

namespace piecework::collision {

struct CcdQueryFile {
  std::vector<CcdQuery> queries;
  std::vector<char> truth;              ///< of each query: whether it meets
  std::size_t rounded_coordinates = 0;  ///< that are no doubles; the truth may be another for them
};

/// Reads the layout of the benchmark of [Wang, Ferguson, Schneider, Jiang, Attene, Panozzo 2021]:
/// eight lines per query, each
///     x numerator, x denominator, y numerator, y denominator, z numerator, z denominator, truth
/// with integers of any length, truth 0 or 1 and the same in all eight. The first four points are
/// the vertices at the start (vertex and triangle, or edge and edge), the last four at the end.
/// Coordinates become the nearest doubles. Line ends may be those of DOS, the last may be missing.
///
/// \throws InputError naming file and line: the file is missing or holds no query, a line has
///         another form, a denominator is zero, a coordinate is too large, a query is incomplete
CcdQueryFile read_ccd_queries(const std::filesystem::path& path, PairKind kind);

}  // namespace piecework::collision
