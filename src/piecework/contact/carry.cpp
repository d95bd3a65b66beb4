// A start that moving obstacles do not run into.

#include <algorithm>
#include <cmath>

#include <piecework/contact/contact.hpp>
#include <piecework/core/clock.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::contact {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// The pair of each cloth vertex with the nearest obstacle triangle; -1: none is a candidate.
std::vector<int> nearest_triangles(const std::vector<NearPair>& pairs, int num_cloth_vertices) {
  std::vector<int> nearest(at(num_cloth_vertices), -1);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const NearPair& pair = pairs[i];
    const bool of_cloth_and_obstacle = pair.kind == collision::PairKind::VertexTriangle &&
                                       pair.vertices[0] < num_cloth_vertices &&
                                       pair.vertices[1] >= num_cloth_vertices;
    if (!of_cloth_and_obstacle) continue;
    int& best = nearest[at(pair.vertices[0])];
    if (best < 0 || pair.distance < pairs[at(best)].distance) best = static_cast<int>(i);
  }
  return nearest;
}

/// Of the gap, how much a vertex may close by itself.
constexpr double kApproach = 0.5;

}  // namespace

void Contact::carry(Positions& x) {
  const Stopwatch watch;
  const Points from{*problem_->previous, obstacle_begin_}, to{x, obstacle_end_};
  near_.cover(from, to);
  const std::vector<NearPair>& pairs = near_.candidates().pairs;
  const std::vector<int> nearest = nearest_triangles(pairs, model_.num_vertices());
  parallel_for(nearest.size(), [&](std::size_t v) {
    if (nearest[v] < 0 || is_held(static_cast<int>(v))) return;
    const auto row = static_cast<Eigen::Index>(v);
    const auto& vertices = pairs[at(nearest[v])].vertices;
    const collision::Closest closest = collision::closest_vertex_triangle(from(vertices));
    const double gap = std::sqrt(closest.distance_sq);
    if (!(gap > 0)) return;
    Vec3 carried = Vec3::Zero();
    for (std::size_t k = 1; k < 4; ++k)
      carried -= closest.beta[k] * (to(vertices[k]) - from(vertices[k]));
    const Vec3 normal = closest.offset / gap;
    const Vec3 relative = x.row(row).transpose() - from(static_cast<int>(v)) - carried;
    const double too_close = -relative.dot(normal) - kApproach * gap;
    if (too_close > 0) x.row(row) += too_close * normal.transpose();
  });
  report_.narrow_ms += watch.elapsed_ms();
}

}  // namespace piecework::contact
