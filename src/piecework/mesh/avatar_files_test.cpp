// Every avatar and every bad figure of the shared test data has a stated outcome here. Skipped
// where that folder is absent; the kinds of trouble themselves are in avatar_test.cpp.

#include <filesystem>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include <piecework/mesh/avatar.hpp>
#include <piecework/mesh/mesh_test_util.hpp>

namespace piecework::mesh {
namespace {

namespace fs = std::filesystem;

fs::path data(const char* folder) { return fs::path(PIECEWORK_SHARED_DATA) / folder; }

#define SKIP_WITHOUT(folder) \
  if (!fs::is_directory(folder)) GTEST_SKIP() << (folder).string() << " is absent"

struct Outcome {
  std::string clip;
  std::string error;  ///< part of the message; empty: imports
  int vertices = -1, triangles = -1;
  double duration = 0;  ///< s
  int notes = 0;
};

/// Finite, and not of a size beyond reason, at many times.
void expect_sound_motion(const Avatar& avatar) {
  Positions x;
  avatar.bind_pose(x);
  const double size = (x.colwise().maxCoeff() - x.colwise().minCoeff()).norm();
  EXPECT_GT(size, 0);
  for (int i = 0; i <= 40; ++i) {
    avatar.positions_at(avatar.duration() * i / 40, x);
    ASSERT_TRUE(x.allFinite()) << i;
    EXPECT_LT((x.colwise().maxCoeff() - x.colwise().minCoeff()).norm(), 10 * size) << i;
  }
}

void expect_outcome(const fs::path& path, const Outcome& expected) {
  SCOPED_TRACE(path.filename().string());
  try {
    const Avatar avatar = import_avatar(path, {.clip = expected.clip});
    EXPECT_EQ(expected.error, "");
    EXPECT_EQ(avatar.num_vertices(), expected.vertices);
    EXPECT_EQ(static_cast<int>(avatar.triangles().size()), expected.triangles);
    EXPECT_NEAR(avatar.duration(), expected.duration, 0.01);
    EXPECT_EQ(static_cast<int>(avatar.notes().size()), expected.notes)
        << (avatar.notes().empty() ? "" : avatar.notes().front());
    expect_sound_motion(avatar);
  } catch (const InputError& error) {
    EXPECT_NE(expected.error, "") << error.what();
    EXPECT_TRUE(contains(error.what(), expected.error));
    EXPECT_TRUE(contains(error.what(), path.filename().string()));
  }
}

TEST(AvatarFiles, EveryAvatarMovesOrSaysWhyNot) {
  const fs::path folder = data("avatars");
  SKIP_WITHOUT(folder);
  const std::map<std::string, Outcome> outcomes = {
      {"CesiumMan.glb", {"", "", 2338, 4672, 2.0, 1}},
      {"RiggedFigure.glb", {"", "", 130, 256, 1.25, 1}},
      {"RiggedSimple.glb", {"", "", 96, 188, 2.08}},
      {"cmu_07_01.fbx", {"", "no triangles, only motion"}},
      {"cmu_131_01.bvh", {"", "unknown kind of avatar file '.bvh'"}},
      {"cmu_131_02.bvh", {"", "unknown kind of avatar file '.bvh'"}},
      {"cmu_49_08.fbx", {"", "no triangles, only motion"}},
      {"makehuman_walk1.bvh", {"", "unknown kind of avatar file '.bvh'"}},
      {"mh_female.glb", {"hop_131_03", "", 13380, 26756, 10.17}},
      {"mh_male.glb", {"walk_131_01", "", 13380, 26756, 9.27}},
      {"ozz_arnaud.fbx", {"", "", 3337, 6670}},
      {"ozz_walk.fbx", {"", "no triangles, only motion"}},
      {"quaternius_robot.glb", {"Robot_Dance", "", 1820, 3234, 3.33, 1}}};
  int seen = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const auto outcome = outcomes.find(entry.path().filename().string());
    ASSERT_NE(outcome, outcomes.end()) << entry.path() << " has no stated outcome";
    expect_outcome(entry.path(), outcome->second);
    ++seen;
  }
  EXPECT_EQ(seen, static_cast<int>(outcomes.size()));
}

TEST(AvatarFiles, EveryBadFigureMovesOrSaysWhyNot) {
  const fs::path folder = data("bad");
  SKIP_WITHOUT(folder);
  const std::map<std::string, Outcome> outcomes = {
      {"AllIndicesOutOfRange.gltf", {"", "has no faces"}},
      {"anim_nan_quat.glb", {"", "is not finite"}},
      {"anim_single_key.glb", {"", "", 4, 2, 0.0}},
      {"anim_times_not_increasing.glb", {"", "does not come after"}},
      {"anim_zero_quat.glb", {"", "is a quaternion of length 0"}},
      {"assimp_BoxWithInfinites.glb", {"", "is not at a finite position"}},
      {"assimp_MissingBin.gltf", {"", "could not open referenced file"}},
      {"assimp_RecursiveNodes.gltf", {"", "recursive reference"}},
      {"bad_json.gltf", {"", "cannot be read"}},
      {"skin_missing_skin_ref.glb", {"", "", 4, 2, 1.0}},
      {"skin_ok_reference.glb", {"", "", 4, 2, 1.0}},
      {"skin_singular_bind.glb", {"", "is singular"}},
      {"skin_weights_sum_3.glb", {"", "", 4, 2, 1.0, 1}},
      {"skin_zero_weights.glb", {"", "", 4, 2, 1.0, 1}},
      {"truncated.glb", {"", "cannot be read"}}};
  int seen = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension != ".glb" && extension != ".gltf") continue;
    const auto outcome = outcomes.find(entry.path().filename().string());
    ASSERT_NE(outcome, outcomes.end()) << entry.path() << " has no stated outcome";
    expect_outcome(entry.path(), outcome->second);
    ++seen;
  }
  EXPECT_EQ(seen, static_cast<int>(outcomes.size()));
}

// Eight of its joints have the name of a part: with the parts in their place it is 3.1 high.
TEST(AvatarFiles, TheRobotStandsUpright) {
  const fs::path path = data("avatars") / "quaternius_robot.glb";
  if (!fs::exists(path)) GTEST_SKIP() << path.string() << " is absent";
  Positions x;
  import_avatar(path, {.clip = "Robot_Dance"}).bind_pose(x);
  EXPECT_NEAR(x.col(1).minCoeff(), 0, 0.05);
  EXPECT_NEAR(x.col(1).maxCoeff(), 4.5, 0.05);
}

TEST(AvatarFiles, ClipsStartInTheBindPose) {
  const fs::path path = data("avatars") / "mh_female.glb";
  if (!fs::exists(path)) GTEST_SKIP() << path.string() << " is absent";
  for (const char* clip : {"walk_131_01", "stylised_131_02", "hop_131_03", "jumps_01_01"}) {
    const Avatar avatar = import_avatar(path, {.clip = clip});
    Positions bind, x;
    avatar.bind_pose(bind);
    avatar.positions_at(0, x);
    EXPECT_LT((x - bind).cwiseAbs().maxCoeff(), 2e-6) << clip;
    avatar.positions_at(0.5 * avatar.duration(), x);
    EXPECT_GT((x - bind).cwiseAbs().maxCoeff(), 0.1) << clip;
  }
  try {
    import_avatar(path, {});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_TRUE(contains(error.what(), "4 clips, and none is chosen; name one of"));
    EXPECT_TRUE(contains(error.what(), "\"jumps_01_01\" (14.3 s)"));
  }
}

}  // namespace
}  // namespace piecework::mesh
