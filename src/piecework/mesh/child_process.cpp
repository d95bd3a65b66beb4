#include <piecework/mesh/child_process.hpp>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <exception>
#include <fstream>
#include <new>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/descriptor.hpp>
#include <piecework/core/error.hpp>

namespace piecework::mesh {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kLimitMemory = false;
#else
constexpr bool kLimitMemory = true;
#endif

// First byte of what a child leaves.
constexpr char kResult = 'R';
constexpr char kBadInput = 'I';
constexpr char kNoMemory = 'M';
constexpr char kException = 'X';

void limit(__rlimit_resource resource, rlim_t value) {
  const rlimit both{value, value};
  ::setrlimit(resource, &both);
}

/// Bytes of address space this process has now.
std::size_t address_space() {
  std::ifstream file("/proc/self/statm");
  std::size_t pages = 0;
  file >> pages;
  return pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

/// Signals back to their defaults (a crash handler of ours must not run), limits, silence.
void confine(const ChildLimits& limits) {
  for (int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGALRM, SIGXCPU, SIGINT, SIGTERM})
    std::signal(signal, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, limits.seconds);
  if (kLimitMemory) limit(RLIMIT_AS, address_space() + limits.memory_bytes);
  const int null = ::open("/dev/null", O_RDWR);
  for (int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(null, stream);
  ::alarm(limits.seconds);
}

bool write_all(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

/// The child's whole life. Nothing may leave it but the bytes in `fd`.
[[noreturn]] void run_child(int fd, const std::function<std::string()>& work,
                            const ChildLimits& limits) {
  bool written = false;
  try {
    confine(limits);
    const std::string result = work();
    written = write_all(fd, std::string_view(&kResult, 1)) && write_all(fd, result);
  } catch (const InputError& error) {
    written = write_all(fd, kBadInput + std::string(error.what()));
  } catch (const std::bad_alloc&) {
    written = write_all(fd, std::string_view(&kNoMemory, 1));
  } catch (const std::exception& error) {
    written = write_all(fd, kException + std::string(error.what()));
  }
  ::_exit(written ? 0 : 1);
}

int wait_for(pid_t child) {
  int status = 0;
  while (::waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) return -1;  // someone else collected it: judged by what it left
  }
  return status;
}

std::string read_all(const std::string& name, int fd) {
  struct stat info {};
  if (::fstat(fd, &info) != 0)
    throw InputError(fmt::format("{}: cannot read what the reader left: {}; try again", name,
                                 std::strerror(errno)));
  std::string bytes(static_cast<std::size_t>(info.st_size), '\0');
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count =
        ::pread(fd, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    done += static_cast<std::size_t>(count);
  }
  bytes.resize(done);
  return bytes;
}

/// What killed the child, or an empty text.
std::string death(int status, const ChildLimits& limits) {
  if (status < 0) return "";
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    if (signal == SIGALRM || signal == SIGXCPU)
      return fmt::format(
          "not read within {} s; the file is probably corrupt, or too large: simplify "
          "it or convert it to OBJ",
          limits.seconds);
    return fmt::format(
        "crashes the reader (signal {}); the file is probably corrupt: export it "
        "again or convert it to OBJ",
        signal);
  }
  if (WEXITSTATUS(status) != 0)
    return "crashes the reader; the file is probably corrupt: export it again or convert it to OBJ";
  return "";
}

}  // namespace

std::string run_in_child(const std::string& name, const std::function<std::string()>& work,
                         const ChildLimits& limits) {
  const Descriptor file(::memfd_create("piecework_reader", MFD_CLOEXEC));
  const pid_t child = file.get() < 0 ? -1 : ::fork();
  if (child < 0)
    throw InputError(fmt::format("{}: cannot start the reader: {}; free memory or processes", name,
                                 std::strerror(errno)));
  if (child == 0) run_child(file.get(), work, limits);
  const std::string problem = death(wait_for(child), limits);
  if (!problem.empty()) throw InputError(fmt::format("{}: {}", name, problem));
  std::string bytes = read_all(name, file.get());
  const char kind = bytes.empty() ? kException : bytes.front();
  if (!bytes.empty()) bytes.erase(0, 1);
  if (kind == kResult) return bytes;
  if (kind == kBadInput) throw InputError(bytes);
  if (kind == kNoMemory)
    throw InputError(
        fmt::format("{}: needs more than {} MiB of memory to read; the file is probably "
                    "corrupt, or too large: simplify it",
                    name, limits.memory_bytes >> 20));
  throw InputError(
      fmt::format("{}: the reader failed: {}; the file is probably corrupt: export it "
                  "again or convert it to OBJ",
                  name, bytes));
}

}  // namespace piecework::mesh
