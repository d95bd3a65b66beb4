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

constexpr char kMagic[8] = {'P', 'W', 'S', 'T', 'A', 'T', 'E', '1'};

/// Fixed header; x and v follow, then a checksum of everything before it.
struct Header {
  char magic[8];
  char hash[16];
  std::int64_t step;
  double time;
  std::int64_t vertices;
};
static_assert(sizeof(Header) == 48);

std::size_t state_bytes(std::int64_t vertices) {
  return static_cast<std::size_t>(vertices) * 6 * sizeof(double);
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
  return hash.hex();
}

void write_state(const fs::path& path, const model::State& state, const std::string& hash) {
  Header header{};
  std::memcpy(header.magic, kMagic, sizeof kMagic);
  std::memcpy(header.hash, hash.data(), std::min(hash.size(), sizeof header.hash));
  header.step = state.step;
  header.time = state.time;
  header.vertices = state.x.rows();
  std::string content(sizeof header + state_bytes(header.vertices), '\0');
  char* out = content.data();
  std::memcpy(out, &header, sizeof header);
  const auto half = state_bytes(header.vertices) / 2;
  std::memcpy(out + sizeof header, state.x.data(), half);
  std::memcpy(out + sizeof header + half, state.v.data(), half);
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
  if (content.size() != sizeof header + state_bytes(header.vertices) + kChecksum)
    throw damaged("is truncated");
  const std::string_view body(content.data(), content.size() - kChecksum);
  if (Hash().add(body).hex() != std::string_view(content).substr(body.size()))
    throw damaged("its checksum is wrong");

  model::State state;
  state.step = static_cast<int>(header.step);
  state.time = header.time;
  state.x.resize(num_vertices, 3);
  state.v.resize(num_vertices, 3);
  const auto half = state_bytes(header.vertices) / 2;
  std::memcpy(state.x.data(), content.data() + sizeof header, half);
  std::memcpy(state.v.data(), content.data() + sizeof header + half, half);
  return state;
}

}  // namespace piecework::runner
