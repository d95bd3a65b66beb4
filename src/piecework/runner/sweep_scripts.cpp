#include <piecework/runner/sweep_scripts.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <piecework/core/error.hpp>

namespace piecework::runner {
namespace {

/// A case that failed is recorded, and is no reason to stop the others or to forget its record.
constexpr const char* kOrRecorded = "|| test -f";

/// One word of a POSIX shell.
std::string shell_word(const std::string& text) {
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

/// A string of Python (JSON's rules are a part of its own).
std::string python_string(const std::string& text) {
  return nlohmann::json(text).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
}

void refuse_for_make(const std::string& name) {
  if (name.find_first_of(" \t\n$#:%=\\'\"*?[];&|<>()`~") != std::string::npos)
    throw InputError(fmt::format(
        "{}: make cannot take this name; use one without blanks and special characters", name));
}

std::string introduction(std::size_t jobs, const ScriptOptions& options, const char* how) {
  return fmt::format(
      "# {} cases of {}, made by piecework sweep --emit. {}\n"
      "# Cases that run at one time on one machine disturb each other's times.\n",
      jobs, options.plan, how);
}

}  // namespace

std::string makefile(const std::vector<SweepJob>& jobs, const ScriptOptions& options) {
  refuse_for_make(options.plan);
  refuse_for_make(options.directory);
  const std::string& dir = options.directory;
  const std::string sweep =
      fmt::format("$(PIECEWORK) sweep {} -o {}", options.plan, options.directory);
  std::string text = introduction(jobs.size(), options, "Run: make -k -f FILE") +
                     "PIECEWORK ?= piecework\n\n.PHONY: all\n" +
                     fmt::format("all: {}/sweep.md\n\nCASES =", dir);
  for (const SweepJob& job : jobs) text += fmt::format(" \\\n  {}/{}/case.json", dir, job.name);
  text += fmt::format("\n\n{}/sweep.md: $(CASES)\n\t{}\n", dir, sweep);
  for (std::size_t i = 0; i < jobs.size(); ++i)
    text += fmt::format("\n{}/{}/case.json:\n\t{} --shard {}/{} {} $@\n", dir, jobs[i].name, sweep,
                        i + 1, jobs.size(), kOrRecorded);
  return text;
}

std::string slurm_script(const std::vector<SweepJob>& jobs, const ScriptOptions& options) {
  std::string text = "#!/bin/bash\n";
  text += fmt::format("#SBATCH --job-name=piecework-sweep\n#SBATCH --array=1-{}\n", jobs.size());
  text += "#SBATCH --nodes=1\n#SBATCH --ntasks=1\n#SBATCH --exclusive\n";
  text += introduction(jobs.size(), options, "Run: sbatch FILE");
  text += "# Whichever task ends last writes the tables.\n\n";
  return text + fmt::format(
                    "exec \"${{PIECEWORK:-piecework}}\" sweep {} -o {} "
                    "--shard \"${{SLURM_ARRAY_TASK_ID:?run this with sbatch}}/{}\"\n",
                    shell_word(options.plan), shell_word(options.directory), jobs.size());
}

std::string snakefile(const std::vector<SweepJob>& jobs, const ScriptOptions& options) {
  std::string text = introduction(jobs.size(), options, "Run: snakemake -k -j 1 -s FILE");
  text += "\nfrom shlex import quote\n\nPIECEWORK = config.get(\"piecework\", \"piecework\")\n";
  text += fmt::format("PLAN = {}\nDIR = {}\n", python_string(options.plan),
                      python_string(options.directory));
  text += "SWEEP = f\"{quote(PIECEWORK)} sweep {quote(PLAN)} -o {quote(DIR)}\"\n";
  text += "CASES = [\n";
  for (const SweepJob& job : jobs) text += fmt::format("    \"{}\",\n", job.name);
  text += fmt::format(
      "]\n\nrule table:\n"
      "    input: [f\"{{DIR}}/{{case}}/case.json\" for case in CASES]\n"
      "    output: f\"{{DIR}}/sweep.md\", f\"{{DIR}}/sweep.csv\", f\"{{DIR}}/sweep.json\"\n"
      "    params: sweep=SWEEP\n"
      "    shell: \"{{params.sweep}}\"\n\n"
      "rule case:\n"
      "    output: DIR + \"/{{case}}/case.json\"\n"
      "    params:\n"
      "        sweep=SWEEP,\n"
      "        shard=lambda wildcards: f\"{{CASES.index(wildcards.case) + 1}}/{{len(CASES)}}\"\n"
      "    shell: \"{{params.sweep}} --shard {{params.shard}} {} {{output:q}}\"\n",
      kOrRecorded);
  return text;
}

}  // namespace piecework::runner
