#pragma once

// From samples to pixels.

#include <cstdint>
#include <span>

#include <renderer/renderer.hpp>

namespace piecework::render {

/// A part of the picture, in pixels from its top left corner.
struct Tile {
  int x = 0, y = 0, width = 0, height = 0;
};

/// Averages blocks of samples x samples in linear light and writes them, sRGB-encoded, into `tile`
/// of `image`. Parallel over rows.
/// \param rgba     4 bytes per sample, bottom row first, (tile.width * samples) per row; each is
///                 255 times the square root of linear light
/// \param samples  1, 2 or 3
void resolve_tile(std::span<const std::uint8_t> rgba, const Tile& tile, int samples, Image& image);

}  // namespace piecework::render
