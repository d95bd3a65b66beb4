#include "patches.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <piecework/core/error.hpp>

namespace piecework::local {
namespace {

/// Largest patch: more would not fit the nearest caches, nor 16-bit rows whatever the mesh (four
/// numbers for each of 3 vertices and 3 far ones of hinges per triangle). Measured with 512, 1024
/// and 2048: 9.3, 8.4 and 7.3 ms at 199809 vertices, mostly because the rim shrinks.
constexpr int kMaxPatchTriangles = 2048;
constexpr int kMinPatchTriangles = 512;
/// Small cloths get smaller patches, so that there are enough for the threads of any machine. Not a
/// matter of how many threads there are: bits depend on the patches.
constexpr int kWantedPatches = 64;

int num_patches(int triangles) {
  const int size = std::clamp(triangles / kWantedPatches, kMinPatchTriangles, kMaxPatchTriangles);
  return (triangles + size - 1) / size;
}

/// Divides triangles into compact groups by recursive bisection of their centres in the start
/// shape, across the longest side of their box. Compact is all that matters here, so this takes
/// neither a graph nor METIS.
class Bisection {
 public:
  explicit Bisection(const model::ClothModel& model)
      : center_(static_cast<Eigen::Index>(model.triangles.size()), 3),
        item_(model.triangles.size()) {
    std::iota(item_.begin(), item_.end(), 0);
    for (std::size_t t = 0; t < model.triangles.size(); ++t) {
      const Triangle& v = model.triangles[t];
      center_.row(static_cast<Eigen::Index>(t)) =
          model.start.row(v[0]) + model.start.row(v[1]) + model.start.row(v[2]);
    }
    const auto count = static_cast<int>(item_.size());
    if (count > 0) divide(0, count, num_patches(count));
  }

  /// Triangles per group, ascending.
  std::vector<std::vector<int>> groups;

 private:
  void divide(int begin, int end, int parts) {
    const auto first = item_.begin() + begin;
    const auto last = item_.begin() + end;
    if (parts == 1) {
      groups.emplace_back(first, last);
      std::sort(groups.back().begin(), groups.back().end());
      return;
    }
    Eigen::RowVector3d low = center_.row(*first);
    Eigen::RowVector3d high = low;
    for (auto it = first; it != last; ++it) {
      low = low.cwiseMin(center_.row(*it));
      high = high.cwiseMax(center_.row(*it));
    }
    Eigen::Index axis = 0;
    (high - low).maxCoeff(&axis);
    const int middle =
        begin + static_cast<int>(static_cast<std::int64_t>(end - begin) * (parts / 2) / parts);
    std::nth_element(first, item_.begin() + middle, last, [&](int a, int b) {
      const double at_a = center_(a, axis);
      const double at_b = center_(b, axis);
      return at_a < at_b || (at_a == at_b && a < b);
    });
    divide(begin, middle, parts / 2);
    divide(middle, end, parts - parts / 2);
  }

  Positions center_;
  std::vector<int> item_;
};

/// Turns the rest frame so that Dm^-1 is upper triangular.
void set_lane(const model::StretchConstraint& c, int lane, TriangleBatch& batch) {
  using Wide = long double;  // the determinant of a sliver would cancel
  const Wide a = c.rest_inverse(0, 0);
  const Wide b = c.rest_inverse(0, 1);
  const Wide p = c.rest_inverse(1, 0);
  const Wide q = c.rest_inverse(1, 1);
  const Wide norm = std::hypot(p, q);
  batch.g00[lane] = static_cast<double>((a * q - b * p) / norm);
  batch.g01[lane] = static_cast<double>((a * p + b * q) / norm);
  batch.g11[lane] = static_cast<double>(norm);
  batch.weight[lane] = c.weight;
}

FlatHinge make_hinge(const model::BendConstraint& c, const std::vector<int>& number) {
  FlatHinge hinge{};
  const double root = std::sqrt(c.weight);
  for (std::size_t k = 0; k < 4; ++k)
    hinge.vertex[k] = static_cast<RowOffset>(4 * number[static_cast<std::size_t>(c.vertices[k])]);
  for (std::size_t k = 0; k < 3; ++k) hinge.coefficient[k] = root * c.coefficient[k + 1];
  return hinge;
}

/// Calls place(item, slot) such that neighbours in `items` are far apart: what shares a vertex must
/// not wait for the sum that was just written. Slots are 0 ... rounded up to whole batches.
template <class Place>
void spread(const std::vector<int>& items, const Place& place) {
  const std::size_t rounds = (items.size() + kLanes - 1) / kLanes;
  for (std::size_t i = 0; i < items.size(); ++i) place(items[i], i % rounds * kLanes + i / rounds);
}

/// The same as a list without holes.
std::vector<int> spread(const std::vector<int>& items) {
  std::vector<int> slots((items.size() + kLanes - 1) / kLanes * kLanes, -1);
  spread(items, [&](int item, std::size_t slot) { slots[slot] = item; });
  slots.erase(std::remove(slots.begin(), slots.end(), -1), slots.end());
  return slots;
}

/// Bending constraints per group of triangles: with the first triangle of their hinge.
std::vector<std::vector<int>> hinge_groups(const model::ClothModel& model,
                                           const std::vector<std::vector<int>>& triangles) {
  std::vector<std::vector<int>> result(triangles.size());
  if (model.bend.empty()) return result;
  std::vector<int> group_of(model.triangles.size());
  for (std::size_t g = 0; g < triangles.size(); ++g)
    for (const int t : triangles[g]) group_of[static_cast<std::size_t>(t)] = static_cast<int>(g);
  int bend = 0;
  for (std::size_t i = 0; i < model.hinges.size(); ++i) {
    if (model.hinge_bends[i] == 0) continue;
    const auto t = static_cast<std::size_t>(model.hinges[i].triangles[0]);
    result[static_cast<std::size_t>(group_of[t])].push_back(bend++);
  }
  PIECEWORK_ASSERT(static_cast<std::size_t>(bend) == model.bend.size());
  return result;
}

/// Vertices of all constraints of a group, ascending.
std::vector<int> vertices_of(const model::ClothModel& model, const std::vector<int>& triangles,
                             const std::vector<int>& bends) {
  std::vector<int> result;
  for (const int t : triangles) {
    const auto& v = model.triangles[static_cast<std::size_t>(t)];
    result.insert(result.end(), v.begin(), v.end());
  }
  for (const int b : bends) {
    const auto& v = model.bend[static_cast<std::size_t>(b)].vertices;
    result.insert(result.end(), v.begin(), v.end());
  }
  std::sort(result.begin(), result.end());
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

void add_triangles(const model::ClothModel& model, const std::vector<int>& group,
                   const std::vector<int>& number, Patches& out) {
  const std::size_t first = out.batches.size();
  const std::size_t count = (group.size() + kLanes - 1) / kLanes;
  out.batches.resize(first + count);
  out.corners.resize(first + count);
  out.triangle.resize((first + count) * kLanes, -1);
  spread(group, [&](int t, std::size_t slot) {
    const std::size_t batch = first + slot / kLanes;
    const std::size_t lane = slot % kLanes;
    const auto& c = model.stretch[static_cast<std::size_t>(t)];
    set_lane(c, static_cast<int>(lane), out.batches[batch]);
    for (std::size_t k = 0; k < 3; ++k)
      out.corners[batch].corner[k][lane] =
          static_cast<RowOffset>(4 * number[static_cast<std::size_t>(c.vertices[k])]);
    out.triangle[batch * kLanes + lane] = t;
  });
}

void add_hinges(const model::ClothModel& model, const std::vector<int>& group,
                const std::vector<int>& number, Patches& out) {
  for (const int b : spread(group)) {
    const model::BendConstraint& c = model.bend[static_cast<std::size_t>(b)];
    const FlatHinge hinge = make_hinge(c, number);
    if (c.rest_length > 0)
      out.curved.push_back({hinge, std::sqrt(c.weight) * c.rest_length});
    else
      out.flat.push_back(hinge);
  }
}

/// Which rows of partial sums make up each vertex of the rim.
void link_rims(int num_vertices, const std::vector<int>& uses, Patches& out) {
  std::vector<int> rim_number(static_cast<std::size_t>(num_vertices), -1);
  out.partial_begin.assign(1, 0);
  for (int v = 0; v < num_vertices; ++v) {
    const int count = uses[static_cast<std::size_t>(v)];
    if (count == 1) continue;
    rim_number[static_cast<std::size_t>(v)] = static_cast<int>(out.rim.size());
    out.rim.push_back(v);
    out.partial_begin.push_back(out.partial_begin.back() + count);
  }
  out.partial.resize(static_cast<std::size_t>(out.partial_begin.back()));
  std::vector<int> cursor(out.partial_begin.begin(), out.partial_begin.end() - 1);
  for (const Patch& patch : out.patches)
    for (int i = patch.num_inner; i < patch.num_vertices; ++i) {
      const int v = out.vertex[static_cast<std::size_t>(patch.first_vertex + i)];
      const auto r = static_cast<std::size_t>(rim_number[static_cast<std::size_t>(v)]);
      out.partial[static_cast<std::size_t>(cursor[r]++)] =
          patch.first_partial + i - patch.num_inner;
    }
}

}  // namespace

Patches::Patches(const model::ClothModel& model) {
  const auto groups = Bisection(model).groups;
  const auto bends = hinge_groups(model, groups);
  std::vector<std::vector<int>> vertices(groups.size());
  std::vector<int> uses(static_cast<std::size_t>(model.num_vertices()), 0);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    vertices[g] = vertices_of(model, groups[g], bends[g]);
    for (const int v : vertices[g]) ++uses[static_cast<std::size_t>(v)];
  }
  std::vector<int> number(uses.size(), -1);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    std::vector<int>& own = vertices[g];
    const auto rim_begin = std::stable_partition(
        own.begin(), own.end(), [&](int v) { return uses[static_cast<std::size_t>(v)] == 1; });
    Patch patch;
    patch.first_vertex = static_cast<int>(vertex.size());
    patch.num_vertices = static_cast<int>(own.size());
    patch.num_inner = static_cast<int>(rim_begin - own.begin());
    patch.first_partial = num_partials;
    patch.first_batch = static_cast<int>(batches.size());
    patch.first_flat = static_cast<int>(flat.size());
    patch.first_curved = static_cast<int>(curved.size());
    for (std::size_t i = 0; i < own.size(); ++i)
      number[static_cast<std::size_t>(own[i])] = static_cast<int>(i);
    PIECEWORK_ASSERT(own.size() <= 16384);
    add_triangles(model, groups[g], number, *this);
    add_hinges(model, bends[g], number, *this);
    patch.num_batches = static_cast<int>(batches.size()) - patch.first_batch;
    patch.num_flat = static_cast<int>(flat.size()) - patch.first_flat;
    patch.num_curved = static_cast<int>(curved.size()) - patch.first_curved;
    num_partials += patch.num_vertices - patch.num_inner;
    max_vertices = std::max(max_vertices, patch.num_vertices);
    max_batches = std::max(max_batches, patch.num_batches);
    vertex.insert(vertex.end(), own.begin(), own.end());
    patches.push_back(patch);
  }
  link_rims(model.num_vertices(), uses, *this);
}

}  // namespace piecework::local
