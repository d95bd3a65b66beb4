// piecework render: draw a finished run again, or a mesh.

#include <filesystem>
#include <tuple>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <piecework/core/error.hpp>
#include <piecework/runner/run.hpp>
#include <piecework/scene/scene_io.hpp>

#include "commands.hpp"
#include "mesh_scene.hpp"
#include "pictures.hpp"

namespace piecework::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExamples =
    "Draw the frames of a run directory, or a mesh file.\n\n"
    "Examples:\n"
    "  piecework render out/cloth --color strain -o 'strain_{frame:04}.png'\n"
    "  piecework render out/cloth --frames 30:60 --size 1920x1080\n"
    "  piecework render garment.obj --color shaded -o garment.png";

struct RenderArguments {
  std::string input;
  std::string output;
  std::string frames;
  std::string color;
  std::string size;
  std::string gl = "auto";
  bool mesh_lines = false;
  bool fast = false;
  MeshArguments mesh;
};

PictureOptions options_for(const scene::Scene& scene, const RenderArguments& arguments) {
  PictureOptions options = picture_options(scene);
  options.gl = arguments.gl;
  options.fast = arguments.fast;
  options.mesh_lines |= arguments.mesh_lines;
  if (!arguments.color.empty()) options.color = arguments.color;
  if (!arguments.size.empty()) std::tie(options.width, options.height) = parse_size(arguments.size);
  return options;
}

int last_frame(const fs::path& directory) {
  int frame = -1;
  while (fs::exists(runner::state_file(directory, frame + 1))) ++frame;
  if (frame < 0)
    throw InputError(fmt::format(
        "{}: no state/frame_0000.bin in it; name a directory that `piecework run` wrote "
        "without --no-state",
        directory.string()));
  return frame;
}

/// "A:B", "A:", ":B" or "A", within 0 ... last.
std::pair<int, int> frame_range(const std::string& text, int last) {
  if (text.empty()) return {0, last};
  const auto colon = text.find(':');
  const auto number = [&](const std::string& part, int fallback) {
    if (part.empty()) return fallback;
    std::size_t used = 0;
    int value = -1;
    try {
      value = std::stoi(part, &used);
    } catch (const std::exception&) {
      used = 0;
    }
    if (used != part.size() || value < 0 || value > last)
      throw InputError(
          fmt::format("--frames {}: \"{}\" is no frame from 0 to {}", text, part, last));
    return value;
  };
  if (colon == std::string::npos) {
    const int frame = number(text, 0);
    return {frame, frame};
  }
  const auto range =
      std::pair(number(text.substr(0, colon), 0), number(text.substr(colon + 1), last));
  if (range.first > range.second)
    throw InputError(fmt::format("--frames {}: the first frame comes after the last", text));
  return range;
}

int render_run(const RenderArguments& arguments, const Verbosity& verbosity) {
  const fs::path directory = arguments.input;
  const auto world = runner::build_world(scene::load_scene(directory / "scene.resolved.json"));
  const auto [first, last] = frame_range(arguments.frames, last_frame(directory));
  const std::string pattern = arguments.output.empty() ? "frame_{frame:04}.png" : arguments.output;
  if (first != last && pattern.find("{frame") == std::string::npos)
    throw InputError(
        fmt::format("-o {}: has no {{frame}} for {} frames; write e.g. 'frame_{{frame:04}}.png'",
                    pattern, last - first + 1));
  const auto shots = shots_of_run(*world, directory, first, last, pattern);
  Progress progress("drawing", verbosity.quiet);
  take_pictures(*world, shots, options_for(world->scene, arguments), progress);
  for (const Shot& shot : shots) fmt::print("{}\n", shot.path.string());
  return 0;
}

int render_mesh(const RenderArguments& arguments, const Verbosity& verbosity) {
  const auto world = runner::build_world(mesh_scene(arguments.input, arguments.mesh));
  const fs::path path = arguments.output.empty()
                            ? fs::path(arguments.input).stem().string() + ".png"
                            : arguments.output;
  const Shot shot{
      .positions = [&] { return world->model.start; }, .caption = world->scene.name, .path = path};
  Progress progress("drawing", verbosity.quiet);
  take_pictures(*world, {shot}, options_for(world->scene, arguments), progress);
  fmt::print("{}\n", path.string());
  return 0;
}

}  // namespace

void add_render(CLI::App& program, Action& action, const Verbosity& verbosity) {
  auto arguments = std::make_shared<RenderArguments>();
  CLI::App* app = program.add_subcommand("render", kExamples);
  app->add_option("input", arguments->input, "Run directory, or mesh file")->required();
  app->add_option("-o,--output", arguments->output,
                  "PNG file; of a run: relative to its directory, with {frame} or {frame:04}");
  app->add_option("--frames", arguments->frames, "A:B, A: or :B [all]");
  app->add_option("--color", arguments->color,
                  "domain, dof, strain, contact or shaded [as the scene says]")
      ->check(CLI::IsMember({"domain", "dof", "strain", "contact", "shaded"}));
  app->add_option("--size", arguments->size, "Picture size, e.g. 1920x1080");
  app->add_option("--gl", arguments->gl, "OpenGL provider")
      ->check(CLI::IsMember({"auto", "osmesa", "egl"}));
  app->add_flag("--mesh-lines", arguments->mesh_lines, "Draw every triangle's edges");
  app->add_flag("--fast", arguments->fast, "No shadows, no ambient occlusion");
  add_mesh_options(*app, arguments->mesh);
  app->callback([arguments, &action, &verbosity] {
    action = [arguments, &verbosity] {
      if (!fs::exists(arguments->input))
        throw InputError(
            fmt::format("{}: no such file or directory; name a run directory or a mesh "
                        "file (a scene is drawn by `piecework run`)",
                        arguments->input));
      return fs::is_directory(arguments->input) ? render_run(*arguments, verbosity)
                                                : render_mesh(*arguments, verbosity);
    };
  });
}

}  // namespace piecework::cli
