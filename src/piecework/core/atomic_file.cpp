#include <piecework/core/atomic_file.hpp>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/descriptor.hpp>
#include <piecework/core/error.hpp>

namespace piecework {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const char* what, int error) {
  throw OutputError(fmt::format("{}: {}: {}", path.string(), what, std::strerror(error)));
}

/// Removes the temporary file unless it was renamed into place.
class TemporaryFile {
 public:
  explicit TemporaryFile(std::string path) : path_(std::move(path)) {}
  ~TemporaryFile() {
    if (!path_.empty()) ::unlink(path_.c_str());
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  [[nodiscard]] const char* c_str() const { return path_.c_str(); }
  void keep() { path_.clear(); }

 private:
  std::string path_;
};

int write_all(int fd, std::string_view content) {
  while (!content.empty()) {
    const ssize_t written = ::write(fd, content.data(), content.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    content.remove_prefix(static_cast<std::size_t>(written));
  }
  return 0;
}

/// The file behind links. Devices, pipes and folders are not replaced by a file.
std::filesystem::path writable_target(const std::filesystem::path& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) return path;
  if (!std::filesystem::is_regular_file(status))
    throw OutputError(
        fmt::format("{}: exists and is no regular file; name another", path.string()));
  const auto target = std::filesystem::canonical(path, error);
  return error ? path : target;
}

}  // namespace

void write_file_atomically(const std::filesystem::path& named, std::string_view content) {
  const std::filesystem::path path = writable_target(named);
  const std::string temporary_path = fmt::format("{}.tmp{}", path.string(), ::getpid());
  Descriptor file(::open(temporary_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
  if (file.get() < 0) fail(path, "cannot create the file", errno);
  TemporaryFile temporary(temporary_path);

  if (const int error = write_all(file.get(), content)) fail(path, "cannot write", error);
  if (::fsync(file.get()) != 0) fail(path, "cannot flush to disk", errno);
  if (file.close() != 0) fail(path, "cannot close", errno);
  if (::rename(temporary.c_str(), path.c_str()) != 0) fail(path, "cannot rename into place", errno);
  temporary.keep();

  // The rename itself must survive a power cut; some file systems refuse fsync on a folder.
  const auto folder = path.parent_path().empty() ? std::filesystem::path(".") : path.parent_path();
  const Descriptor directory(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (directory.get() >= 0) (void)::fsync(directory.get());
}

std::string read_file(const std::filesystem::path& path, std::size_t max_bytes) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status))
    throw InputError(fmt::format("{}: no such file; check the path", path.string()));
  if (std::filesystem::is_directory(status))
    throw InputError(fmt::format("{}: is a folder; name a file", path.string()));
  std::ifstream stream(path, std::ios::binary);
  if (!stream)
    throw InputError(fmt::format("{}: cannot be opened: {}", path.string(), std::strerror(errno)));
  std::string content;
  char buffer[1 << 16];
  while (stream.read(buffer, sizeof buffer) || stream.gcount() > 0) {
    content.append(buffer, static_cast<std::size_t>(stream.gcount()));
    if (content.size() > max_bytes)
      throw InputError(
          fmt::format("{}: larger than the limit of {} bytes", path.string(), max_bytes));
  }
  return content;
}

void ensure_directory(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error)
    throw OutputError(
        fmt::format("{}: cannot create the folder: {}", path.string(), error.message()));
}

}  // namespace piecework
