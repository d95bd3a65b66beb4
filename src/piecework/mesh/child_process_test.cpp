#include <piecework/mesh/child_process.hpp>

#include <csignal>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include <piecework/core/error.hpp>
#include <piecework/mesh/mesh_test_util.hpp>

namespace piecework::mesh {
namespace {

std::string error_of(const std::function<std::string()>& work, const ChildLimits& limits = {}) {
  try {
    run_in_child("f.ply", work, limits);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(ChildProcess, ReturnsWhatTheWorkReturned) {
  EXPECT_EQ(run_in_child("f", [] { return std::string("a\0b", 3); }), std::string("a\0b", 3));
  EXPECT_EQ(run_in_child("f", [] { return std::string(); }), "");
  EXPECT_EQ(run_in_child("f", [] { return std::string(30'000'000, 'x'); }).size(), 30'000'000U);
}

TEST(ChildProcess, TheParentKeepsItsMemory) {
  int touched = 0;
  run_in_child("f", [&] {
    touched = 1;
    return std::string();
  });
  EXPECT_EQ(touched, 0);
}

TEST(ChildProcess, CrashesBecomeInputErrors) {
  EXPECT_TRUE(contains(error_of([]() -> std::string {
                         std::raise(SIGSEGV);
                         return "";
                       }),
                       "f.ply: crashes the reader (signal 11)"));
  EXPECT_TRUE(contains(error_of([]() -> std::string { ::_exit(3); }), "crashes the reader"));
  EXPECT_TRUE(contains(error_of([]() -> std::string { ::_exit(0); }), "the reader failed"));
}

TEST(ChildProcess, ExceptionsComeBackAsText) {
  EXPECT_EQ(error_of([]() -> std::string { throw InputError("f.ply: line 3: no; fix"); }),
            "f.ply: line 3: no; fix");
  EXPECT_TRUE(contains(error_of([]() -> std::string { throw std::runtime_error("odd"); }),
                       "the reader failed: odd"));
}

TEST(ChildProcess, TimeIsLimited) {
  ChildLimits limits;
  limits.seconds = 1;
  EXPECT_TRUE(contains(error_of(
                           []() -> std::string {
                             for (;;) ::pause();
                           },
                           limits),
                       "not read within 1 s"));
}

TEST(ChildProcess, MemoryIsLimited) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the limit is off under this sanitizer, which reserves terabytes";
#else
  ChildLimits limits;
  limits.memory_bytes = std::size_t{64} << 20;
  const auto take_a_gigabyte = [] {
    return std::to_string(std::vector<char>(std::size_t{1} << 30, 'x').size());
  };
  EXPECT_TRUE(contains(error_of(take_a_gigabyte, limits), "more than 64 MiB of memory"));
#endif
}

}  // namespace
}  // namespace piecework::mesh
