#include <renderer/text.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <renderer/color.hpp>
#include <renderer/font.hpp>

namespace piecework::render {
namespace {

constexpr float kCapHeight = 20.0F;  // of the font's grid
constexpr float kStroke = 2.3F;      // width of a stroke on the grid
constexpr float kSpacing = 5.2F;     // between glyphs
constexpr float kMinStroke = 1.15F;  // pixels: thinner lines look grey and ragged
constexpr std::string_view kMissing = "M 0 0 L 0 14 L 8 14 L 8 0 L 0 0";
constexpr float kMissingWidth = 8;

struct Segment {
  float x0, y0, x1, y1;
};

/// Reads the little stroke language of font.hpp.
class StrokeReader {
 public:
  explicit StrokeReader(std::string_view strokes) : rest_(strokes) {}

  std::vector<Segment> read() {
    for (skip_spaces(); !rest_.empty(); skip_spaces()) {
      const char command = rest_.front();
      rest_.remove_prefix(1);
      if (command == 'M') {
        x_ = number();
        y_ = number();
        down_ = true;
      } else if (command == 'L') {
        const float x = number();
        line_to(x, number());
      } else {
        arc(command == 'O');
      }
    }
    return std::move(segments_);
  }

 private:
  void skip_spaces() {
    while (!rest_.empty() && rest_.front() == ' ') rest_.remove_prefix(1);
  }

  float number() {
    skip_spaces();
    const std::size_t end = std::min(rest_.find(' '), rest_.size());
    const float value = std::stof(std::string(rest_.substr(0, end)));
    rest_.remove_prefix(end);
    return value;
  }

  void line_to(float x, float y) {
    if (down_) segments_.push_back({x_, y_, x, y});
    x_ = x;
    y_ = y;
    down_ = true;
  }

  void arc(bool whole) {
    const float cx = number();
    const float cy = number();
    const float rx = number();
    const float ry = number();
    const float from = whole ? 0.0F : number();
    const float to = whole ? 360.0F : number();
    if (whole) down_ = false;
    constexpr float kRadians = std::numbers::pi_v<float> / 180.0F;
    const int steps = std::max(2, static_cast<int>(std::lround(std::abs(to - from) / 12.0F)));
    for (int i = 0; i <= steps; ++i) {
      const float part = static_cast<float>(i) / static_cast<float>(steps);
      const float angle = kRadians * (from + (to - from) * part);
      line_to(cx + rx * std::cos(angle), cy + ry * std::sin(angle));
    }
    if (whole) down_ = false;
  }

  std::string_view rest_;
  float x_ = 0, y_ = 0;
  bool down_ = false;
  std::vector<Segment> segments_;
};

/// Next code point of UTF-8 text; malformed bytes come out one by one as U+FFFD.
char32_t next_code_point(std::string_view& text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(0);
  const std::size_t length = first < 0x80   ? 1
                             : first < 0xC0 ? 0
                             : first < 0xE0 ? 2
                             : first < 0xF0 ? 3
                                            : 4;
  bool valid = length != 0 && length <= text.size();
  char32_t code = length <= 1 ? first : static_cast<char32_t>(first & (0x7FU >> length));
  for (std::size_t i = 1; valid && i < length; ++i) {
    valid = (byte(i) & 0xC0U) == 0x80U;
    code = (code << 6U) | (byte(i) & 0x3FU);
  }
  text.remove_prefix(valid ? length : 1);
  return valid ? code : U'\uFFFD';
}

struct Metrics {
  float width;
  std::string_view strokes;
};

Metrics metrics_of(char32_t code) {
  const Glyph* glyph = find_glyph(code);
  return glyph != nullptr ? Metrics{glyph->width, glyph->strokes}
                          : Metrics{kMissingWidth, kMissing};
}

float grid_width(std::string_view text) {
  float width = 0;
  bool first = true;
  while (!text.empty()) {
    width += metrics_of(next_code_point(text)).width + (first ? 0.0F : kSpacing);
    first = false;
  }
  return width;
}

/// Mixes `color` over a pixel. Done on encoded values: dark text on white keeps its weight.
void blend(Image& image, int x, int y, const Rgb& color, float cover) {
  if (cover <= 0 || x < 0 || y < 0 || x >= image.width || y >= image.height) return;
  std::uint8_t* pixel = image.rgb.data() + 3 * (static_cast<std::size_t>(y) * image.width +
                                                static_cast<std::size_t>(x));
  const float part = std::min(cover, 1.0F);
  const auto mix = [&](std::uint8_t old, float value) {
    const float result = static_cast<float>(old) * (1 - part) + 255.0F * value * part;
    return static_cast<std::uint8_t>(std::lround(std::clamp(result, 0.0F, 255.0F)));
  };
  pixel[0] = mix(pixel[0], color.r);
  pixel[1] = mix(pixel[1], color.g);
  pixel[2] = mix(pixel[2], color.b);
}

float distance(const Segment& s, float x, float y) {
  const float dx = s.x1 - s.x0;
  const float dy = s.y1 - s.y0;
  const float length_sq = dx * dx + dy * dy;
  const float along = (x - s.x0) * dx + (y - s.y0) * dy;
  const float t = length_sq > 0 ? std::clamp(along / length_sq, 0.0F, 1.0F) : 0.0F;
  return std::hypot(x - s.x0 - t * dx, y - s.y0 - t * dy);
}

/// Pixels that shapes with these limits can touch, within the image.
struct Box {
  int x0, y0, x1, y1;
};
Box pixel_box(const Image& image, float x0, float y0, float x1, float y1) {
  const auto limit = [](float x, int end) {
    return static_cast<int>(std::clamp(x, -1.0F, static_cast<float>(end)));
  };
  return {std::max(limit(std::floor(x0), image.width), 0),
          std::max(limit(std::floor(y0), image.height), 0),
          std::min(limit(std::ceil(x1), image.width), image.width - 1),
          std::min(limit(std::ceil(y1), image.height), image.height - 1)};
}

/// From the font's grid to pixels.
std::vector<Segment> place(std::vector<Segment> segments, float x, float baseline, float scale) {
  for (Segment& s : segments) {
    s = {x + scale * s.x0, baseline - scale * s.y0, x + scale * s.x1, baseline - scale * s.y1};
  }
  return segments;
}

void draw_glyph(Image& image, const std::vector<Segment>& segments, float half_stroke,
                const Rgb& color) {
  if (segments.empty()) return;
  float x0 = segments.front().x0;
  float x1 = x0;
  float y0 = segments.front().y0;
  float y1 = y0;
  for (const Segment& s : segments) {
    x0 = std::min({x0, s.x0, s.x1});
    x1 = std::max({x1, s.x0, s.x1});
    y0 = std::min({y0, s.y0, s.y1});
    y1 = std::max({y1, s.y0, s.y1});
  }
  const float margin = half_stroke + 1.0F;
  const Box box = pixel_box(image, x0 - margin, y0 - margin, x1 + margin, y1 + margin);
  for (int y = box.y0; y <= box.y1; ++y) {
    for (int x = box.x0; x <= box.x1; ++x) {
      float nearest = 1e9F;
      for (const Segment& s : segments) {
        nearest = std::min(nearest,
                           distance(s, static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F));
      }
      blend(image, x, y, color, half_stroke - nearest + 0.5F);
    }
  }
}

}  // namespace

float text_width(std::string_view text, float cap_height) {
  return grid_width(text) * cap_height / kCapHeight;
}

void draw_text(Image& image, std::string_view text, float x, float baseline,
               const TextStyle& style) {
  const float scale = style.cap_height / kCapHeight;
  const float half_stroke = 0.5F * std::max(kStroke * scale, kMinStroke);
  if (style.align == Align::Centre) x -= 0.5F * text_width(text, style.cap_height);
  if (style.align == Align::Right) x -= text_width(text, style.cap_height);
  while (!text.empty()) {
    const Metrics metrics = metrics_of(next_code_point(text));
    draw_glyph(image, place(StrokeReader(metrics.strokes).read(), x, baseline, scale), half_stroke,
               style.color);
    x += scale * (metrics.width + kSpacing);
  }
}

void fill_rectangle(Image& image, float x, float y, float width, float height, const Rgb& color) {
  const auto overlap = [](int cell, float low, float high) {
    const auto start = static_cast<float>(cell);
    return std::max(0.0F, std::min(start + 1.0F, high) - std::max(start, low));
  };
  const Box box = pixel_box(image, x, y, x + width, y + height);
  for (int j = box.y0; j <= box.y1; ++j) {
    for (int i = box.x0; i <= box.x1; ++i) {
      blend(image, i, j, color, overlap(i, x, x + width) * overlap(j, y, y + height));
    }
  }
}

void fill_disc(Image& image, float x, float y, float radius, const Rgb& color) {
  draw_glyph(image, {{x, y, x, y}}, radius, color);
}

}  // namespace piecework::render
