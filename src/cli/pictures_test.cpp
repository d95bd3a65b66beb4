// Pictures from the command line.

#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "cli_test_util.hpp"

namespace piecework::cli {
namespace {

class CliPictures : public Cli {
 protected:
  void SetUp() override {
    Cli::SetUp();
    if (call("doctor").code != 0) GTEST_SKIP() << "no OpenGL here (libosmesa6 or EGL)";
  }
};

TEST_F(CliPictures, RunDrawsFramesAndASheetAndRenderDrawsThemAgain) {
  ASSERT_EQ(call("run " + scene(12, 2) + " --size 320x240 -o " + dir("p")).code, 0);
  for (const char* name : {"frame_0000.png", "frame_0002.png", "contact_sheet.png"})
    EXPECT_EQ(read_file(fs::path(dir("p")) / name).substr(1, 3), "PNG") << name;
  const Result again =
      call("render " + dir("p") + " --color strain --frames 1: -o 's_{frame}.png'");
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_TRUE(fs::exists(dir("p/s_2.png")));
  EXPECT_FALSE(fs::exists(dir("p/s_0.png")));
  EXPECT_EQ(call("render " + dir("p") + " --frames 2:7").code, 3);
  EXPECT_EQ(call("render " + dir("p") + " -o '{frames}.png'").code, 2);
  EXPECT_EQ(call("render " + dir("nowhere")).code, 3);
  EXPECT_EQ(call("render " + dir("p") + " -o one.png").code, 3);
}

TEST_F(CliPictures, PartitionAndRenderDrawMeshes) {
  write_file_atomically(folder_ / "two.obj", "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nf 1 2 3 4\n");
  EXPECT_EQ(call("partition " + dir("two.obj") + " -k 2 --color dof -o " + dir("d.png")).code, 0);
  EXPECT_EQ(
      call("render " + dir("two.obj") + " --color shaded --size 200x200 -o " + dir("m.png")).code,
      0);
  EXPECT_EQ(read_file(dir("d.png")).substr(1, 3), "PNG");
  EXPECT_EQ(read_file(dir("m.png")).substr(1, 3), "PNG");
}

TEST_F(CliPictures, NoStateLeavesNoState) {
  ASSERT_EQ(call("run " + scene(12, 2) + " --size 160x120 --no-state -o " + dir("n")).code, 0);
  EXPECT_TRUE(fs::exists(dir("n/frame_0002.png")));
  EXPECT_FALSE(fs::exists(dir("n/state")));
}

}  // namespace
}  // namespace piecework::cli
