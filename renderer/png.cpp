#include <renderer/png.hpp>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <memory>

#include <zlib.h>

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_PNG
#define STBI_NO_STDIO
#define STBI_MAX_DIMENSIONS 32768
#include <stb_image.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::render {
namespace {

constexpr int kLevel = 1;       // deflate: 58 ms for 1080p where the default takes 250
constexpr int kBandRows = 128;  // rows compressed by one task; fixed, so bytes are too
constexpr char kFilterUp = 2;   // PNG specification 9.2
constexpr std::size_t kMaxFile = std::size_t{1} << 30;

void append_big_endian(std::string& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) {
    out.push_back(static_cast<char>((value >> static_cast<unsigned>(shift)) & 0xFFU));
  }
}

void append_chunk(std::string& out, const char* name, const std::string& content) {
  append_big_endian(out, static_cast<std::uint32_t>(content.size()));
  const std::string body = name + content;
  out += body;
  const auto* bytes = reinterpret_cast<const Bytef*>(body.data());
  append_big_endian(out,
                    static_cast<std::uint32_t>(crc32(0, bytes, static_cast<uInt>(body.size()))));
}

/// One band of rows: filtered and compressed on its own, so that bands can be made in parallel.
/// Each but the last ends at a byte boundary without closing the stream: joined they are one.
struct Band {
  std::string deflated;
  uLong checksum = 0;  ///< Adler-32 of the filtered bytes
  std::size_t size = 0;
};

std::string filter_up(const Image& image, int first, int last) {
  const std::size_t row_bytes = 3 * static_cast<std::size_t>(image.width);
  std::string filtered(static_cast<std::size_t>(last - first) * (row_bytes + 1), '\0');
  char* out = filtered.data();
  for (int row = first; row < last; ++row) {
    const std::uint8_t* current = image.rgb.data() + static_cast<std::size_t>(row) * row_bytes;
    *out++ = kFilterUp;
    if (row == 0) {
      std::memcpy(out, current, row_bytes);
    } else {
      const std::uint8_t* above = current - row_bytes;
      for (std::size_t i = 0; i < row_bytes; ++i) {
        out[i] = static_cast<char>(static_cast<std::uint8_t>(current[i] - above[i]));
      }
    }
    out += row_bytes;
  }
  return filtered;
}

Band compress_band(const Image& image, int first, int last) {
  std::string filtered = filter_up(image, first, last);
  Band band;
  band.size = filtered.size();
  auto* input = reinterpret_cast<Bytef*>(filtered.data());
  band.checksum = adler32(adler32(0, nullptr, 0), input, static_cast<uInt>(filtered.size()));
  z_stream stream{};
  constexpr int kRawWindow = -15;  // no zlib header: the caller writes one for all bands
  constexpr int kMemoryLevel = 9;
  if (deflateInit2(&stream, kLevel, Z_DEFLATED, kRawWindow, kMemoryLevel, Z_DEFAULT_STRATEGY) !=
      Z_OK) {
    throw std::bad_alloc();
  }
  constexpr std::size_t kSyncBytes = 16;
  band.deflated.resize(deflateBound(&stream, static_cast<uLong>(filtered.size())) + kSyncBytes);
  stream.next_in = input;
  stream.avail_in = static_cast<uInt>(filtered.size());
  stream.next_out = reinterpret_cast<Bytef*>(band.deflated.data());
  stream.avail_out = static_cast<uInt>(band.deflated.size());
  deflate(&stream, last == image.height ? Z_FINISH : Z_SYNC_FLUSH);  // the buffer is large enough
  band.deflated.resize(stream.total_out);
  deflateEnd(&stream);
  return band;
}

std::string compress(const Image& image) {
  const int num_bands = (image.height + kBandRows - 1) / kBandRows;
  std::vector<Band> bands(static_cast<std::size_t>(num_bands));
  parallel_for(
      bands.size(),
      [&](std::size_t i) {
        const int first = static_cast<int>(i) * kBandRows;
        bands[i] = compress_band(image, first, std::min(first + kBandRows, image.height));
      },
      1);
  std::string result("\x78\x01", 2);  // zlib header: window of 32 KiB, fastest
  uLong checksum = adler32(0, nullptr, 0);
  for (const Band& band : bands) {
    result += band.deflated;
    checksum = adler32_combine(checksum, band.checksum, static_cast<z_off_t>(band.size));
  }
  append_big_endian(result, static_cast<std::uint32_t>(checksum));
  return result;
}

}  // namespace

std::string encode_png(const Image& image) {
  if (image.width < 1 || image.height < 1 ||
      image.rgb.size() != 3 * static_cast<std::size_t>(image.width) * image.height) {
    throw InputError("image: " + std::to_string(image.width) + "x" + std::to_string(image.height) +
                     " pixels with " + std::to_string(image.rgb.size()) + " bytes cannot be a PNG");
  }
  std::string header;
  append_big_endian(header, static_cast<std::uint32_t>(image.width));
  append_big_endian(header, static_cast<std::uint32_t>(image.height));
  header +=
      std::string("\x08\x02\x00\x00\x00", 5);  // 8 bits, RGB, deflate, filters, not interlaced
  const std::string data = compress(image);
  std::string png("\x89PNG\r\n\x1a\n", 8);
  append_chunk(png, "IHDR", header);
  append_chunk(png, "sRGB", std::string(1, '\0'));
  constexpr std::size_t kMaxChunk = std::size_t{1} << 30;  // PNG allows 2^31 - 1
  for (std::size_t start = 0; start < data.size(); start += kMaxChunk) {
    append_chunk(png, "IDAT", data.substr(start, kMaxChunk));
  }
  append_chunk(png, "IEND", {});
  return png;
}

void write_png(const std::filesystem::path& path, const Image& image) {
  write_file_atomically(path, encode_png(image));
}

Image read_png(const std::filesystem::path& path) {
  const std::string content = read_file(path, kMaxFile);
  Image image;
  int channels = 0;
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
      stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(content.data()),
                            static_cast<int>(content.size()), &image.width, &image.height,
                            &channels, 3),
      stbi_image_free);
  if (pixels == nullptr) {
    throw InputError(path.string() + ": not a readable PNG (" + stbi_failure_reason() + ")");
  }
  const std::size_t bytes = 3 * static_cast<std::size_t>(image.width) * image.height;
  image.rgb.assign(pixels.get(), pixels.get() + bytes);
  return image;
}

}  // namespace piecework::render
