#include "mesh_scene.hpp"

#include <filesystem>

#include <CLI/CLI.hpp>

namespace piecework::cli {

void add_mesh_options(CLI::App& app, MeshArguments& arguments) {
  app.add_option("-k,--domains", arguments.domains, "Domains [32]")->check(CLI::Range(1, 65536));
  app.add_option("--units", arguments.units, "Metres per unit of the mesh file [1]")
      ->check(CLI::PositiveNumber);
  app.add_option("--up-axis", arguments.up_axis, "Axis that points up in the mesh file [y]")
      ->check(CLI::IsMember({"x", "y", "z"}));
  app.add_flag("--repair", arguments.repair,
               "Mend the mesh where that is safe, and say what was done");
}

scene::Scene mesh_scene(const std::string& path, const MeshArguments& arguments) {
  scene::Scene scene;
  scene.name = std::filesystem::path(path).stem().string();
  scene.source = path;
  scene.solver.domains = arguments.domains;
  scene.materials["cloth"] = {.bending = 1e-5};
  scene::Cloth cloth;
  cloth.name = scene.name;
  cloth.material = "cloth";
  cloth.mesh.file = path;
  cloth.mesh.units = arguments.units;
  cloth.mesh.up_axis = arguments.up_axis;
  cloth.mesh.repair = arguments.repair;
  scene.cloths.push_back(cloth);
  return scene;
}

}  // namespace piecework::cli
