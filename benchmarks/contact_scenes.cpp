#include "contact_scenes.hpp"

#include <algorithm>
#include <cmath>

#include <piecework/scene/scene_io.hpp>

namespace piecework::bench {
namespace {

constexpr double kGravity = 9.81, kH = 1.0 / 120;

/// A square sheet of cotton of scene B, its middle above the origin.
scene::Cloth sheet(const char* name, double size, int side, double x, double y) {
  scene::Cloth cloth{.name = name, .material = "cotton"};
  cloth.mesh.generator = "sheet";
  cloth.mesh.width = cloth.mesh.height = size;
  cloth.mesh.columns = cloth.mesh.rows = side;
  cloth.translate = {x - size / 2, y, -size / 2};
  return cloth;
}

scene::Scene scene_of_cotton(const char* name) {
  scene::Scene scene;
  scene.name = name;
  scene.step.h = kH;
  scene.materials["cotton"] = {.stretching = 261.08, .bending = 7.014e-6};
  return scene;
}

std::array<double, 3> sloping_gravity() {
  return {kGravity * std::sin(kSlope), -kGravity * std::cos(kSlope), 0};
}

}  // namespace

scene::Scene drape_scene(int side, const std::string& tolerance) {
  const std::string count = std::to_string(side);
  return scene::load_scene("drape_on_sphere", {{"cloths.0.mesh.columns", count},
                                               {"cloths.0.mesh.rows", count},
                                               {"quality.tolerance", tolerance}});
}

scene::Scene slope_scene(bool mesh, double friction) {
  scene::Scene scene = scene_of_cotton("slope");
  scene.gravity = sloping_gravity();
  scene.cloths = {sheet("sheet", 0.4, 20, 0, 0.7e-3)};
  if (friction > 0) scene.friction = friction;
  scene::Collider solid{.name = "solid", .shape = mesh ? "mesh" : "plane"};
  if (mesh) {
    solid.mesh = scene::Mesh{.generator = "box", .width = 8, .height = 0.5, .depth = 2};
    solid.translate = {2, -0.5, 0};
  }
  scene.colliders = {solid};
  return scene;
}

double coulomb_distance(double speed, double friction, double h, int steps) {
  const double driven = kGravity * std::sin(kSlope), held = friction * kGravity * std::cos(kSlope);
  double distance = 0;
  for (int k = 0; k < steps; ++k) {
    speed = std::max(0.0, speed + h * (driven - held));
    distance += h * speed;
  }
  return distance;
}

scene::Scene support_scene(Support support, int side, double friction) {
  scene::Scene scene = scene_of_cotton(support == Support::Rigid ? "rod" : "sheets");
  scene.self_collision = true;
  scene.friction = friction;
  if (support == Support::Rigid) {
    constexpr double radius = 0.06;
    scene.cloths = {sheet("cloth", 0.6, side, 0.13, radius + 0.7e-3)};
    scene.colliders = {
        {.name = "rod", .shape = "capsule", .radius = radius, .from = {0, 0, -1}, .to = {0, 0, 1}}};
    return scene;
  }
  scene.gravity = sloping_gravity();
  scene.cloths = {sheet("cloth", 0.4, side, 0, 0.7e-3), sheet("ground", 0.9, side, 0, 0)};
  scene.cloths[1].pins = {{.region = {.sets = {"border"}}}};
  return scene;
}

scene::Scene without_contact(scene::Scene scene) {
  scene.self_collision = false;
  scene.colliders.clear();
  scene.friction.reset();
  return scene;
}

}  // namespace piecework::bench
