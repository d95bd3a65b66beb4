#include <piecework/contact/pair_contacts.hpp>

#include <cmath>

namespace piecework::contact {
namespace {

/// Factor of two edges and its gradient; 1 unless they are nearly parallel.
struct Fade {
  double value = 1;
  Vec3 by_first = Vec3::Zero(), by_second = Vec3::Zero();  ///< by the two edge vectors
};

Fade parallel_fade(const collision::PairPoints& x, const collision::PairPoints& rest) {
  constexpr double kParallel = 1e-3;  // sine squared, [Li et al. 2020]
  const Vec3 e = x[1] - x[0], f = x[3] - x[2];
  const Vec3 w = e.cross(f);
  const double threshold =
      kParallel * (rest[1] - rest[0]).squaredNorm() * (rest[3] - rest[2]).squaredNorm();
  const double ratio = w.squaredNorm() / threshold;
  if (!(ratio < 1)) return {};
  const double slope = 2 * (1 - ratio) / threshold;
  return {ratio * (2 - ratio), 2 * slope * f.cross(w), 2 * slope * w.cross(e)};
}

}  // namespace

bool activate(const NearPair& pair, const Points& x, const Points& rest,
              const Activation& activation, ActivePair& active) {
  const collision::PairPoints points = x(pair.vertices);
  const collision::Closest closest = collision::closest(pair.kind, points);
  const double dhat = activation.distance;
  if (!(closest.distance_sq < dhat * dhat) || !(closest.distance_sq > 0)) return false;
  const double d = std::sqrt(closest.distance_sq);
  const ActivationValue b = activation(d);
  active.vertices = pair.vertices;
  active.beta = closest.beta;
  active.normal = closest.offset / d;
  Fade fade;
  if (pair.kind == collision::PairKind::EdgeEdge) fade = parallel_fade(points, rest(pair.vertices));
  active.energy = fade.value * b.energy;
  active.pressure = -fade.value * b.slope;
  active.curvature = fade.value * b.curvature;
  for (std::size_t i = 0; i < 4; ++i)
    active.gradient[i] = fade.value * b.slope * closest.beta[i] * active.normal;
  if (fade.value < 1) {
    active.gradient[0] -= b.energy * fade.by_first;
    active.gradient[1] += b.energy * fade.by_first;
    active.gradient[2] -= b.energy * fade.by_second;
    active.gradient[3] += b.energy * fade.by_second;
  }
  return true;
}

}  // namespace piecework::contact
