#include <piecework/runner/checkpoint.hpp>

#include <gtest/gtest.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/testing/small_cloths.hpp>

#include "small_scene.hpp"

namespace piecework::runner {
namespace {

const std::string kHash = "0123456789abcdef";

model::State some_state() {
  model::State state;
  state.x = testing::random_positions(17, 1e3, 1);
  state.v = testing::random_positions(17, 1e-3, 2);
  state.step = 42;
  state.time = 0.35000000000000003;
  return state;
}

class Checkpoint : public ::testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path file() const { return folder_.path() / "checkpoint.bin"; }
  void expect_refused(const std::string& fragment, const std::string& hash = kHash,
                      int vertices = 17) const {
    try {
      (void)read_state(file(), hash, vertices);
      ADD_FAILURE() << "accepted, but should say: " << fragment;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(fragment), std::string::npos) << error.what();
    }
  }
  TemporaryFolder folder_;
};

TEST_F(Checkpoint, KeepsEveryBit) {
  const model::State state = some_state();
  write_state(file(), state, kHash);
  const model::State read = read_state(file(), kHash, 17);
  EXPECT_TRUE(read.x == state.x);
  EXPECT_TRUE(read.v == state.v);
  EXPECT_EQ(read.step, state.step);
  EXPECT_EQ(read.time, state.time);
  EXPECT_EQ(read.previous_v.size(), 0);
  EXPECT_TRUE(read.memory.empty());
}

TEST_F(Checkpoint, KeepsWhatTheNextStepLooksBackOn) {
  model::State state = some_state();
  state.previous_v = testing::random_positions(17, 1, 3);
  state.memory = {4, 0.1};
  state.obstacles = Positions::Constant(2, 3, 0.25);
  write_state(file(), state, kHash);
  const model::State read = read_state(file(), kHash, 17);
  EXPECT_TRUE(read.previous_v == state.previous_v);
  EXPECT_EQ(read.memory, state.memory);
  EXPECT_EQ(read.obstacles, state.obstacles);
}

TEST_F(Checkpoint, RefusesWhatIsNotTheSameRun) {
  write_state(file(), some_state(), kHash);
  expect_refused("another scene", "fedcba9876543210");
  expect_refused("number of vertices", kHash, 18);
}

TEST_F(Checkpoint, RefusesEveryKindOfDamage) {
  expect_refused("no such file");
  write_state(file(), some_state(), kHash);
  const std::string good = read_file(file());
  write_file_atomically(file(), good.substr(0, 20));
  expect_refused("too short");
  write_file_atomically(file(), good.substr(0, good.size() - 100));
  expect_refused("truncated");
  std::string flipped = good;
  flipped[200] = static_cast<char>(flipped[200] ^ 4);
  write_file_atomically(file(), flipped);
  expect_refused("checksum");
  flipped = good;
  flipped[0] = 'X';
  write_file_atomically(file(), flipped);
  expect_refused("not a saved state");
}

std::string hash_with(const std::vector<scene::Override>& overrides) {
  return motion_hash(*build_world(small_scene(overrides)));
}

TEST(MotionHash, SeesPhysicsAndOnlyPhysics) {
  const std::string base = hash_with({});
  for (const char* key : {"solver.threads", "step.steps"})
    EXPECT_EQ(hash_with({{key, "2"}}), base) << key;
  EXPECT_EQ(hash_with({{"render.color", "strain"}, {"camera.fov", "50"}, {"name", "other"}}), base);
  EXPECT_EQ(hash_with({{"quality.preset", "reference"}, {"quality.tolerance", "0.01"}}), base)
      << "the same numbers under another name";
  EXPECT_NE(hash_with({{"quality.preset", "reference"}}), base);
  EXPECT_NE(hash_with({{"step.h", "0.02"}}), base);
  EXPECT_NE(hash_with({{"step.output_every", "2"}}), base) << "frames are counted by it";
  EXPECT_NE(hash_with({{"materials.cotton.density", "0.6"}}), base);
  EXPECT_NE(hash_with({{"quality.max_iterations", "7"}}), base);
  EXPECT_NE(hash_with({{"cloths.0.mesh.columns", "9"}}), base);
}

// The same scene text over another mesh is another motion; the same mesh elsewhere is not.
TEST(MotionHash, SeesTheMeshAndNotItsPlace) {
  const TemporaryFolder folder;
  const auto hash_of = [&](const char* name, const char* obj) {
    std::filesystem::create_directories(folder.path() / name);
    const auto path = folder.path() / name / "m.obj";
    write_file_atomically(path, obj);
    return motion_hash(*build_world(scene::parse_scene(
        R"({"name": "t", "materials": {"m": {}}, "cloths": [{"material": "m", "mesh": {"file": ")" +
            path.string() + R"("}}]})",
        "t.json")));
  };
  const std::string base = hash_of("a", "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 3 2\n");
  EXPECT_EQ(hash_of("b", "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 3 2\n"), base);
  EXPECT_NE(hash_of("a", "v 0 0 0\nv 1 0 0\nv 0 0 2\nf 1 3 2\n"), base);
}

}  // namespace
}  // namespace piecework::runner
