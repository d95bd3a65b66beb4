#pragma once

// Into which parts intersections divide cloth. Private to `untangle`.

#include <array>
#include <optional>
#include <vector>

#include "setting.hpp"

namespace piecework::untangle {

/// Vertices that hang together when the edges that pass through something are cut. Where a cut ends
/// a few edges short of the border it counts as going through: sheets that overlap in part cut each
/// other up to the first border that comes, be it whose it may.
class Regions {
 public:
  Regions(const Setting& setting, const std::vector<collision::Intersection>& crossings);

  /// The end of the edge that is in the smaller region, which has come through; nothing if both are
  /// in one.
  [[nodiscard]] std::optional<std::size_t> smaller_end(const std::array<int, 2>& edge) const;

 private:
  std::vector<int> region_;  ///< per vertex of cloth: a vertex that names its region
  std::vector<int> size_;    ///< by name
};

}  // namespace piecework::untangle
