#pragma once

// What the tests of the program share: calls of it, and a scene.

#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <piecework/core/atomic_file.hpp>

namespace piecework::cli {

namespace fs = std::filesystem;

struct Result {
  int code = -1;  ///< exit code, or 128 + signal
  std::string out;
  std::string err;
};

class Cli : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / fmt::format("piecework_cli_{}", ::getpid());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// Runs `piecework <arguments>`; arguments are shell words.
  [[nodiscard]] Result call(const std::string& arguments) const {
    const fs::path out = folder_ / "stdout";
    const fs::path err = folder_ / "stderr";
    const int status = std::system(fmt::format("'{}' {} >'{}' 2>'{}' </dev/null", PIECEWORK_PROGRAM,
                                               arguments, out.string(), err.string())
                                       .c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), read_file(out),
            read_file(err)};
  }

  /// A sheet of `side` x `side` vertices that hangs, as a scene file.
  [[nodiscard]] std::string scene(int side = 12, int steps = 6) const {
    const fs::path path = folder_ / fmt::format("sheet{}_{}.json", side, steps);
    write_file_atomically(path, fmt::format(R"({{"name": "sheet", "step": {{"steps": {}}},
      "solver": {{"domains": 4}}, "quality": {{"stop": "iterations", "max_iterations": 5}},
      "materials": {{"m": {{"stretching": 261, "bending": 1e-5}}}},
      "cloths": [{{"material": "m", "mesh": {{"generator": "sheet", "columns": {}, "rows": {}}},
                 "pins": [{{"region": {{"vertices": [0]}}}}]}}],
      "expect": [{{"quantity": "lowest_y", "max": -0.001}}]}})",
                                            steps, side, side));
    return path.string();
  }

  [[nodiscard]] std::string dir(const std::string& name) const { return (folder_ / name).string(); }

  fs::path folder_;
};

/// Starts `piecework run` in the background, without a shell between.
inline pid_t start(const std::vector<std::string>& arguments) {
  std::vector<char*> argv{const_cast<char*>(PIECEWORK_PROGRAM)};  // NOLINT: execv's interface
  for (const std::string& argument : arguments)
    argv.push_back(const_cast<char*>(argument.c_str()));  // NOLINT
  argv.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    std::freopen("/dev/null", "w", stderr);
    std::freopen("/dev/null", "w", stdout);
    execv(PIECEWORK_PROGRAM, argv.data());
    _exit(127);
  }
  return child;
}

inline bool wait_for(const fs::path& path) {
  for (int i = 0; i < 3000 && !fs::exists(path); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  return fs::exists(path);
}

}  // namespace piecework::cli
