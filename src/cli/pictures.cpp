#include "pictures.hpp"

#include <algorithm>
#include <cmath>
#include <future>
#include <limits>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/decomposition/decomposition.hpp>
#include <piecework/model/measures.hpp>
#include <piecework/runner/checkpoint.hpp>
#include <piecework/runner/contact_pressure.hpp>
#include <piecework/runner/run.hpp>
#include <renderer/png.hpp>

#include "scenery.hpp"

namespace piecework::cli {
namespace {

render::ColorMode color_mode(const std::string& name) {
  if (name == "domain") return render::ColorMode::Domain;
  if (name == "dof") return render::ColorMode::Dof;
  if (name == "strain" || name == "contact") return render::ColorMode::Strain;
  if (name == "shaded") return render::ColorMode::Shaded;
  throw InputError(
      fmt::format("color \"{}\" is unknown; use domain, dof, strain, contact or shaded", name));
}

bool can_touch(const scene::Scene& scene) {
  return scene.self_collision || !scene.colliders.empty();
}

void check_color(const scene::Scene& scene, const PictureOptions& options) {
  (void)color_mode(options.color);
  if (options.color == "contact" && !can_touch(scene))
    throw InputError(
        fmt::format("{}: color \"contact\": nothing can touch: the scene has no `colliders`, and "
                    "`self_collision` is off; use another color",
                    scene.name));
}

render::Provider provider(const std::string& name) {
  if (name == "osmesa") return render::Provider::Osmesa;
  if (name == "egl") return render::Provider::Egl;
  return render::Provider::Auto;
}

/// What colours show, if they show numbers.
struct Quantity {
  const char* label;
  float least;         ///< a colour scale that ends below this would show rounding
  int percentile;      ///< where the scale ends
  bool only_positive;  ///< the percentile is that of finite values above 0
  std::vector<float> (*values)(const runner::World& world, const Positions& x, double time);
};

std::vector<float> strain(const runner::World& world, const Positions& x, double) {
  return model::triangle_strain(world.model, x);
}

const Quantity* quantity(const std::string& color) {
  static constexpr Quantity kStrain{"strain", 1e-3F, 99, false, strain};
  // Pressure has peaks where folds are pinched.
  static constexpr Quantity kContact{"contact pressure, Pa", 0.1F, 90, true,
                                     runner::contact_pressure};
  return color == "strain" ? &kStrain : color == "contact" ? &kContact : nullptr;
}

/// What all pictures of a series share.
struct Extent {
  Bounds cloth, bodies;
  float value = 0;  ///< percentile of the quantity, largest of all shots
};

float percentile(std::vector<float> values, int percent) {
  if (values.empty()) return 0;
  const auto nth =
      values.begin() +
      static_cast<std::ptrdiff_t>((values.size() - 1) * static_cast<std::size_t>(percent) / 100);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

Extent measure(const runner::World& world, const std::vector<Shot>& shots, const Quantity* shown) {
  Extent extent;
  for (const Shot& shot : shots) {
    const Positions x = shot.positions();
    extent.cloth.include(x);
    extent.bodies.include(bounds_of_bodies(world, shot.time));
    if (shown == nullptr) continue;
    std::vector<float> values = shown->values(world, x, shot.time);
    if (shown->only_positive)
      std::erase_if(values, [](float value) { return !(value > 0 && std::isfinite(value)); });
    extent.value = std::max(extent.value, percentile(std::move(values), shown->percentile));
  }
  return extent;
}

/// A round number not below `value`: 1, 2, 2.5 or 5 times a power of ten.
float round_up(float value) {
  if (!(value > 0)) return 0.01F;
  const float power = std::pow(10.0F, std::floor(std::log10(value)));
  for (const float step : {1.0F, 2.0F, 2.5F, 5.0F, 10.0F})
    if (value <= step * power * 1.0001F) return step * power;
  return value;
}

Vec3 vec(const std::array<double, 3>& a) { return {a[0], a[1], a[2]}; }

render::Camera make_camera(const scene::Camera& wish, const Bounds& box, double aspect) {
  render::Camera camera =
      render::frame_box(box.low, box.high, aspect, wish.azimuth, wish.elevation, wish.fov);
  if (wish.position) camera.eye = vec(*wish.position);
  if (wish.target) camera.target = vec(*wish.target);
  return camera;
}

/// Below everything, for scenes without a level plane.
double automatic_ground(const Extent& extent) {
  const double margin = 0.02 * extent.cloth.size();
  return std::min(extent.cloth.low.y(), extent.bodies.low.y()) - margin;
}

render::Style make_style(const PictureOptions& options, const runner::World& world) {
  render::Style style;
  style.color = color_mode(options.color);
  style.borders = options.borders;
  style.mesh_lines = options.mesh_lines;
  style.shadows = style.ambient_occlusion = !options.fast;
  // Cloth that touches something folds: its inside is a little darker.
  if (can_touch(world.scene)) style.back = 0.72F;
  return style;
}

/// Encodes pictures one behind the drawing.
class Encoder {
 public:
  void write(const std::filesystem::path& path, render::Image image) {
    wait();
    pending_ = std::async(std::launch::async,
                          [path, image = std::move(image)] { render::write_png(path, image); });
  }
  void wait() {
    if (pending_.valid()) pending_.get();
  }

 private:
  std::future<void> pending_;
};

std::string picture_name(const std::string& pattern, int frame) {
  try {
    return fmt::format(fmt::runtime(pattern), fmt::arg("frame", frame));
  } catch (const fmt::format_error& error) {
    throw Error(ExitCode::Usage, fmt::format("-o {}: {}; the only placeholder is {{frame}}, e.g. "
                                             "'frame_{{frame:04}}.png'",
                                             pattern, error.what()));
  }
}

}  // namespace

PictureOptions picture_options(const scene::Scene& scene) {
  return {.width = scene.render.size[0],
          .height = scene.render.size[1],
          .color = scene.render.color,
          .borders = scene.render.borders,
          .mesh_lines = scene.render.mesh_lines};
}

void check_pictures(const scene::Scene& scene, const PictureOptions& options) {
  check_color(scene, options);
  const render::Renderer probe(provider(options.gl), options.width, options.height);
}

void take_pictures(const runner::World& world, const std::vector<Shot>& shots,
                   const PictureOptions& options, Progress& progress) {
  check_color(world.scene, options);
  render::Style style = make_style(options, world);
  const Quantity* shown = quantity(options.color);

  render::Renderer renderer(provider(options.gl), options.width, options.height);
  const Extent extent = measure(world, shots, shown);
  if (shown != nullptr) {
    style.value_label = shown->label;
    style.value_high = round_up(std::max(extent.value, shown->least));
  }
  const render::Camera camera = make_camera(world.scene.camera, framed(extent.cloth, extent.bodies),
                                            static_cast<double>(options.width) / options.height);
  const auto adjacent =
      decomposition::adjacent_domains(world.domains, world.model.hinges, world.seam_neighbors);
  const std::vector<render::Rgb> colors =
      render::domain_palette(world.domains.num_domains, adjacent);
  std::vector<render::DofClass> classes;
  for (int v = 0; style.color == render::ColorMode::Dof && v < world.model.num_vertices(); ++v)
    classes.push_back(static_cast<render::DofClass>(world.domains.dof_class(v)));

  Encoder encoder;
  progress.start(0, static_cast<int>(shots.size()));
  for (std::size_t i = 0; i < shots.size(); ++i) {
    const double time = shots[i].time;
    const Positions x = shots[i].positions();
    std::vector<float> values;
    if (shown != nullptr) values = shown->values(world, x, time);
    const auto surfaces = bodies_at(world, time, camera.eye, extent.cloth);
    std::vector<render::Body> bodies;
    for (const mesh::TriangleMesh& s : surfaces) bodies.push_back({&s.positions, s.triangles});
    const auto plane = level_ground(world, time);
    style.ground_height =
        world.scene.camera.ground.value_or(plane.value_or(automatic_ground(extent)));
    style.caption = shots[i].caption.empty() ? fmt::format("t = {:.3f} s", time) : shots[i].caption;
    render::Image image = renderer.draw({.positions = &x,
                                         .triangles = world.model.triangles,
                                         .triangle_domain = world.domains.triangle_domain,
                                         .domain_colors = colors,
                                         .triangle_value = values,
                                         .vertex_class = classes,
                                         .bodies = bodies},
                                        camera, style);
    encoder.write(shots[i].path, std::move(image));
    progress.update(static_cast<int>(i + 1), "");
  }
  encoder.wait();
  progress.finish();
}

void write_contact_sheet(const std::vector<Shot>& shots, const std::filesystem::path& path,
                         int count) {
  const int last = static_cast<int>(shots.size()) - 1;
  const int pictures = std::min(count, last + 1);
  std::vector<render::Image> images;
  std::vector<std::string> captions;
  for (int k = 0; k < pictures; ++k) {
    const Shot& shot =
        shots[static_cast<std::size_t>(pictures > 1 ? k * last / (pictures - 1) : 0)];
    images.push_back(render::read_png(shot.path));
    captions.push_back(fmt::format("t = {:.3f} s", shot.time));
  }
  render::write_png(path, render::contact_sheet(images, captions, std::min(4, pictures), 480));
}

std::vector<Shot> shots_of_run(const runner::World& world, const std::filesystem::path& directory,
                               int first, int last, const std::string& pattern) {
  const std::string hash = runner::motion_hash(world);
  std::vector<Shot> shots;
  for (int frame = first; frame <= last; ++frame) {
    const std::filesystem::path state = runner::state_file(directory, frame);
    const auto positions = [&world, state, hash] {
      return runner::read_state(state, hash, world.model.num_vertices()).x;
    };
    shots.push_back({.positions = positions,
                     .time = frame * world.scene.step.output_every * world.scene.step.h,
                     .path = directory / picture_name(pattern, frame)});
  }
  return shots;
}

}  // namespace piecework::cli
