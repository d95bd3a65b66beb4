#include <piecework/core/hash.hpp>

#include <fmt/format.h>

namespace piecework {

std::string Hash::hex() const { return fmt::format("{:016x}", value_); }

}  // namespace piecework
