#pragma once

// Contact of cloth with itself and with obstacles during a step: energy, friction, and the limit
// that keeps anything from passing through anything.

#include <optional>
#include <span>
#include <vector>

#include <piecework/colliders/collider.hpp>
#include <piecework/collision/ccd.hpp>
#include <piecework/collision/surface.hpp>
#include <piecework/contact/activation.hpp>
#include <piecework/contact/bodies.hpp>
#include <piecework/contact/held.hpp>
#include <piecework/contact/move_filter.hpp>
#include <piecework/contact/near_pairs.hpp>
#include <piecework/contact/pair_contacts.hpp>
#include <piecework/model/constraints.hpp>
#include <piecework/model/contact_terms.hpp>

namespace piecework::contact {

struct ContactOptions {
  double h = 1.0 / 120.0;  ///< s
  bool self = false;       ///< cloth touches cloth
  Activation activation;
  std::optional<colliders::Friction> friction;  ///< absent: none
  double slip_speed = 1e-3;  ///< below this friction is not yet fully developed, m/s
  collision::CcdOptions ccd;
  bool check = true;  ///< count interpenetrations after every step
};

/// Stiffness of a contact that a cloth's own stiffness suggests, N/m: a tenth of the mean diagonal
/// entry of K. A vertex in contact is then held about as stiffly as by its neighbours (it takes
/// part in several pairs), and rests under its own weight well within the contact distance.
double default_stiffness(const model::ClothModel& model, double h);

/// What cloth touches besides itself.
struct Colliders {
  std::span<const colliders::AnalyticCollider> bodies;
  std::span<const colliders::MeshCollider> meshes;
};

/// Meshes whose motion is prescribed, under one numbering.
class Obstacles {
 public:
  explicit Obstacles(std::span<const colliders::MeshCollider> meshes);
  [[nodiscard]] const Triangles& triangles() const { return triangles_; }
  [[nodiscard]] int num_vertices() const { return first_vertex_.back(); }
  [[nodiscard]] bool are_static() const;
  /// Positions at a time (s), num_vertices() x 3, m.
  void place(double time, Positions& x) const;
  /// Of cloth and these meshes. \param self  cloth touches cloth
  [[nodiscard]] collision::Surface surface(const model::ClothModel& cloth, bool self) const;
  /// The mesh that a vertex belongs to.
  [[nodiscard]] const colliders::MeshCollider& of_vertex(int v) const;
  /// The largest contact distance of any, m; 0 without any. \param otherwise  of those without
  [[nodiscard]] double distance(double otherwise) const;

 private:
  std::span<const colliders::MeshCollider> meshes_;
  Triangles triangles_;
  std::vector<int> first_vertex_;  ///< per mesh, and their number
};

class Contact final : public model::ContactTerms {
 public:
  /// \param model, colliders  must outlive this object
  Contact(const model::ClothModel& model, ContactOptions options, const Colliders& colliders);

  void begin_step(const model::StepProblem& problem, double begin, double end,
                  const Positions& obstacles) override;
  double start(Positions& x) override;
  void take_back_start() override;
  bool advance_held(Positions& x) override;
  bool limit(const Positions& from, Positions& to) override;
  double evaluate(const Positions& x, Positions& gradient) override;
  bool renew_friction() override;
  void stiffness(const Positions& normals, model::ContactStiffness& stiffness) const override;
  void hessian(std::vector<model::ContactBlock>& blocks) const override;
  /// What touches, in the last evaluate().
  [[nodiscard]] std::span<const ActivePair> active() const { return active_; }
  [[nodiscard]] bool touching() const override { return !active_.empty(); }
  [[nodiscard]] Positions lagging_obstacles() const override;
  void end_step(const Positions& x) override;
  [[nodiscard]] const model::ContactReport& report() const override { return report_; }

 private:
  /// Shortens the way from `from` to {to, obstacles} so that nothing meets on it.
  Shortening shorten(const Points& from, Positions& to, Positions& obstacles);
  /// Takes vertices in x along with what is held, moves, and is near them; `obstacles` are at the
  /// end of the way.
  void carry_along(const Points& from, Positions& x, const Positions& obstacles);
  /// Moves what is held on from `from` to where the step wants it, as far as the cloth lets it;
  /// false if it lets nothing.
  bool go_on(const Positions& from, Positions& to);
  /// The same with bodies that go a given part of the way that is left. \param obstacles  now
  Shortening go_on_by(double part, const Positions& from, const Positions& obstacles,
                      Positions& to);
  void note_held(const Shortening& way);
  /// Pins or obstacles move on the way.
  [[nodiscard]] bool held_moves(const Positions& from, const Positions& to) const;
  void find_active(const Positions& x);
  void find_active_pairs(const PairList& list, const Points& points);
  /// Contact distance and friction of a pair.
  [[nodiscard]] Activation activation_of(const NearPair& pair) const;
  [[nodiscard]] colliders::Friction friction_of(const NearPair& pair) const;
  /// How far a pair has slid since the step began, m.
  [[nodiscard]] Vec3 slid(const FrictionPair& pair, const Points& points) const;
  double add_friction(const Positions& x, Positions& gradient);
  [[nodiscard]] model::ContactBlock block(const collision::PairVertices& vertices, int count,
                                          const std::array<double, 4>& beta,
                                          const Mat3& stiffness) const;
  void add_stiffness(const collision::PairVertices& vertices, int count,
                     const std::array<double, 4>& beta, const Vec3& normal, double pressing,
                     double sliding, const Positions& normals,
                     model::ContactStiffness& stiffness) const;

  const model::ClothModel& model_;
  ContactOptions options_;
  Obstacles obstacles_;
  Bodies bodies_;
  double slack_;  ///< how far vertices may move until lists are made anew, m
  NearPairs near_;
  MoveFilter filter_;
  int listed_ = -1;  ///< generation of near_ for which bodies were listed
  Positions rest_obstacles_;

  // Of the step.
  const model::StepProblem* problem_ = nullptr;
  Held is_held_;
  double end_time_ = 0;
  Positions obstacle_begin_, obstacle_end_, obstacle_now_;
  Positions obstacle_before_;  ///< before the last start()
  bool lags_ = false;          ///< obstacles were not where they belong when it began
  bool arrived_ = true;        ///< what is held is where the step wants it
  model::ContactReport report_;

  std::vector<ActivePair> active_;
  std::vector<std::vector<ActivePair>> active_blocks_;
  std::vector<FrictionPair> sliding_;  ///< its force_ratio is of the last evaluate()
  bool has_friction_;
  std::vector<double> moved_;  ///< since near pairs were listed, m
};

}  // namespace piecework::contact
