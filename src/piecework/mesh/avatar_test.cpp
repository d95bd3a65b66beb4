#include <piecework/mesh/avatar.hpp>

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include <piecework/core/parallel.hpp>
#include <piecework/mesh/avatar_test_util.hpp>
#include <piecework/mesh/mesh_test_util.hpp>

namespace piecework::mesh {
namespace {

constexpr double kFloat = 1e-6;  // files hold floats

class AvatarTest : public FolderTest {
 protected:
  std::filesystem::path save(const StripFigure& figure) const {
    GltfBuffer buffer;
    const std::string json = figure.json(buffer);
    write("figure.bin", buffer.data());
    return write("figure.gltf", json);
  }
  Avatar load(const StripFigure& figure, const AvatarOptions& options = {}) const {
    return import_avatar(save(figure), options);
  }
  std::string error(const StripFigure& figure, const AvatarOptions& options = {}) const {
    try {
      load(figure, options);
    } catch (const InputError& failed) {
      return failed.what();
    }
    return "";
  }
};

/// Where the clip of a StripFigure takes a point of the strip with weight `knee`, or (weight 1) of
/// the badge: written out by hand, in angles and sums, without matrices, quaternions or joints.
Vec3 bent(const Vec3& v, double knee, double time) {
  const double hip_z = 1.5 * std::min(2.0, std::max(0.0, time));
  const double angle = std::numbers::pi * std::min(1.0, std::max(0.0, time - 0.5));
  const double c = std::cos(angle), s = std::sin(angle);
  const Vec3 turned(c * v.x() - s * (v.y() - 1), 1 + s * v.x() + c * (v.y() - 1), v.z());
  return (1 - knee) * v + knee * turned + Vec3(0, 0, hip_z);
}

const std::vector<double> kKnee{0, 0, 0.5, 0.75, 1, 1};

TEST_F(AvatarTest, SkinsAsWrittenOutByHand) {
  const Avatar avatar = load({});
  EXPECT_EQ(avatar.clip(), "bend");
  EXPECT_NEAR(avatar.duration(), 2, kFloat);
  ASSERT_EQ(avatar.num_vertices(), 6 + 3);
  EXPECT_EQ(avatar.triangles().size(), 5U);
  EXPECT_TRUE(avatar.notes().empty());
  Positions bind, x;
  avatar.bind_pose(bind);
  double largest = 0;
  for (const double time : {0.0, 0.3, 0.5, 0.6, 1.0, 1.23, 1.5, 2.0, 9.0}) {
    avatar.positions_at(time, x);
    for (int v = 0; v < 6; ++v) {
      const Vec3 start = bind.row(v);
      EXPECT_LT((Vec3(x.row(v)) - bent(start, kKnee[v], time)).norm(), kFloat) << v << " " << time;
      largest = std::max(largest, (Vec3(x.row(v)) - start).norm());
    }
    for (int v = 6; v < 9; ++v) {
      const Vec3 start = bind.row(v);
      EXPECT_LT((Vec3(x.row(v)) - bent(start, 1, time)).norm(), kFloat) << "the rigid part";
    }
  }
  EXPECT_GT(largest, 3) << "it did move";
}

TEST_F(AvatarTest, BindPoseIsTheFileWithoutAClip) {
  StripFigure still;
  still.clips = false;
  const Avatar avatar = load(still);
  EXPECT_FALSE(avatar.moves());
  Positions bind, x;
  avatar.bind_pose(bind);
  avatar.positions_at(17, x);
  EXPECT_TRUE(x == bind);
  for (int v = 0; v < 6; ++v)
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(bind(v, k), static_cast<double>(still.positions[3 * v + k]), kFloat);
  EXPECT_NEAR(bind(6, 1), 1.5, kFloat) << "the badge hangs above the knee";
  EXPECT_NE(error(still, {.clip = "bend"}).find("no clip \"bend\", and no other"),
            std::string::npos);
}

TEST_F(AvatarTest, WeldsWhatMovesAlike) {
  const Avatar seam = load({});
  const std::vector<int> map{0, 1, 2, 3, 4, 5, 5, 6, 7, 8};
  EXPECT_EQ(seam.vertex_map(), map);
  StripFigure apart;
  apart.weights[4 * 6] = 0.5F;  // its last vertex moves otherwise than the one at the same place
  apart.weights[4 * 6 + 1] = 0.5F;
  EXPECT_EQ(load(apart).num_vertices(), 10);
}

TEST_F(AvatarTest, LeadsInFromTheBindPoseOrHoldsTheFirstPose) {
  AvatarOptions options{.start_time = 1.0, .lead_in = 2.0};
  Positions bind, first, x;
  const Avatar blends = load({}, options);
  blends.bind_pose(bind);
  blends.positions_at(0, x);
  EXPECT_LT((x - bind).norm(), kFloat);
  blends.positions_at(2, first);
  for (int v = 0; v < 6; ++v)
    EXPECT_LT((Vec3(first.row(v)) - bent(bind.row(v), kKnee[v], 1)).norm(), kFloat);
  blends.positions_at(1, x);
  EXPECT_NEAR(x(4, 2), 0.75, kFloat) << "half of the way of the hip";
  blends.positions_at(1e-4, x);
  EXPECT_LT((x - bind).norm(), 1e-6) << "starts at rest";
  options.lead = AvatarLead::FirstPose;
  const Avatar holds = load({}, options);
  for (const double time : {0.0, 1.0, 2.0}) {
    holds.positions_at(time, x);
    EXPECT_LT((x - first).norm(), kFloat);
  }
  holds.positions_at(2.5, x);
  EXPECT_LT((Vec3(x.row(4)) - bent(bind.row(4), 1, 1.5)).norm(), kFloat);
}

TEST_F(AvatarTest, UnitsAndUpAxis) {
  Positions metres, turned;
  load({}).positions_at(1, metres);
  load({}, {.unit_in_metres = 0.01, .up_axis = UpAxis::Z}).positions_at(1, turned);
  for (Eigen::Index v = 0; v < metres.rows(); ++v) {
    const Vec3 expected = 0.01 * Vec3(metres(v, 0), metres(v, 2), -metres(v, 1));
    EXPECT_LT((Vec3(turned.row(v)) - expected).norm(), 1e-12);
  }
}

TEST_F(AvatarTest, WeightsAreScaledToOne) {
  StripFigure heavy;
  for (float& weight : heavy.weights) weight *= 3;
  const Avatar avatar = load(heavy);
  ASSERT_EQ(avatar.notes().size(), 1U);
  EXPECT_EQ(avatar.notes()[0], "scaled the weights of 7 vertices to a sum of 1");
  Positions x, expected;
  avatar.positions_at(1.2, x);
  load({}).positions_at(1.2, expected);
  EXPECT_LT((x - expected).norm(), kFloat);
}

TEST_F(AvatarTest, VerticesWithoutWeightsFollowTheNearestJoint) {
  StripFigure lost;
  for (const std::size_t v : {0U, 4U})
    for (std::size_t k = 0; k < 4; ++k) lost.weights[4 * v + k] = 0;
  const Avatar avatar = load(lost);
  ASSERT_EQ(avatar.notes().size(), 1U);
  EXPECT_EQ(avatar.notes()[0], "2 vertices without weights follow the nearest joint");
  Positions bind, x;
  avatar.bind_pose(bind);
  avatar.positions_at(1.2, x);
  EXPECT_LT((Vec3(x.row(0)) - bent(bind.row(0), 0, 1.2)).norm(), kFloat) << "the hip";
  EXPECT_LT((Vec3(x.row(4)) - bent(bind.row(4), 1, 1.2)).norm(), kFloat) << "the knee";
}

TEST_F(AvatarTest, SameBitsForEveryThreadCount) {
  const Avatar avatar = load({});
  Positions one, x;
  ThreadPool(1).run([&] { avatar.positions_at(0.77, one); });
  for (const int threads : {2, 8}) {
    ThreadPool(threads).run([&] { avatar.positions_at(0.77, x); });
    EXPECT_TRUE(x == one);
  }
}

TEST_F(AvatarTest, ClipsByName) {
  StripFigure two;
  two.second_clip = "walk";
  EXPECT_EQ(load(two, {.clip = "walk"}).clip(), "walk");
  EXPECT_NE(error(two).find("2 clips, and none is chosen; name one of \"bend\" (2 s), \"walk\""),
            std::string::npos)
      << error(two);
  EXPECT_NE(error(two, {.clip = "run"}).find("no clip \"run\"; name one of \"bend\" (2 s), "),
            std::string::npos);
  EXPECT_NE(error({}, {.start_time = 2.5}).find("lasts 2 s, it cannot start at 2.5 s"),
            std::string::npos);
}

TEST_F(AvatarTest, AJointAndThePartOnItMayBeCalledAlike) {
  StripFigure alike;
  alike.body = "knee";
  Positions x, expected;
  load(alike).positions_at(1.2, x);
  load({}).positions_at(1.2, expected);
  EXPECT_TRUE(x == expected);
  alike.body = "body";
  alike.hip = "knee";
  EXPECT_TRUE(contains(error(alike), "a joint names 'knee', but 2 nodes have that name"));
}

TEST_F(AvatarTest, RefusesWhatCannotBeMoved) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto with = [&](const auto& change) {
    StripFigure figure;
    change(figure);
    return error(figure);
  };
  EXPECT_TRUE(contains(with([](StripFigure& f) {
                         f.turn_times = {0.5F, 0.5F};
                       }),
                       "rotation key 1 of 'knee' at 0.5 s does not come after"));
  EXPECT_TRUE(contains(with([](StripFigure& f) { f.turns[7] = f.turns[6] = 0; }),
                       "rotation key 1 of 'knee' is a quaternion of length 0, not 1"));
  EXPECT_TRUE(contains(with([&](StripFigure& f) { f.turns[4] = nan; }),
                       "rotation key 1 of 'knee' is not finite"));
  EXPECT_TRUE(contains(with([&](StripFigure& f) { f.moves[5] = nan; }),
                       "position key 1 of 'hip' is not finite"));
  EXPECT_TRUE(contains(with([](StripFigure& f) { f.inverse_binds[16 + 5] = 0; }),
                       "the bind matrix of joint 'knee' is singular"));
  EXPECT_TRUE(contains(with([&](StripFigure& f) { f.inverse_binds[12] = nan; }),
                       "the bind matrix of joint 'hip' is not finite"));
  EXPECT_TRUE(contains(with([&](StripFigure& f) { f.positions[4] = nan; }),
                       "vertex 1 is not at a finite position"));
  EXPECT_TRUE(contains(with([](StripFigure& f) { f.figure = false; }),
                       "no triangles, only motion: \"bend\" (2 s)"));
}

TEST_F(AvatarTest, RefusesOtherFilesAndOptions) {
  const auto refusal = [](const std::filesystem::path& path, const AvatarOptions& options) {
    try {
      import_avatar(path, options);
    } catch (const InputError& failed) {
      return std::string(failed.what());
    }
    return std::string();
  };
  EXPECT_TRUE(contains(refusal(folder_ / "none.glb", {}), "file not found"));
  EXPECT_TRUE(contains(refusal(write("walk.bvh", "HIERARCHY"), {}), "avatar file '.bvh'"));
  EXPECT_TRUE(contains(refusal(write("empty.fbx", ""), {}), "file is empty"));
  EXPECT_TRUE(contains(refusal(write("torn.glb", "glTF\2"), {}), "cannot be read"));
  EXPECT_TRUE(contains(error({}, {.unit_in_metres = 0}), "0 metres per unit"));
  EXPECT_TRUE(contains(error({}, {.lead_in = -1}), "give times from 0 up"));
}

}  // namespace
}  // namespace piecework::mesh
