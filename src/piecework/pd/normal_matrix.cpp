#include <piecework/pd/normal_matrix.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>

#include <piecework/core/parallel.hpp>
#include <piecework/model/projection.hpp>

namespace piecework::pd {
namespace {

constexpr double kInverseSqrt2 = 0.70710678118654752440;

std::size_t at(int index) { return static_cast<std::size_t>(index); }

/// The eigenvalues of symmetric B above 1 become 1: no stiffness is taken away twice.
Mat2 clamped(const Mat2& B) {
  const double mean = 0.5 * (B(0, 0) + B(1, 1));
  const double half_gap = std::hypot(0.5 * (B(0, 0) - B(1, 1)), B(0, 1));
  if (mean + half_gap <= 1) return B;
  if (!(mean - half_gap < 1)) return Mat2::Identity();
  // The projector onto the larger eigenvalue is (B - smaller I) / (larger - smaller).
  const double scale = (mean + half_gap - 1) / (2 * half_gap);
  return B - scale * (B - (mean - half_gap) * Mat2::Identity());
}

/// What of w |F - R|^2's Hessian projective dynamics leaves out, per unit weight.
struct Softening {
  Vec3 normal, R1, R2;
  double c_T;  ///< of the in-plane rotation
  Mat2 B;      ///< of motion along the normal
};

bool softening(const Mat32& F, Softening& result) {
  Mat32 R;
  if (!model::closest_isometry(F, R)) return false;  // a collapsed triangle keeps K's stiffness
  const Vec3 area = F.col(0).cross(F.col(1));
  const double s = area.norm();
  const double aa = F.col(0).squaredNorm();
  const double bb = F.col(1).squaredNorm();
  const double ab = F.col(0).dot(F.col(1));
  const double trace = std::sqrt(aa + bb + 2 * s);  // of S = (F^T F)^1/2
  Mat2 inverse;
  inverse << bb + s, -ab, -ab, aa + s;
  result = {area / s, R.col(0), R.col(1), std::min(1.0, 2 / trace), clamped(inverse / (s * trace))};
  return result.B.allFinite();
}

}  // namespace

NormalMatrix::NormalMatrix(const model::ClothModel& model, const model::Reduction& reduction,
                           const SparseMatrix& K)
    : model_(model),
      reduction_(reduction),
      K_(K),
      vertex_triangles_(mesh::vertex_triangles(model.triangles, model.num_vertices())),
      triangle_normal_(static_cast<Eigen::Index>(model.stretch.size()), 3),
      vertex_normal_(model.num_vertices(), 3),
      normals_(reduction.count(), 3),
      values_(static_cast<std::size_t>(K.nonZeros()), 0.0) {
  list_uses(reduction);
  list_pairs();
}

void NormalMatrix::list_uses(const model::Reduction& reduction) {
  use_begin_.reserve(model_.stretch.size() + 1);
  use_begin_.push_back(0);
  pair_begin_.push_back(0);
  std::vector<Use> uses;
  for (const model::StretchConstraint& c : model_.stretch) {
    const Vec2 G1 = c.rest_inverse.row(0).transpose();
    const Vec2 G2 = c.rest_inverse.row(1).transpose();
    const std::array<Vec2, 3> G{-(G1 + G2), G1, G2};
    uses.clear();
    for (std::size_t k = 0; k < 3; ++k)
      model_.sewing.map().visit_carriers(c.vertices[k], [&](int carrier, double weight) {
        const int unknown = reduction.number(carrier);
        if (unknown < 0) return;
        const auto same = std::find_if(uses.begin(), uses.end(),
                                       [&](const Use& use) { return use.unknown == unknown; });
        if (same == uses.end())
          uses.push_back({unknown, weight * G[k]});
        else
          same->G += weight * G[k];
      });
    std::sort(uses.begin(), uses.end(),
              [](const Use& a, const Use& b) { return a.unknown < b.unknown; });
    uses_.insert(uses_.end(), uses.begin(), uses.end());
    use_begin_.push_back(static_cast<int>(uses_.size()));
    pair_begin_.push_back(pair_begin_.back() +
                          static_cast<int>(uses.size() * (uses.size() + 1) / 2));
  }
  pair_value_.resize(at(pair_begin_.back()));
}

void NormalMatrix::list_pairs() {
  std::vector<int> entry_of_pair(pair_value_.size());
  parallel_for(model_.stretch.size(), [&](std::size_t t) {
    int pair = pair_begin_[t];
    for (int i = use_begin_[t]; i < use_begin_[t + 1]; ++i)
      for (int j = use_begin_[t]; j <= i; ++j) {
        const int column = uses_[at(j)].unknown;
        const int* first = K_.innerIndexPtr() + K_.outerIndexPtr()[column];
        const int* last = K_.innerIndexPtr() + K_.outerIndexPtr()[column + 1];
        entry_of_pair[at(pair++)] = static_cast<int>(
            std::lower_bound(first, last, uses_[at(i)].unknown) - K_.innerIndexPtr());
      }
  });
  entry_pairs_.begin.assign(values_.size() + 1, 0);
  for (const int entry : entry_of_pair) ++entry_pairs_.begin[at(entry) + 1];
  std::partial_sum(entry_pairs_.begin.begin(), entry_pairs_.begin.end(),
                   entry_pairs_.begin.begin());
  entry_pairs_.item.resize(entry_of_pair.size());
  std::vector<int> cursor(entry_pairs_.begin.begin(), entry_pairs_.begin.end() - 1);
  for (std::size_t pair = 0; pair < entry_of_pair.size(); ++pair)
    entry_pairs_.item[at(cursor[at(entry_of_pair[pair])]++)] = static_cast<int>(pair);
}

void NormalMatrix::find_normals(const Positions& x) {
  parallel_for(model_.triangles.size(), [&](std::size_t t) {
    const Triangle& v = model_.triangles[t];
    const Vec3 e1 = (x.row(v[1]) - x.row(v[0])).transpose();
    const Vec3 e2 = (x.row(v[2]) - x.row(v[0])).transpose();
    triangle_normal_.row(static_cast<Eigen::Index>(t)) = e1.cross(e2).transpose();
  });
  parallel_for(static_cast<std::size_t>(model_.num_vertices()), [&](std::size_t v) {
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    for (int k = vertex_triangles_.begin[v]; k < vertex_triangles_.begin[v + 1]; ++k)
      sum += triangle_normal_.row(vertex_triangles_.item[at(k)]);
    vertex_normal_.row(static_cast<Eigen::Index>(v)) = sum;
  });
  parallel_for(static_cast<std::size_t>(reduction_.count()), [&](std::size_t i) {
    const Eigen::RowVector3d sum = reduction_.row(vertex_normal_, static_cast<int>(i));
    const double length = sum.norm();
    normals_.row(static_cast<Eigen::Index>(i)) = length > 1e-200 && std::isfinite(length)
                                                     ? Eigen::RowVector3d(sum / length)
                                                     : Eigen::RowVector3d(0, 1, 0);
  });
}

void NormalMatrix::add_triangle(std::size_t t, const Positions& x) {
  const model::StretchConstraint& c = model_.stretch[t];
  double* const pairs = pair_value_.data() + pair_begin_[t];
  Mat32 edges;
  edges.col(0) = (x.row(c.vertices[1]) - x.row(c.vertices[0])).transpose();
  edges.col(1) = (x.row(c.vertices[2]) - x.row(c.vertices[0])).transpose();
  Softening soft;
  if (!softening(edges * c.rest_inverse, soft)) {
    std::fill(pairs, pair_value_.data() + pair_begin_[t + 1], 0.0);
    return;
  }
  const auto rotation = [&](const Use& use) {  // t_a . n_a
    const auto n = normals_.row(use.unknown);
    return kInverseSqrt2 * (use.G[1] * n.dot(soft.R1) - use.G[0] * n.dot(soft.R2));
  };
  int pair = 0;
  for (int i = use_begin_[t]; i < use_begin_[t + 1]; ++i) {
    const Use& a = uses_[at(i)];
    const double turn_a = soft.c_T * rotation(a);
    const Vec2 out_a = soft.B * a.G * normals_.row(a.unknown).dot(soft.normal);
    for (int j = use_begin_[t]; j <= i; ++j) {
      const Use& b = uses_[at(j)];
      pairs[pair++] = c.weight * (turn_a * rotation(b) +
                                  out_a.dot(b.G) * normals_.row(b.unknown).dot(soft.normal));
    }
  }
}

std::span<const double> NormalMatrix::assemble(const Positions& x) {
  find_normals(x);
  parallel_for(model_.stretch.size(), [&](std::size_t t) { add_triangle(t, x); });
  parallel_for(static_cast<std::size_t>(reduction_.count()), [&](std::size_t i) {
    const auto column = static_cast<Eigen::Index>(i);
    for (int e = K_.outerIndexPtr()[i]; e < K_.outerIndexPtr()[i + 1]; ++e) {
      const int row = K_.innerIndexPtr()[e];
      if (row < column) continue;
      double value = K_.valuePtr()[e];
      if (row != column) value *= normals_.row(row).dot(normals_.row(column));
      for (int k = entry_pairs_.begin[at(e)]; k < entry_pairs_.begin[at(e) + 1]; ++k)
        value -= pair_value_[at(entry_pairs_.item[at(k)])];
      values_[at(e)] = value;
    }
  });
  return values_;
}

}  // namespace piecework::pd
