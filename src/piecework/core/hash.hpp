#pragma once

// FNV-1a, 64 bit: names a scene, a mesh or a state in reports and checkpoints. Not cryptographic.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace piecework {

class Hash {
 public:
  Hash& add_bytes(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) value_ = (value_ ^ bytes[i]) * 0x100000001b3ULL;
    return *this;
  }
  Hash& add(std::string_view text) { return add_bytes(text.data(), text.size()); }
  template <class T, std::size_t N>
  Hash& add(std::span<T, N> values) {
    return add_bytes(values.data(), values.size_bytes());
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }
  /// 16 hexadecimal digits.
  [[nodiscard]] std::string hex() const;

 private:
  std::uint64_t value_ = 0xcbf29ce484222325ULL;
};

}  // namespace piecework
