// piecework check: is a scene sound, what is on and why, how large will it be. Runs nothing.

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include <piecework/model/measures.hpp>
#include <piecework/runner/expectation.hpp>
#include <piecework/runner/methods.hpp>
#include <piecework/runner/world.hpp>
#include <piecework/scene/scene_io.hpp>

#include "commands.hpp"

namespace piecework::cli {
namespace {

constexpr const char* kExamples =
    "Load a scene, its meshes and its domains, and say what a run would do.\n\n"
    "Examples:\n"
    "  piecework check scene.json\n"
    "  piecework check hanging_tablecloth --set solver.domains=64";

void print_feature(const char* name, bool on, const std::string& why) {
  fmt::print("  {:<14} {:<4} {}\n", name, on ? "on" : "-", why);
}

/// \pre the scene has friction
std::string friction_words(const scene::Scene& scene) {
  const std::string words = fmt::format("coefficient {:g}", *scene.friction);
  return scene.kinetic_friction
             ? fmt::format("{}, {:g} of what slides", words, *scene.kinetic_friction)
             : words;
}

void print_features(const runner::World& world) {
  const scene::Scene& scene = world.scene;
  std::size_t held = 0;
  for (const auto& pin : world.pins) held += pin.vertices.size();
  fmt::print("features\n");
  print_feature("gravity", world.forces.gravity.has_value(),
                world.forces.gravity ? fmt::format("{:g} m/s^2", world.forces.gravity->norm())
                                     : "gravity is null");
  print_feature("bending", !world.model.bend.empty(),
                world.model.bend.empty() ? "no material names `bending`"
                                         : fmt::format("{} hinges", world.model.bend.size()));
  print_feature("pins", held > 0,
                held > 0 ? fmt::format("{} groups, {} vertices", world.pins.size(), held)
                         : "no cloth names `pins`");
  const mesh::SeamMap& seams = world.model.sewing.map();
  print_feature("seams", !seams.empty(),
                seams.empty() ? "the scene names no `seams`"
                              : fmt::format("{} vertices follow others", seams.num_slaves()));
  print_feature("loads", !world.forces.loads.empty(),
                world.forces.loads.empty() ? "no cloth names `loads`"
                                           : fmt::format("{} patches", world.forces.loads.size()));
  print_feature("wind", world.forces.wind.has_value(),
                world.forces.wind ? fmt::format("{:g} m/s", world.forces.wind->velocity.norm())
                                  : "the scene names no `wind`");
  print_feature("self-collision", scene.self_collision,
                scene.self_collision ? "cloth touches cloth" : "the scene does not ask for it");
  print_feature("colliders", !scene.colliders.empty(),
                scene.colliders.empty()
                    ? "the scene names no `colliders`"
                    : fmt::format("{} {}", scene.colliders.size(),
                                  scene.colliders.size() == 1 ? "body" : "bodies"));
  if (runner::may_touch(world)) {
    print_feature("contact", true,
                  fmt::format("from {:.3g} mm on", 1e3 * runner::contact_distance(world)));
    print_feature("friction", scene.friction.has_value(),
                  scene.friction ? friction_words(scene) : "the scene names no `friction`");
  }
  print_feature(
      "damping", scene.damping.has_value(),
      scene.damping ? fmt::format("{:g} 1/s", *scene.damping) : "the scene names no `damping`");
}

void print_cloths(const runner::World& world) {
  fmt::print("cloths\n");
  for (std::size_t p = 0; p < world.model.parts.size(); ++p) {
    const auto& part = world.model.parts[p];
    const auto& document = world.documents[p];
    const auto x = world.model.start.middleRows(part.first_vertex, part.num_vertices);
    const Eigen::RowVector3d size = x.colwise().maxCoeff() - x.colwise().minCoeff();
    fmt::print(
        "  {}: {} vertices ({} in the file), {} triangles, {:.4g} x {:.4g} x {:.4g} m, {:.4g} kg\n",
        part.name, part.num_vertices, document.num_file_vertices(), part.num_triangles, size.x(),
        size.y(), size.z(), world.model.mass.segment(part.first_vertex, part.num_vertices).sum());
    std::vector<std::string> sets;
    for (const auto& [name, vertices] : document.vertex_sets)
      sets.push_back(fmt::format("{} ({})", name, vertices.size()));
    fmt::print("    vertex sets: {}\n", fmt::join(sets, ", "));
  }
}

/// How hard the scene is for projective dynamics: iterations grow with 8 k_s h^2 / m.
void print_stiffness(const runner::World& world) {
  double worst = 0;
  for (const auto& [name, material] : world.scene.materials) {
    const double vertex_mass = world.model.mass.mean();
    worst = std::max(worst, 8 * material.stretching * material.thickness * world.scene.step.h *
                                world.scene.step.h / vertex_mass);
  }
  fmt::print("stiffness     8 k_s h^2 / m = {:.3g}: {}\n", worst,
             worst < 50    ? "projective dynamics converges fast"
             : worst < 500 ? "some tens of iterations per step"
                           : "vanilla projective dynamics will converge slowly");
}

/// nnz(L) of a METIS-ordered sheet, fitted to measured factors of 20K to 1M vertices (within 3 %).
double factor_nonzeros(double n, bool bending) {
  const double per_vertex = std::max(10.0, 8.85 * std::log2(n) - 64);
  return n * per_vertex / (bending ? 1.0 : 2.4);
}

int check(const std::string& path, const std::vector<std::string>& set) {
  std::vector<scene::Override> overrides;
  for (const std::string& text : set) overrides.push_back(parse_override(text));
  const auto world = runner::build_world(scene::load_scene(path, overrides));
  const runner::ExpectationChecker expectations(*world);
  runner::require_contact(*world);  // before anything is printed
  const auto& s = world->domain_summary;
  fmt::print("{}: sound\n", world->scene.name);
  print_cloths(*world);
  print_features(*world);
  for (const std::string& note : world->notes) fmt::print("note: {}\n", note);
  const std::vector<float> strain = model::triangle_strain(world->model, world->model.start);
  fmt::print("start strain  {:.3g} (largest; 0 = at rest)\n",
             *std::max_element(strain.begin(), strain.end()));
  fmt::print("steps         {} of {:g} s, {} frames\n", world->scene.step.steps,
             world->scene.step.h, world->scene.step.steps / world->scene.step.output_every);
  print_stiffness(*world);
  fmt::print("domains       {} (C|B|R {}|{}|{}, edge cut {}, balance {:.3f})\n", s.domains,
             s.corner, s.boundary, s.remainder, s.edge_cut, s.balance);
  const double n = world->model.num_vertices();
  fmt::print(
      "size          {} degrees of freedom, about {:.3g} MB for the factor, {:.3g} MB per saved "
      "state\n",
      3 * world->model.num_vertices(), 8e-6 * factor_nonzeros(n, !world->model.bend.empty()),
      48e-6 * n);
  return 0;
}

}  // namespace

void add_check(CLI::App& program, Action& action) {
  auto path = std::make_shared<std::string>();
  auto set = std::make_shared<std::vector<std::string>>();
  CLI::App* app = program.add_subcommand("check", kExamples);
  app->add_option("scene", *path, "Scene file, or the name of a built-in scene")->required();
  app->add_option("--set", *set, "Override a scene key: key=value")->allow_extra_args(false);
  app->callback([path, set, &action] { action = [path, set] { return check(*path, *set); }; });
}

}  // namespace piecework::cli
