#include <piecework/testing/patchwork.hpp>

#include <algorithm>
#include <string>

#include <Eigen/LU>

#include <piecework/testing/small_cloths.hpp>

namespace piecework::testing {
namespace {

/// Border vertices of a patch as a closed loop, in the patch's own numbers.
std::vector<int> loop_of(const Patch& p) {
  std::vector<int> loop;
  for (int i = 0; i + 1 < p.columns; ++i) loop.push_back(i);
  for (int j = 0; j + 1 < p.rows; ++j) loop.push_back(j * p.columns + p.columns - 1);
  for (int i = p.columns - 1; i > 0; --i) loop.push_back((p.rows - 1) * p.columns + i);
  for (int j = p.rows - 1; j > 0; --j) loop.push_back(j * p.columns);
  loop.push_back(0);
  return loop;
}

/// Sews v onto the loop if it lies on it.
bool sew_onto(const Positions& x, int v, const std::vector<int>& loop, int first,
              std::vector<mesh::Stitch>& stitches) {
  for (std::size_t k = 0; k + 1 < loop.size(); ++k) {
    const int a = first + loop[k];
    const int b = first + loop[k + 1];
    const Eigen::RowVector3d along = x.row(b) - x.row(a);
    const double ratio = (x.row(v) - x.row(a)).dot(along) / along.squaredNorm();
    if (ratio < -1e-12 || ratio > 1 + 1e-12) continue;
    if ((x.row(a) + ratio * along - x.row(v)).norm() > 1e-12) continue;
    stitches.push_back({.vertex = v, .a = a, .b = b, .ratio = std::clamp(ratio, 0.0, 1.0)});
    return true;
  }
  return false;
}

}  // namespace

mesh::TriangleMesh patchwork(const std::vector<Patch>& patches) {
  mesh::TriangleMesh all;
  for (const Patch& p : patches) {
    mesh::TriangleMesh one = grid_mesh(p.columns, p.rows);
    one.positions.col(0) = (p.x0 + (p.x1 - p.x0) * one.positions.col(0).array()).matrix();
    one.positions.col(2) = (p.z0 + (p.z1 - p.z0) * one.positions.col(2).array()).matrix();
    all = all.triangles.empty() ? one : disjoint_union(all, one);
  }
  return all;
}

std::vector<Patch> four_patches() {
  return {{0, 0, 1, 0.4, 13, 7},
          {0, 0.4, 0.47, 1, 6, 6},
          {0.47, 0.4, 1, 0.7, 9, 8},
          {0.47, 0.7, 1, 1, 5, 12}};
}

std::vector<mesh::Stitch> geometric_stitches(const std::vector<Patch>& patches) {
  const Positions x = patchwork(patches).positions;
  std::vector<mesh::Stitch> stitches;
  std::vector<int> first = {0};
  for (const Patch& p : patches) first.push_back(first.back() + p.columns * p.rows);
  for (std::size_t p = 0; p < patches.size(); ++p)
    for (int v = first[p]; v < first[p + 1]; ++v)
      for (std::size_t q = 0; q < p; ++q)
        if (sew_onto(x, v, loop_of(patches[q]), first[q], stitches)) break;
  return stitches;
}

Eigen::MatrixXd constraint_rows(const std::vector<mesh::Stitch>& stitches, int num_vertices) {
  Eigen::MatrixXd C =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(stitches.size()), num_vertices);
  for (std::size_t i = 0; i < stitches.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    C(row, stitches[i].vertex) += 1;
    C(row, stitches[i].a) -= 1 - stitches[i].ratio;
    C(row, stitches[i].b) -= stitches[i].ratio;
  }
  return C;
}

Eigen::MatrixXd constraint_rows(const mesh::SeamMap& seams) {
  Eigen::MatrixXd C =
      Eigen::MatrixXd::Zero(seams.num_slaves(), static_cast<Eigen::Index>(seams.row.size()));
  for (int s = 0; s < seams.num_slaves(); ++s) {
    const int slave = seams.slaves[static_cast<std::size_t>(s)];
    C(s, slave) += 1;
    seams.visit_carriers(slave, [&](int carrier, double weight) { C(s, carrier) -= weight; });
  }
  return C;
}

Eigen::MatrixXd solve_with_multipliers(const Eigen::MatrixXd& K, const Eigen::MatrixXd& b,
                                       const Eigen::MatrixXd& C) {
  const Eigen::Index n = K.rows();
  const Eigen::Index rows = C.rows();
  const double scale = K.diagonal().mean();
  Eigen::MatrixXd saddle = Eigen::MatrixXd::Zero(n + rows, n + rows);
  saddle.topLeftCorner(n, n) = K;
  saddle.bottomLeftCorner(rows, n) = scale * C;
  saddle.topRightCorner(n, rows) = scale * C.transpose();
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(n + rows, b.cols());
  right.topRows(n) = b;
  return saddle.partialPivLu().solve(right).topRows(n);
}

mesh::SeamNames plain_names() {
  return {{"seam 0", "seam 1", "seam 2"}, [](int v) { return "vertex " + std::to_string(v); }};
}

}  // namespace piecework::testing
