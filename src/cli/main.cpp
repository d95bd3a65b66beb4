// piecework: cloth simulation, pictures and timing tables from the command line.
// Data go to stdout, everything else to stderr. Exit codes: src/piecework/core/error.hpp.

#include <cstdio>
#include <exception>
#include <filesystem>
#include <new>
#include <system_error>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <piecework/core/error.hpp>

#include "commands.hpp"
#include "console.hpp"

namespace piecework::cli {
namespace {

constexpr const char* kVersion = "piecework 0.1.0";

constexpr const char* kExamples =
    "Examples:\n"
    "  piecework run hanging_tablecloth -o out/cloth         simulate, draw frames, write tables\n"
    "  piecework run scene.json --set solver.domains=16 --no-images --export ply\n"
    "  piecework render out/cloth --color strain             draw a finished run again\n"
    "  piecework partition garment.obj -k 32 -o domains.png  cut a mesh into domains\n"
    "  piecework check scene.json                            what is on, and whether it is sound\n"
    "  piecework tune scene.json -o tuned.json               domains for this processor\n"
    "  piecework compare out/a out/reference                 position error and time ratio\n"
    "  piecework sweep plan.json -o out/sweep                many settings, one table\n"
    "  piecework scenes                                      scenes that come along\n";

/// Help that starts with examples.
class Formatter : public CLI::Formatter {
 public:
  std::string make_description(const CLI::App* app) const override {
    const std::string text = CLI::Formatter::make_description(app);
    return app->get_parent() == nullptr ? text + "\n" + kExamples : text;
  }
};

int report(const Error& error) {
  say("piecework: {}\n", error.what());
  return static_cast<int>(error.code());
}

}  // namespace

int run_program(int argc, char** argv) {
  CLI::App program("CPU cloth simulation by domain-decomposed projective dynamics.", "piecework");
  program.formatter(std::make_shared<Formatter>());
  program.set_version_flag("--version", kVersion);
  program.require_subcommand(1);
  program.fallthrough();
  Verbosity verbosity;
  program.add_flag("-q,--quiet", verbosity.quiet, "Errors only");
  program.add_flag("-v,--verbose", verbosity.verbose, "Say more");
  Action action;
  add_run(program, action, verbosity);
  add_render(program, action, verbosity);
  add_partition(program, action, verbosity);
  add_tune(program, action, verbosity);
  add_compare(program, action);
  add_sweep(program, action, verbosity);
  add_ccd(program, action);
  add_check(program, action);
  add_env(program, action);
  add_schema(program, action);
  add_doctor(program, action);
  add_scenes(program, action);

  try {
    program.parse(argc, argv);
  } catch (const CLI::Success& done) {  // --help, --version
    return program.exit(done);
  } catch (const CLI::ParseError& error) {
    say("piecework: {}\nTry: piecework --help\n", error.what());
    return static_cast<int>(ExitCode::Usage);
  }
  try {
    const int code = action();
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0)
      return report(OutputError("standard output: cannot be written"));
    return code;
  } catch (const Error& error) {
    return report(error);
  } catch (const std::filesystem::filesystem_error& error) {
    return report(InputError(error.what()));
  } catch (const std::system_error& error) {  // fmt cannot print
    return report(OutputError(error.what()));
  } catch (const std::bad_alloc&) {
    return report(SimulationError("out of memory; use a smaller mesh or --no-images"));
  }
}

}  // namespace piecework::cli

int main(int argc, char** argv) {
  try {
    return piecework::cli::run_program(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "piecework: unexpected: %s\n", error.what());
    return static_cast<int>(piecework::ExitCode::SimulationFailed);
  }
}
