#pragma once

// Text and simple shapes for legends and captions, in a stroke font of our own: no font file, no
// font library, and sharp at every size.

#include <string_view>

#include <renderer/renderer.hpp>

namespace piecework::render {

enum class Align { Left, Centre, Right };

/// Width in pixels of UTF-8 text whose capital letters are `cap_height` pixels high.
float text_width(std::string_view text, float cap_height);

struct TextStyle {
  float cap_height = 16;  ///< pixels
  Rgb color;
  Align align = Align::Left;
};

/// Draws one line, anti-aliased; what lies outside of the image is cut off. Characters that the
/// font lacks are drawn as a small box.
/// \param x, baseline  pixels from the top left corner of the image; x as `style.align` says
void draw_text(Image& image, std::string_view text, float x, float baseline,
               const TextStyle& style);

/// Fills an axis-parallel rectangle given in (fractional) pixels.
void fill_rectangle(Image& image, float x, float y, float width, float height, const Rgb& color);

/// Fills a disc given in (fractional) pixels.
void fill_disc(Image& image, float x, float y, float radius, const Rgb& color);

}  // namespace piecework::render
