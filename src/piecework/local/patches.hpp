#pragma once

// All constraints of a model, cut into patches. Private to `local`.

#include <vector>

#include <piecework/model/constraints.hpp>

#include "patch.hpp"

namespace piecework::local {

/// All constraints of a model. A function of the model alone.
struct Patches {
  explicit Patches(const model::ClothModel& model);

  std::vector<Patch> patches;
  std::vector<int> vertex;  ///< patch by patch: inner vertices, ascending, then the rim
  std::vector<TriangleBatch> batches;
  std::vector<BatchCorners> corners;
  std::vector<int> triangle;  ///< kLanes per batch; -1: none
  std::vector<FlatHinge> flat;
  std::vector<CurvedHinge> curved;
  int max_vertices = 0, max_batches = 0;  ///< of a patch

  /// Vertices on the rim of some patch, or without constraints; ascending.
  std::vector<int> rim;
  std::vector<int> partial_begin;  ///< per vertex of the rim: offsets into `partial`
  std::vector<int> partial;        ///< rows of partial sums, in the order of the patches
  int num_partials = 0;
};

}  // namespace piecework::local
