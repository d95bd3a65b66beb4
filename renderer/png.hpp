#pragma once

// Images to PNG, and sheets of small pictures.

#include <filesystem>
#include <string>
#include <vector>

#include "renderer.hpp"

namespace piecework::render {

/// PNG bytes (8 bit RGB). Level 1 deflate with the "up" filter: a fraction of the time of stb's
/// default and smaller files.
std::string encode_png(const Image& image);

/// Encodes and writes atomically. \throws OutputError.
void write_png(const std::filesystem::path& path, const Image& image);

/// Reads an 8-bit PNG. \throws InputError.
Image read_png(const std::filesystem::path& path);

/// `images` scaled down and laid out in `columns` columns on a white sheet, with captions.
Image contact_sheet(const std::vector<Image>& images, const std::vector<std::string>& captions,
                    int columns, int tile_width);

}  // namespace piecework::render
