#pragma once

// Images to PNG, and sheets of small pictures.

#include <filesystem>
#include <string>
#include <vector>

#include <renderer/renderer.hpp>

namespace piecework::render {

/// PNG bytes (8 bit RGB). Level 1 deflate with the "up" filter: a fraction of the time of stb's
/// default and smaller files. Parallel; the bytes do not depend on the number of threads. May run
/// on a worker thread while the next picture is drawn.
/// \throws InputError if the image has no pixels or rgb does not have width x height x 3 bytes.
std::string encode_png(const Image& image);

/// Encodes and writes atomically. \throws InputError as above, OutputError.
void write_png(const std::filesystem::path& path, const Image& image);

/// Reads a PNG as 8-bit RGB: other depths are converted, transparency is dropped.
/// \throws InputError if the file is missing or is not a PNG.
Image read_png(const std::filesystem::path& path);

/// `images` scaled down (area average in linear light) to `tile_width` pixels and laid out row by
/// row in `columns` columns on a white sheet, with captions below them.
/// \param captions  one per image, or none at all
/// \throws InputError if there is no image, an image is empty, or a number is out of range.
Image contact_sheet(const std::vector<Image>& images, const std::vector<std::string>& captions,
                    int columns, int tile_width);

}  // namespace piecework::render
