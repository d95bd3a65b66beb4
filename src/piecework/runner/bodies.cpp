#include <piecework/runner/bodies.hpp>

#include <memory>
#include <type_traits>
#include <utility>

#include <fmt/format.h>

#include <piecework/colliders/audit.hpp>
#include <piecework/colliders/sequence.hpp>
#include <piecework/colliders/tessellation.hpp>
#include <piecework/core/error.hpp>
#include <piecework/mesh/avatar.hpp>
#include <piecework/runner/scene_values.hpp>

namespace piecework::runner {
namespace {

colliders::RigidMotion motion_of(const scene::Collider& collider) {
  if (!collider.motion) return {};
  const scene::Motion& m = *collider.motion;
  return {.velocity = vec(m.velocity),
          .axis = vec(m.axis),
          .center = vec(m.center),
          .rate = m.rate,
          .start = m.start,
          .stop = m.stop};
}

/// Absent: that of the scene.
std::optional<colliders::Friction> friction_of(const scene::Collider& collider,
                                               const scene::Scene& scene) {
  if (!collider.friction && !collider.kinetic_friction) return std::nullopt;
  const double sticking = collider.friction ? *collider.friction : scene.friction.value_or(0);
  return colliders::Friction{sticking, collider.kinetic_friction.value_or(sticking)};
}

colliders::Traits traits_of(const scene::Collider& collider, const scene::Scene& scene) {
  return {.name = collider.name,
          .friction = friction_of(collider, scene),
          .thickness = collider.thickness};
}

/// Untouched directions keep their bits.
template <class Transform>
Transform placement_of(const scene::Collider& collider) {
  Transform placement = Transform::Identity();
  placement.translation() = vec(collider.translate);
  if (collider.rotate != std::array<double, 3>{0, 0, 0})
    placement.linear() = rotation(collider.rotate);
  return placement;
}

/// \pre the shape is none but those that are exact solids
colliders::Shape shape_of(const scene::Collider& c) {
  if (c.shape == "plane") return colliders::Plane{vec(c.point), vec(c.normal)};
  if (c.shape == "sphere") return colliders::Sphere{vec(c.center), c.radius};
  if (c.shape == "capsule") return colliders::Capsule{vec(c.from), vec(c.to), c.radius};
  if (c.shape == "box") return colliders::Box{vec(c.center), 0.5 * vec(c.size), c.rounding};
  if (c.shape == "cylinder")
    return colliders::Cylinder{vec(c.from), vec(c.to), c.radius, c.rounding};
  std::vector<colliders::Plane> planes;
  for (const scene::HalfSpace& h : c.planes) planes.push_back({vec(h.point), vec(h.normal)});
  return colliders::HalfSpaces(planes, c.rounding);
}

colliders::AnalyticCollider analytic_collider(const scene::Collider& collider,
                                              const scene::Scene& scene,
                                              const std::string& pointer) {
  try {
    return {traits_of(collider, scene), shape_of(collider),
            placement_of<Eigen::Isometry3d>(collider), motion_of(collider)};
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}: {}", scene.source, pointer, error.what()));
  }
}

/// What a mesh collider is made of.
struct Body {
  mesh::TriangleMesh mesh;
  colliders::Deformation deformation;
  std::vector<std::string> notes;
};

Body body_of(const scene::Sequence& s) {
  colliders::SequenceFiles files{.pattern = s.pattern,
                                 .first = s.first,
                                 .last = s.last,
                                 .fps = s.fps,
                                 .start = s.start,
                                 .import = {}};
  files.import.unit_in_metres = s.units;
  files.import.up_axis = up_axis(s.up_axis);
  colliders::MeshSequence sequence = colliders::load_sequence(files);
  return {std::move(sequence.mesh), std::move(sequence.deformation), std::move(sequence.notes)};
}

Body body_of(const scene::Avatar& a) {
  mesh::AvatarOptions options;
  options.unit_in_metres = a.units;
  options.up_axis = up_axis(a.up_axis);
  options.clip = a.clip;
  options.start_time = a.start_time;
  options.lead_in = a.lead_in;
  options.lead = a.lead == "first_pose" ? mesh::AvatarLead::FirstPose : mesh::AvatarLead::BindPose;
  const auto avatar = std::make_shared<const mesh::Avatar>(mesh::import_avatar(a.file, options));
  Body body;
  body.mesh.triangles = avatar->triangles();
  avatar->positions_at(0, body.mesh.positions);
  body.notes = avatar->notes();
  if (avatar->moves())
    body.deformation = [avatar](double time, Positions& x) { avatar->positions_at(time, x); };
  return body;
}

/// \param pointer  place of the collider in the scene, for messages
/// \throws InputError if a file is missing or faulty, or if a shape is wrong or has no end
Body body_of(const scene::Collider& collider, const scene::Scene& scene,
             const std::string& pointer) {
  if (collider.sequence) return body_of(*collider.sequence);
  if (collider.avatar) {
    require_file(collider.avatar->file, scene.source, pointer + "/avatar/file");
    return body_of(*collider.avatar);
  }
  if (collider.mesh) {
    mesh::MeshDocument document = load_mesh(*collider.mesh);
    return {std::move(document.mesh), {}, std::move(document.notes)};
  }
  const colliders::AnalyticCollider solid = analytic_collider(collider, scene, pointer);
  const std::string name = fmt::format("{}: {}: {}", scene.source, pointer, collider.name);
  return {colliders::closed_surface(solid.shape(), collider.segments, name), {}, {}};
}

}  // namespace

int add_colliders(World& world) {
  const Positions& cloth = world.model.start;
  const double extent = (cloth.colwise().maxCoeff() - cloth.colwise().minCoeff()).maxCoeff();
  const colliders::AuditOptions options{.h = world.scene.step.h, .steps = world.scene.step.steps};
  int inside_solids = 0;
  const auto note = [&](const auto& collider) {
    const colliders::Audit audit = colliders::audit(collider, cloth, options);
    if (std::is_same_v<std::decay_t<decltype(collider)>, colliders::AnalyticCollider>)
      inside_solids += static_cast<int>(audit.inside.size());
    for (const std::string& line : colliders::notes(audit, collider.traits(), extent))
      world.notes.push_back(line);
  };
  for (std::size_t i = 0; i < world.scene.colliders.size(); ++i) {
    const scene::Collider& collider = world.scene.colliders[i];
    const std::string pointer = fmt::format("/colliders/{}", i);
    if (collider.shape != "mesh" && collider.surface == "exact") {
      world.analytic_colliders.push_back(analytic_collider(collider, world.scene, pointer));
      note(world.analytic_colliders.back());
      continue;
    }
    Body body = body_of(collider, world.scene, pointer);
    for (const std::string& line : body.notes)
      world.notes.push_back(fmt::format("collider {}: {}", collider.name, line));
    auto placement = placement_of<Eigen::Affine3d>(collider);
    placement.scale(vec(collider.scale));
    world.mesh_colliders.emplace_back(traits_of(collider, world.scene), std::move(body.mesh),
                                      placement, motion_of(collider), std::move(body.deformation));
    note(world.mesh_colliders.back());
  }
  return inside_solids;
}

}  // namespace piecework::runner
