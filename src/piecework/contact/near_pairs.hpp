#pragma once

// Which pairs are worth looking at: those that the broad phase proposes for the whereabouts of a
// step, and among them those that are near now.

#include <span>
#include <vector>

#include <piecework/collision/broad_phase.hpp>
#include <piecework/collision/distance.hpp>
#include <piecework/core/types.hpp>

namespace piecework::contact {

/// Cloth and obstacles under one numbering, as in collision::Surface.
struct Points {
  const Positions& cloth;
  const Positions& obstacles;

  [[nodiscard]] Vec3 operator()(int v) const {
    const auto row = static_cast<Eigen::Index>(v);
    if (row < cloth.rows()) return cloth.row(row).transpose();
    return obstacles.row(row - cloth.rows()).transpose();
  }
  [[nodiscard]] collision::PairPoints operator()(const collision::PairVertices& v) const {
    return {(*this)(v[0]), (*this)(v[1]), (*this)(v[2]), (*this)(v[3])};
  }
  [[nodiscard]] int count() const { return static_cast<int>(cloth.rows() + obstacles.rows()); }
};

struct NearPair {
  collision::PairVertices vertices;
  collision::PairKind kind;
  double distance;  ///< where the list was made, m
};

/// A list of near pairs that stays complete while nothing moves far (a Verlet list): valid within
/// `slack` of where it was made.
class NearPairs {
 public:
  /// \param reach  contact distance d^, m  \param slack  m
  NearPairs(collision::Surface surface, double reach, double slack);

  /// Forgets the whereabouts: a new step.
  void begin();

  /// The whereabouts of the step from now on contain both; true if the broad phase had to be asked.
  bool cover(const Points& from, const Points& to);

  /// All pairs that can come within `reach` while every vertex stays within the whereabouts, with
  /// their distances where the last near() made its list.
  [[nodiscard]] std::span<const NearPair> candidates() const { return candidates_; }

  /// All pairs that can come within `reach` of each other while no vertex is farther than slack
  /// from where the list was made; made anew at x unless it is valid there.
  /// \pre x is within the whereabouts
  std::span<const NearPair> near(const Points& x);

  /// Largest distance of a vertex from where the list of the last near() was made, m.
  [[nodiscard]] double moved(const Points& x) const;

  /// The list of the last near() is complete at x too.
  [[nodiscard]] bool valid_at(const Points& x) const;

  [[nodiscard]] const collision::Surface& surface() const { return broad_phase_.surface(); }

 private:
  [[nodiscard]] collision::PairVertices vertex_triangle(collision::PairIndex pair) const;
  [[nodiscard]] collision::PairVertices edge_edge(collision::PairIndex pair) const;
  [[nodiscard]] bool contains(const Points& x) const;
  void list_candidates();

  collision::BroadPhase broad_phase_;
  double reach_, slack_;
  std::vector<collision::VertexBox> boxes_;  ///< empty: no whereabouts yet
  std::vector<NearPair> candidates_;
  std::vector<NearPair> near_;
  std::vector<std::vector<NearPair>> blocks_;  ///< of near_, while it is made
  Positions made_at_;                          ///< cloth, then obstacles; empty: no list
};

}  // namespace piecework::contact
