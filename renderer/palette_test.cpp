#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include <renderer/color.hpp>
#include <renderer/renderer.hpp>

#include <piecework/core/error.hpp>

namespace piecework::render {
namespace {

using Pair = std::array<int, 2>;

/// CIE L*a*b* (D65); the palette is made in OKLab, so this is a second opinion.
std::array<double, 3> cielab(const Rgb& color) {
  const auto linear = [](double c) {
    return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
  };
  const double r = linear(color.r);
  const double g = linear(color.g);
  const double b = linear(color.b);
  const auto f = [](double t) { return t > 0.008856 ? std::cbrt(t) : 7.787 * t + 16.0 / 116.0; };
  const double x = f((0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.95047);
  const double y = f(0.2126 * r + 0.7152 * g + 0.0722 * b);
  const double z = f((0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.08883);
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

double cie76(const Rgb& p, const Rgb& q) {
  const auto a = cielab(p);
  const auto b = cielab(q);
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

/// A grid of domains with one diagonal per cell: up to six neighbours, like cloth domains.
std::vector<Pair> grid_adjacency(int columns, int rows) {
  std::vector<Pair> pairs;
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const int a = j * columns + i;
      if (i + 1 < columns) pairs.push_back({a, a + 1});
      if (j + 1 < rows) pairs.push_back({a, a + columns});
      if (i + 1 < columns && j + 1 < rows) pairs.push_back({a, a + columns + 1});
    }
  }
  return pairs;
}

double closest_pair(const std::vector<Rgb>& colors, const std::vector<Pair>& pairs) {
  double least = 1e9;
  for (const auto& [a, b] : pairs) least = std::min(least, cie76(colors[a], colors[b]));
  return least;
}

std::vector<Pair> all_pairs(int count) {
  std::vector<Pair> pairs;
  for (int a = 0; a < count; ++a) {
    for (int b = 0; b < a; ++b) pairs.push_back({a, b});
  }
  return pairs;
}

TEST(DomainPalette, NeighboursDifferStrongly) {
  struct Grid {
    int columns, rows;
  };
  for (const Grid& grid : {Grid{2, 1}, Grid{4, 2}, Grid{8, 4}, Grid{8, 8}, Grid{16, 8}}) {
    SCOPED_TRACE(grid.columns * grid.rows);
    const std::vector<Pair> pairs = grid_adjacency(grid.columns, grid.rows);
    const std::vector<Rgb> colors = domain_palette(grid.columns * grid.rows, pairs);
    EXPECT_GT(closest_pair(colors, pairs), 18);  // 2.3 is just visible
  }
}

TEST(DomainPalette, NoTwoOf64AreNearlyTheSame) {
  for (int count : {2, 8, 32, 64}) {
    SCOPED_TRACE(count);
    const std::vector<Rgb> colors = domain_palette(count, {});
    EXPECT_GT(closest_pair(colors, all_pairs(count)), 6);
  }
}

TEST(DomainPalette, ColoursAreSoftAndWithinRange) {
  for (const Rgb& color : domain_palette(128, {})) {
    for (float c : {color.r, color.g, color.b}) {
      EXPECT_GE(c, 0.0F);
      EXPECT_LE(c, 1.0F);
    }
    const auto lab = cielab(color);
    EXPECT_GT(lab[0], 40) << "too dark to show shading";
    EXPECT_LT(lab[0], 92) << "too pale against the background";
    EXPECT_GT(std::hypot(lab[1], lab[2]), 10) << "grey";
  }
}

TEST(DomainPalette, RepeatsOnlyAwayFromNeighbours) {
  const std::vector<Pair> pairs = grid_adjacency(40, 25);
  const std::vector<Rgb> colors = domain_palette(1000, pairs);
  ASSERT_EQ(colors.size(), 1000U);
  EXPECT_GT(closest_pair(colors, pairs), 15);
}

TEST(DomainPalette, DependsOnItsArgumentsOnly) {
  const std::vector<Pair> pairs = grid_adjacency(8, 4);
  const std::vector<Rgb> first = domain_palette(32, pairs);
  std::vector<Pair> shuffled(pairs.rbegin(), pairs.rend());
  for (Pair& pair : shuffled) std::swap(pair[0], pair[1]);
  const std::vector<Rgb> second = domain_palette(32, shuffled);
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].r, second[i].r);
    EXPECT_EQ(first[i].g, second[i].g);
    EXPECT_EQ(first[i].b, second[i].b);
  }
}

TEST(DomainPalette, EdgeCases) {
  EXPECT_TRUE(domain_palette(0, {}).empty());
  EXPECT_EQ(domain_palette(1, {}).size(), 1U);
  const std::vector<Pair> odd{{0, 1}, {1, 0}, {1, 1}, {0, 1}};  // twice, reversed, itself
  EXPECT_GT(closest_pair(domain_palette(2, odd), {{0, 1}}), 28);
  EXPECT_THROW(domain_palette(-1, {}), InputError);
  EXPECT_THROW(domain_palette(2, std::vector<Pair>{{0, 2}}), InputError);
  EXPECT_THROW(domain_palette(2, std::vector<Pair>{{-1, 0}}), InputError);
}

TEST(Color, OklabOfKnownColours) {  // values of Ottosson's article
  const Oklab white = oklab_from_rgb({1, 1, 1});
  EXPECT_NEAR(white.l, 1, 1e-4);
  EXPECT_NEAR(white.a, 0, 1e-4);
  EXPECT_NEAR(white.b, 0, 1e-4);
  const Oklab red = oklab_from_rgb({1, 0, 0});
  EXPECT_NEAR(red.l, 0.628, 1e-3);
  EXPECT_NEAR(red.a, 0.225, 1e-3);
  EXPECT_NEAR(red.b, 0.126, 1e-3);
}

TEST(Color, OklabAndBack) {
  for (float r : {0.0F, 0.02F, 0.5F, 1.0F}) {
    for (float g : {0.0F, 0.3F, 1.0F}) {
      for (float b : {0.0F, 0.7F, 1.0F}) {
        const Rgb back = rgb_from_oklab(oklab_from_rgb({r, g, b}));
        EXPECT_NEAR(back.r, r, 2e-3);
        EXPECT_NEAR(back.g, g, 2e-3);
        EXPECT_NEAR(back.b, b, 2e-3);
      }
    }
  }
}

TEST(Color, StrainMapDarkensSteadily) {
  double previous = cielab(strain_color(0))[0];
  EXPECT_GT(previous, 88);
  for (int i = 1; i <= 20; ++i) {
    const double lightness = cielab(strain_color(static_cast<float>(i) / 20))[0];
    EXPECT_LT(lightness, previous - 1.0) << i;
    previous = lightness;
  }
  EXPECT_EQ(strain_color(-3).r, strain_color(0).r);
  EXPECT_EQ(strain_color(7).g, strain_color(1).g);
}

}  // namespace
}  // namespace piecework::render
