#include <piecework/core/atomic_file.hpp>

#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <thread>

#include <gtest/gtest.h>

#include <piecework/core/error.hpp>
#include <piecework/core/hash.hpp>

namespace piecework {
namespace {

namespace fs = std::filesystem;

class AtomicFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("piecework_atomic_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), {}));
  }
  fs::path folder_;
};

TEST_F(AtomicFile, RoundTripsBinaryContent) {
  const std::string content("a\0b\n\xff", 5);
  write_file_atomically(folder_ / "f", content);
  EXPECT_EQ(read_file(folder_ / "f"), content);
  write_file_atomically(folder_ / "f", "");
  EXPECT_EQ(read_file(folder_ / "f"), "");
  EXPECT_EQ(files(), 1U);
}

TEST_F(AtomicFile, FailureNamesThePathAndLeavesNothing) {
  try {
    write_file_atomically(folder_ / "missing" / "f", "x");
    FAIL();
  } catch (const OutputError& error) {
    EXPECT_NE(std::string(error.what()).find("missing/f"), std::string::npos) << error.what();
    EXPECT_EQ(error.code(), ExitCode::OutputFailed);
  }
  fs::create_directory(folder_ / "taken");
  fs::create_directory(folder_ / "taken" / "inside");
  EXPECT_THROW(write_file_atomically(folder_ / "taken", "x"), OutputError);
  EXPECT_EQ(files(), 1U);
}

TEST_F(AtomicFile, LinksAreFollowedAndPipesKept) {
  write_file_atomically(folder_ / "target", "old");
  fs::create_symlink("target", folder_ / "link");
  write_file_atomically(folder_ / "link", "new");
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_EQ(read_file(folder_ / "target"), "new");
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  EXPECT_THROW(write_file_atomically(folder_ / "pipe", "x"), OutputError);
  EXPECT_TRUE(fs::is_fifo(folder_ / "pipe"));
}

TEST_F(AtomicFile, ReadingReportsWhatIsWrong) {
  EXPECT_THROW(read_file(folder_ / "none"), InputError);
  EXPECT_THROW(read_file(folder_), InputError);
  write_file_atomically(folder_ / "big", std::string(1000, 'x'));
  EXPECT_THROW(read_file(folder_ / "big", 999), InputError);
  EXPECT_EQ(read_file(folder_ / "big", 1000).size(), 1000U);
}

// A child rewrites one file for ever and is killed at random moments: every state seen on disk
// must be one of the two contents, whole.
TEST_F(AtomicFile, KillNeverTearsAFile) {
  const std::string a(1 << 20, 'a');
  const std::string b(1 << 20, 'b');
  write_file_atomically(folder_ / "f", a);
  int rewritten = 0;
  for (int round = 0; round < 20; ++round) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      for (;;) {
        write_file_atomically(folder_ / "f", b);
        write_file_atomically(folder_ / "f", a);
      }
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(3 + 2 * round));
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    const std::string seen = read_file(folder_ / "f");
    ASSERT_TRUE(seen == a || seen == b) << "torn after kill " << round;
    rewritten += seen == b;
  }
  RecordProperty("seen_second_content", rewritten);
}

TEST(Hash, KnownValues) {
  // Published FNV-1a test vectors.
  EXPECT_EQ(Hash().hex(), "cbf29ce484222325");
  EXPECT_EQ(Hash().add("a").hex(), "af63dc4c8601ec8c");
  EXPECT_EQ(Hash().add("foobar").hex(), "85944171f73967e8");
}

}  // namespace
}  // namespace piecework
