#include <piecework/pd/normal_matrix.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include <piecework/core/parallel.hpp>
#include <piecework/mesh/topology.hpp>
#include <piecework/model/hessian.hpp>
#include <piecework/model/projection.hpp>

#include "kernels.hpp"

namespace piecework::pd {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

/// How much of each corner of a triangle an unknown carries.
struct Use {
  int unknown;
  Vec3 share;
};

/// A triangle with slaves of seams: its corners hang on more than three unknowns.
struct SewnTriangle {
  int triangle;
  int first_use, num_uses;
  int first_pair;
};

}  // namespace

struct NormalMatrix::Impl {
  Impl(const model::ClothModel& m, const model::Reduction& r, const SparseMatrix& k, Isa isa)
      : model(m),
        reduction(r),
        K(k),
        kernels(outer_kernels(isa)),
        vertex_triangles(mesh::vertex_triangles(m.triangles, m.num_vertices())),
        triangle_normal(static_cast<Eigen::Index>(m.stretch.size()), 3),
        vertex_normal(m.num_vertices(), 3),
        normals(Positions::Zero(r.count() + 1, 3)),
        values(static_cast<std::size_t>(k.nonZeros()), 0.0) {
    sort_triangles();
    list_pairs();
  }

  void sort_triangles();
  void add_plain(std::size_t t);
  void add_sewn(std::size_t t);
  void list_pairs();
  template <class Visit>
  void visit_pairs(const Visit& visit) const;
  void find_normals(const Positions& x);
  void fill_sewn(const SewnTriangle& sewn, const Positions& x);
  void gather_column(std::size_t column, const Eigen::VectorXd& extra_diagonal);

  const model::ClothModel& model;
  const model::Reduction& reduction;
  const SparseMatrix& K;
  const OuterKernels& kernels;
  std::vector<NormalBatch> batches;  ///< triangles without slaves
  int in_last_batch = kLanes;        ///< used lanes
  std::vector<SewnTriangle> sewn;
  std::vector<Use> uses;
  std::vector<double> pair_value;  ///< of the batches, then of sewn triangles, N/m
  mesh::Adjacency entry_pairs;     ///< per entry of K~: which pair_value belong to it
  mesh::Adjacency vertex_triangles;
  Positions triangle_normal;  ///< per triangle, twice its area long, m^2
  Positions vertex_normal;    ///< |V| x 3, sums of the above
  Positions normals;          ///< N, and a row of zeros for held vertices
  std::vector<double> values;
};

NormalMatrix::NormalMatrix(const model::ClothModel& model, const model::Reduction& reduction,
                           const SparseMatrix& K, Isa isa)
    : impl_(std::make_unique<Impl>(model, reduction, K, isa)) {}
NormalMatrix::~NormalMatrix() = default;

Eigen::Map<const Positions> NormalMatrix::normals() const {
  return {impl_->normals.data(), impl_->reduction.count(), 3};
}

void NormalMatrix::Impl::sort_triangles() {
  const mesh::SeamMap& seams = model.sewing.map();
  const auto is_sewn = [&](std::size_t t) {
    const Triangle& v = model.stretch[t].vertices;
    return std::any_of(v.begin(), v.end(), [&](int vertex) { return seams.is_slave(vertex); });
  };
  for (std::size_t t = 0; t < model.stretch.size(); ++t)
    if (!is_sewn(t)) add_plain(t);
  pair_value.resize(batches.size() * kPairs * kLanes);
  for (std::size_t t = 0; t < model.stretch.size(); ++t)
    if (is_sewn(t)) add_sewn(t);
}

void NormalMatrix::Impl::add_plain(std::size_t t) {
  if (in_last_batch == kLanes) {
    batches.emplace_back(NormalBatch{});
    // Lanes that stay free: any triangle without weight.
    for (int k = 0; k < 3; ++k)
      std::fill_n(batches.back().unknown[k], kLanes, 3 * reduction.count());
    in_last_batch = 0;
  }
  NormalBatch& batch = batches.back();
  const model::StretchConstraint& c = model.stretch[t];
  const int lane = in_last_batch++;
  batch.weight[lane] = c.weight;
  for (int k = 0; k < 4; ++k) batch.inverse[k][lane] = c.rest_inverse(k / 2, k % 2);
  for (int k = 0; k < 3; ++k) {
    const int number = reduction.number(c.vertices[at(k)]);
    batch.vertex[k][lane] = 3 * c.vertices[at(k)];
    batch.unknown[k][lane] = 3 * (number < 0 ? reduction.count() : number);
  }
}

void NormalMatrix::Impl::add_sewn(std::size_t t) {
  const model::StretchConstraint& c = model.stretch[t];
  const auto first = static_cast<std::ptrdiff_t>(uses.size());
  for (int k = 0; k < 3; ++k)
    model.sewing.map().visit_carriers(c.vertices[at(k)], [&](int carrier, double weight) {
      const int unknown = reduction.number(carrier);
      if (unknown < 0) return;
      const auto same = std::find_if(uses.begin() + first, uses.end(),
                                     [&](const Use& use) { return use.unknown == unknown; });
      if (same == uses.end())
        uses.push_back({unknown, weight * Vec3::Unit(k)});
      else
        same->share[k] += weight;
    });
  const int count = static_cast<int>(std::ssize(uses) - first);
  sewn.push_back(
      {static_cast<int>(t), static_cast<int>(first), count, static_cast<int>(pair_value.size())});
  pair_value.resize(pair_value.size() + static_cast<std::size_t>(count * (count + 1) / 2));
}

/// Calls visit(unknown, unknown, index into pair_value).
template <class Visit>
void NormalMatrix::Impl::visit_pairs(const Visit& visit) const {
  for (std::size_t b = 0; b < batches.size(); ++b)
    for (int lane = 0; lane < kLanes; ++lane) {
      int pair = static_cast<int>(b) * kPairs * kLanes + lane;
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j <= i; ++j, pair += kLanes)
          visit(batches[b].unknown[i][lane] / 3, batches[b].unknown[j][lane] / 3, pair);
    }
  for (const SewnTriangle& s : sewn) {
    int pair = s.first_pair;
    for (int i = 0; i < s.num_uses; ++i)
      for (int j = 0; j <= i; ++j, ++pair)
        visit(uses[at(s.first_use + i)].unknown, uses[at(s.first_use + j)].unknown, pair);
  }
}

void NormalMatrix::Impl::list_pairs() {
  std::vector<int> entry_of_pair(pair_value.size(), -1);
  entry_pairs.begin.assign(values.size() + 1, 0);
  visit_pairs([&](int a, int b, int pair) {
    const auto [column, row] = std::minmax(a, b);
    if (row == reduction.count()) return;  // a held vertex
    const int* first = K.innerIndexPtr() + K.outerIndexPtr()[column];
    const int* last = K.innerIndexPtr() + K.outerIndexPtr()[column + 1];
    const auto entry = std::lower_bound(first, last, row) - K.innerIndexPtr();
    entry_of_pair[at(pair)] = static_cast<int>(entry);
    ++entry_pairs.begin[static_cast<std::size_t>(entry) + 1];
  });
  std::partial_sum(entry_pairs.begin.begin(), entry_pairs.begin.end(), entry_pairs.begin.begin());
  entry_pairs.item.resize(at(entry_pairs.begin.back()));
  std::vector<int> cursor(entry_pairs.begin.begin(), entry_pairs.begin.end() - 1);
  for (std::size_t pair = 0; pair < entry_of_pair.size(); ++pair)
    if (entry_of_pair[pair] >= 0)
      entry_pairs.item[at(cursor[at(entry_of_pair[pair])]++)] = static_cast<int>(pair);
}

void NormalMatrix::Impl::find_normals(const Positions& x) {
  parallel_for(model.triangles.size(), [&](std::size_t t) {
    const Triangle& v = model.triangles[t];
    const Vec3 e1 = (x.row(v[1]) - x.row(v[0])).transpose();
    const Vec3 e2 = (x.row(v[2]) - x.row(v[0])).transpose();
    triangle_normal.row(static_cast<Eigen::Index>(t)) = e1.cross(e2).transpose();
  });
  parallel_for(static_cast<std::size_t>(model.num_vertices()), [&](std::size_t v) {
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    for (int k = vertex_triangles.begin[v]; k < vertex_triangles.begin[v + 1]; ++k)
      sum += triangle_normal.row(vertex_triangles.item[at(k)]);
    vertex_normal.row(static_cast<Eigen::Index>(v)) = sum;
  });
  parallel_for(static_cast<std::size_t>(reduction.count()), [&](std::size_t i) {
    const Eigen::RowVector3d sum = reduction.row(vertex_normal, static_cast<int>(i));
    const double length = sum.norm();
    normals.row(static_cast<Eigen::Index>(i)) = length > 1e-200 && std::isfinite(length)
                                                    ? Eigen::RowVector3d(sum / length)
                                                    : Eigen::RowVector3d(0, 1, 0);
  });
}

void NormalMatrix::Impl::fill_sewn(const SewnTriangle& s, const Positions& x) {
  const model::StretchConstraint& c = model.stretch[at(s.triangle)];
  double* pair = pair_value.data() + s.first_pair;
  const Mat32 F = model::deformation_gradient(c, x);
  Mat32 R;
  if (!model::closest_isometry(F, R)) {  // a collapsed triangle keeps K's stiffness
    std::fill_n(pair, s.num_uses * (s.num_uses + 1) / 2, 0.0);
    return;
  }
  const auto soft = model::stretch_softening(c, F, R, model::HessianForm::Projected);
  for (int i = 0; i < s.num_uses; ++i) {
    const Use& a = uses[at(s.first_use + i)];
    const auto n_a = normals.row(a.unknown);
    const double turn_a = n_a * soft.twist * a.share;
    const double out_a = n_a * soft.normal;
    for (int j = 0; j <= i; ++j) {
      const Use& b = uses[at(s.first_use + j)];
      const auto n_b = normals.row(b.unknown);
      const double turn_b = n_b * soft.twist * b.share;
      const double out_b = n_b * soft.normal;
      *pair++ = turn_a * turn_b + a.share.dot(soft.bend * b.share) * out_a * out_b;
    }
  }
}

void NormalMatrix::Impl::gather_column(std::size_t column, const Eigen::VectorXd& extra_diagonal) {
  const auto c = static_cast<Eigen::Index>(column);
  const Eigen::RowVector3d n = normals.row(c);
  for (int e = K.outerIndexPtr()[column]; e < K.outerIndexPtr()[column + 1]; ++e) {
    const int row = K.innerIndexPtr()[e];
    if (row < c) continue;
    double value = K.valuePtr()[e];
    if (row != c)
      value *= normals.row(row).dot(n);
    else if (extra_diagonal.size() > 0)
      value += extra_diagonal[c];
    for (int k = entry_pairs.begin[at(e)]; k < entry_pairs.begin[at(e) + 1]; ++k)
      value -= pair_value[at(entry_pairs.item[at(k)])];
    values[at(e)] = value;
  }
}

void NormalMatrix::find_normals(const Positions& x) { impl_->find_normals(x); }

std::span<const double> NormalMatrix::assemble(const Positions& x,
                                               const Eigen::VectorXd& extra_diagonal) {
  Impl& a = *impl_;
  constexpr std::size_t kBatches = 32;  // per task
  parallel_for((a.batches.size() + kBatches - 1) / kBatches,
               [&](std::size_t block) {
                 const std::size_t first = block * kBatches;
                 const auto count = std::min(kBatches, a.batches.size() - first);
                 a.kernels.normal_pairs(a.batches.data() + first, static_cast<int>(count), x.data(),
                                        a.normals.data(),
                                        a.pair_value.data() + first * kPairs * kLanes);
               },
               1);
  parallel_for(a.sewn.size(), [&](std::size_t s) { a.fill_sewn(a.sewn[s], x); });
  parallel_for(static_cast<std::size_t>(a.reduction.count()),
               [&](std::size_t column) { a.gather_column(column, extra_diagonal); });
  return a.values;
}

}  // namespace piecework::pd
