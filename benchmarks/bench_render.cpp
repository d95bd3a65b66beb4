// What a picture costs: 1080p of a wavy sheet of 100000 triangles in 32 domains, in each quality,
// beside the barest drawing of the same sheet (no borders, no shadows, one sample per pixel); and
// what encoding the picture costs, beside the same encoder on one thread.
// Validation: the cloth covers the middle of the picture; the PNG is one, and smaller than the
// pixels.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/core/types.hpp>
#include <renderer/png.hpp>
#include <renderer/renderer.hpp>

#include "bench.hpp"
#include "interleaved.hpp"

namespace piecework::bench {
namespace {

constexpr int kWidth = 1920;
constexpr int kHeight = 1080;
constexpr int kIterations = 15;

/// A sheet of columns x rows squares, two triangles each, in 8 x 4 domains.
struct Sheet {
  Positions positions;
  Triangles triangles;
  std::vector<int> domain;
  std::vector<render::Rgb> colors = render::domain_palette(32, {});

  Sheet(int columns, int rows) : positions((columns + 1) * (rows + 1), 3) {
    for (int j = 0; j <= rows; ++j) {
      for (int i = 0; i <= columns; ++i) {
        const double x = 1.25 * i / columns;
        const double z = static_cast<double>(j) / rows;
        positions.row(j * (columns + 1) + i) << x,
            0.06 * std::sin(9 * x + 2 * z) + 0.04 * std::sin(12 * z - 4 * x), z;
      }
    }
    for (int j = 0; j < rows; ++j) {
      for (int i = 0; i < columns; ++i) {
        const int a = j * (columns + 1) + i;
        const int below = a + columns + 1;
        triangles.push_back({a, below, below + 1});
        triangles.push_back({a, below + 1, a + 1});
        domain.insert(domain.end(), 2, 8 * i / columns + 8 * (4 * j / rows));
      }
    }
  }

  [[nodiscard]] render::Frame frame() const {
    render::Frame result;
    result.positions = &positions;
    result.triangles = triangles;
    result.triangle_domain = domain;
    result.domain_colors = colors;
    return result;
  }
};

render::Camera camera() {
  return render::frame_box({0, -0.1, 0}, {1.25, 0.1, 1}, 16.0 / 9.0, 25, 40, 30);
}

render::Style bare() {
  render::Style style;
  style.borders = style.shadows = style.ground = style.ambient_occlusion = false;
  style.supersampling = 1;
  return style;
}

struct Mode {
  const char* name;
  bool shadows, ambient_occlusion;
  int supersampling;
};

constexpr std::array kModes{
    Mode{"plain", false, false, 1},         // domain colours and borders
    Mode{"shadows", true, false, 1},        // with soft shadows on cloth and ground
    Mode{"supersampled", false, false, 2},  // plain, anti-aliased
    Mode{"full", true, true, 2},            // the default style
};

render::Style style_of(const Mode& mode) {
  render::Style style;
  style.shadows = style.ground = mode.shadows;
  style.ambient_occlusion = mode.ambient_occlusion;
  style.supersampling = mode.supersampling;
  return style;
}

/// The middle pixel is coloured, where the background is nearly grey.
bool shows_cloth(const render::Image& image) {
  const std::size_t middle = 3 * (static_cast<std::size_t>(kHeight / 2) * kWidth + kWidth / 2);
  const auto [low, high] =
      std::minmax({image.rgb[middle], image.rgb[middle + 1], image.rgb[middle + 2]});
  return high - low > 20;
}

Sheet sheet_for(bool small) { return small ? Sheet(50, 40) : Sheet(250, 200); }

void draw(benchmark::State& state, const Mode& mode) {
  try {
    const Sheet sheet = sheet_for(quick());
    render::Renderer renderer(render::Provider::Auto, kWidth, kHeight);
    render::Image image;
    const auto ours = [&] { image = renderer.draw(sheet.frame(), camera(), style_of(mode)); };
    const auto barest = [&] { keep(renderer.draw(sheet.frame(), camera(), bare()).rgb.data()); };
    barest();  // compiles shaders
    ours();
    InterleavedTimer timer;
    for (auto _ : state) {
      timer.sample(ours, barest);
      state.SetIterationTime(timer.last_a());
    }
    if (!shows_cloth(image)) {
      fail(state, "the middle of the picture is not cloth");
      return;
    }
    timer.write(state.counters);
    state.counters["triangles"] = static_cast<double>(sheet.triangles.size());
    state.SetLabel(renderer.description());
  } catch (const BackendError& error) {
    skip(state, error.what());
  }
}

void encode(benchmark::State& state) {
  try {
    const Sheet sheet = sheet_for(quick());
    render::Renderer renderer(render::Provider::Auto, kWidth, kHeight);
    const render::Image image = renderer.draw(sheet.frame(), camera(), render::Style{});
    ThreadPool one(1);
    std::string png;
    const auto ours = [&] { png = render::encode_png(image); };
    const auto single = [&] {
      const std::string other = one.run([&] { return render::encode_png(image); });
      keep(other.data());
    };
    ours();
    single();
    InterleavedTimer timer;
    for (auto _ : state) {
      timer.sample(ours, single);
      state.SetIterationTime(timer.last_a());
    }
    const auto signature = std::string_view("\x89PNG", 4);
    if (!png.starts_with(signature) || png.size() > image.rgb.size()) {
      fail(state, fmt::format("the PNG of {} bytes is not one", png.size()));
      return;
    }
    timer.write(state.counters);
    state.counters["bytes"] = static_cast<double>(png.size());
  } catch (const BackendError& error) {
    skip(state, error.what());
  }
}

const Registration registration([] {
  const int iterations = quick() ? 2 : kIterations;
  const int triangles = quick() ? 4000 : 100000;
  for (const Mode& mode : kModes) {
    const std::string name = fmt::format("render/{}/tris:{}/size:1080p", mode.name, triangles);
    benchmark::RegisterBenchmark(name.c_str(), draw, mode)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond)
        ->Iterations(iterations);
  }
  benchmark::RegisterBenchmark("png/1080p", encode)
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond)
      ->Iterations(iterations);
});

}  // namespace
}  // namespace piecework::bench
