#include <renderer/overlay.hpp>

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>

#include <renderer/color.hpp>
#include <renderer/text.hpp>

namespace piecework::render {
namespace {

constexpr Rgb kInk{0.20F, 0.21F, 0.24F};
constexpr Rgb kSoftInk{0.36F, 0.38F, 0.42F};

/// Sizes below are for a picture of 1080 rows.
float unit(const Image& image) { return static_cast<float>(image.height) / 1080.0F; }

float text_height(const Image& image) { return std::max(17.0F * unit(image), 8.0F); }

double round_step(double range) {
  const double raw = range / 5.0;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (double factor : {1.0, 2.0, 5.0}) {
    if (raw <= factor * power * 1.0000001) return factor * power;
  }
  return 10.0 * power;
}

/// Decimals that tell neighbouring ticks apart.
std::string tick_label(double value, double step) {
  if (std::abs(value) >= 1e5 || step < 1e-5) return fmt::format("{:.3g}", value);
  const int decimals = std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
  return fmt::format("{:.{}f}", value, decimals);
}

void draw_color_bar(const Style& style, Image& image) {
  const float u = unit(image);
  const float cap = text_height(image);
  const auto low = static_cast<double>(style.value_low);
  const auto high = static_cast<double>(style.value_high);
  const std::vector<double> marks = ticks(low, high);
  const double step = marks.size() > 1 ? marks[1] - marks[0] : high - low;
  float widest = 0;
  for (double mark : marks) widest = std::max(widest, text_width(tick_label(mark, step), cap));

  const float height = std::round(0.42F * static_cast<float>(image.height));
  const float width = std::round(20.0F * u);
  const float right = static_cast<float>(image.width) - 44.0F * u;
  const float x = std::round(right - widest - 16.0F * u - width);
  const float y = std::round(0.5F * (static_cast<float>(image.height) - height));
  const float line = std::max(1.0F, 1.5F * u);
  fill_rectangle(image, x - line, y - line, width + 2 * line, height + 2 * line, kSoftInk);
  const int rows = static_cast<int>(height);
  for (int row = 0; row < rows; ++row) {
    const float t = 1.0F - (static_cast<float>(row) + 0.5F) / height;
    fill_rectangle(image, x, y + static_cast<float>(row), width, 1.0F, strain_color(t));
  }
  for (double mark : marks) {
    const auto t = static_cast<float>((mark - low) / (high - low));
    const float at = y + height * (1.0F - t);
    fill_rectangle(image, x + width, at - 0.5F * line, 7.0F * u, line, kSoftInk);
    draw_text(image, tick_label(mark, step), x + width + 16.0F * u, at + 0.5F * cap, {cap, kInk});
  }
  draw_text(image, style.value_label, right, y - 1.5F * cap - 6.0F * u, {cap, kInk, Align::Right});
}

void draw_dot_legend(const DrawData& data, Image& image) {
  const float u = unit(image);
  const float cap = text_height(image);
  struct Entry {
    DofClass kind;
    const char* name;
    std::size_t count;
    float radius;
  };
  const Entry entries[] = {{DofClass::Corner, "corner", data.num_corners, 9.0F},
                           {DofClass::Duplicate, "duplicate", data.num_duplicates, 6.5F}};
  float widest = 0;
  for (const Entry& entry : entries) {
    widest = std::max(widest, text_width(fmt::format("{}  {}", entry.name, entry.count), cap));
  }
  const float right = static_cast<float>(image.width) - 44.0F * u;
  const float left = right - widest;
  float baseline = static_cast<float>(image.height) - 44.0F * u - 2.1F * cap;
  for (const Entry& entry : entries) {
    const float radius = std::max(entry.radius * u, 3.0F);
    const float middle = baseline - 0.45F * cap;
    const Rgb color = dot_color(entry.kind);
    const Rgb rim{0.5F * color.r, 0.5F * color.g, 0.5F * color.b};
    fill_disc(image, left - 24.0F * u, middle, radius + std::max(1.0F, 1.5F * u), rim);
    fill_disc(image, left - 24.0F * u, middle, radius, color);
    draw_text(image, entry.name, left, baseline, {cap, kInk});
    draw_text(image, std::to_string(entry.count), right, baseline, {cap, kSoftInk, Align::Right});
    baseline += 2.1F * cap;
  }
}

void draw_caption(const Style& style, Image& image) {
  const float u = unit(image);
  const float margin = std::max(44.0F * u, 6.0F);
  const float room = static_cast<float>(image.width) - 2 * margin;
  float cap = text_height(image);
  const float width = text_width(style.caption, cap);
  if (width > room) cap *= std::max(room, 1.0F) / width;
  draw_text(image, style.caption, margin, static_cast<float>(image.height) - margin, {cap, kInk});
}

}  // namespace

std::vector<double> ticks(double low, double high) {
  std::vector<double> result;
  const double range = high - low;
  if (!(range > 0) || !std::isfinite(range)) return result;
  const double step = round_step(range);
  const double slack = 1e-6 * step;
  for (double k = std::ceil((low - slack) / step); k * step <= high + slack; k += 1.0) {
    result.push_back(k == 0.0 ? 0.0 : k * step);
    if (result.size() > 16) break;  // range far below the values' precision
  }
  return result;
}

void draw_overlay(const DrawData& data, const Style& style, Image& image) {
  if (style.legend && image.height >= kMinLegendHeight) {
    if (style.color == ColorMode::Strain) draw_color_bar(style, image);
    if (style.color == ColorMode::Dof) draw_dot_legend(data, image);
  }
  if (!style.caption.empty()) draw_caption(style, image);
}

}  // namespace piecework::render
