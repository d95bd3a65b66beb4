#pragma once

// Memory for vector kernels. Private to the global module.

#include <sys/mman.h>

#include <cstddef>
#include <memory>
#include <new>

namespace piecework::global {

/// Numbers that are not initialised and start at 64 bytes; large arrays ask for huge pages: sweeps
/// stream through them, and prefetchers stop at the end of a page.
template <class T>
class AlignedArray {
 public:
  AlignedArray() = default;

  /// \throws std::bad_alloc
  explicit AlignedArray(std::size_t size) : size_(size) {
    const std::size_t bytes = size * sizeof(T);
    const std::size_t alignment = bytes >= kHuge ? kHuge : 64;
    data_ = {static_cast<T*>(::operator new(bytes, std::align_val_t(alignment))), {alignment}};
    if (bytes >= kHuge) ::madvise(data_.get(), bytes / kHuge * kHuge, MADV_HUGEPAGE);  // a hint
  }

  [[nodiscard]] T* data() const { return data_.get(); }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  static constexpr std::size_t kHuge = std::size_t{1} << 21;
  struct Free {
    std::size_t alignment = 64;
    void operator()(T* data) const { ::operator delete(data, std::align_val_t(alignment)); }
  };
  std::unique_ptr<T, Free> data_;
  std::size_t size_ = 0;
};

}  // namespace piecework::global
