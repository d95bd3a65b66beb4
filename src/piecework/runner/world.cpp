#include <piecework/runner/world.hpp>

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/mesh/generate.hpp>
#include <piecework/mesh/import.hpp>
#include <piecework/runner/bodies.hpp>
#include <piecework/runner/scene_values.hpp>
#include <piecework/runner/sewing.hpp>
#include <piecework/runner/start.hpp>

namespace piecework::runner {
namespace {

/// The enumerator with this name; the scene module has already refused unknown names.
template <class Enum, std::size_t N>
Enum named(const std::string& name, const Enum (&values)[N]) {
  for (const Enum value : values)
    if (name == mesh::to_string(value)) return value;
  throw InputError(fmt::format("\"{}\" is not known here", name));
}

mesh::ImportOptions import_options(const scene::Mesh& mesh) {
  mesh::ImportOptions options;
  options.unit_in_metres = mesh.units;
  options.up_axis = up_axis(mesh.up_axis);
  options.repair = mesh.repair;
  options.weld = mesh.weld;
  return options;
}

/// Start shape: scaled, turned about x, then y, then z, moved.
Positions place(const Positions& positions, const scene::Cloth& cloth) {
  Positions placed = positions;
  if (cloth.scale != std::array<double, 3>{1, 1, 1})
    placed = placed * vec(cloth.scale).asDiagonal();
  // Untouched coordinates keep their bits.
  if (cloth.rotate != std::array<double, 3>{0, 0, 0})
    placed = placed * rotation(cloth.rotate).transpose();
  placed.rowwise() += vec(cloth.translate).transpose();
  return placed;
}

model::RestShape rest_shape(const scene::Cloth& cloth, const mesh::MeshDocument& document,
                            const std::string& where) {
  if (cloth.rest == "uv")
    return model::rest_from_uv(document.corner_uv, document.mesh.triangles, where);
  if (cloth.rest != "file")
    return model::rest_from_positions(document.mesh.positions, document.mesh.triangles, where);
  const mesh::MeshDocument rest = mesh::import_mesh(cloth.rest_file, import_options(cloth.mesh));
  const Positions positions = mesh::corresponding_positions(document, rest, cloth.rest_file);
  return model::rest_from_positions(positions, document.mesh.triangles, cloth.rest_file);
}

bool in_box(const Vec3& x, const std::array<std::array<double, 3>, 2>& box) {
  for (Eigen::Index k = 0; k < 3; ++k) {
    const auto i = static_cast<std::size_t>(k);
    if (x[k] < box[0][i] || x[k] > box[1][i]) return false;
  }
  return true;
}

const std::vector<int>& named_set(const mesh::MeshDocument& document, const std::string& name,
                                  const std::string& where) {
  const auto found = document.vertex_sets.find(name);
  if (found != document.vertex_sets.end()) return found->second;
  std::vector<std::string> known;
  for (const auto& [set, vertices] : document.vertex_sets) known.push_back(set);
  throw InputError(fmt::format("{}/sets: the mesh has no vertex set \"{}\"; it has: {}", where,
                               name, fmt::join(known, ", ")));
}

/// Model vertices of a region of one cloth, ascending.
std::vector<int> resolve(const World& world, std::size_t part, const scene::Region& region,
                         const std::string& where) {
  const mesh::MeshDocument& document = world.documents[part];
  const int first = world.model.parts[part].first_vertex;
  std::vector<int> vertices;
  for (const int file_vertex : region.vertices)
    vertices.push_back(world.vertex(part, file_vertex, where + "/vertices"));
  for (const std::string& name : region.sets)
    for (const int v : named_set(document, name, where)) vertices.push_back(first + v);
  for (int v = 0; v < world.model.parts[part].num_vertices; ++v) {
    const Vec3 x = world.model.start.row(first + v).transpose();
    if (region.box && in_box(x, *region.box)) vertices.push_back(first + v);
    if (!region.sphere) continue;
    const auto& [cx, cy, cz, radius] = *region.sphere;
    if ((x - Vec3(cx, cy, cz)).norm() <= radius) vertices.push_back(first + v);
  }
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  if (vertices.empty())
    throw InputError(fmt::format(
        "{}: no vertex lies in this region; box and sphere are compared with start positions",
        where));
  return vertices;
}

void add_pins_and_loads(World& world, std::size_t part, const std::string& where) {
  const scene::Cloth& cloth = world.scene.cloths[part];
  for (std::size_t i = 0; i < cloth.pins.size(); ++i) {
    const scene::Pin& pin = cloth.pins[i];
    world.pins.push_back(
        {.vertices = resolve(world, part, pin.region, fmt::format("{}/pins/{}/region", where, i)),
         .velocity = vec(pin.velocity),
         .axis = vec(pin.axis),
         .center = vec(pin.center),
         .rate = pin.rate,
         .start = pin.start,
         .stop = pin.stop,
         .release = pin.release});
  }
  for (std::size_t i = 0; i < cloth.loads.size(); ++i) {
    const scene::Load& load = cloth.loads[i];
    world.forces.loads.push_back(
        {.vertices = resolve(world, part, load.region, fmt::format("{}/loads/{}/region", where, i)),
         .force = vec(load.force),
         .start = load.start,
         .stop = load.stop});
  }
  world.part_velocity.push_back(vec(cloth.velocity));
}

void add_fields(World& world) {
  if (world.scene.gravity) world.forces.gravity = vec(*world.scene.gravity);
  if (!world.scene.wind) return;
  const scene::Wind& wind = *world.scene.wind;
  world.forces.wind = model::Wind{.velocity = vec(wind.velocity),
                                  .air_density = wind.air_density,
                                  .normal_drag = wind.normal_drag,
                                  .tangential_drag = wind.tangential_drag,
                                  .gust_amplitude = wind.gust_amplitude,
                                  .gust_period = wind.gust_period};
}

model::ClothPart make_part(World& world, const scene::Cloth& cloth, const std::string& pointer) {
  if (cloth.mesh.generator.empty())
    require_file(cloth.mesh.file, world.scene.source, pointer + "/mesh/file");
  const std::string where = fmt::format("{}: {}", world.scene.source, pointer);
  mesh::MeshDocument document = load_mesh(cloth.mesh);
  for (const std::string& note : document.notes)
    world.notes.push_back(fmt::format("{}: {}", cloth.name, note));
  model::ClothPart part;
  part.name = cloth.name;
  part.triangles = document.mesh.triangles;
  part.rest = rest_shape(cloth, document, where);
  document.mesh.positions = place(document.mesh.positions, cloth);
  part.start = document.mesh.positions;
  const scene::Material& material = world.scene.materials.at(cloth.material);
  part.material = {.density = material.density,
                   .stretching = material.stretching * material.thickness,
                   .bending = material.bending};
  world.documents.push_back(std::move(document));
  return part;
}

}  // namespace

decomposition::Elements World::elements() const {
  return {.triangles = model.triangles,
          .hinges = model.hinges,
          .hinge_bends = model.hinge_bends,
          .num_vertices = model.num_vertices(),
          .seams = model.sewing.empty() ? nullptr : &model.sewing.map(),
          .seam_neighbors = seam_neighbors};
}

int World::vertex(std::size_t part, int file_vertex, const std::string& where) const {
  const mesh::MeshDocument& document = documents[part];
  if (file_vertex < 0 || file_vertex >= document.num_file_vertices())
    throw InputError(fmt::format("{}: vertex {} does not exist; the mesh has vertices 0 to {}",
                                 where, file_vertex, document.num_file_vertices() - 1));
  const int v = document.vertex_map.empty()
                    ? file_vertex
                    : document.vertex_map[static_cast<std::size_t>(file_vertex)];
  if (v < 0)
    throw InputError(fmt::format("{}: no face uses vertex {}; name another", where, file_vertex));
  return model.parts[part].first_vertex + v;
}

std::string World::vertex_name(int vertex) const {
  std::size_t p = 0;
  while (vertex >= model.parts[p].first_vertex + model.parts[p].num_vertices) ++p;
  const int v = vertex - model.parts[p].first_vertex;
  const std::vector<int>& map = documents[p].vertex_map;
  const auto in_file = std::find(map.begin(), map.end(), v) - map.begin();
  return fmt::format("vertex {} of {}", map.empty() ? v : static_cast<int>(in_file),
                     model.parts[p].name);
}

mesh::MeshDocument load_mesh(const scene::Mesh& mesh) {
  if (mesh.generator.empty()) return mesh::import_mesh(mesh.file, import_options(mesh));
  using enum mesh::GeneratorKind;
  using enum mesh::SheetPattern;
  mesh::GeneratorOptions options;
  options.width = mesh.width;
  options.height = mesh.height;
  options.depth = mesh.depth;
  options.columns = mesh.columns;
  options.rows = mesh.rows;
  options.radius = mesh.radius;
  options.pattern = named(mesh.pattern, {Alternating, OneDiagonal, Delaunay});
  options.jitter = mesh.jitter;
  options.seed = static_cast<std::uint64_t>(mesh.seed);
  options.patches_x = mesh.patches_x;
  options.patches_y = mesh.patches_y;
  return mesh::generate(
      named(mesh.generator, {Sheet, Strip, Tube, Disc, Quilt, Icosphere, Box, Stairs, Funnel, Pot}),
      options);
}

std::unique_ptr<World> build_world(const scene::Scene& scene) {
  Stopwatch watch;
  auto world = std::make_unique<World>();
  world->scene = scene;
  std::vector<model::ClothPart> parts;
  for (std::size_t i = 0; i < scene.cloths.size(); ++i)
    parts.push_back(make_part(*world, scene.cloths[i], fmt::format("/cloths/{}", i)));
  world->model = model::build_model(parts);
  sew(*world);
  add_fields(*world);
  for (std::size_t i = 0; i < scene.cloths.size(); ++i)
    add_pins_and_loads(*world, i, fmt::format("{}: /cloths/{}", scene.source, i));
  hold_seams(*world);
  prepare_start(*world, add_colliders(*world));
  world->load_ms = watch.lap();

  world->domains = decomposition::decompose(
      world->elements(),
      {.domains = scene.solver.domains, .domain_weights = scene.solver.domain_weights});
  world->domain_summary = decomposition::summarize(world->domains, world->elements());
  world->notes.insert(world->notes.end(), world->domains.notes.begin(), world->domains.notes.end());
  world->partition_ms = watch.lap();
  return world;
}

}  // namespace piecework::runner
