#include <renderer/color.hpp>

#include <algorithm>
#include <array>
#include <numbers>

namespace piecework::render {

float linear_from_srgb(float encoded) {
  return encoded <= 0.04045F ? encoded / 12.92F : std::pow((encoded + 0.055F) / 1.055F, 2.4F);
}

float srgb_from_linear(float linear) {
  return linear <= 0.0031308F ? linear * 12.92F : 1.055F * std::pow(linear, 1.0F / 2.4F) - 0.055F;
}

Oklab oklab_from_rgb(const Rgb& color) {
  const float r = linear_from_srgb(color.r);
  const float g = linear_from_srgb(color.g);
  const float b = linear_from_srgb(color.b);
  const float l = std::cbrt(0.4122214708F * r + 0.5363325363F * g + 0.0514459929F * b);
  const float m = std::cbrt(0.2119034982F * r + 0.6806995451F * g + 0.1073969566F * b);
  const float s = std::cbrt(0.0883024619F * r + 0.2817188376F * g + 0.6299787005F * b);
  return {0.2104542553F * l + 0.7936177850F * m - 0.0040720468F * s,
          1.9779984951F * l - 2.4285922050F * m + 0.4505937099F * s,
          0.0259040371F * l + 0.7827717662F * m - 0.8086757660F * s};
}

Rgb rgb_from_oklab(const Oklab& color) {
  const auto cube = [](float x) { return x * x * x; };
  const float l = cube(color.l + 0.3963377774F * color.a + 0.2158037573F * color.b);
  const float m = cube(color.l - 0.1055613458F * color.a - 0.0638541728F * color.b);
  const float s = cube(color.l - 0.0894841775F * color.a - 1.2914855480F * color.b);
  return {srgb_from_linear(4.0767416621F * l - 3.3077115913F * m + 0.2309699292F * s),
          srgb_from_linear(-1.2684380046F * l + 2.6097574011F * m - 0.3413193965F * s),
          srgb_from_linear(-0.0041960863F * l - 0.7034186147F * m + 1.7076147010F * s)};
}

Oklab oklab_from_lch(float lightness, float chroma, float hue_degrees) {
  const float hue = hue_degrees * std::numbers::pi_v<float> / 180.0F;
  return {lightness, chroma * std::cos(hue), chroma * std::sin(hue)};
}

Rgb clamp_to_gamut(const Rgb& color) {
  return {std::clamp(color.r, 0.0F, 1.0F), std::clamp(color.g, 0.0F, 1.0F),
          std::clamp(color.b, 0.0F, 1.0F)};
}

Rgb strain_color(float t) {
  // Chosen by eye on shaded cloth; lightness is linear in t.
  struct Stop {
    float chroma, hue;
  };
  constexpr std::array<Stop, 7> kStops{{{0.020F, 95},
                                        {0.085F, 90},
                                        {0.140F, 72},
                                        {0.165F, 45},
                                        {0.175F, 20},
                                        {0.160F, -10},
                                        {0.145F, -50}}};
  const float x = std::clamp(t, 0.0F, 1.0F) * static_cast<float>(kStops.size() - 1);
  const auto low = std::min(static_cast<std::size_t>(x), kStops.size() - 2);
  const float f = x - static_cast<float>(low);
  const Stop& p = kStops[low];
  const Stop& q = kStops[low + 1];
  const float lightness = 0.95F - 0.56F * std::clamp(t, 0.0F, 1.0F);
  return clamp_to_gamut(rgb_from_oklab(oklab_from_lch(
      lightness, p.chroma + f * (q.chroma - p.chroma), p.hue + f * (q.hue - p.hue))));
}

Rgb muted(const Rgb& color) {
  Oklab lab = oklab_from_rgb(color);
  lab.l = 0.80F + 0.35F * (lab.l - 0.72F);
  lab.a *= 0.42F;
  lab.b *= 0.42F;
  return clamp_to_gamut(rgb_from_oklab(lab));
}

}  // namespace piecework::render
