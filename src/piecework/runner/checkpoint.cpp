#include <piecework/runner/checkpoint.hpp>

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>

#include <fmt/format.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/hash.hpp>
#include <piecework/scene/scene_io.hpp>

namespace piecework::runner {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "the format is little-endian");

constexpr char kMagic[8] = {'P', 'W', 'S', 'T', 'A', 'T', 'E', '3'};

/// Fixed header; x, v, what the next step looks back on, and a checksum of everything before it
/// follow.
struct Header {
  char magic[8];
  char hash[16];
  std::int64_t step;
  double time;
  std::int64_t vertices;
  std::int64_t previous;   ///< rows of previous_v: vertices, or 0
  std::int64_t memory;     ///< numbers
  std::int64_t obstacles;  ///< rows of State::obstacles, or 0
};
static_assert(sizeof(Header) == 72);

std::size_t position_bytes(std::int64_t rows) {
  return static_cast<std::size_t>(rows) * 3 * sizeof(double);
}

/// Without header and checksum.
std::size_t body_bytes(const Header& header) {
  return 2 * position_bytes(header.vertices) + position_bytes(header.previous) +
         position_bytes(header.obstacles) +
         static_cast<std::size_t>(header.memory) * sizeof(double);
}

/// The numbers of a file count what they say, so that sizes computed from them cannot overflow.
bool is_plausible(const Header& header, std::size_t file_size) {
  const auto limit = static_cast<std::int64_t>(file_size);
  return header.vertices <= limit && header.memory >= 0 && header.memory <= limit &&
         header.obstacles >= 0 && header.obstacles <= limit &&
         (header.previous == 0 || header.previous == header.vertices);
}

/// Meshes at the start: where solids are and how all move is in the scene.
void add_colliders(const World& world, Hash& hash) {
  Positions x;
  for (const colliders::MeshCollider& collider : world.mesh_colliders) {
    collider.positions_at(0, x);
    hash.add(std::span(x.data(), static_cast<std::size_t>(x.size())));
    hash.add(std::span(collider.triangles()));
  }
}

}  // namespace

std::string scene_hash(const scene::Scene& scene) {
  scene::Scene motion = scene;
  motion.name.clear();
  motion.description.clear();
  motion.source.clear();
  motion.solver.threads = 0;
  motion.quality.preset.clear();  // its numbers are there
  motion.step.steps = motion.step.output_every;
  motion.camera = {};
  motion.render = {};
  motion.expect.clear();
  for (scene::Cloth& cloth : motion.cloths) {
    cloth.mesh.file = fs::path(cloth.mesh.file).filename().string();
    cloth.rest_file = fs::path(cloth.rest_file).filename().string();
  }
  for (scene::Seam& seam : motion.seams) seam.file = fs::path(seam.file).filename().string();
  const auto drop_folder = [](std::string& file) { file = fs::path(file).filename().string(); };
  for (scene::Collider& collider : motion.colliders) {
    if (collider.mesh) drop_folder(collider.mesh->file);
    if (collider.sequence) drop_folder(collider.sequence->pattern);
    if (collider.avatar) drop_folder(collider.avatar->file);
  }
  return Hash().add(scene::resolved_json(motion)).hex();
}

std::string motion_hash(const World& world) {
  const model::ClothModel& model = world.model;
  Hash hash;
  hash.add(scene_hash(world.scene));
  hash.add(std::span(model.start.data(), static_cast<std::size_t>(model.start.size())));
  hash.add(std::span(model.triangles));
  for (const model::StretchConstraint& c : model.stretch)
    hash.add(std::span(c.rest_inverse.data(), 4)).add(std::span(&c.weight, 1));
  for (const model::BendConstraint& c : model.bend)
    hash.add(std::span(&c.weight, 1)).add(std::span(&c.rest_length, 1));
  for (const model::Pin& pin : world.pins) hash.add(std::span(pin.vertices));
  for (const model::Load& load : world.forces.loads) hash.add(std::span(load.vertices));
  if (!model.sewing.empty()) {
    const mesh::SeamMap& seams = model.sewing.map();
    hash.add(std::span(seams.slaves)).add(std::span(seams.begin)).add(std::span(seams.carrier));
    hash.add(std::span(seams.weight)).add(std::span(seams.close_time));
  }
  add_colliders(world, hash);
  return hash.hex();
}

void write_state(const fs::path& path, const model::State& state, const std::string& hash) {
  Header header{};
  std::memcpy(header.magic, kMagic, sizeof kMagic);
  std::memcpy(header.hash, hash.data(), std::min(hash.size(), sizeof header.hash));
  header.step = state.step;
  header.time = state.time;
  header.vertices = state.x.rows();
  header.previous = state.previous_v.rows();
  header.memory = std::ssize(state.memory);
  header.obstacles = state.obstacles.rows();
  std::string content;
  content.reserve(sizeof header + body_bytes(header));
  const auto add = [&](const void* data, std::size_t bytes) {
    content.append(static_cast<const char*>(data), bytes);
  };
  add(&header, sizeof header);
  add(state.x.data(), position_bytes(header.vertices));
  add(state.v.data(), position_bytes(header.vertices));
  add(state.previous_v.data(), position_bytes(header.previous));
  add(state.memory.data(), state.memory.size() * sizeof(double));
  add(state.obstacles.data(), position_bytes(header.obstacles));
  content += Hash().add(content).hex();
  write_file_atomically(path, content);
}

model::State read_state(const fs::path& path, const std::string& hash, int num_vertices) {
  const std::string content = read_file(path);
  const auto damaged = [&](const char* what) {
    return InputError(fmt::format("{}: {}; delete it, or run with --overwrite to start anew",
                                  path.string(), what));
  };
  constexpr std::size_t kChecksum = 16;
  Header header{};
  if (content.size() < sizeof header + kChecksum) throw damaged("too short for a saved state");
  std::memcpy(&header, content.data(), sizeof header);
  if (std::memcmp(header.magic, kMagic, sizeof kMagic) != 0)
    throw damaged("not a saved state of this version");
  if (std::string(header.hash, sizeof header.hash) != hash)
    throw damaged("belongs to another scene (its physics or mesh differ)");
  if (header.vertices != num_vertices)
    throw damaged("has another number of vertices than the scene");
  if (!is_plausible(header, content.size()) ||
      content.size() != sizeof header + body_bytes(header) + kChecksum)
    throw damaged("is truncated");
  const std::string_view body(content.data(), content.size() - kChecksum);
  if (Hash().add(body).hex() != std::string_view(content).substr(body.size()))
    throw damaged("its checksum is wrong");

  model::State state;
  state.step = static_cast<int>(header.step);
  state.time = header.time;
  const char* next = content.data() + sizeof header;
  const auto take = [&](void* data, std::size_t bytes) {
    std::memcpy(data, next, bytes);
    next += bytes;
  };
  const auto take_positions = [&](Positions& rows, std::int64_t count) {
    rows.resize(count, 3);
    if (count > 0) take(rows.data(), position_bytes(count));
  };
  take_positions(state.x, header.vertices);
  take_positions(state.v, header.vertices);
  take_positions(state.previous_v, header.previous);
  state.memory.resize(static_cast<std::size_t>(header.memory));
  if (header.memory > 0) take(state.memory.data(), state.memory.size() * sizeof(double));
  take_positions(state.obstacles, header.obstacles);
  return state;
}

}  // namespace piecework::runner
