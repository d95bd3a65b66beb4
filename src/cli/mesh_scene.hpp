#pragma once

// A scene around a mesh file, for the commands that take a mesh where others take a scene.

#include <string>

#include <piecework/scene/scene.hpp>

namespace CLI {
class App;
}

namespace piecework::cli {

struct MeshArguments {
  int domains = 32;
  double units = 1;
  std::string up_axis = "y";
  bool repair = false;
};

/// -k, --units, --up-axis, --repair.
void add_mesh_options(CLI::App& app, MeshArguments& arguments);

/// One cloth of the mesh, with bending (whose hinges belong to the domains), nothing else.
scene::Scene mesh_scene(const std::string& path, const MeshArguments& arguments);

}  // namespace piecework::cli
