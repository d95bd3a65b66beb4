#pragma once

// Contact of single vertices with bodies that have a closed form.

#include <optional>
#include <span>
#include <vector>

#include <piecework/colliders/collider.hpp>
#include <piecework/contact/activation.hpp>
#include <piecework/contact/pair_contacts.hpp>

namespace piecework::contact {

/// A vertex near a body.
struct NearBody {
  int vertex;
  int body;
  /// It was inside when the list was made: pushed out by a parabola, since a barrier has no inside.
  bool inside;
};

/// The bodies of a step: where they are at its begin and end.
class Bodies {
 public:
  /// \param colliders  must outlive this object
  Bodies(std::span<const colliders::AnalyticCollider> colliders, const Activation& activation,
         std::optional<colliders::Friction> friction);

  [[nodiscard]] bool empty() const { return colliders_.empty(); }

  /// Bodies are where they belong at `begin`, s.
  void begin_step(double begin, double end);

  /// Moves the bodies by a part of the way that is left to their end, and cuts the ways of vertices
  /// from `from` to x short of them, seen from each body: vertices are carried along. What is held
  /// stays. Lists are void.
  void move(double part, const Positions& from, const std::vector<char>& held, Positions& x);

  /// As before the last move().
  void take_back();

  /// Back to the begin of the step, or on to its end, whatever is in the way.
  void place(double part);

  /// Any body moves during the step.
  [[nodiscard]] bool move_in_step() const { return moves_; }
  /// Part of the step's way that the bodies have gone.
  [[nodiscard]] double part() const { return part_; }

  /// A vertex that is not held is inside of a body at x and was not so at `from`, where the bodies
  /// were before the last move().
  [[nodiscard]] bool any_enters(const Positions& from, const std::vector<char>& held,
                                const Positions& x) const;

  /// Cuts straight ways short of the bodies where they are now; true if any was.
  bool limit(const Positions& from, const std::vector<char>& held, Positions& to) const;

  /// Lists the vertices that come within contact while nothing moves farther than `slack` from x.
  void list(const Positions& x, double slack);

  /// Vertices that are inside of a body at the step's end.
  [[nodiscard]] int count_inside(const Positions& x) const;

  /// Adds contacts at x to `active`, in the order of the list.
  void activate(const Positions& x, std::vector<ActivePair>& active) const;

  /// Where the point of its body was, when the step began, that is now at the vertex' old place: a
  /// vertex that has moved to there has not slid. \param pair  with count 1
  [[nodiscard]] Vec3 unslid(const ActivePair& pair, const Vec3& previous) const;

 private:
  [[nodiscard]] double distance(int body) const;
  [[nodiscard]] Vec3 beside(int body, const Vec3& from, const Vec3& way, double part) const;
  void pose(double time, std::vector<Eigen::Isometry3d>& poses) const;
  [[nodiscard]] bool is_inside(int body, const std::vector<Eigen::Isometry3d>& poses,
                               const Positions& x, std::size_t v) const;
  [[nodiscard]] double free_part(int body, const Vec3& from, const Vec3& way,
                                 const Eigen::Isometry3d& pose) const;

  std::span<const colliders::AnalyticCollider> colliders_;
  Activation activation_;
  std::optional<colliders::Friction> friction_;
  double begin_time_ = 0, end_time_ = 0;
  bool moves_ = false;
  double part_ = 0, part_before_ = 0;
  std::vector<Eigen::Isometry3d> begin_, end_, now_, before_;  ///< before_: the last move()
  std::vector<NearBody> near_;
  std::vector<std::vector<NearBody>> blocks_;
};

}  // namespace piecework::contact
