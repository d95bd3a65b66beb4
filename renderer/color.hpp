#pragma once

// Colour arithmetic: sRGB <-> linear light, and the perceptual space OKLab (Ottosson 2020).

#include <cmath>

#include <renderer/renderer.hpp>

namespace piecework::render {

/// Lightness in [0, 1], a (green-red) and b (blue-yellow). Equal distances look about equally
/// different; 0.02 is just visible side by side.
struct Oklab {
  float l = 0, a = 0, b = 0;
};

/// sRGB-encoded value in [0, 1] to linear light, and back.
float linear_from_srgb(float encoded);
float srgb_from_linear(float linear);

Oklab oklab_from_rgb(const Rgb& color);

/// Colours outside of the sRGB gamut come back with components outside of [0, 1].
Rgb rgb_from_oklab(const Oklab& color);

/// Lightness, chroma, hue in degrees.
Oklab oklab_from_lch(float lightness, float chroma, float hue_degrees);

inline float oklab_distance(const Oklab& x, const Oklab& y) {
  return std::hypot(x.l - y.l, x.a - y.a, x.b - y.b);
}

/// Components clamped to [0, 1].
Rgb clamp_to_gamut(const Rgb& color);

/// The colour map of ColorMode::Strain at t in [0, 1] (clamped): from near white through gold and
/// red to deep violet, its lightness falling at a steady rate, so that it also reads in grey.
Rgb strain_color(float t);

/// A pale tint of a domain's colour, against which dots stand out (ColorMode::Dof).
Rgb muted(const Rgb& color);

}  // namespace piecework::render
