#pragma once

// What is wrong with positions of cloth. Private to `untangle`.

#include <set>
#include <utility>
#include <vector>

#include <piecework/collision/distance.hpp>

#include "setting.hpp"

namespace piecework::untangle {

struct InsideMesh {
  int vertex, mesh;  ///< mesh: in Setting::closed
};
struct InsideBody {
  int vertex, body;
};

struct Tangle {
  std::vector<collision::Intersection> crossings;
  std::vector<InsideMesh> in_mesh;
  std::vector<InsideBody> in_body;

  [[nodiscard]] Count count() const {
    return {static_cast<int>(crossings.size()), static_cast<int>(in_mesh.size() + in_body.size())};
  }
};

/// Pieces of cloth (Setting::piece) that have passed through closed meshes.
using Passed = std::set<std::pair<int, int>>;

/// Cloth in x, then the obstacles.
Positions all_positions(const Setting& setting, const Positions& x);

/// \param all  all_positions()
/// \param[in,out] passed  grows by what passes now: out of such a mesh its piece must come
Tangle find_tangle(const Setting& setting, const Positions& all, Passed& passed);

/// Two elements that are nearer than they should be, though apart.
struct NearPair {
  collision::PairVertices vertices;
  collision::Closest closest;
  double wanted;  ///< m
};
struct NearBody {
  int vertex, body;
  double missing;  ///< to the wanted distance, m
  Vec3 outward;
};

/// What lies too close together. Neighbours in a cloth are as close as the mesh wants them.
struct Closeness {
  std::vector<NearPair> pairs;
  std::vector<NearBody> bodies;
};

/// Of what involves marked vertices, everything within `part` of the contact distance.
/// \param marked  per vertex of cloth
Closeness find_close(const Setting& setting, const Positions& all, const std::vector<char>& marked,
                     double part);

}  // namespace piecework::untangle
