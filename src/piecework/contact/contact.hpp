#pragma once

// Contact of cloth with itself and with obstacles during a step: energy, friction, and the limit
// that keeps anything from passing through anything.

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <piecework/collision/ccd.hpp>
#include <piecework/collision/surface.hpp>
#include <piecework/contact/activation.hpp>
#include <piecework/contact/near_pairs.hpp>
#include <piecework/contact/pair_contacts.hpp>
#include <piecework/model/constraints.hpp>
#include <piecework/model/contact_terms.hpp>

namespace piecework::contact {

struct ContactOptions {
  double h = 1.0 / 120.0;  ///< s
  bool self = false;       ///< cloth touches cloth
  Activation activation;
  std::optional<double> friction;  ///< mu; absent: none
  double slip_speed = 1e-3;        ///< below this friction is not yet fully developed, m/s
  collision::CcdOptions ccd;
  bool check = true;  ///< count interpenetrations after every step
};

/// Stiffness of a contact that a cloth's own stiffness suggests, N/m: a tenth of the mean diagonal
/// entry of K. A vertex in contact is then held about as stiffly as by its neighbours (it takes
/// part in several pairs), and rests under its own weight well within the contact distance.
double default_stiffness(const model::ClothModel& model, double h);

/// Triangle meshes whose motion is prescribed.
struct Obstacles {
  Triangles triangles;
  /// Positions at a time (s), |O| x 3, m.
  std::function<void(double, Positions&)> place;
  int num_vertices = 0;
};

class Contact final : public model::ContactTerms {
 public:
  /// \param model  must outlive this object
  Contact(const model::ClothModel& model, ContactOptions options, Obstacles obstacles);

  void begin_step(const model::StepProblem& problem, double begin, double end) override;
  double start(Positions& x) override;
  void hold_at(double fraction) override;
  bool advance_held(Positions& x) override;
  bool limit(const Positions& from, Positions& to) override;
  double evaluate(const Positions& x, Positions& gradient) override;
  bool renew_friction() override;
  void stiffness(const Positions& normals, model::ContactStiffness& stiffness) const override;
  [[nodiscard]] bool touching() const override { return !active_.empty(); }
  void end_step(const Positions& x) override;
  [[nodiscard]] const model::ContactReport& report() const override { return report_; }

 private:
  struct Hit {
    std::size_t pair;
    double time;
  };

  /// Shortens the way from the points `from` to `to` and obstacles_end; returns the fraction that
  /// what is held may go.
  double shorten(const Points& from, Positions& to, Positions& obstacles);
  void find_hits(std::span<const NearPair> pairs, double moved, const Points& from,
                 const Points& to, bool first);
  void take_scales();
  void lower_scale(int vertex, double scale);
  void go(const Points& from, Positions& to, Positions& obstacles);
  [[nodiscard]] bool is_held(int v) const;
  void find_active(const Positions& x);
  double add_friction(const Positions& x, Positions& gradient);
  void add_to_gradient(const collision::PairVertices& vertices, int count,
                       const std::array<Vec3, 4>& forces, Positions& gradient) const;

  const model::ClothModel& model_;
  ContactOptions options_;
  Obstacles obstacles_;
  NearPairs near_;
  Positions rest_obstacles_;

  // Of the step.
  const model::StepProblem* problem_ = nullptr;
  double end_time_ = 0;
  Positions obstacle_begin_, obstacle_end_, obstacle_now_;
  double fraction_ = 1;  ///< of the way of what is held
  model::ContactReport report_;

  std::vector<ActivePair> active_;
  std::vector<std::vector<ActivePair>> active_blocks_;
  std::vector<FrictionPair> friction_;

  // Of shorten().
  Positions way_, obstacle_way_;
  std::vector<double> scale_, next_scale_;
  std::vector<char> changed_;
  double held_scale_ = 1, next_held_scale_ = 1;
  bool held_moves_ = false;
  std::vector<Hit> hits_;
  std::vector<std::vector<Hit>> hit_blocks_;
};

}  // namespace piecework::contact
