#include <piecework/model/measures.hpp>

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include <piecework/core/parallel.hpp>

namespace piecework::model {

std::vector<float> triangle_strain(const ClothModel& model, const Positions& x) {
  std::vector<float> strain(model.stretch.size());
  parallel_for(strain.size(), [&](std::size_t t) {
    const StretchConstraint& c = model.stretch[t];
    Mat32 edges;
    edges.col(0) = (x.row(c.vertices[1]) - x.row(c.vertices[0])).transpose();
    edges.col(1) = (x.row(c.vertices[2]) - x.row(c.vertices[0])).transpose();
    const Mat32 F = edges * c.rest_inverse;
    // sigma_1 +- sigma_2 from the trace and the area, as in the polar decomposition.
    const double trace = F.squaredNorm();
    const double s = Vec3(F.col(0)).cross(Vec3(F.col(1))).norm();
    const double sum = std::sqrt(trace + 2 * s);
    const double difference = std::sqrt(std::max(0.0, trace - 2 * s));
    const double largest = 0.5 * (sum + difference);
    const double smallest = 0.5 * (sum - difference);
    strain[t] = static_cast<float>(std::max(std::abs(largest - 1), std::abs(smallest - 1)));
  });
  return strain;
}

Vec3 linear_momentum(const ClothModel& model, const Positions& v) {
  return v.transpose() * model.mass;
}

Vec3 center_of_mass(const ClothModel& model, const Positions& x, int first, int count) {
  const auto mass = model.mass.segment(first, count);
  return x.middleRows(first, count).transpose() * mass / mass.sum();
}

double kinetic_energy(const ClothModel& model, const Positions& v) {
  return 0.5 * model.mass.dot(v.rowwise().squaredNorm());
}

}  // namespace piecework::model
