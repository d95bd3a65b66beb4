#pragma once

// A POSIX file descriptor with an owner.

#include <unistd.h>

#include <utility>

namespace piecework {

/// Closes its descriptor on every path out; -1 is none.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  [[nodiscard]] int get() const { return fd_; }

  /// Closes now and says whether that failed: 0, or -1 with errno. Data may be lost if it did.
  int close() { return ::close(std::exchange(fd_, -1)); }

 private:
  int fd_;
};

}  // namespace piecework
