#include <piecework/local/jacobi.hpp>

#include <cmath>
#include <numeric>

#include <piecework/core/parallel.hpp>
#include <piecework/model/projection.hpp>

namespace piecework::local {
namespace {

mesh::Adjacency corners_of_vertices(const model::ClothModel& model) {
  mesh::Adjacency corners;
  corners.begin.assign(static_cast<std::size_t>(model.num_vertices()) + 1, 0);
  for (const Triangle& triangle : model.triangles)
    for (const int v : triangle) ++corners.begin[static_cast<std::size_t>(v) + 1];
  std::partial_sum(corners.begin.begin(), corners.begin.end(), corners.begin.begin());
  corners.item.resize(static_cast<std::size_t>(corners.begin.back()));
  std::vector<int> cursor(corners.begin.begin(), corners.begin.end() - 1);
  for (std::size_t t = 0; t < model.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k)
      corners.item[static_cast<std::size_t>(
          cursor[static_cast<std::size_t>(model.triangles[t][k])]++)] = static_cast<int>(3 * t + k);
  return corners;
}

}  // namespace

JacobiStep::JacobiStep(const model::ClothModel& model, double h)
    : model_(model),
      inverse_h_sq_(1.0 / (h * h)),
      corner_force_(3 * static_cast<Eigen::Index>(model.stretch.size()), 3),
      bend_force_(static_cast<Eigen::Index>(model.bend.size()), 3),
      vertex_corners_(corners_of_vertices(model)) {
  bend_begin_.assign(static_cast<std::size_t>(model.num_vertices()) + 1, 0);
  for (const model::BendConstraint& c : model.bend)
    for (const int v : c.vertices) ++bend_begin_[static_cast<std::size_t>(v) + 1];
  std::partial_sum(bend_begin_.begin(), bend_begin_.end(), bend_begin_.begin());
  bend_use_.resize(static_cast<std::size_t>(bend_begin_.back()));
  std::vector<int> cursor(bend_begin_.begin(), bend_begin_.end() - 1);
  for (std::size_t i = 0; i < model.bend.size(); ++i)
    for (std::size_t k = 0; k < 4; ++k)
      bend_use_[static_cast<std::size_t>(
          cursor[static_cast<std::size_t>(model.bend[i].vertices[k])]++)] = {
          static_cast<int>(i), model.bend[i].coefficient[k]};
}

JacobiStep::Result JacobiStep::evaluate(const Positions& x, const model::StepProblem& problem,
                                        Positions& gradient) {
  gradient.resize(x.rows(), 3);
  const Sum stretch = parallel_sum<Sum>(
      model_.stretch.size(), [&](std::size_t t) { return project_triangle(t, x, problem); });
  const double bend =
      parallel_sum<double>(model_.bend.size(), [&](std::size_t i) { return project_bend(i, x); });
  const double inertia =
      parallel_sum<double>(static_cast<std::size_t>(x.rows()),
                           [&](std::size_t v) { return gather(v, x, problem, gradient); });
  return {stretch.energy + bend + inertia, stretch.degenerate};
}

JacobiStep::Sum JacobiStep::project_triangle(std::size_t t, const Positions& x,
                                             const model::StepProblem& problem) {
  const model::StretchConstraint& c = model_.stretch[t];
  const Mat32 F = model::deformation_gradient(c, x);
  Mat32 R;
  const bool degenerate = model::project_stretch(c, F, *problem.previous, model_.start, R);
  const Mat32 stress = c.weight * (F - R);
  const auto row = 3 * static_cast<Eigen::Index>(t);
  const Eigen::RowVector3d force1 = c.rest_inverse.row(0) * stress.transpose();
  const Eigen::RowVector3d force2 = c.rest_inverse.row(1) * stress.transpose();
  corner_force_.row(row) = -(force1 + force2);
  corner_force_.row(row + 1) = force1;
  corner_force_.row(row + 2) = force2;
  return {0.5 * c.weight * (F - R).squaredNorm(), degenerate};
}

double JacobiStep::project_bend(std::size_t i, const Positions& x) {
  const model::BendConstraint& c = model_.bend[i];
  // The coefficients sum to zero, so differences to one vertex keep the accuracy.
  Vec3 curvature = Vec3::Zero();
  for (std::size_t k = 1; k < 4; ++k)
    curvature += c.coefficient[k] * (x.row(c.vertices[k]) - x.row(c.vertices[0])).transpose();
  double missing = curvature.norm();  // |c^T x - y|
  if (c.rest_length > 0) {
    const double length = missing;
    missing = std::abs(length - c.rest_length);
    // A curved hinge that is momentarily flat has no direction to aim at: it waits, and its energy
    // is the one that it has nearby.
    if (length > 1e-12 * c.rest_length) curvature *= 1.0 - c.rest_length / length;
  }
  bend_force_.row(static_cast<Eigen::Index>(i)) = (c.weight * curvature).transpose();
  return 0.5 * c.weight * missing * missing;
}

double JacobiStep::gather(std::size_t v, const Positions& x, const model::StepProblem& problem,
                          Positions& gradient) const {
  const auto row = static_cast<Eigen::Index>(v);
  if ((*problem.fixed)[v]) {
    gradient.row(row).setZero();
    return 0;
  }
  const Vec3 offset = (x.row(row) - problem.predicted->row(row)).transpose();
  const double inertia = model_.mass[row] * inverse_h_sq_;
  Vec3 force = inertia * offset;
  for (int k = vertex_corners_.begin[v]; k < vertex_corners_.begin[v + 1]; ++k)
    force += corner_force_.row(vertex_corners_.item[static_cast<std::size_t>(k)]).transpose();
  for (int k = bend_begin_[v]; k < bend_begin_[v + 1]; ++k) {
    const BendUse& use = bend_use_[static_cast<std::size_t>(k)];
    force += use.coefficient * bend_force_.row(use.constraint).transpose();
  }
  gradient.row(row) = force.transpose();
  return 0.5 * inertia * offset.squaredNorm();
}

}  // namespace piecework::local
