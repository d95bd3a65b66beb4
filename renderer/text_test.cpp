#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <renderer/font.hpp>
#include <renderer/overlay.hpp>
#include <renderer/text.hpp>

namespace piecework::render {
namespace {

Image paper(int width, int height) {
  return {width, height,
          std::vector<std::uint8_t>(3 * static_cast<std::size_t>(width) * height, 255)};
}

bool has_ink(const Image& image, int x, int y) {
  return image.rgb[3 * (static_cast<std::size_t>(y) * image.width + x)] < 200;
}

int count_ink(const Image& image) {
  int count = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) count += has_ink(image, x, y) ? 1 : 0;
  }
  return count;
}

TEST(Text, EveryPrintableCharacterHasAGlyphOfItsOwn) {
  std::vector<std::vector<std::uint8_t>> seen;
  for (char32_t code = 33; code < 127; ++code) {
    ASSERT_NE(find_glyph(code), nullptr) << static_cast<int>(code);
    Image image = paper(40, 50);
    draw_text(image, std::string(1, static_cast<char>(code)), 8, 36, {24, {0, 0, 0}});
    EXPECT_GT(count_ink(image), 3) << static_cast<char>(code);
    EXPECT_EQ(std::count(seen.begin(), seen.end(), image.rgb), 0) << static_cast<char>(code);
    seen.push_back(image.rgb);
  }
}

TEST(Text, StaysWithinItsBox) {
  Image image = paper(300, 60);
  draw_text(image, "Hxgy 0123", 20, 40, {20, {0, 0, 0}});
  const float width = text_width("Hxgy 0123", 20);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (!has_ink(image, x, y)) continue;
      EXPECT_GE(x, 17);
      EXPECT_LE(x, 20 + width + 3);
      EXPECT_GE(y, 17);
      EXPECT_LE(y, 49);
    }
  }
}

TEST(Text, AlignmentMovesTheSameInk) {
  Image left = paper(200, 40);
  Image right = paper(200, 40);
  draw_text(left, "0.05", 100, 30, {16, {0, 0, 0}, Align::Left});
  draw_text(right, "0.05", 100 + text_width("0.05", 16), 30, {16, {0, 0, 0}, Align::Right});
  EXPECT_TRUE(left.rgb == right.rgb);
  EXPECT_GT(count_ink(left), 40);
}

TEST(Text, DigitsShareOneWidth) {
  for (char digit = '0'; digit <= '9'; ++digit) {
    EXPECT_EQ(text_width(std::string(1, digit), 20), text_width("0", 20)) << digit;
  }
}

TEST(Text, OddBytesAreDrawnAsBoxes) {
  for (const char* text : {"\xff", "\xc3", "a\xe2\x88", "\xf0\x9f\x98\x80", "\x01"}) {
    Image image = paper(100, 40);
    draw_text(image, text, 10, 30, {16, {0, 0, 0}});
    EXPECT_GT(count_ink(image), 5);
  }
  Image degree = paper(60, 40);
  draw_text(degree, "\xc2\xb0", 10, 30, {16, {0, 0, 0}});
  Image box = paper(60, 40);
  draw_text(box, "\xff", 10, 30, {16, {0, 0, 0}});
  EXPECT_FALSE(degree.rgb == box.rgb);
}

TEST(Text, IsCutOffAtTheImage) {
  Image image = paper(30, 20);
  draw_text(image, "a long line that leaves the image", -40, 15, {16, {0, 0, 0}});
  fill_rectangle(image, -5, -5, 10, 10, {1, 0, 0});
  fill_disc(image, 29, 19, 8, {0, 0, 1});
  fill_disc(image, 1e9F, -1e9F, 8, {0, 0, 1});
  EXPECT_EQ(image.rgb[0], 255);
  EXPECT_EQ(image.rgb[1], 0);
}

TEST(Ticks, AreRoundAndWithinRange) {
  const std::vector<double> marks = ticks(0.0, 0.1);
  ASSERT_EQ(marks.size(), 6U);
  EXPECT_NEAR(marks[1], 0.02, 1e-12);
  EXPECT_NEAR(marks.back(), 0.1, 1e-12);
  struct Range {
    double low, high;
  };
  for (const Range& range : {Range{0, 1}, Range{-0.3, 0.7}, Range{3, 3.001}, Range{-5000, 12000},
                             Range{0, 7e-9}, Range{0.013, 0.094}}) {
    const std::vector<double> found = ticks(range.low, range.high);
    EXPECT_GE(found.size(), 3U);
    EXPECT_LE(found.size(), 7U);
    const double slack = 1e-6 * (range.high - range.low);
    for (double mark : found) {
      EXPECT_GE(mark, range.low - slack);
      EXPECT_LE(mark, range.high + slack);
    }
  }
  EXPECT_TRUE(ticks(1, 1).empty());
  EXPECT_TRUE(ticks(2, 1).empty());
}

}  // namespace
}  // namespace piecework::render
