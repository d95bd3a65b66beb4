#pragma once

// The stroke font's glyphs.

#include <string_view>

namespace piecework::render {

/// A glyph as strokes on a grid: baseline at y = 0, capitals 20 high, small letters 14, y upwards.
///   M x y                  lifts the pen to a point
///   L x y                  line to a point
///   A cx cy rx ry from to  elliptical arc between angles in degrees, counter-clockwise if to >
///   from;
///                          joined by a line to where the pen is, if it is down
///   O cx cy rx ry          a whole ellipse, on its own
struct Glyph {
  char32_t code;
  float width;  ///< from the leftmost to the rightmost stroke's middle; digits share one width
  std::string_view strokes;
};

/// Null if the font lacks the character.
const Glyph* find_glyph(char32_t code);

}  // namespace piecework::render
