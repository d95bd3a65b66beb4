// Sheets of small pictures.

#include <algorithm>
#include <array>
#include <cmath>

#include <renderer/color.hpp>
#include <renderer/png.hpp>
#include <renderer/text.hpp>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::render {
namespace {

constexpr int kMinTile = 16;
constexpr int kMaxTile = 8192;
constexpr double kMaxPixels = 1 << 28;
constexpr Rgb kInk{0.20F, 0.21F, 0.24F};
constexpr Rgb kFrame{0.80F, 0.82F, 0.84F};

/// Source cells that one target cell covers along an axis, with their shares.
struct Cover {
  int first = 0;
  std::vector<float> shares;  ///< sum to 1
};

std::vector<Cover> covers(int from, int to) {
  std::vector<Cover> result(static_cast<std::size_t>(to));
  const double ratio = static_cast<double>(from) / to;
  for (int i = 0; i < to; ++i) {
    const double low = i * ratio;
    const double high = std::min((i + 1) * ratio, static_cast<double>(from));
    Cover& cover = result[i];
    cover.first = std::min(static_cast<int>(low), from - 1);
    for (int j = cover.first; j < from && (j < high || cover.shares.empty()); ++j) {
      const double share = std::min(j + 1.0, high) - std::max(static_cast<double>(j), low);
      cover.shares.push_back(static_cast<float>(std::max(share, 0.0) / (high - low)));
    }
  }
  return result;
}

const std::array<float, 256>& linear_table() {
  static const std::array<float, 256> kTable = [] {
    std::array<float, 256> table{};
    for (std::size_t i = 0; i < table.size(); ++i) {
      table[i] = linear_from_srgb(static_cast<float>(i) / 255.0F);
    }
    return table;
  }();
  return kTable;
}

int scaled_height(const Image& image, int width) {
  const double height = static_cast<double>(image.height) * width / image.width;
  return std::max(1, static_cast<int>(std::min(std::round(height), 1e9)));
}

Image scale_to_width(const Image& image, int width) {
  Image result;
  result.width = width;
  result.height = scaled_height(image, width);
  result.rgb.resize(3 * static_cast<std::size_t>(result.width) * result.height);
  const std::vector<Cover> columns = covers(image.width, result.width);
  const std::vector<Cover> rows = covers(image.height, result.height);
  const std::array<float, 256>& linear = linear_table();
  parallel_for(
      rows.size(),
      [&](std::size_t y) {
        std::vector<float> line(3 * static_cast<std::size_t>(image.width), 0.0F);
        for (std::size_t j = 0; j < rows[y].shares.size(); ++j) {
          const std::size_t source = static_cast<std::size_t>(rows[y].first) + j;
          const std::uint8_t* pixels = image.rgb.data() + source * line.size();
          for (std::size_t i = 0; i < line.size(); ++i) {
            line[i] += rows[y].shares[j] * linear[pixels[i]];
          }
        }
        std::uint8_t* out = result.rgb.data() + 3 * y * static_cast<std::size_t>(width);
        for (std::size_t k = 0; k < 3 * columns.size(); ++k) {
          const Cover& cover = columns[k / 3];
          float sum = 0;
          for (std::size_t i = 0; i < cover.shares.size(); ++i) {
            sum += cover.shares[i] * line[3 * (static_cast<std::size_t>(cover.first) + i) + k % 3];
          }
          const float encoded = srgb_from_linear(std::clamp(sum, 0.0F, 1.0F));
          out[k] = static_cast<std::uint8_t>(std::lround(255.0F * encoded));
        }
      },
      8);
  return result;
}

void paste(const Image& tile, int x, int y, Image& sheet) {
  const std::size_t row_bytes = 3 * static_cast<std::size_t>(tile.width);
  for (int row = 0; row < tile.height; ++row) {
    const std::size_t to = 3 * (static_cast<std::size_t>(y + row) * sheet.width + x);
    std::copy_n(tile.rgb.begin() + static_cast<std::ptrdiff_t>(row * row_bytes), row_bytes,
                sheet.rgb.begin() + static_cast<std::ptrdiff_t>(to));
  }
}

void check(const std::vector<Image>& images, const std::vector<std::string>& captions, int columns,
           int tile_width) {
  if (images.empty()) throw InputError("contact sheet: there is no image");
  if (!captions.empty() && captions.size() != images.size()) {
    throw InputError("contact sheet: " + std::to_string(captions.size()) + " captions for " +
                     std::to_string(images.size()) + " images");
  }
  if (columns < 1) throw InputError("contact sheet: columns: must be at least 1");
  if (tile_width < kMinTile || tile_width > kMaxTile) {
    throw InputError("contact sheet: tile width: must be within 16 ... 8192");
  }
  for (const Image& image : images) {
    if (image.width < 1 || image.height < 1 ||
        image.rgb.size() != 3 * static_cast<std::size_t>(image.width) * image.height) {
      throw InputError("contact sheet: an image has no pixels");
    }
  }
}

}  // namespace

Image contact_sheet(const std::vector<Image>& images, const std::vector<std::string>& captions,
                    int columns, int tile_width) {
  check(images, captions, columns, tile_width);
  int tile_height = 0;
  for (const Image& image : images) {
    tile_height = std::max(tile_height, scaled_height(image, tile_width));
  }
  const int used_columns = std::min(columns, static_cast<int>(images.size()));
  const int rows = (static_cast<int>(images.size()) + used_columns - 1) / used_columns;
  const int gap = std::max(8, tile_width / 24);
  const float cap = std::max(8.0F, static_cast<float>(tile_width) / 34.0F);
  const int caption_height = captions.empty() ? 0 : static_cast<int>(std::ceil(2.4F * cap));
  const double pixels = (static_cast<double>(used_columns) * (tile_width + gap) + gap) *
                        (static_cast<double>(rows) * (tile_height + caption_height + gap) + gap);
  if (pixels > kMaxPixels) {
    throw InputError("contact sheet: " + std::to_string(images.size()) +
                     " images of this size make it too large; use fewer or smaller tiles");
  }
  Image sheet;
  sheet.width = used_columns * (tile_width + gap) + gap;
  sheet.height = rows * (tile_height + caption_height + gap) + gap;
  sheet.rgb.assign(3 * static_cast<std::size_t>(sheet.width) * sheet.height, 255);
  for (std::size_t i = 0; i < images.size(); ++i) {
    const int column = static_cast<int>(i) % used_columns;
    const int x = gap + column * (tile_width + gap);
    const int y = gap + static_cast<int>(i) / used_columns * (tile_height + caption_height + gap);
    const Image tile = scale_to_width(images[i], tile_width);
    fill_rectangle(sheet, static_cast<float>(x - 1), static_cast<float>(y - 1),
                   static_cast<float>(tile.width + 2), static_cast<float>(tile.height + 2), kFrame);
    paste(tile, x, y, sheet);
    if (captions.empty()) continue;
    const float room = static_cast<float>(tile_width);
    const float width = text_width(captions[i], cap);
    const float shrink = width > room ? room / width : 1.0F;
    draw_text(sheet, captions[i], static_cast<float>(x),
              static_cast<float>(y + tile.height) + 1.9F * cap, {cap * shrink, kInk});
  }
  return sheet;
}

}  // namespace piecework::render
