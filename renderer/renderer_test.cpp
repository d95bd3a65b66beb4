#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <renderer/gl_context.hpp>
#include <renderer/renderer.hpp>
#include <renderer/resolve.hpp>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::render {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 200;

/// A square sheet over x, z in [-0.5, 0.5] in four domains (quadrants by x and z).
struct Scene {
  Positions positions;
  Triangles triangles;
  std::vector<int> domain;
  std::vector<Rgb> colors{
      {0.85F, 0.35F, 0.35F}, {0.35F, 0.55F, 0.85F}, {0.40F, 0.75F, 0.45F}, {0.90F, 0.75F, 0.35F}};
  std::vector<float> values;
  std::vector<DofClass> classes;

  [[nodiscard]] Frame frame() const {
    Frame result;
    result.positions = &positions;
    result.triangles = triangles;
    result.triangle_domain = domain;
    result.domain_colors = colors;
    result.triangle_value = values;
    result.vertex_class = classes;
    return result;
  }
};

Scene make_scene(int side, double waves) {
  Scene scene;
  scene.positions.resize(side * side, 3);
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      const double x = static_cast<double>(i) / (side - 1) - 0.5;
      const double z = static_cast<double>(j) / (side - 1) - 0.5;
      scene.positions.row(j * side + i) << x, waves * std::sin(8 * x + 3 * z), z;
      const bool middle_x = 2 * i == side - 1;
      const bool middle_z = 2 * j == side - 1;
      scene.classes.push_back(middle_x && middle_z   ? DofClass::Corner
                              : middle_x || middle_z ? DofClass::Duplicate
                                                     : DofClass::Internal);
    }
  }
  for (int j = 0; j + 1 < side; ++j) {
    for (int i = 0; i + 1 < side; ++i) {
      const int a = j * side + i;
      for (const Triangle& t :
           {Triangle{a, a + side, a + side + 1}, Triangle{a, a + side + 1, a + 1}}) {
        scene.triangles.push_back(t);
        scene.domain.push_back((2 * i >= side - 1 ? 1 : 0) + (2 * j >= side - 1 ? 2 : 0));
        scene.values.push_back(0.1F * static_cast<float>(i) / static_cast<float>(side - 2));
      }
    }
  }
  return scene;
}

Camera camera_for(double scale = 1.0) {
  return frame_box(Vec3(-0.5, -0.1, -0.5) * scale, Vec3(0.5, 0.1, 0.5) * scale,
                   static_cast<double>(kWidth) / kHeight, 20, 45, 35);
}

/// Pixel of a point, by similar triangles (shares nothing with the code under test).
Vec2 pixel_of(const Camera& camera, const Vec3& p, int width = kWidth, int height = kHeight) {
  const Vec3 z = (camera.eye - camera.target).normalized();
  const Vec3 x = camera.up.cross(z).normalized();
  const Vec3 y = z.cross(x);
  const Vec3 d = p - camera.eye;
  const double focal = height / 2.0 / std::tan(camera.fov_degrees * 3.14159265358979 / 360.0);
  return {width / 2.0 + focal * d.dot(x) / -d.dot(z), height / 2.0 - focal * d.dot(y) / -d.dot(z)};
}

std::array<int, 3> at(const Image& image, const Vec2& pixel) {
  const auto x = static_cast<int>(pixel.x());
  const auto y = static_cast<int>(pixel.y());
  const std::size_t i = 3 * (static_cast<std::size_t>(y) * image.width + x);
  return {image.rgb[i], image.rgb[i + 1], image.rgb[i + 2]};
}

/// Hue in degrees from red, green, blue (hexagon model).
double hue(double r, double g, double b) {
  return std::atan2(std::sqrt(3.0) * (g - b), 2 * r - g - b) * 180 / 3.14159265358979;
}
double hue_difference(const std::array<int, 3>& pixel, const Rgb& color) {
  const double d = hue(pixel[0], pixel[1], pixel[2]) - hue(color.r, color.g, color.b);
  return std::abs(std::remainder(d, 360.0));
}

double brightness(const std::array<int, 3>& p) { return (p[0] + p[1] + p[2]) / 3.0; }

double mean_difference(const Image& a, const Image& b) {
  EXPECT_EQ(a.rgb.size(), b.rgb.size());
  double sum = 0;
  for (std::size_t i = 0; i < a.rgb.size(); ++i) sum += std::abs(a.rgb[i] - b.rgb[i]);
  return sum / static_cast<double>(a.rgb.size());
}

/// Fixture that skips where no OpenGL can be had.
class RendererTest : public testing::Test {
 protected:
  void SetUp() override {
    static const std::vector<ProviderReport> reports = probe_providers();
    for (const ProviderReport& report : reports) {
      if (report.works) return;
    }
    GTEST_SKIP() << "no OpenGL provider works: " << reports.front().detail;
  }

  static Image draw(const Scene& scene, const Style& style, double camera_scale = 1.0) {
    return Renderer(Provider::Auto, kWidth, kHeight)
        .draw(scene.frame(), camera_for(camera_scale), style);
  }
};

const std::array<Vec3, 4> kQuadrants{Vec3(-0.25, 0, -0.25), Vec3(0.25, 0, -0.25),
                                     Vec3(-0.25, 0, 0.25), Vec3(0.25, 0, 0.25)};

TEST_F(RendererTest, DomainsShowTheirColours) {
  const Scene scene = make_scene(21, 0);
  for (int samples : {1, 2, 3}) {
    for (bool quality : {false, true}) {
      Style style;
      style.supersampling = samples;
      style.shadows = style.ambient_occlusion = quality;
      const Image image = draw(scene, style);
      ASSERT_EQ(image.rgb.size(), 3U * kWidth * kHeight);
      for (std::size_t d = 0; d < 4; ++d) {
        const auto pixel = at(image, pixel_of(camera_for(), kQuadrants[d]));
        EXPECT_LT(hue_difference(pixel, scene.colors[d]), 14) << d;
        const Rgb& c = scene.colors[d];
        EXPECT_NEAR(brightness(pixel), 255 * (c.r + c.g + c.b) / 3, 45) << d;
      }
    }
  }
}

TEST_F(RendererTest, TheBackShowsTheColoursToo) {
  Scene scene = make_scene(21, 0);
  for (Triangle& t : scene.triangles) std::swap(t[1], t[2]);
  const Image image = draw(scene, Style{});
  for (std::size_t d = 0; d < 4; ++d) {
    const auto pixel = at(image, pixel_of(camera_for(), kQuadrants[d]));
    EXPECT_LT(hue_difference(pixel, scene.colors[d]), 14) << d;
    EXPECT_GT(brightness(pixel), 90) << d;
  }
}

TEST_F(RendererTest, BordersAreDrawnBetweenDomainsAndNowhereElse) {
  const Scene scene = make_scene(21, 0);
  Style style;
  const Image with = draw(scene, style);
  style.borders = false;
  const Image without = draw(scene, style);
  const Camera camera = camera_for();
  int on_line = 0;
  constexpr int kSteps = 101;
  for (int k = 5; k < kSteps - 5; ++k) {  // along both borders
    const double t = static_cast<double>(k) / (kSteps - 1) - 0.5;
    for (const Vec3& p : {Vec3(t, 0, 0), Vec3(0, 0, t)}) {
      const Vec2 pixel = pixel_of(camera, p);
      on_line += brightness(at(without, pixel)) - brightness(at(with, pixel)) > 40 ? 1 : 0;
    }
  }
  EXPECT_GT(on_line, 2 * (kSteps - 10) * 8 / 10);
  std::vector<Vec2> line;
  for (int k = 0; k <= 2000; ++k) {
    const double t = k / 2000.0 - 0.5;
    line.push_back(pixel_of(camera, {t, 0, 0}));
    line.push_back(pixel_of(camera, {0, 0, t}));
  }
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Vec2 pixel(x + 0.5, y + 0.5);
      if (at(with, pixel) == at(without, pixel)) continue;
      const double distance = (*std::min_element(line.begin(), line.end(),
                                                 [&](const Vec2& a, const Vec2& b) {
                                                   return (a - pixel).norm() < (b - pixel).norm();
                                                 }) -
                               pixel)
                                  .norm();
      ASSERT_LT(distance, 3.0) << x << " " << y;
    }
  }
}

TEST_F(RendererTest, SameFrameSamePixels) {
  const Scene scene = make_scene(31, 0.05);
  Style style;
  style.color = ColorMode::Dof;
  style.caption = "t = 0.25 s";
  Renderer renderer(Provider::Auto, kWidth, kHeight);
  const Image first = renderer.draw(scene.frame(), camera_for(), style);
  EXPECT_TRUE(renderer.draw(scene.frame(), camera_for(), style).rgb == first.rgb);
  EXPECT_TRUE(draw(scene, style).rgb == first.rgb) << "another renderer";
  const Image single = ThreadPool(1).run([&] { return draw(scene, style); });
  EXPECT_TRUE(single.rgb == first.rgb) << "another number of threads";
}

TEST_F(RendererTest, ProvidersAgree) {
  const Scene scene = make_scene(31, 0.05);
  for (const ProviderReport& report : probe_providers()) {
    if (!report.works) GTEST_SKIP() << "only one provider works here: " << report.detail;
  }
  for (ColorMode mode : {ColorMode::Domain, ColorMode::Dof}) {
    Style style;
    style.color = mode;
    Renderer osmesa(Provider::Osmesa, kWidth, kHeight);
    Renderer egl(Provider::Egl, kWidth, kHeight);
    const Image a = osmesa.draw(scene.frame(), camera_for(), style);
    const Image b = egl.draw(scene.frame(), camera_for(), style);
    EXPECT_LT(mean_difference(a, b), 0.5);
    EXPECT_TRUE(osmesa.draw(scene.frame(), camera_for(), style).rgb == a.rgb) << "interleaved";
    EXPECT_NE(osmesa.description(), egl.description());
  }
}

TEST_F(RendererTest, SizeOfTheSceneDoesNotMatter) {
  const Scene scene = make_scene(31, 0.05);
  const Image reference = draw(scene, Style{});
  for (double scale : {1e-3, 1e3}) {
    Scene scaled = scene;
    scaled.positions *= scale;
    EXPECT_LT(mean_difference(draw(scaled, Style{}, scale), reference), 0.3) << scale;
  }
}

TEST_F(RendererTest, ShadowsDarkenTheGround) {
  Scene scene = make_scene(21, 0);
  Style style;
  style.ground_height = -0.3;
  const Image with = draw(scene, style);
  style.shadows = style.ambient_occlusion = false;
  const Image without = draw(scene, style);
  style = Style{};
  style.ground = false;
  const Image no_ground = draw(scene, style);
  int darker = 0;
  for (std::size_t i = 0; i < with.rgb.size(); i += 3) {
    darker += without.rgb[i] - with.rgb[i] > 20 && no_ground.rgb[i] == without.rgb[i] ? 1 : 0;
  }
  EXPECT_GT(darker, 300);
}

TEST_F(RendererTest, FoldsShadeEachOther) {
  Scene scene = make_scene(61, 0);  // folds across the direction that the key light comes from
  scene.positions.col(1) = 0.2 * (12.0 * scene.positions.col(2).array()).sin();
  Style style;
  style.color = ColorMode::Shaded;
  style.ground = style.borders = false;
  const Image with = draw(scene, style);
  style.ambient_occlusion = false;
  const Image key_only = draw(scene, style);
  style.shadows = false;
  const Image flat = draw(scene, style);
  EXPECT_GT(mean_difference(with, key_only), 0.5);
  EXPECT_GT(mean_difference(key_only, flat), 0.05);
}

TEST_F(RendererTest, StrainRunsFromLightToDark) {
  const Scene scene = make_scene(21, 0);
  Style style;
  style.color = ColorMode::Strain;
  style.legend = false;
  const Image image = draw(scene, style);
  const Camera camera = camera_for();
  double previous = 1e9;
  for (double x : {-0.45, -0.15, 0.15, 0.45}) {
    const double value = brightness(at(image, pixel_of(camera, {x, 0, 0.1})));
    EXPECT_LT(value, previous - 15) << x;
    previous = value;
  }
  style.legend = true;
  EXPECT_GT(mean_difference(draw(scene, style), image), 0.5) << "the colour bar";
}

TEST_F(RendererTest, DofDotsMarkCornersAndDuplicates) {
  const Scene scene = make_scene(21, 0);
  Style style;
  style.color = ColorMode::Dof;
  style.legend = false;
  const Image image = draw(scene, style);
  const Camera camera = camera_for();
  const auto corner = at(image, pixel_of(camera, {0, 0, 0}));
  EXPECT_GT(corner[0], 2 * corner[1]);
  EXPECT_GT(corner[0], 2 * corner[2]);
  const auto duplicate = at(image, pixel_of(camera, {0.25, 0, 0}));
  EXPECT_GT(duplicate[0], 180);
  EXPECT_GT(duplicate[0], 2 * duplicate[2]);
  const auto internal = at(image, pixel_of(camera, {0.275, 0, 0.275}));
  EXPECT_GT(std::min({internal[0], internal[1], internal[2]}), 100);
}

TEST_F(RendererTest, MeshLinesDarkenEdges) {
  const Scene scene = make_scene(9, 0);
  Style style;
  style.borders = false;
  const Image without = draw(scene, style);
  style.mesh_lines = true;
  const Image with = draw(scene, style);
  const Camera camera = camera_for();
  const Vec2 edge = pixel_of(camera, {0.125, 0, 0.06});
  const Vec2 inside = pixel_of(camera, {0.21, 0, 0.165});
  EXPECT_LT(brightness(at(with, edge)), brightness(at(without, edge)) - 15);
  EXPECT_NEAR(brightness(at(with, inside)), brightness(at(without, inside)), 3);
}

TEST_F(RendererTest, CaptionLeavesInkInTheLowerLeft) {
  const Scene scene = make_scene(5, 0);
  Style style;
  const Image without = draw(scene, style);
  style.caption = "t = 0.25 s";
  const Image with = draw(scene, style);
  int changed = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (at(with, Vec2(x, y)) == at(without, Vec2(x, y))) continue;
      ++changed;
      EXPECT_LT(x, kWidth / 2);
      EXPECT_GT(y, kHeight / 2);
    }
  }
  EXPECT_GT(changed, 50);
}

TEST_F(RendererTest, AnEmptyMeshDrawsTheBackground) {
  for (ColorMode mode : {ColorMode::Domain, ColorMode::Dof, ColorMode::Strain, ColorMode::Shaded}) {
    Style style;
    style.color = mode;
    style.legend = false;
    const Image image =
        Renderer(Provider::Auto, kWidth, kHeight).draw(Frame{}, camera_for(), style);
    EXPECT_GT(*std::min_element(image.rgb.begin(), image.rgb.end()), 220);
    for (int y = 0; y < kHeight; ++y) {
      EXPECT_NEAR(brightness(at(image, Vec2(5, y))), brightness(at(image, Vec2(300, y))), 1.5);
    }
  }
}

// 5200 samples across are more than one tile: there must be no seam and no shift.
TEST_F(RendererTest, TilesJoinWithoutSeams) {
  const Scene scene = make_scene(31, 0.05);
  constexpr int kWide = 2600;
  Renderer renderer(Provider::Auto, kWide, kHeight);
  const Camera camera = frame_box({-0.5, -0.1, -0.5}, {0.5, 0.1, 0.5},
                                  static_cast<double>(kWide) / kHeight, 20, 45, 35);
  Style style;
  style.supersampling = 1;
  const Image one = renderer.draw(scene.frame(), camera, style);
  style.supersampling = 2;
  const Image two = renderer.draw(scene.frame(), camera, style);
  EXPECT_LT(mean_difference(one, two), 0.6);
  for (std::size_t d = 0; d < 4; ++d) {
    const auto pixel = at(two, pixel_of(camera, kQuadrants[d], kWide, kHeight));
    EXPECT_LT(hue_difference(pixel, scene.colors[d]), 14) << d;
  }
}

TEST_F(RendererTest, OddViewsDoNotFail) {
  const Scene scene = make_scene(9, 0.1);
  Renderer renderer(Provider::Auto, 16, 17);
  for (const Camera& camera :
       {Camera{{0, 3, 0}, {0, 0, 0}, {0, 1, 0}, 40}, Camera{{0, -3, 0}, {0, 0, 0}, {0, 1, 0}, 40},
        Camera{{0, 0.01, 0}, {0, 0, 5}, {0, 1, 0}, 170},
        Camera{{0, 0, 9}, {0, 0, 20}, {0, 0, 0}, 1},
        Camera{{0, 0, 900}, {0, 0, 0}, {1, 0, 0}, 35}}) {
    const Image image = renderer.draw(scene.frame(), camera, Style{});
    EXPECT_EQ(image.rgb.size(), 3U * 16 * 17);
  }
  Style style;
  for (double height : {-1e9, -1.0, 0.0, 1.0, 1e9}) {
    style.ground_height = height;
    EXPECT_NO_THROW(renderer.draw(scene.frame(), camera_for(), style)) << height;
  }
}

TEST_F(RendererTest, SurvivesDegenerateTriangles) {
  Scene scene = make_scene(9, 0);
  scene.triangles[3] = {7, 7, 7};
  scene.triangles[5] = {1, 2, 1};
  EXPECT_NO_THROW(draw(scene, Style{}));
  scene.positions.setZero();
  EXPECT_NO_THROW(draw(scene, Style{}));
}

TEST_F(RendererTest, CanBeMoved) {
  const Scene scene = make_scene(9, 0);
  Renderer first(Provider::Auto, kWidth, kHeight);
  const Image reference = first.draw(scene.frame(), camera_for(), Style{});
  Renderer second(std::move(first));
  EXPECT_TRUE(second.draw(scene.frame(), camera_for(), Style{}).rgb == reference.rgb);
  Renderer third(Provider::Auto, 32, 32);
  third = std::move(second);
  EXPECT_TRUE(third.draw(scene.frame(), camera_for(), Style{}).rgb == reference.rgb);
}

TEST_F(RendererTest, RejectsWhatDoesNotFit) {
  Renderer renderer(Provider::Auto, kWidth, kHeight);
  const Scene scene = make_scene(9, 0);
  const auto rejects = [&](const Frame& frame, const Style& style, const char* word) {
    try {
      renderer.draw(frame, camera_for(), style);
      ADD_FAILURE() << "accepted: " << word;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << error.what();
    }
  };
  Frame frame = scene.frame();
  frame.triangle_domain = frame.triangle_domain.subspan(1);
  rejects(frame, Style{}, "triangle_domain");
  frame = scene.frame();
  frame.domain_colors = frame.domain_colors.subspan(1);
  rejects(frame, Style{}, "no colour");
  Style style;
  style.color = ColorMode::Dof;
  frame = scene.frame();
  frame.vertex_class = {};
  rejects(frame, style, "vertex_class");
  style.color = ColorMode::Strain;
  frame = scene.frame();
  frame.triangle_value = frame.triangle_value.first(3);
  rejects(frame, style, "triangle_value");
  style.value_high = style.value_low;
  rejects(scene.frame(), style, "value_low");
  for (int samples : {0, 4}) {
    style = Style{};
    style.supersampling = samples;
    rejects(scene.frame(), style, "supersampling");
  }
  Scene bad = scene;
  bad.values[7] = std::numeric_limits<float>::quiet_NaN();
  style = Style{};
  style.color = ColorMode::Strain;
  rejects(bad.frame(), style, "triangle 7");
  bad = scene;
  bad.positions(3, 1) = std::numeric_limits<double>::quiet_NaN();
  rejects(bad.frame(), Style{}, "vertex 3");
  bad = scene;
  bad.triangles[2][0] = 81;
  rejects(bad.frame(), Style{}, "vertex 81");
  Camera camera = camera_for();
  camera.eye = camera.target;
  EXPECT_THROW(renderer.draw(scene.frame(), camera, Style{}), InputError);
  EXPECT_NO_THROW(renderer.draw(scene.frame(), camera_for(), Style{})) << "still usable";
}

TEST(Renderer, RejectsPictureSizes) {
  for (const auto& [width, height] : {std::pair{15, 100}, std::pair{100, 8193}, std::pair{0, 0}}) {
    EXPECT_THROW(Renderer(Provider::Auto, width, height), InputError);
  }
}

TEST(GlContext, MissingLibrariesNameThePackages) {
  const std::array<const char*, 2> none{"libpiecework_no_such_library.so.1", "libnothing.so"};
  for (Provider provider : {Provider::Auto, Provider::Osmesa, Provider::Egl}) {
    try {
      create_context(provider, none, none);
      FAIL() << "made a context out of nothing";
    } catch (const BackendError& error) {
      const std::string text = error.what();
      EXPECT_EQ(error.code(), ExitCode::BackendMissing);
      for (const char* word : {"libosmesa6", "libegl1", "libegl-mesa0"}) {
        EXPECT_NE(text.find(word), std::string::npos) << text;
      }
    }
  }
}

// A library that loads but is no GL: symbols are missing.
TEST(GlContext, AnotherLibraryIsRefused) {
  const std::array<const char*, 1> other{"libm.so.6"};
  EXPECT_THROW(create_osmesa_context(other), BackendError);
  EXPECT_THROW(create_egl_context(other), BackendError);
}

TEST(GlContext, EveryProviderIsReported) {
  const std::vector<ProviderReport> reports = probe_providers();
  ASSERT_EQ(reports.size(), 2U);
  EXPECT_EQ(reports[0].provider, Provider::Osmesa);
  EXPECT_EQ(reports[1].provider, Provider::Egl);
  for (const ProviderReport& report : reports) EXPECT_FALSE(report.detail.empty());
}

TEST(Resolve, AveragesInLinearLightAndFlips) {
  // Two pixels above two: bottom row first in the samples, top row first in the image.
  Image image{2, 2, std::vector<std::uint8_t>(12)};
  const std::vector<std::uint8_t> once{0,   0, 0, 255, 255, 255, 255, 255,   // bottom row
                                       255, 0, 0, 255, 180, 180, 180, 255};  // top row
  resolve_tile(once, {0, 0, 2, 2}, 1, image);
  EXPECT_EQ(image.rgb[0], 255);
  EXPECT_EQ(image.rgb[1], 0);
  // (180 / 255)^2 = 0.498 in linear light is 187.6 in sRGB
  EXPECT_NEAR(image.rgb[3], 188, 1);
  EXPECT_EQ(image.rgb[6], 0);
  EXPECT_EQ(image.rgb[9], 255);
  // Half the samples black, half white: 0.5 in linear light is 188 in sRGB.
  for (int samples : {2, 3}) {
    Image one{1, 1, std::vector<std::uint8_t>(3)};
    std::vector<std::uint8_t> block;
    for (int i = 0; i < samples * samples; ++i) {
      for (int c = 0; c < 4; ++c) block.push_back(2 * i < samples * samples ? 255 : 0);
    }
    resolve_tile(block, {0, 0, 1, 1}, samples, one);
    EXPECT_NEAR(one.rgb[0], samples == 2 ? 188 : 197, 1);
  }
}

}  // namespace
}  // namespace piecework::render
