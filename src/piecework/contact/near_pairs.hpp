#pragma once

// Which pairs are worth looking at: those that the broad phase proposes for the whereabouts of a
// step, and among them those that are near now.

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include <piecework/collision/broad_phase.hpp>
#include <piecework/collision/distance.hpp>
#include <piecework/core/parallel.hpp>
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
  /// All of them, count() x 3, m.
  void copy_to(Positions& out) const;
};

/// A vector that starts as zero, for sums.
struct Sum3 {
  Vec3 value = Vec3::Zero();
  Sum3& operator+=(const Sum3& other) {
    value += other.value;
    return *this;
  }
};

struct NearPair {
  collision::PairVertices vertices;
  collision::PairKind kind;
  double distance;  ///< where the list was made, or less, m
};

/// Pairs and where they were measured.
struct PairList {
  std::vector<NearPair> pairs;
  Positions made_at;  ///< cloth, then obstacles; empty: no list

  /// How far each vertex is from where the list was made, m.
  void moved(const Points& x, std::vector<double>& distance) const;
};

/// |b_v - a_v - u| of every vertex, u the mean motion of the cloth: what moves all of a pair alike
/// does not bring it closer. \param a, b  point(vertex), m
template <class A, class B>
void own_motion(int count, int num_cloth, const A& a, const B& b, std::vector<double>& distance) {
  const Vec3 mean = num_cloth == 0 ? Vec3(Vec3::Zero())
                                   : Vec3(parallel_sum<Sum3>(static_cast<std::size_t>(num_cloth),
                                                             [&](std::size_t v) {
                                                               const int i = static_cast<int>(v);
                                                               return Sum3{b(i) - a(i)};
                                                             })
                                              .value /
                                          num_cloth);
  distance.resize(static_cast<std::size_t>(count));
  parallel_for(distance.size(), [&](std::size_t v) {
    const int i = static_cast<int>(v);
    distance[v] = std::sqrt((b(i) - a(i) - mean).squaredNorm());
  });
}

/// By how much two elements may have come closer while their vertices moved by so much each.
inline double closing_bound(collision::PairKind kind, double a, double b, double c, double d) {
  return kind == collision::PairKind::VertexTriangle ? a + std::max({b, c, d})
                                                     : std::max(a, b) + std::max(c, d);
}

/// The same with the motion of every vertex.
inline double closing_bound(const NearPair& pair, const std::vector<double>& moved) {
  const auto of = [&](std::size_t k) { return moved[static_cast<std::size_t>(pair.vertices[k])]; };
  return closing_bound(pair.kind, of(0), of(1), of(2), of(3));
}

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

  /// All pairs that can come within `reach` while every vertex stays within the whereabouts.
  [[nodiscard]] const PairList& candidates() const { return candidates_; }

  /// All pairs that can come within `reach` of each other while no vertex is farther than slack
  /// from where the list was made; made anew at x unless it is valid there.
  /// \pre x is within the whereabouts
  const PairList& near(const Points& x);

  /// Counts the lists that near() has made.
  [[nodiscard]] int generation() const { return generation_; }

  /// The list of the last near() is complete at x too.
  [[nodiscard]] bool valid_at(const Points& x) const;

  [[nodiscard]] const collision::Surface& surface() const { return broad_phase_.surface(); }

 private:
  [[nodiscard]] collision::PairVertices vertex_triangle(collision::PairIndex pair) const;
  [[nodiscard]] collision::PairVertices edge_edge(collision::PairIndex pair) const;
  [[nodiscard]] bool contains(const Points& x) const;
  void list_candidates(const Points& x);

  collision::BroadPhase broad_phase_;
  double reach_, slack_;
  double margin_ = 0;  ///< by which the whereabouts are wider than what they were asked to cover, m
  int generation_ = 0;
  std::vector<collision::VertexBox> boxes_;  ///< empty: no whereabouts yet
  PairList candidates_, near_;
  std::vector<std::vector<NearPair>> blocks_;  ///< of near_, while it is made
  std::vector<double> moved_;
};

}  // namespace piecework::contact
