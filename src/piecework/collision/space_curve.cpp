#include "space_curve.hpp"

#include <algorithm>
#include <array>

#include <piecework/core/parallel.hpp>

namespace piecework::collision {
namespace {

constexpr int kDigitBits = 10, kDigits = 3;
constexpr std::size_t kValues = std::size_t{1} << kDigitBits;
constexpr std::size_t kChunk = 16384;  // keys counted by one task; the result does not depend on it

/// Every bit followed by two zeros.
std::uint32_t spread(std::uint32_t bits) {
  bits = (bits | bits << 16) & 0x030000ffU;
  bits = (bits | bits << 8) & 0x0300f00fU;
  bits = (bits | bits << 4) & 0x030c30c3U;
  return (bits | bits << 2) & 0x09249249U;
}

std::uint32_t cell(float x) {
  constexpr float cells = static_cast<float>(kValues);
  return static_cast<std::uint32_t>(std::clamp(x * cells, 0.0F, cells - 1));
}

/// One pass of a radix sort, least digit first: count, sum, move.
void sort_by_digit(const std::vector<std::uint64_t>& from, std::vector<std::uint64_t>& to,
                   int shift, std::vector<std::array<std::uint32_t, kValues>>& place) {
  const auto digit = [&](std::uint64_t key) { return (key >> shift) & (kValues - 1); };
  const auto for_chunk = [&](std::size_t chunk, const auto& visit) {
    const std::size_t end = std::min((chunk + 1) * kChunk, from.size());
    for (std::size_t i = chunk * kChunk; i < end; ++i) visit(from[i]);
  };
  const auto count = [&](std::size_t chunk) {
    place[chunk].fill(0);
    for_chunk(chunk, [&](std::uint64_t key) { ++place[chunk][digit(key)]; });
  };
  parallel_for(place.size(), count, 1);
  std::uint32_t sum = 0;
  for (std::size_t value = 0; value < kValues; ++value)
    for (auto& counts : place) {
      const std::uint32_t here = counts[value];
      counts[value] = sum;
      sum += here;
    }
  const auto move = [&](std::size_t chunk) {
    for_chunk(chunk, [&](std::uint64_t key) { to[place[chunk][digit(key)]++] = key; });
  };
  parallel_for(place.size(), move, 1);
}

}  // namespace

/// [Skilling 2004], for three axes: reflections and exchanges of axes from the first bit to the
/// last, then Gray's code.
std::uint32_t hilbert_code(float x, float y, float z) {
  std::array<std::uint32_t, 3> c{cell(x), cell(y), cell(z)};
  for (std::uint32_t bit = kValues / 2; bit > 1; bit /= 2) {
    const std::uint32_t below = bit - 1;
    for (std::uint32_t& axis : c) {
      const std::uint32_t exchange = (c[0] ^ axis) & below;
      if ((axis & bit) != 0) {
        c[0] ^= below;
      } else {
        c[0] ^= exchange;
        axis ^= exchange;
      }
    }
  }
  c[1] ^= c[0];
  c[2] ^= c[1];
  std::uint32_t flip = 0;
  for (std::uint32_t bit = kValues / 2; bit > 1; bit /= 2)
    if ((c[2] & bit) != 0) flip ^= bit - 1;
  return spread(c[0] ^ flip) << 2 | spread(c[1] ^ flip) << 1 | spread(c[2] ^ flip);
}

void sort_by_code(std::vector<std::uint64_t>& keys, std::vector<std::uint64_t>& spare) {
  spare.resize(keys.size());
  std::vector<std::array<std::uint32_t, kValues>> place((keys.size() + kChunk - 1) / kChunk);
  for (int pass = 0; pass < kDigits; ++pass) {
    sort_by_digit(keys, spare, 32 + pass * kDigitBits, place);
    keys.swap(spare);
  }
}

}  // namespace piecework::collision
