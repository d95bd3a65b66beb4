#pragma once

// Legend, colour bar and caption, drawn onto the finished picture.

#include <vector>

#include <renderer/draw_data.hpp>
#include <renderer/renderer.hpp>

namespace piecework::render {

/// Pictures lower than this many pixels get no legend: it could not be read.
inline constexpr int kMinLegendHeight = 160;

void draw_overlay(const DrawData& data, const Style& style, Image& image);

/// Round numbers (1, 2 or 5 times a power of ten apart) within [low, high], 3 to 7 of them.
std::vector<double> ticks(double low, double high);

}  // namespace piecework::render
