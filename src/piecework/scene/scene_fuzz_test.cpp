// Damaged scenes: whatever the bytes, a scene or an InputError of the promised form.

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <optional>

#include <gtest/gtest.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/random.hpp>
#include <piecework/scene/scene_io.hpp>

namespace piecework::scene {
namespace {

std::size_t below(Random& random, std::size_t limit) { return random.next() % limit; }

/// Begin and end of a random run of letters and digits, or of one other character.
std::pair<std::size_t, std::size_t> random_token(const std::string& text, Random& random) {
  const auto wordy = [&](std::size_t i) {
    return std::isalnum(static_cast<unsigned char>(text[i])) || text[i] == '_' || text[i] == '.';
  };
  std::size_t begin = below(random, text.size()), end = begin + 1;
  if (!wordy(begin)) return {begin, end};
  while (begin > 0 && wordy(begin - 1)) --begin;
  while (end < text.size() && wordy(end)) ++end;
  return {begin, end};
}

std::string mutated(std::string text, Random& random) {
  static const std::vector<std::string> words = {"null", "-1", "1e999", "\"",  "{",  "}",
                                                 "[",    "]",  ",",     ":",   "/*", "//",
                                                 "\n",   "\\", "true",  "\xff"};
  switch (below(random, 6)) {
    case 0:
      return text.substr(0, below(random, text.size()));
    case 1:
      text[below(random, text.size())] ^= static_cast<char>(1U << below(random, 8));
      return text;
    case 2: {
      const auto [begin, end] = random_token(text, random);
      return text.erase(begin, end - begin);
    }
    case 3: {
      const auto [begin, end] = random_token(text, random);
      return text.replace(begin, end - begin, words[below(random, words.size())]);
    }
    case 4: {
      const auto [begin, end] = random_token(text, random);
      return text.insert(begin, text.substr(begin, end - begin));
    }
    default:
      return text.insert(below(random, text.size()), words[below(random, words.size())]);
  }
}

struct Report {
  long line = 0, column = 0;  ///< 0: none
};

/// Takes "s.json:<line>:<column>: /<pointer>: <problem>; <remedy>" apart, line and column being
/// optional; nothing if the message has another form.
std::optional<Report> parsed(const std::string& message) {
  const std::size_t pointer = message.find(": /");
  if (!message.starts_with("s.json:") || pointer == std::string::npos) return {};
  const std::size_t problem = message.find(": ", pointer + 2);
  if (problem == std::string::npos) return {};
  const std::size_t remedy = message.find("; ", problem);
  if (remedy == std::string::npos || remedy + 2 >= message.size()) return {};
  Report report;
  int end = 0;
  const std::string place = message.substr(0, pointer);
  if (std::sscanf(place.c_str(), "s.json:%ld:%ld%n", &report.line, &report.column, &end) == 2)
    return end == static_cast<int>(place.size()) ? std::optional(report) : std::nullopt;
  return place == "s.json" ? std::optional(report) : std::nullopt;
}

TEST(SceneFuzz, DamagedScenesAreReadOrRefused) {
  const std::string text = read_file(std::string(PIECEWORK_SOURCE_DIR) + "/scenes/trampoline.json");
  Random random(11);
  int read = 0, refused = 0;
  for (int i = 0; i < 2000; ++i) {
    std::string damaged = text;
    for (std::size_t times = 1 + below(random, 3); times > 0 && !damaged.empty(); --times)
      damaged = mutated(damaged, random);
    try {
      (void)resolved_json(parse_scene(damaged, "s.json"));
      ++read;
    } catch (const InputError& error) {
      EXPECT_TRUE(parsed(error.what())) << error.what();
      ++refused;
    }
  }
  EXPECT_GT(read, 100);
  EXPECT_GT(refused, 500);
}

// The place of every syntax error must be inside the text: the walk over the tokens that finds it
// has to end where nlohmann's parser did.
TEST(SceneFuzz, PlacesAreInsideTheText) {
  const std::string text = read_file(std::string(PIECEWORK_SOURCE_DIR) + "/scenes/two_sheets.json");
  Random random(12);
  int places = 0;
  for (int i = 0; i < 500; ++i) {
    const std::string damaged = mutated(text, random);
    try {
      (void)parse_scene(damaged, "s.json");
    } catch (const InputError& error) {
      const Report place = parsed(error.what()).value_or(Report{});
      const long lines = 1 + std::count(damaged.begin(), damaged.end(), '\n');
      EXPECT_LE(place.line, lines) << error.what();
      EXPECT_LE(place.column, 121) << error.what();
      if (place.line > 0) ++places;
    }
  }
  EXPECT_GT(places, 200);
}

TEST(SceneFuzz, DamagedOverridesAreReadOrRefused) {
  const std::string text = read_file(std::string(PIECEWORK_SOURCE_DIR) + "/scenes/trampoline.json");
  const std::vector<std::string> paths = {"solver.domains", "/cloths/0/pins/0/region",
                                          "gravity",        "materials.rubber.bending",
                                          "expect.0",       "name"};
  const std::vector<std::string> values = {
      "{\"sets\": [\"left\"]}", "[0, -9.81, 0]", "1e-3", "\"quoted\"", "plain text", "null"};
  Random random(13);
  int read = 0, refused = 0;
  for (int i = 0; i < 500; ++i) {
    std::string path = paths[below(random, paths.size())];
    std::string value = values[below(random, values.size())];
    (random.uniform() < 0.3 ? path : value) =
        mutated(random.uniform() < 0.3 ? path : value, random);
    try {
      (void)resolved_json(parse_scene(text, "s.json", {{path, value}}));
      ++read;
    } catch (const InputError&) {
      ++refused;
    }
  }
  EXPECT_GT(read, 20);
  EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace piecework::scene
