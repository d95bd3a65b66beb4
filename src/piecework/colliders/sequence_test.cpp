#include <piecework/colliders/sequence.hpp>

#include <gtest/gtest.h>

#include <piecework/core/error.hpp>
#include <piecework/mesh/mesh_test_util.hpp>

namespace piecework::colliders {
namespace {

class SequenceTest : public mesh::FolderTest {
 protected:
  /// A triangle at height y.
  void save(const std::string& name, double y, const std::string& faces = "f 1 2 3\n") const {
    const std::string h = std::to_string(y);
    write(name, "v 0 " + h + " 0\nv 0 " + h + " 1\nv 1 " + h + " 0\n" + faces);
  }
  [[nodiscard]] SequenceFiles files(int first, int last, const std::string& pattern) const {
    SequenceFiles result;
    result.pattern = (folder_ / pattern).string();
    result.first = first;
    result.last = last;
    result.fps = 10;
    result.start = 0.5;
    return result;
  }
  static std::string refusal(const SequenceFiles& files) {
    try {
      load_sequence(files);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
};

TEST_F(SequenceTest, MovesLinearlyBetweenFrames) {
  save("f_0008.obj", 1);
  save("f_0009.obj", 2);
  save("f_0010.obj", 5);
  const MeshSequence sequence = load_sequence(files(8, 10, "f_{:04}.obj"));
  Positions x;
  const std::vector<std::pair<double, double>> heights{{0, 1},      {0.5, 1}, {0.55, 1.5}, {0.6, 2},
                                                       {0.65, 3.5}, {0.7, 5}, {100, 5}};
  for (const auto& [time, height] : heights) {
    sequence.deformation(time, x);
    EXPECT_NEAR(x(2, 1), height, 1e-12) << time;
    EXPECT_NEAR(x(2, 0), 1, 1e-12);
  }
}

TEST_F(SequenceTest, NamesOfFrames) {
  EXPECT_EQ(frame_file("a/f_{:04}.obj", 12), "a/f_0012.obj");
  EXPECT_EQ(frame_file("f_{:03d}.ply", 1234), "f_1234.ply");
  EXPECT_EQ(frame_file("{}.obj", 7), "7.obj");
  for (const char* bad : {"f.obj", "{}{}.obj", "}{.obj", "{:x}.obj", "{:0}.obj", "{:099}.obj",
                          "{0}.obj", "{:04dd}.obj"})
    EXPECT_THROW(frame_file(bad, 1), InputError) << bad;
}

TEST_F(SequenceTest, RefusesFramesThatAreMissingOrOthers) {
  save("f_1.obj", 0);
  save("f_2.obj", 1, "f 1 3 2\n");
  write("f_3.obj", "v 0 0 0\nv 0 nan 1\nv 1 0 0\nf 1 2 3\n");
  EXPECT_TRUE(mesh::contains(refusal(files(1, 2, "f_{}.obj")), "f_2.obj"));
  EXPECT_TRUE(mesh::contains(refusal(files(3, 3, "f_{}.obj")), "f_3.obj"));
  EXPECT_TRUE(mesh::contains(refusal(files(1, 1, "g_{}.obj")), "g_1.obj: file not found"));
  EXPECT_TRUE(mesh::contains(refusal(files(2, 1, "f_{}.obj")), "comes before the first one (2)"));
  EXPECT_EQ(refusal(files(1, 1, "f_{}.obj")), "");
}

}  // namespace
}  // namespace piecework::colliders
