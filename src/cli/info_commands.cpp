// piecework env | schema | doctor | scenes: what this program and this machine are.

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/runner/environment.hpp>
#include <piecework/scene/scene_io.hpp>
#include <renderer/renderer.hpp>

#include "commands.hpp"

namespace piecework::cli {
namespace {

int print_doctor() {
  bool pictures = false;
  fmt::print("OpenGL\n");
  for (const auto& report : render::probe_providers()) {
    fmt::print("  {:<8} {:<8} {}\n", report.provider == render::Provider::Egl ? "egl" : "osmesa",
               report.works ? "works" : "missing", report.detail);
    pictures |= report.works;
  }
  if (!pictures) fmt::print("  without one, use --no-images; install libosmesa6 for pictures\n");
  fmt::print("machine\n");
  for (const auto& [key, value] : runner::describe_environment())
    fmt::print("  {:<16} {}\n", key, value);
  const double load = runner::load_average();
  fmt::print("  {:<16} {:.2f}{}\n", "load", load,
             load > 0.5 * available_threads() ? "  busy: timings will be disturbed" : "");
  fmt::print("scenes\n  {} built in\n", scene::builtin_scenes().size());
  return static_cast<int>(pictures ? ExitCode::Ok : ExitCode::BackendMissing);
}

int print_scenes() {
  for (const auto& scene : scene::builtin_scenes())
    fmt::print("{:<20} {}\n", scene.name, scene.description);
  return 0;
}

}  // namespace

std::pair<std::string, std::string> parse_override(const std::string& text) {
  const auto equals = text.find('=');
  if (equals == std::string::npos || equals == 0)
    throw Error(ExitCode::Usage,
                fmt::format("--set {}: write key=value, e.g. --set solver.domains=16", text));
  return {text.substr(0, equals), text.substr(equals + 1)};
}

std::pair<int, int> parse_size(const std::string& text) {
  int width = 0;
  int height = 0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%dx%d%c", &width, &height, &rest) != 2 || width <= 0 ||
      height <= 0)
    throw Error(ExitCode::Usage,
                fmt::format("--size {}: write width x height, e.g. --size 1280x720", text));
  return {width, height};
}

void add_env(CLI::App& program, Action& action) {
  CLI::App* app = program.add_subcommand(
      "env", "Print machine, compiler and libraries as JSON, as in every result.");
  app->callback([&action] {
    action = [] {
      fmt::print("{}\n", runner::to_json(runner::describe_environment()));
      return 0;
    };
  });
}

void add_schema(CLI::App& program, Action& action) {
  auto markdown = std::make_shared<bool>(false);
  CLI::App* app =
      program.add_subcommand("schema", "Print the JSON Schema of scene files, for editors.");
  app->add_flag("--markdown", *markdown, "Print the reference of all keys instead (docs/scene.md)");
  app->callback([markdown, &action] {
    action = [markdown] {
      const std::string text = *markdown ? scene::reference_markdown() : scene::json_schema();
      fmt::print("{}{}", text, text.ends_with('\n') ? "" : "\n");
      return 0;
    };
  });
}

void add_doctor(CLI::App& program, Action& action) {
  CLI::App* app =
      program.add_subcommand("doctor", "Say what works here: OpenGL, cores, libraries.");
  app->callback([&action] { action = print_doctor; });
}

void add_scenes(CLI::App& program, Action& action) {
  CLI::App* app = program.add_subcommand("scenes", "List the built-in scenes.");
  app->callback([&action] { action = print_scenes; });
}

}  // namespace piecework::cli
