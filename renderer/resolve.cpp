#include <renderer/resolve.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <renderer/color.hpp>

#include <piecework/core/parallel.hpp>

namespace piecework::render {
namespace {

constexpr std::uint32_t kFull = 255 * 255;  // sum of one sample of white

/// Sums are shifted right so that the table stays in the first-level cache.
constexpr std::uint32_t shift_for(int samples) { return samples == 1 ? 2 : samples == 2 ? 4 : 5; }

std::vector<std::uint8_t> encode_table(int samples) {
  const std::uint32_t shift = shift_for(samples);
  const std::uint32_t largest = kFull * static_cast<std::uint32_t>(samples * samples);
  std::vector<std::uint8_t> table((largest >> shift) + 1);
  for (std::size_t i = 0; i < table.size(); ++i) {
    const auto sum = static_cast<float>(i << shift) + 0.5F * static_cast<float>(1U << shift);
    const float encoded = srgb_from_linear(std::min(sum / static_cast<float>(largest), 1.0F));
    table[i] = static_cast<std::uint8_t>(std::lround(255.0F * encoded));
  }
  return table;
}

const std::vector<std::uint8_t>& table_for(int samples) {
  static const std::array<std::vector<std::uint8_t>, 3> kTables{encode_table(1), encode_table(2),
                                                                encode_table(3)};
  return kTables[static_cast<std::size_t>(samples - 1)];
}

/// Linear light of one channel, summed over a block of samples.
template <int kSamples>
std::uint32_t block_sum(const std::uint8_t* first, std::size_t stride) {
  std::uint32_t sum = 0;
  for (std::size_t j = 0; j < kSamples; ++j) {
    for (std::size_t i = 0; i < kSamples; ++i) {
      const std::uint32_t value = first[j * stride + 4 * i];
      sum += value * value;
    }
  }
  return sum;
}

template <int kSamples>
void resolve_row(const std::uint8_t* samples, std::size_t stride, int width, std::uint8_t* out) {
  const std::uint8_t* table = table_for(kSamples).data();
  constexpr std::uint32_t kShift = shift_for(kSamples);
  for (int x = 0; x < width; ++x) {
    for (std::size_t c = 0; c < 3; ++c) {
      *out++ = table[block_sum<kSamples>(samples + c, stride) >> kShift];
    }
    samples += static_cast<std::size_t>(4 * kSamples);
  }
}

}  // namespace

void resolve_tile(std::span<const std::uint8_t> rgba, const Tile& tile, int samples, Image& image) {
  const auto stride = static_cast<std::size_t>(4 * tile.width) * samples;
  const auto resolve = samples == 1   ? resolve_row<1>
                       : samples == 2 ? resolve_row<2>
                                      : resolve_row<3>;
  parallel_for(
      static_cast<std::size_t>(tile.height),
      [&](std::size_t row) {
        const std::size_t from_below = static_cast<std::size_t>(tile.height) - 1 - row;
        const std::size_t out =
            3 * ((static_cast<std::size_t>(tile.y) + row) * image.width + tile.x);
        resolve(rgba.data() + from_below * samples * stride, stride, tile.width,
                image.rgb.data() + out);
      },
      16);
}

}  // namespace piecework::render
