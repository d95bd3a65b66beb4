#include <piecework/runner/cells.hpp>

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace piecework::runner {

std::string three_digits(double value) {
  if (value == 0) return "0";
  if (!std::isfinite(value)) return kOff;
  const double size = std::abs(value);
  if (size < 1e-3 || size >= 1e6) return fmt::format("{:.2e}", value);
  const int decimals = std::max(0, 2 - static_cast<int>(std::floor(std::log10(size))));
  return fmt::format("{:.{}f}", value, decimals);
}

std::string plain_cell(const std::string& name) {
  std::string text;
  for (const char c : name) text += c == '|' ? std::string("\\|") : std::string(1, c);
  return text;
}

std::string median_cell(const MedianInterval& median) {
  if (median.count == 0) return kOff;
  if (median.count < kMinSamplesForInterval) return three_digits(median.median);
  return fmt::format("{} [{}-{}]", three_digits(median.median), three_digits(median.low),
                     three_digits(median.high));
}

std::string list_of(const std::string& json) {
  std::string text;
  const auto object = nlohmann::ordered_json::parse(json);
  for (const auto& [key, value] : object.items())
    text +=
        fmt::format("- {}: {}\n", key, value.is_string() ? value.get<std::string>() : value.dump());
  return text;
}

std::string csv_number(double value) {
  return std::isfinite(value) ? fmt::format("{:.9g}", value) : "";
}

}  // namespace piecework::runner
