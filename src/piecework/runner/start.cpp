#include <piecework/runner/start.hpp>

#include <string>

#include <fmt/format.h>

#include <piecework/collision/intersections.hpp>
#include <piecework/model/pins.hpp>
#include <piecework/runner/methods.hpp>

namespace piecework::runner {
namespace {

/// Edges through triangles among cloth at x and meshes, by the exact check.
std::size_t count_crossings(const World& world, const Positions& x) {
  if (!world.scene.self_collision && world.mesh_colliders.empty()) return 0;
  const contact::Obstacles obstacles(world.mesh_colliders);
  Positions placed;
  obstacles.place(0, placed);
  Positions all;
  contact::Points{x, placed}.copy_to(all);
  return collision::find_intersections(obstacles.surface(world.model, world.scene.self_collision),
                                       all)
      .size();
}

std::string text_of(const untangle::Count& count) {
  return fmt::format("{} edges through triangles and {} vertices inside of bodies", count.edges,
                     count.inside);
}

std::string note_on(const World& world, const untangle::UntangleReport& report) {
  const std::string found = "start: " + text_of(report.before);
  if (report.before.total() == 0)
    return "start: edges touch triangles along seams only; that is left as it is";
  if (report.after.total() == 0)
    return fmt::format("{}; untangled in {} rounds, the largest move {:.3g} mm", found,
                       report.rounds, 1e3 * report.largest_move);
  return fmt::format(
      "{}; after {} rounds of untangling {} are left, the first at {}; no step takes them apart: "
      "move cloths or colliders apart there, release what is pinned, or allow more rounds "
      "(/contact/untangle)",
      found, report.rounds, text_of(report.after), world.vertex_name(*report.left_at));
}

}  // namespace

void prepare_start(World& world, int inside_solids) {
  const model::PinScript pins(world.pins, world.model.start);
  Positions x = world.model.start;
  pins.place(0, x);
  world.model.sewing.follow(0, x);
  const std::size_t crossings = count_crossings(world, x);
  if (crossings == 0 && inside_solids == 0) return;
  if (world.scene.contact.untangle == 0) {
    world.notes.push_back(fmt::format(
        "start: {} edges pass through triangles and {} vertices are inside of bodies; no step "
        "takes edges out of triangles: move cloths or colliders apart, or switch /contact/untangle "
        "on",
        crossings, inside_solids));
    return;
  }
  world.untangling = untangle::untangle(
      world.model, {world.analytic_colliders, world.mesh_colliders}, pins.fixed_at(0),
      {.rounds = world.scene.contact.untangle,
       .distance = contact_distance(world),
       .self = world.scene.self_collision},
      x);
  world.untangled = std::move(x);
  world.notes.push_back(note_on(world, *world.untangling));
}

model::State start_state(const World& world, const model::Integrator& integrator) {
  model::State state = integrator.initial_state(world.part_velocity);
  if (world.untangling) state.x = world.untangled;
  return state;
}

}  // namespace piecework::runner
