#pragma once

// Vectors of plain numbers as bytes, on their way from a child process. Internal to mesh/.

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/core/types.hpp>
#include <piecework/mesh/assimp_guard.hpp>

namespace piecework::mesh {

/// Flat bytes, one vector or text after the other.
class Packer {
 public:
  template <class T>
  void add(const std::vector<T>& items) {
    static_assert(std::is_trivially_copyable_v<T>);
    add_bytes(items.data(), items.size(), sizeof(T));
  }
  void add(const std::string& text) { add_bytes(text.data(), text.size(), 1); }
  /// Vectors of fixed-size Eigen vectors, whose elements are plain doubles.
  template <int Size>
  void add(const std::vector<Eigen::Matrix<double, Size, 1>>& items) {
    add_bytes(items.data(), items.size(), sizeof(double) * Size);
  }
  std::string take() { return std::move(bytes_); }

 private:
  void add_bytes(const void* data, std::size_t count, std::size_t item_size) {
    const std::uint64_t number = count;
    bytes_.append(reinterpret_cast<const char*>(&number), sizeof number);
    if (count > 0) bytes_.append(static_cast<const char*>(data), count * item_size);
  }
  std::string bytes_;
};

/// Reads what Packer wrote; a damaged child may have written anything.
class Unpacker {
 public:
  Unpacker(const std::string& file, std::string_view bytes) : file_(file), bytes_(bytes) {}
  template <class Items>
  void get(Items& items) {
    using Item = typename Items::value_type;
    std::uint64_t count = 0;
    copy(&count, sizeof count);
    if (count > bytes_.size() / sizeof(Item)) fail();
    items.resize(count);
    copy(items.data(), count * sizeof(Item));
  }

 private:
  void copy(void* to, std::size_t size) {
    if (size > bytes_.size()) fail();
    if (size > 0) std::memcpy(to, bytes_.data(), size);
    bytes_.remove_prefix(size);
  }
  [[noreturn]] void fail() const {
    throw InputError(fmt::format("{}: crashes the reader; {}", file_, kExportAgain));
  }
  const std::string& file_;
  std::string_view bytes_;
};

}  // namespace piecework::mesh
