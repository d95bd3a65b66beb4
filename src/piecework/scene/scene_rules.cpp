#include <piecework/scene/scene_rules.hpp>

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include <piecework/scene/nearest.hpp>

namespace piecework::scene {
namespace {

/// One part of the scene and where it is; reports faults in it.
class Part {
 public:
  Part(const Document& document, std::string pointer)
      : document_(document), pointer_(std::move(pointer)) {}

  [[nodiscard]] Part in(std::string_view key) const {
    return {document_, pointer_ + pointer_step(key)};
  }
  [[nodiscard]] Part in(std::size_t index) const { return in(std::to_string(index)); }

  void require(bool holds, const std::string& problem, const std::string& remedy) const {
    if (!holds) fail(document_, pointer_, problem, remedy);
  }

 private:
  const Document& document_;
  std::string pointer_;
};

void check_order(const Part& part, std::optional<double> first, std::optional<double> second,
                 const char* first_name, const char* second_name) {
  if (!first || !second) return;
  part.require(*first <= *second,
               fmt::format("{} ({}) is below {} ({})", second_name, *second, first_name, *first),
               "exchange or correct them");
}

void check_region(const Region& region, const Part& part) {
  if (region.box)
    for (std::size_t axis = 0; axis < 3; ++axis)
      part.in("box").require(
          (*region.box)[0][axis] <= (*region.box)[1][axis],
          fmt::format("the lowest corner is above the highest along {}", "xyz"[axis]),
          "write [[lowest x, y, z], [highest x, y, z]]");
  if (region.sphere)
    part.in("sphere").in(3).require((*region.sphere)[3] > 0, "the radius must be above 0",
                                    "write [x, y, z, radius]");
}

void check_cloth(const Cloth& cloth, const Scene& scene, const Part& part) {
  std::vector<std::string> materials;
  for (const auto& [name, material] : scene.materials) materials.push_back(name);
  part.in("material")
      .require(scene.materials.contains(cloth.material),
               fmt::format("no material \"{}\" is defined", printable(cloth.material)),
               suggestion(cloth.material, materials, "materials"));
  part.require(cloth.rest != "file" || !cloth.rest_file.empty(),
               "\"rest\" is \"file\" without a \"rest_file\"", "name the mesh of the rest shape");
  for (std::size_t i = 0; i < cloth.pins.size(); ++i) {
    const Pin& pin = cloth.pins[i];
    const Part here = part.in("pins").in(i);
    check_region(pin.region, here.in("region"));
    check_order(here.in("stop"), pin.start, pin.stop, "start", "stop");
    here.in("axis").require(pin.rate == 0 || pin.axis != std::array<double, 3>{0, 0, 0},
                            "the axis of rotation has no direction",
                            "write one, such as [0, 1, 0]");
  }
  for (std::size_t i = 0; i < cloth.loads.size(); ++i) {
    const Part here = part.in("loads").in(i);
    check_region(cloth.loads[i].region, here.in("region"));
    check_order(here.in("stop"), cloth.loads[i].start, cloth.loads[i].stop, "start", "stop");
  }
}

void check_cloths(const Scene& scene, const Part& part) {
  std::set<std::string> names;
  for (std::size_t i = 0; i < scene.cloths.size(); ++i) {
    const Cloth& cloth = scene.cloths[i];
    part.in(i).in("name").require(names.insert(cloth.name).second,
                                  fmt::format("a second cloth named \"{}\"", printable(cloth.name)),
                                  "give each cloth its own \"name\"");
    check_cloth(cloth, scene, part.in(i));
  }
}

void check_stitches(const Seam& seam, const Part& part) {
  for (std::size_t i = 0; i < seam.stitches.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k)
      part.in(i).in(k).require(seam.stitches[i][k] == std::floor(seam.stitches[i][k]),
                               fmt::format("{} is no vertex number", seam.stitches[i][k]),
                               "write [vertex, a, b, ratio]");
    part.in(i).in(3).require(seam.stitches[i][3] <= 1,
                             fmt::format("the ratio {} is above 1", seam.stitches[i][3]),
                             "choose one of 0 (at a) to 1 (at b)");
  }
}

void check_seam(const Seam& seam, const Scene& scene, const Part& part) {
  std::vector<std::string> names;
  for (const Cloth& cloth : scene.cloths) names.push_back(cloth.name);
  const auto check_name = [&](const char* key, const std::string& name) {
    part.in(key).require(name.empty() || std::find(names.begin(), names.end(), name) != names.end(),
                         fmt::format("no cloth is named \"{}\"", printable(name)),
                         suggestion(name, names, "cloths"));
  };
  check_name("cloth", seam.cloth);
  check_name("to", seam.to);
  part.require(!seam.cloth.empty() || names.size() == 1,
               fmt::format("the seam does not say which of the {} cloths is sewn", names.size()),
               "add \"cloth\", the name of one");
  part.require(seam.file.empty() || seam.to.empty(), "a file sews a cloth to itself",
               "remove \"to\"");
  part.require(seam.chain.empty() || !seam.to_chain.empty(), "\"chain\" without a \"to_chain\"",
               "add the vertices that it is sewn to");
  part.require(seam.set.empty() || !seam.to_set.empty(), "\"set\" without a \"to_set\"",
               "add the vertex set that it is sewn to");
  check_stitches(seam, part.in("stitches"));
}

void check_motion(const Motion& motion, const Part& part) {
  check_order(part.in("stop"), motion.start, motion.stop, "start", "stop");
  part.in("axis").require(motion.rate == 0 || motion.axis != std::array<double, 3>{0, 0, 0},
                          "the axis of rotation has no direction", "write one, such as [0, 1, 0]");
}

void check_normal(const std::array<double, 3>& normal, const Part& part) {
  part.in("normal").require(normal != std::array<double, 3>{0, 0, 0}, "the normal has no direction",
                            "write one, such as [0, 1, 0]");
}

void check_friction(std::optional<double> friction, std::optional<double> kinetic,
                    const Part& part) {
  part.in("kinetic_friction")
      .require(friction.has_value() || !kinetic, "\"kinetic_friction\" without \"friction\"",
               "add \"friction\", at least as large");
  check_order(part.in("kinetic_friction"), kinetic, friction, "kinetic_friction", "friction");
}

void check_collider(const Collider& collider, const Part& part) {
  const int sources = int{collider.mesh.has_value()} + int{collider.sequence.has_value()} +
                      int{collider.avatar.has_value()};
  part.require(collider.shape != "mesh" || sources == 1,
               fmt::format("{} of \"mesh\", \"sequence\" and \"avatar\" are given", sources),
               "give one of them");
  check_normal(collider.normal, part);
  part.require(collider.shape != "half_spaces" || !collider.planes.empty(),
               "\"half_spaces\" without \"planes\"", "list at least one");
  part.in("rounding")
      .require(
          collider.shape != "half_spaces" || collider.surface == "exact" || collider.rounding == 0,
          "triangles of half-spaces have sharp edges", "leave out \"rounding\", or \"surface\"");
  for (std::size_t i = 0; i < collider.planes.size(); ++i)
    check_normal(collider.planes[i].normal, part.in("planes").in(i));
  part.in("to").require(collider.shape != "cylinder" || collider.from != collider.to,
                        "\"from\" and \"to\" are the same point", "move one of them");
  if (collider.sequence)
    check_order(part.in("sequence").in("last"), collider.sequence->first, collider.sequence->last,
                "first", "last");
  if (collider.motion) check_motion(*collider.motion, part.in("motion"));
}

void check_colliders(const Scene& scene, const Part& part) {
  std::set<std::string> names;
  for (std::size_t i = 0; i < scene.colliders.size(); ++i) {
    const std::string& name = scene.colliders[i].name;
    part.in(i).in("name").require(names.insert(name).second,
                                  fmt::format("a second collider named \"{}\"", printable(name)),
                                  "give each collider its own \"name\"");
    check_collider(scene.colliders[i], part.in(i));
    const Collider& collider = scene.colliders[i];
    check_friction(collider.friction ? collider.friction : scene.friction,
                   collider.kinetic_friction, part.in(i));
  }
}

void check_expectation(const Expectation& expected, const Scene& scene, const Part& part) {
  check_order(part.in("max"), expected.min, expected.max, "min", "max");
  std::vector<std::string> names;
  bool found = expected.cloth.empty();
  for (const Cloth& cloth : scene.cloths) {
    names.push_back(cloth.name);
    found = found || cloth.name == expected.cloth;
  }
  part.in("cloth").require(found,
                           fmt::format("no cloth is named \"{}\"", printable(expected.cloth)),
                           suggestion(expected.cloth, names, "cloths"));
  if (!expected.quantity.starts_with("vertex_")) return;
  part.require(expected.vertex.has_value(),
               fmt::format("{} does not say which vertex", expected.quantity),
               "add \"vertex\", a number from 0");
  part.require(!expected.cloth.empty() || scene.cloths.size() == 1,
               fmt::format("{} does not say of which of the {} cloths", expected.quantity,
                           scene.cloths.size()),
               "add \"cloth\", the name of one");
}

void check_domain_weights(const Solver& solver, const Part& part) {
  const std::size_t count = solver.domain_weights.size();
  part.require(count == 0 || count == static_cast<std::size_t>(solver.domains),
               fmt::format("{} weights for {} domains", count, solver.domains),
               "write one per domain, or [] for equal domains");
}

void check_seam_form(const Solver& solver, const Part& part) {
  part.require(solver.seams != "dual" || solver.global == "primal_dual",
               fmt::format("multipliers on seams, but \"global\" is \"{}\"", solver.global),
               "write \"elimination\", or choose \"primal_dual\" for \"global\"");
}

void check_local_step(const Scene& scene, const Part& part) {
  const std::string& local = scene.solver.local;
  part.require(local == "jacobi" || scene.solver.method == "dd_pd",
               fmt::format("\"{}\" is a part of \"method\": \"dd_pd\" only", local),
               "write \"jacobi\", or choose \"dd_pd\" for \"method\"");
  part.require(local != "literal_eq12" || scene.quality.accelerate == "none",
               "the printed Eq. 12 may raise the energy, which no acceleration can take",
               "set \"accelerate\": \"none\" in \"quality\", or choose \"gauss_seidel\"");
}

/// A misspelt override must not pass as the definition of a new material.
void check_overridden_materials(const Scene& scene, const Document& document, const Part& part) {
  std::vector<std::string> used;
  for (const Cloth& cloth : scene.cloths) used.push_back(cloth.material);
  for (const Node& entry : *document.root.find("materials")->object())
    part.in(entry.key).require(
        entry.key_place.line > 0 || std::find(used.begin(), used.end(), entry.key) != used.end(),
        fmt::format("no cloth uses a material \"{}\"", printable(entry.key)),
        suggestion(entry.key, used, "materials"));
}

}  // namespace

void check_rules(const Scene& scene, const Document& document) {
  const Part root(document, "");
  check_cloths(scene, root.in("cloths"));
  check_overridden_materials(scene, document, root.in("materials"));
  check_order(root.in("quality").in("max_iterations"), scene.quality.min_iterations,
              scene.quality.max_iterations, "min_iterations", "max_iterations");
  check_domain_weights(scene.solver, root.in("solver").in("domain_weights"));
  check_seam_form(scene.solver, root.in("solver").in("seams"));
  check_local_step(scene, root.in("solver").in("local"));
  root.in("step")
      .in("output_every")
      .require(
          scene.step.steps % scene.step.output_every == 0,
          fmt::format("{} steps are no multiple of {}", scene.step.steps, scene.step.output_every),
          "choose a divisor of \"steps\"");
  root.in("camera").in("target").require(
      !scene.camera.position || scene.camera.position != scene.camera.target,
      "the camera looks at its own position", "move \"target\" or \"position\"");
  for (std::size_t i = 0; i < scene.seams.size(); ++i)
    check_seam(scene.seams[i], scene, root.in("seams").in(i));
  check_friction(scene.friction, scene.kinetic_friction, root);
  check_colliders(scene, root.in("colliders"));
  for (std::size_t i = 0; i < scene.expect.size(); ++i)
    check_expectation(scene.expect[i], scene, root.in("expect").in(i));
}

}  // namespace piecework::scene
