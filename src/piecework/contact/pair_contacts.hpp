#pragma once

// The forces of pairs that are closer than the contact distance.

#include <array>
#include <span>
#include <vector>

#include <piecework/colliders/collider.hpp>
#include <piecework/contact/activation.hpp>
#include <piecework/contact/near_pairs.hpp>

namespace piecework::contact {

/// One pair in contact: E = b(d), for two edges times a factor that fades as they become parallel
/// [Li et al. 2020, Eq. 24], where their closest points are not unique and vertices do the work.
struct ActivePair {
  collision::PairVertices vertices;  ///< those past `count` are unused
  int count = 4;                     ///< 1: a vertex and a body given by a formula
  std::array<double, 4> beta;
  Vec3 normal;                   ///< offset / d
  double energy;                 ///< J
  double pressure;               ///< -dE/dd, N
  double curvature;              ///< d2E/dd2, N/m
  std::array<Vec3, 4> gradient;  ///< of E, N
  colliders::Friction friction;
};

/// \param rest  start shape: its lengths say what is parallel
/// False: not in contact.
bool activate(const NearPair& pair, const Points& x, const Points& rest,
              const Activation& activation, ActivePair& active);

/// A pair whose pressure, normal and closest points are frozen, for friction during a step.
struct FrictionPair {
  collision::PairVertices vertices;
  int count;
  std::array<double, 4> beta;
  Vec3 normal;
  double limit;    ///< mu_s times the pressure, N
  double sliding;  ///< mu_k / mu_s
  Vec3 start;      ///< where the first closest point was relative to the second, m
  // Where the pair is now.
  double force_ratio = 0;     ///< f1(y) / y, 1/m
  double energy = 0;          ///< J
  Vec3 force = Vec3::Zero();  ///< gradient by the first closest point, N
};

}  // namespace piecework::contact
