#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <unistd.h>

#include <gtest/gtest.h>
#include <zlib.h>

#include <renderer/png.hpp>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/core/random.hpp>

namespace piecework::render {
namespace {

namespace fs = std::filesystem;

/// A folder that is removed with its content.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (fs::temp_directory_path() / "piecework_png_XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~TemporaryFolder() { fs::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  fs::path operator/(const char* name) const { return path_ / name; }

 private:
  fs::path path_;
};

Image pattern(int width, int height, std::uint64_t seed) {
  Image image{width, height, {}};
  Random random(seed);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto noise = static_cast<int>(random.next() % 16);
      image.rgb.push_back(static_cast<std::uint8_t>((x * 3 + noise) & 255));
      image.rgb.push_back(static_cast<std::uint8_t>((y * 2) & 255));
      image.rgb.push_back(static_cast<std::uint8_t>((x * y + noise) & 255));
    }
  }
  return image;
}

std::uint32_t big_endian(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    value = (value << 8U) | static_cast<unsigned char>(bytes.at(at + i));
  }
  return value;
}

/// Decoder written from the PNG specification: chunks with checksums, zlib, the five filters.
class Decoder {
 public:
  explicit Decoder(const std::string& png) {
    EXPECT_EQ(png.substr(0, 8), std::string("\x89PNG\r\n\x1a\n", 8));
    std::string compressed;
    for (std::size_t at = 8; at < png.size();) {
      const std::uint32_t size = big_endian(png, at);
      const std::string name = png.substr(at + 4, 4);
      const std::string content = png.substr(at + 8, size);
      const auto* body = reinterpret_cast<const Bytef*>(png.data() + at + 4);
      EXPECT_EQ(big_endian(png, at + 8 + size), crc32(0, body, size + 4)) << name;
      if (name == "IHDR") read_header(content);
      if (name == "IDAT") compressed += content;
      last_chunk = name;
      at += 12 + size;
    }
    EXPECT_EQ(last_chunk, "IEND");
    inflate_rows(compressed);
  }

  Image image;
  std::string last_chunk;

 private:
  void read_header(const std::string& content) {
    image.width = static_cast<int>(big_endian(content, 0));
    image.height = static_cast<int>(big_endian(content, 4));
    EXPECT_EQ(content.substr(8), std::string("\x08\x02\x00\x00\x00", 5));
  }

  void inflate_rows(const std::string& compressed) {
    const std::size_t stride = 3 * static_cast<std::size_t>(image.width);
    std::vector<Bytef> raw(static_cast<std::size_t>(image.height) * (stride + 1));
    uLongf size = raw.size();
    ASSERT_EQ(uncompress(raw.data(), &size, reinterpret_cast<const Bytef*>(compressed.data()),
                         compressed.size()),
              Z_OK);
    ASSERT_EQ(size, raw.size());
    image.rgb.resize(static_cast<std::size_t>(image.height) * stride);
    for (int y = 0; y < image.height; ++y) {
      for (std::size_t i = 0; i < stride; ++i) {
        const int filter = raw[y * (stride + 1)];
        const int left = i >= 3 ? image.rgb[y * stride + i - 3] : 0;
        const int up = y > 0 ? image.rgb[(y - 1) * stride + i] : 0;
        const int corner = i >= 3 && y > 0 ? image.rgb[(y - 1) * stride + i - 3] : 0;
        const int predicted = predict(filter, left, up, corner);
        image.rgb[y * stride + i] =
            static_cast<std::uint8_t>((raw[y * (stride + 1) + 1 + i] + predicted) & 255);
      }
    }
  }

  static int predict(int filter, int left, int up, int corner) {
    switch (filter) {
      case 0:
        return 0;
      case 1:
        return left;
      case 2:
        return up;
      case 3:
        return (left + up) / 2;
      default:
        break;
    }
    EXPECT_EQ(filter, 4);
    const int p = left + up - corner;
    if (std::abs(p - left) <= std::abs(p - up) && std::abs(p - left) <= std::abs(p - corner)) {
      return left;
    }
    return std::abs(p - up) <= std::abs(p - corner) ? up : corner;
  }
};

TEST(Png, IndependentDecoderSeesTheSamePixels) {
  for (const Image& image : {pattern(1, 1, 1), pattern(3, 1, 2), pattern(1, 300, 3),
                             pattern(640, 128, 4), pattern(333, 517, 5)}) {
    SCOPED_TRACE(image.height);
    const Decoder decoder(encode_png(image));
    EXPECT_EQ(decoder.image.width, image.width);
    EXPECT_EQ(decoder.image.height, image.height);
    EXPECT_TRUE(decoder.image.rgb == image.rgb);
  }
}

TEST(Png, WriteThenReadGivesTheSameImage) {
  const TemporaryFolder folder;
  const Image image = pattern(257, 401, 6);
  write_png(folder / "a.png", image);
  const Image back = read_png(folder / "a.png");
  EXPECT_EQ(back.width, image.width);
  EXPECT_EQ(back.height, image.height);
  EXPECT_TRUE(back.rgb == image.rgb);
}

TEST(Png, SameBytesForEveryThreadCount) {
  const Image image = pattern(200, 700, 7);
  const std::string reference = ThreadPool(1).run([&] { return encode_png(image); });
  for (int threads : {2, 8}) {
    EXPECT_TRUE(ThreadPool(threads).run([&] { return encode_png(image); }) == reference);
  }
}

TEST(Png, SmoothPicturesShrink) {
  Image image{400, 400, {}};
  for (int y = 0; y < 400; ++y) {
    for (int x = 0; x < 400 * 3; ++x) image.rgb.push_back(static_cast<std::uint8_t>(y / 2));
  }
  EXPECT_LT(encode_png(image).size(), image.rgb.size() / 50);
}

TEST(Png, RejectsImagesWithoutPixels) {
  EXPECT_THROW(encode_png(Image{}), InputError);
  EXPECT_THROW(encode_png(Image{2, 2, std::vector<std::uint8_t>(11)}), InputError);
  EXPECT_THROW(encode_png(Image{-1, 2, {}}), InputError);
}

TEST(Png, ReadRejectsWhatIsNoPng) {
  const TemporaryFolder folder;
  EXPECT_THROW(read_png(folder / "missing.png"), InputError);
  std::ofstream(folder / "text.png") << "not a picture";
  EXPECT_THROW(read_png(folder / "text.png"), InputError);
  std::ofstream(folder / "empty.png") << "";
  EXPECT_THROW(read_png(folder / "empty.png"), InputError);
  const std::string png = encode_png(pattern(64, 64, 8));
  std::ofstream(folder / "half.png", std::ios::binary) << png.substr(0, png.size() / 2);
  EXPECT_THROW(read_png(folder / "half.png"), InputError);
}

TEST(Png, FailedWriteIsAnOutputError) {
  const TemporaryFolder folder;
  EXPECT_THROW(write_png(folder / "no such folder/a.png", pattern(4, 4, 9)), OutputError);
}

Image uniform(int width, int height, std::uint8_t value) {
  return {width, height,
          std::vector<std::uint8_t>(3 * static_cast<std::size_t>(width) * height, value)};
}

TEST(ContactSheet, LaysOutTilesRowByRow) {
  const std::vector<Image> images{uniform(200, 100, 10), uniform(200, 100, 90),
                                  uniform(200, 100, 170)};
  const Image sheet = contact_sheet(images, {}, 2, 48);
  EXPECT_GE(sheet.width, 2 * 48);
  EXPECT_GE(sheet.height, 2 * 24);
  const int gap = (sheet.width - 2 * 48) / 3;
  const auto value = [&](int column, int row) {
    const int x = gap + column * (48 + gap) + 24;
    const int y = gap + row * (24 + gap) + 12;
    return static_cast<int>(sheet.rgb[3 * (static_cast<std::size_t>(y) * sheet.width + x)]);
  };
  EXPECT_EQ(value(0, 0), 10);
  EXPECT_EQ(value(1, 0), 90);
  EXPECT_EQ(value(0, 1), 170);
  EXPECT_EQ(value(1, 1), 255);
}

// Black and white stripes average to mid grey in linear light: sRGB 188, not 128.
TEST(ContactSheet, AveragesInLinearLight) {
  Image stripes{320, 320, {}};
  for (int y = 0; y < 320; ++y) {
    for (int x = 0; x < 320 * 3; ++x) stripes.rgb.push_back(y % 2 == 0 ? 0 : 255);
  }
  const Image sheet = contact_sheet({stripes}, {}, 1, 32);
  const std::size_t middle = static_cast<std::size_t>(sheet.height / 2) * sheet.width;
  EXPECT_NEAR(sheet.rgb[3 * (middle + sheet.width / 2)], 188, 1);
}

TEST(ContactSheet, CaptionsTakeRoomAndLeaveInk) {
  const std::vector<Image> images{uniform(100, 50, 200), uniform(60, 60, 200)};
  const Image plain = contact_sheet(images, {}, 2, 120);
  const Image sheet = contact_sheet(images, {"frame 0", std::string(300, 'x')}, 2, 120);
  EXPECT_GT(sheet.height, plain.height);
  EXPECT_EQ(sheet.width, plain.width);
  EXPECT_LT(*std::min_element(sheet.rgb.begin(), sheet.rgb.end()), 120);
}

TEST(ContactSheet, EnlargesSmallImages) {
  const Image sheet = contact_sheet({uniform(4, 2, 77)}, {}, 3, 64);
  const std::size_t middle = static_cast<std::size_t>(sheet.height / 2) * sheet.width;
  EXPECT_EQ(sheet.rgb[3 * (middle + sheet.width / 2)], 77);
}

TEST(ContactSheet, RejectsImpossibleSheets) {
  EXPECT_THROW(contact_sheet({}, {}, 1, 64), InputError);
  EXPECT_THROW(contact_sheet({Image{}}, {}, 1, 64), InputError);
  EXPECT_THROW(contact_sheet({uniform(4, 4, 0)}, {}, 0, 64), InputError);
  EXPECT_THROW(contact_sheet({uniform(4, 4, 0)}, {}, 1, 8), InputError);
  EXPECT_THROW(contact_sheet({uniform(4, 4, 0)}, {"a", "b"}, 1, 64), InputError);
  EXPECT_THROW(contact_sheet({uniform(1, 4000, 0), uniform(1, 4000, 0)}, {}, 1, 8000), InputError);
}

}  // namespace
}  // namespace piecework::render
