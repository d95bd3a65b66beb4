#include "case_process.hpp"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <thread>

#include <fmt/format.h>

#include <piecework/core/error.hpp>

#include "signals.hpp"

namespace piecework::cli {
namespace {

constexpr const char* kThisProgram = "/proc/self/exe";
constexpr int kCannotStart = 127;

/// In the child: only calls that are allowed after fork().
[[noreturn]] void become(char* const* argv, const char* log, pid_t parent) {
  ::setpgid(0, 0);  // the terminal's Ctrl-C reaches the parent only, which passes it on
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(kCannotStart);  // it died in between
  const int in = ::open("/dev/null", O_RDONLY);
  const int out = ::open(log, O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (in < 0 || out < 0) ::_exit(kCannotStart);
  ::dup2(in, STDIN_FILENO);
  ::dup2(out, STDOUT_FILENO);
  ::dup2(out, STDERR_FILENO);
  ::execv(kThisProgram, argv);
  ::_exit(kCannotStart);
}

/// Waits for the child, looking for signals in between. A pause costs the child nothing.
int wait_for(pid_t child) {
  constexpr auto kPause = std::chrono::milliseconds(20);
  bool told = false;
  int status = 0;
  for (;;) {
    const pid_t ended = ::waitpid(child, &status, WNOHANG);
    if (ended == child) return status;
    if (ended < 0 && errno != EINTR)
      throw OutputError(fmt::format("waiting for a case: {}", std::strerror(errno)));
    if (stop_signal() != 0 && !told) {
      ::kill(child, stop_signal());
      told = true;
    }
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace

ChildEnd run_piecework(const std::vector<std::string>& arguments,
                       const std::filesystem::path& log) {
  constexpr int kSignalled = 128;
  std::vector<std::string> words = {"piecework"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child < 0)
    throw OutputError(fmt::format("a case cannot be started: {}", std::strerror(errno)));
  if (child == 0) become(argv.data(), log.c_str(), parent);
  const int status = wait_for(child);
  ChildEnd end;
  end.exit_code = WIFSIGNALED(status) ? kSignalled + WTERMSIG(status) : WEXITSTATUS(status);
  if (end.exit_code == kCannotStart)
    throw OutputError(fmt::format("{}: a case cannot be started", log.string()));
  end.stopped = end.exit_code == kSignalled + SIGINT || end.exit_code == kSignalled + SIGTERM;
  return end;
}

}  // namespace piecework::cli
