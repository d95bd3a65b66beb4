// piecework partition: domains of a mesh or a scene, as numbers and as a picture.

#include <filesystem>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <piecework/core/error.hpp>
#include <piecework/runner/world.hpp>
#include <piecework/scene/scene_io.hpp>

#include "commands.hpp"
#include "console.hpp"
#include "mesh_scene.hpp"
#include "pictures.hpp"

namespace piecework::cli {
namespace {

constexpr const char* kExamples =
    "Cut a mesh (or a scene's cloths) into domains: counts, edge cut, balance, picture.\n\n"
    "Examples:\n"
    "  piecework partition garment.obj -k 32 -o domains.png\n"
    "  piecework partition hanging_tablecloth -k 64 --color dof -o classes.png\n"
    "  piecework partition scan.ply --units 0.001 --up-axis z -k 16 --json";

struct PartitionArguments {
  std::string input;
  std::string picture;
  std::string color = "domain";
  std::string size = "1280x960";
  std::string gl = "auto";
  bool json = false;
  bool mesh_lines = false;
  MeshArguments mesh;
};

bool is_scene(const std::string& input) {
  const std::filesystem::path path = input;
  return path.extension() == ".json" || !std::filesystem::exists(path);
}

void print_json(const decomposition::Summary& s) {
  const nlohmann::ordered_json json{{"domains", s.domains},   {"corner", s.corner},
                                    {"boundary", s.boundary}, {"remainder", s.remainder},
                                    {"edge_cut", s.edge_cut}, {"balance", s.balance}};
  fmt::print("{}\n", json.dump());
}

void print_text(const runner::World& world) {
  const decomposition::Summary& s = world.domain_summary;
  fmt::print("{}: {} vertices, {} triangles\n", world.scene.name, world.model.num_vertices(),
             world.model.triangles.size());
  fmt::print("  #D         {:>10}   domains\n", s.domains);
  fmt::print("  |C|        {:>10}   corner vertices (more than two domains)\n", s.corner);
  fmt::print("  |B|        {:>10}   boundary vertices (more than one domain, corners included)\n",
             s.boundary);
  fmt::print("  |R|        {:>10}   remainder (all but corners)\n", s.remainder);
  fmt::print("  edge cut   {:>10}   mesh edges between domains\n", s.edge_cut);
  fmt::print("  balance    {:>10.4f}   largest / mean number of constraints per domain\n",
             s.balance);
}

int partition(const PartitionArguments& arguments, bool k_given, const Verbosity& verbosity) {
  scene::Scene scene = is_scene(arguments.input) ? scene::load_scene(arguments.input)
                                                 : mesh_scene(arguments.input, arguments.mesh);
  if (k_given) {
    scene.solver.domains = arguments.mesh.domains;
    scene.solver.domain_weights.clear();  // they were for another number
  }
  const auto world = runner::build_world(scene);
  for (const std::string& note : world->notes)
    if (!verbosity.quiet) say("note: {}\n", note);
  if (verbosity.verbose)
    say("loaded in {:.0f} ms, divided in {:.0f} ms\n", world->load_ms, world->partition_ms);
  if (!arguments.picture.empty()) {
    PictureOptions options = picture_options(scene);
    std::tie(options.width, options.height) = parse_size(arguments.size);
    options.color = arguments.color;
    options.gl = arguments.gl;
    options.mesh_lines |= arguments.mesh_lines;
    const auto& s = world->domain_summary;
    const Shot shot{.positions = [&] { return world->model.start; },
                    .caption = fmt::format("{}: {} domains, C|B|R {}|{}|{}", scene.name, s.domains,
                                           s.corner, s.boundary, s.remainder),
                    .path = arguments.picture};
    Progress silent("drawing", true);
    take_pictures(*world, {shot}, options, silent);
  }
  if (arguments.json)
    print_json(world->domain_summary);
  else
    print_text(*world);
  return 0;
}

}  // namespace

void add_partition(CLI::App& program, Action& action, const Verbosity& verbosity) {
  auto arguments = std::make_shared<PartitionArguments>();
  CLI::App* app = program.add_subcommand("partition", kExamples);
  app->add_option("input", arguments->input, "Mesh file, scene file, or built-in scene")
      ->required();
  app->add_option("-o,--output", arguments->picture, "PNG picture of the domains");
  app->add_option("--color", arguments->color, "domain, or dof to show classes of vertices")
      ->check(CLI::IsMember({"domain", "dof"}));
  app->add_option("--size", arguments->size, "Picture size [1280x960]");
  app->add_option("--gl", arguments->gl, "OpenGL provider")
      ->check(CLI::IsMember({"auto", "osmesa", "egl"}));
  app->add_flag("--json", arguments->json, "Print the counts as JSON");
  app->add_flag("--mesh-lines", arguments->mesh_lines, "Draw every triangle's edges");
  add_mesh_options(*app, arguments->mesh);
  app->callback([arguments, app, &action, &verbosity] {
    const bool k_given = app->count("--domains") > 0;
    action = [arguments, k_given, &verbosity] { return partition(*arguments, k_given, verbosity); };
  });
}

}  // namespace piecework::cli
