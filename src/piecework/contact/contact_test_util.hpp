#pragma once

// Steps of contact without an engine, for this folder's tests.

#include <memory>
#include <utility>
#include <vector>

#include <piecework/collision/intersections.hpp>
#include <piecework/contact/contact.hpp>
#include <piecework/model/stepper.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::contact {

/// `count` sheets of side x side vertices over 1 m x 1 m, `gap` above each other.
inline mesh::TriangleMesh stacked_sheets(int count, int side, double gap) {
  mesh::TriangleMesh all = testing::grid_mesh(side, side);
  for (int k = 1; k < count; ++k) {
    mesh::TriangleMesh sheet = testing::grid_mesh(side, side);
    sheet.positions.col(1).array() += k * gap;
    all = testing::disjoint_union(all, sheet);
  }
  return all;
}

/// A cloth, what it may touch, and one step at a time.
struct ContactStep {
  model::ClothModel model;
  std::vector<colliders::AnalyticCollider> bodies;
  std::vector<colliders::MeshCollider> meshes;
  ContactOptions options;
  Positions previous, predicted;
  std::vector<char> fixed;
  model::StepProblem problem;
  std::unique_ptr<Contact> contact;

  explicit ContactStep(const mesh::TriangleMesh& cloth)
      : ContactStep(testing::cloth_model(cloth, testing::cotton())) {}
  explicit ContactStep(model::ClothModel cloth)
      : model(std::move(cloth)),
        previous(model.start),
        predicted(model.start),
        fixed(static_cast<std::size_t>(model.num_vertices()), 0) {
    options.self = true;
  }
  ContactStep(const ContactStep&) = delete;
  ContactStep& operator=(const ContactStep&) = delete;

  /// A step from `previous`, with bodies and meshes where they are at these times.
  void begin(double from = 0, double to = 0) {
    problem = {.predicted = &predicted, .fixed = &fixed, .previous = &previous};
    if (!contact) contact = std::make_unique<Contact>(model, options, Colliders{bodies, meshes});
    contact->begin_step(problem, from, to, {});
  }

  /// The end of a step that would go to `wanted` at once. \param held_part  see Contact::start()
  Positions go(const Positions& wanted, double from = 0, double to = 0,
               double* held_part = nullptr) {
    predicted = wanted;
    begin(from, to);
    Positions x = wanted;
    const double part = contact->start(x);
    if (held_part) *held_part = part;
    return x;
  }

  [[nodiscard]] double energy(const Positions& x) const {
    Positions ignored = Positions::Zero(x.rows(), 3);
    return contact->evaluate(x, ignored);
  }
  [[nodiscard]] Positions gradient(const Positions& x) const {
    Positions g = Positions::Zero(x.rows(), 3);
    (void)contact->evaluate(x, g);
    return g;
  }
  /// Edges through triangles, cloth and meshes, by exact arithmetic: meshes where the contact says
  /// that they lag, else at `time`.
  [[nodiscard]] std::size_t intersections(const Positions& x, double time = 0) const {
    const Obstacles obstacles{std::span(meshes)};
    Positions placed;
    obstacles.place(time, placed);
    if (contact && contact->lagging_obstacles().rows() > 0) placed = contact->lagging_obstacles();
    Positions all(x.rows() + placed.rows(), 3);
    all << x, placed;
    const auto surface =
        collision::make_surface(model.triangles, model.num_vertices(), obstacles.triangles(),
                                obstacles.num_vertices(), true);
    return collision::find_intersections(surface, all).size();
  }
};

/// Derivative by central differences of the energy by one coordinate.
inline double slope_of_energy(const ContactStep& step, const Positions& x, Eigen::Index v, int axis,
                              double by) {
  Positions there = x;
  there(v, axis) = x(v, axis) + by;
  const double above = step.energy(there);
  there(v, axis) = x(v, axis) - by;
  return (above - step.energy(there)) / (2 * by);
}

}  // namespace piecework::contact
