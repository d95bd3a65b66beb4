#include <piecework/model/forces.hpp>

#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include <piecework/core/parallel.hpp>

namespace piecework::model {

Vec3 Wind::at(double time) const {
  if (gust_amplitude == 0) return velocity;
  return velocity * (1.0 + gust_amplitude * std::sin(2.0 * std::numbers::pi * time / gust_period));
}

ForceField::ForceField(const ClothModel& model, ExternalForces forces)
    : model_(model), forces_(std::move(forces)) {
  if (!forces_.wind) return;
  vertex_triangles_ = mesh::vertex_triangles(model.triangles, model.num_vertices());
  triangle_force_.resize(static_cast<Eigen::Index>(model.triangles.size()), 3);
}

void ForceField::evaluate(const Positions& x, const Positions& v, double time, double h,
                          Positions& a) {
  a.resize(model_.num_vertices(), 3);
  a.setZero();
  if (forces_.gravity) a.rowwise() += forces_.gravity->transpose();
  if (forces_.wind) add_wind(x, v, time, h, a);
  for (const Load& load : forces_.loads) {
    if (time < load.start || (load.stop && time >= *load.stop)) continue;
    double mass = 0;
    for (const int vertex : load.vertices) mass += model_.mass[vertex];
    for (const int vertex : load.vertices) a.row(vertex) += load.force.transpose() / mass;
  }
}

void ForceField::add_wind(const Positions& x, const Positions& v, double time, double h,
                          Positions& a) {
  const Wind& wind = *forces_.wind;
  const Vec3 air = wind.at(time);
  parallel_for(model_.triangles.size(), [&](std::size_t t) {
    const auto [i, j, k] = model_.triangles[t];
    const Vec3 twice_area =
        (x.row(j) - x.row(i)).transpose().cross((x.row(k) - x.row(i)).transpose());
    const Vec3 u = air - (v.row(i) + v.row(j) + v.row(k)).transpose() / 3.0;
    const double speed = u.norm();
    const double area = 0.5 * twice_area.norm();
    auto force = triangle_force_.row(static_cast<Eigen::Index>(t));
    force.setZero();
    if (!(area > 0) || !(speed > 0)) return;
    const Vec3 n = twice_area / (2.0 * area);
    const Vec3 along = u.dot(n) * n;
    const Vec3 drag = 0.5 * wind.air_density * area * speed *
                      (wind.normal_drag * along + wind.tangential_drag * (u - along));
    // Limiting by the triangle's own mass limits every vertex, whose mass is its triangles' thirds.
    force = (drag / (1.0 + h / model_.triangle_mass[t] * drag.norm() / speed)).transpose();
  });
  parallel_for(static_cast<std::size_t>(model_.num_vertices()), [&](std::size_t vertex) {
    Vec3 sum = Vec3::Zero();
    for (int k = vertex_triangles_.begin[vertex]; k < vertex_triangles_.begin[vertex + 1]; ++k)
      sum += triangle_force_.row(vertex_triangles_.item[static_cast<std::size_t>(k)]).transpose() /
             3.0;
    const auto row = static_cast<Eigen::Index>(vertex);
    a.row(row) += sum.transpose() / model_.mass[row];
  });
}

}  // namespace piecework::model
