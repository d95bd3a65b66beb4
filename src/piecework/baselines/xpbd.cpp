#include <piecework/baselines/xpbd.hpp>

#include <cmath>

#include <fmt/format.h>
#include <Eigen/LU>

#include <piecework/core/clock.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/model/hessian.hpp>
#include <piecework/model/projection.hpp>

namespace piecework::baselines {

using model::StepReport;

namespace {

constexpr std::size_t kGrain = 64;  // chosen: colours are small

/// Below this a triangle is undeformed to rounding, and C has no gradient.
constexpr double kLeastStrain = 1e-14;

template <class Body>
void color_by_color(const Coloring& coloring, const Body& body) {
  for (int color = 0; color < coloring.num_colors(); ++color) {
    const auto first = static_cast<std::size_t>(coloring.begin[static_cast<std::size_t>(color)]);
    const auto last = static_cast<std::size_t>(coloring.begin[static_cast<std::size_t>(color) + 1]);
    parallel_for(
        last - first, [&](std::size_t i) { body(first + i); }, kGrain);
  }
}

}  // namespace

Xpbd::Xpbd(const model::ClothModel& model, double h, double gravity, model::StopOptions stop,
           XpbdOptions options)
    : model_(model),
      options_(options),
      h_sq_(h * h),
      convergence_(model, gravity, stop),
      local_(model, h) {}

std::string Xpbd::description() const {
  return fmt::format("XPBD, {}, Gauss-Seidel in {} + {} colours",
                     options_.stretch == XpbdStretch::Norm ? "|F - R|" : "F - R",
                     triangles_.coloring.num_colors(), hinges_.coloring.num_colors());
}

template <std::size_t N, class Factor>
void Xpbd::add_touches(const std::array<int, N>& vertices, const Factor& factor,
                       std::vector<Touch>& touches) const {
  touches.clear();
  for (std::size_t a = 0; a < N; ++a)
    model_.sewing.map().visit_carriers(vertices[a], [&](int carrier, double weight) {
      for (Touch& touch : touches)
        if (touch.vertex == carrier) {
          touch.factor += weight * factor(a);
          return;
        }
      touches.push_back({carrier, weight * factor(a)});
    });
}

template <class Touches>
Xpbd::Kind Xpbd::make_kind(std::size_t count, const Touches& touches_of) const {
  std::vector<int> begin{0};
  std::vector<int> vertices;
  std::vector<Touch> touches;
  for (std::size_t i = 0; i < count; ++i) {
    touches_of(i, touches);
    for (const Touch& touch : touches) vertices.push_back(touch.vertex);
    begin.push_back(static_cast<int>(vertices.size()));
  }
  std::vector<char> moves(static_cast<std::size_t>(model_.num_vertices()));
  for (std::size_t v = 0; v < moves.size(); ++v)
    moves[v] = inverse_mass_[static_cast<Eigen::Index>(v)] > 0;
  Kind kind;
  kind.coloring = color_greedily(begin, vertices, moves);
  kind.begin.push_back(0);
  for (const int i : kind.coloring.item) {
    touches_of(static_cast<std::size_t>(i), touches);
    kind.touch.insert(kind.touch.end(), touches.begin(), touches.end());
    kind.begin.push_back(static_cast<int>(kind.touch.size()));
  }
  kind.multiplier.setZero(static_cast<Eigen::Index>(count), 3);
  return kind;
}

void Xpbd::prepare(const std::vector<char>& fixed) {
  fixed_ = fixed;
  reduction_ = model::Reduction(model_, fixed);
  Eigen::VectorXd mass = model_.mass;
  for (const int slave : model_.sewing.map().slaves)
    model_.sewing.map().visit_carriers(
        slave, [&](int carrier, double weight) { mass[carrier] += weight * model_.mass[slave]; });
  inverse_mass_.setZero(mass.size());
  for (const int v : reduction_.vertices()) inverse_mass_[v] = 1.0 / mass[v];
  triangles_ = make_kind(model_.stretch.size(), [&](std::size_t t, std::vector<Touch>& touches) {
    const auto G = shape_gradients(model_.stretch[t]);
    add_touches(
        model_.stretch[t].vertices, [&](std::size_t a) { return G[a]; }, touches);
  });
  triangles_.multiplier.setZero(2 * triangles_.multiplier.rows(), 3);
  hinges_ = make_kind(model_.bend.size(), [&](std::size_t i, std::vector<Touch>& touches) {
    add_touches(
        model_.bend[i].vertices,
        [&](std::size_t a) { return Vec2(model_.bend[i].coefficient[a], 0); }, touches);
  });
  increment_.resize(reduction_.count(), 3);
}

/// What open seams add to F and c^T x during this step.
void Xpbd::set_offsets() {
  const mesh::SeamMap& seams = model_.sewing.map();
  seam_offset_.resize(seams.num_slaves(), 3);
  for (Eigen::Index s = 0; s < seam_offset_.rows(); ++s) {
    const int slave = seams.slaves[static_cast<std::size_t>(s)];
    seam_offset_.row(s) = x_.row(slave);
    seams.visit_carriers(slave, [&](int carrier, double weight) {
      seam_offset_.row(s) -= weight * x_.row(carrier);
    });
  }
  const auto offset_of = [&](int vertex) -> Eigen::RowVector3d {
    if (!seams.is_slave(vertex)) return Eigen::RowVector3d::Zero();
    return seam_offset_.row(seams.row[static_cast<std::size_t>(vertex)]);
  };
  triangles_.offset.setZero(triangles_.multiplier.rows(), 3);
  for (std::size_t i = 0; i < triangles_.coloring.item.size(); ++i) {
    const auto& c = model_.stretch[static_cast<std::size_t>(triangles_.coloring.item[i])];
    const auto G = shape_gradients(c);
    for (std::size_t a = 0; a < 3; ++a)
      triangles_.offset.middleRows<2>(2 * static_cast<Eigen::Index>(i)) +=
          G[a] * offset_of(c.vertices[a]);
  }
  hinges_.offset.setZero(hinges_.multiplier.rows(), 3);
  for (std::size_t i = 0; i < hinges_.coloring.item.size(); ++i) {
    const auto& c = model_.bend[static_cast<std::size_t>(hinges_.coloring.item[i])];
    for (std::size_t a = 0; a < 4; ++a)
      hinges_.offset.row(static_cast<Eigen::Index>(i)) +=
          c.coefficient[a] * offset_of(c.vertices[a]);
  }
}

StepReport Xpbd::minimize(const model::StepProblem& problem, Positions& x) {
  StepReport report;
  Stopwatch watch;
  if (fixed_ != *problem.fixed) prepare(*problem.fixed);
  convergence_.begin();
  x_ = x;
  previous_ = *problem.previous;
  if (!model_.sewing.empty()) set_offsets();
  triangles_.multiplier.setZero();
  hinges_.multiplier.setZero();
  report.phases.misc = watch.lap();
  const bool asks_gradient =
      convergence_.stop().rule == model::StopRule::Gradient || static_cast<bool>(problem.observer);
  if (asks_gradient) measure(problem, report);
  bool go_on = problem.observe(report, x_);
  while (go_on && report.iterations < convergence_.stop().max_iterations && !report.converged) {
    before_ = x_;
    sweep(problem);
    ++report.iterations;
    for (int i = 0; i < reduction_.count(); ++i)
      increment_.row(i) = x_.row(reduction_.vertex(i)) - before_.row(reduction_.vertex(i));
    convergence_.measure_increment(increment_, report);
    if (asks_gradient) measure(problem, report);
    go_on = problem.observe(report, x_);
    report.converged = convergence_.reached(report);
    if (!std::isfinite(report.dx_2)) break;  // the integrator refuses the state
  }
  measure(problem, report);
  report.phases.local = watch.lap();
  x = x_;
  return report;
}

void Xpbd::measure(const model::StepProblem& problem, StepReport& report) {
  follow_seams();
  const auto result = local_.evaluate(x_, problem, gradient_);
  report.energy = result.energy;
  report.degenerate_projections = result.degenerate;
  convergence_.measure_gradient(reduction_, gradient_, report);
}

void Xpbd::follow_seams() {
  const mesh::SeamMap& seams = model_.sewing.map();
  for (Eigen::Index s = 0; s < seam_offset_.rows(); ++s) {
    const int slave = seams.slaves[static_cast<std::size_t>(s)];
    Eigen::RowVector3d place = seam_offset_.row(s);
    seams.visit_carriers(slave,
                         [&](int carrier, double weight) { place += weight * x_.row(carrier); });
    x_.row(slave) = place;
  }
}

void Xpbd::sweep(const model::StepProblem& problem) {
  color_by_color(triangles_.coloring, [&](std::size_t i) { solve_triangle(i, problem); });
  color_by_color(hinges_.coloring, [&](std::size_t i) { solve_hinge(i); });
}

Mat32 Xpbd::gradient_of_deformation(std::size_t i) const {
  Mat32 F = Mat32::Zero();
  if (triangles_.offset.rows() > 0)
    F = triangles_.offset.middleRows<2>(2 * static_cast<Eigen::Index>(i)).transpose();
  const auto first = static_cast<std::size_t>(triangles_.begin[i]);
  const auto last = static_cast<std::size_t>(triangles_.begin[i + 1]);
  const int origin = triangles_.touch[first].vertex;
  // The factors sum to zero, so differences to one vertex keep the accuracy.
  for (std::size_t k = first + 1; k < last; ++k)
    F += (x_.row(triangles_.touch[k].vertex) - x_.row(origin)).transpose() *
         triangles_.touch[k].factor.transpose();
  return F;
}

Vec3 Xpbd::curvature(std::size_t i) const {
  Vec3 v = Vec3::Zero();
  if (hinges_.offset.rows() > 0) v = hinges_.offset.row(static_cast<Eigen::Index>(i)).transpose();
  const auto first = static_cast<std::size_t>(hinges_.begin[i]);
  const auto last = static_cast<std::size_t>(hinges_.begin[i + 1]);
  const int origin = hinges_.touch[first].vertex;
  for (std::size_t k = first + 1; k < last; ++k)
    v +=
        hinges_.touch[k].factor[0] * (x_.row(hinges_.touch[k].vertex) - x_.row(origin)).transpose();
  return v;
}

void Xpbd::solve_triangle(std::size_t i, const model::StepProblem& problem) {
  const auto& c = model_.stretch[static_cast<std::size_t>(triangles_.coloring.item[i])];
  const Mat32 F = gradient_of_deformation(i);
  Mat32 R;
  model::project_stretch(c, F, *problem.previous, model_.start, R);
  const double stiffness = c.weight * h_sq_;  // 1 / a
  const auto impulse = options_.stretch == XpbdStretch::Norm ? norm_impulse(i, F - R, stiffness)
                                                             : frame_impulse(i, F - R, stiffness);
  for (int k = triangles_.begin[i]; k < triangles_.begin[i + 1]; ++k) {
    const Touch& touch = triangles_.touch[static_cast<std::size_t>(k)];
    const double inverse_mass = inverse_mass_[touch.vertex];
    if (inverse_mass > 0)  // held vertices are shared between colours and must not be written
      x_.row(touch.vertex) += inverse_mass * (touch.factor.transpose() * impulse);
  }
}

Eigen::Matrix<double, 2, 3> Xpbd::norm_impulse(std::size_t i, const Mat32& difference,
                                               double stiffness) {
  const double C = difference.norm();
  if (!(C > kLeastStrain)) return Eigen::Matrix<double, 2, 3>::Zero();
  const Mat32 direction = difference / C;
  double mobility = 0;
  for (int k = triangles_.begin[i]; k < triangles_.begin[i + 1]; ++k) {
    const Touch& touch = triangles_.touch[static_cast<std::size_t>(k)];
    mobility += inverse_mass_[touch.vertex] * (direction * touch.factor).squaredNorm();
  }
  double& multiplier = triangles_.multiplier(2 * static_cast<Eigen::Index>(i), 0);
  const double change = -(stiffness * C + multiplier) / (stiffness * mobility + 1.0);
  multiplier += change;
  return change * direction.transpose();
}

Eigen::Matrix<double, 2, 3> Xpbd::frame_impulse(std::size_t i, const Mat32& difference,
                                                double stiffness) {
  Mat2 matrix = Mat2::Identity();
  for (int k = triangles_.begin[i]; k < triangles_.begin[i + 1]; ++k) {
    const Touch& touch = triangles_.touch[static_cast<std::size_t>(k)];
    matrix += stiffness * inverse_mass_[touch.vertex] * touch.factor * touch.factor.transpose();
  }
  auto multiplier = triangles_.multiplier.middleRows<2>(2 * static_cast<Eigen::Index>(i));
  const Eigen::Matrix<double, 2, 3> change =
      -(matrix.inverse() * (stiffness * difference.transpose() + multiplier));
  multiplier += change;
  return change;
}

void Xpbd::solve_hinge(std::size_t i) {
  const auto& c = model_.bend[static_cast<std::size_t>(hinges_.coloring.item[i])];
  Vec3 v = curvature(i);
  Vec3 multiplier = hinges_.multiplier.row(static_cast<Eigen::Index>(i)).transpose();
  const double length = v.norm();
  Vec3 direction = Vec3::Zero();
  if (c.rest_length > 0) {
    // One number: how far |c^T x| is from L. Without a direction it waits, as in the local step.
    if (!(length > 1e-12 * c.rest_length)) return;
    direction = v / length;
    v = Vec3(length - c.rest_length, 0, 0);
  }
  const auto first = static_cast<std::size_t>(hinges_.begin[i]);
  const auto last = static_cast<std::size_t>(hinges_.begin[i + 1]);
  double mobility = 0;
  for (std::size_t k = first; k < last; ++k)
    mobility += inverse_mass_[hinges_.touch[k].vertex] * hinges_.touch[k].factor[0] *
                hinges_.touch[k].factor[0];
  const double stiffness = c.weight * h_sq_;  // 1 / a
  const Vec3 change = -(stiffness * v + multiplier) / (stiffness * mobility + 1.0);
  hinges_.multiplier.row(static_cast<Eigen::Index>(i)) += change.transpose();
  const Vec3 impulse = c.rest_length > 0 ? Vec3(change[0] * direction) : change;
  for (std::size_t k = first; k < last; ++k) {
    const Touch& touch = hinges_.touch[k];
    const double inverse_mass = inverse_mass_[touch.vertex];
    if (inverse_mass > 0)
      x_.row(touch.vertex) += (inverse_mass * touch.factor[0] * impulse).transpose();
  }
}

double Xpbd::triangle_residual(std::size_t i) const {
  const auto& c = model_.stretch[static_cast<std::size_t>(triangles_.coloring.item[i])];
  if (!(c.weight > 0)) return 0;
  const Mat32 F = gradient_of_deformation(i);
  Mat32 R;
  model::project_stretch(c, F, previous_, model_.start, R);
  const auto row = 2 * static_cast<Eigen::Index>(i);
  const double a = 1.0 / (c.weight * h_sq_);
  if (options_.stretch == XpbdStretch::Frame)
    return 0.5 * c.weight *
           (F - R + a * triangles_.multiplier.middleRows<2>(row).transpose()).squaredNorm();
  const double missing = (F - R).norm() + a * triangles_.multiplier(row, 0);
  return 0.5 * c.weight * missing * missing;
}

double Xpbd::hinge_residual(std::size_t i) const {
  const auto& c = model_.bend[static_cast<std::size_t>(hinges_.coloring.item[i])];
  if (!(c.weight > 0)) return 0;
  Vec3 v = curvature(i);
  if (c.rest_length > 0) v = Vec3(v.norm() - c.rest_length, 0, 0);
  v += hinges_.multiplier.row(static_cast<Eigen::Index>(i)).transpose() / (c.weight * h_sq_);
  return 0.5 * c.weight * v.squaredNorm();
}

double Xpbd::constraint_residual() const {
  double sum = 0;
  for (std::size_t i = 0; i < triangles_.coloring.item.size(); ++i) sum += triangle_residual(i);
  for (std::size_t i = 0; i < hinges_.coloring.item.size(); ++i) sum += hinge_residual(i);
  return sum;
}

}  // namespace piecework::baselines
