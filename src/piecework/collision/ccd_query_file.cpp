#include <piecework/collision/ccd_query_file.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <gmpxx.h>

#include <piecework/core/error.hpp>

namespace piecework::collision {
namespace {

constexpr std::size_t kPoints = 8;  // lines of one query
constexpr std::size_t kFields = 7;

/// Where a complaint belongs.
struct Place {
  std::string file;
  std::size_t line = 0;

  [[noreturn]] void refuse(const std::string& what) const {
    throw InputError(fmt::format("{}:{}: {}", file, line, what));
  }
};

std::array<std::string_view, kFields> split(std::string_view line, const Place& place) {
  std::array<std::string_view, kFields> fields;
  const auto commas = static_cast<std::size_t>(std::count(line.begin(), line.end(), ','));
  if (commas + 1 != kFields)
    place.refuse(fmt::format("{} fields; write {}: numerator, denominator of x, y, z, then truth",
                             commas + 1, kFields));
  for (std::string_view& field : fields) {
    const auto end = std::min(line.find(','), line.size());
    field = line.substr(0, end);
    line.remove_prefix(std::min(end + 1, line.size()));
    const auto first = field.find_first_not_of(" \t");
    field = first == std::string_view::npos
                ? std::string_view()
                : field.substr(first, field.find_last_not_of(" \t") + 1 - first);
  }
  return fields;
}

mpz_class parse_integer(std::string_view text, const Place& place) {
  const std::string_view digits = text.substr(text.starts_with('-') ? 1 : 0);
  if (digits.empty() || digits.find_first_not_of("0123456789") != std::string_view::npos)
    place.refuse(fmt::format("\"{}\" is no integer; write digits with or without a minus", text));
  return mpz_class(std::string(text));
}

/// The double nearest to q, no larger than the largest double; the even one of two.
double nearest(const mpq_class& q) {
  const double low = q.get_d();  // truncated
  if (q == low) return low;
  const double high = std::nextafter(low, sgn(q) * std::numeric_limits<double>::infinity());
  const mpq_class middle = (mpq_class(low) + mpq_class(high)) / 2;
  const int side = cmp(abs(q), abs(middle));
  if (side != 0) return side < 0 ? low : high;
  return std::bit_cast<std::uint64_t>(low) % 2 == 0 ? low : high;
}

double parse_coordinate(std::string_view numerator, std::string_view denominator,
                        std::size_t& rounded, const Place& place) {
  const mpz_class below = parse_integer(denominator, place);
  if (below == 0) place.refuse("a denominator is zero; write another");
  mpq_class q(parse_integer(numerator, place), below);
  q.canonicalize();
  if (abs(q) > std::numeric_limits<double>::max())
    place.refuse("a coordinate is beyond the largest double; scale it");
  const double value = nearest(q);
  rounded += q == value ? 0 : 1;
  return value;
}

bool parse_truth(std::string_view text, const Place& place) {
  if (text != "0" && text != "1")
    place.refuse(fmt::format("truth \"{}\"; write 0 (no meeting) or 1", text));
  return text == "1";
}

}  // namespace

CcdQueryFile read_ccd_queries(const std::filesystem::path& path, PairKind kind) {
  std::ifstream stream(path);
  if (!stream) throw InputError(fmt::format("{}: cannot be read; check the name", path.string()));
  CcdQueryFile file;
  Place place{path.string()};
  std::size_t points = 0;
  for (std::string line; std::getline(stream, line);) {
    ++place.line;
    if (line.ends_with('\r')) line.pop_back();
    if (line.empty() && stream.peek() == std::ifstream::traits_type::eof()) break;
    const auto fields = split(line, place);
    const bool truth = parse_truth(fields[6], place);
    if (points % kPoints == 0) {
      file.queries.emplace_back().kind = kind;
      file.truth.push_back(truth ? 1 : 0);
    } else if (truth != (file.truth.back() != 0)) {
      place.refuse("truth differs from the line above; the eight lines of a query have the same");
    }
    const std::size_t point = points++ % kPoints;
    CcdQuery& q = file.queries.back();
    Vec3& x = point < 4 ? q.start[point] : q.end[point - 4];
    for (std::size_t k = 0; k < 3; ++k)
      x[static_cast<int>(k)] =
          parse_coordinate(fields[2 * k], fields[2 * k + 1], file.rounded_coordinates, place);
  }
  if (points == 0) throw InputError(fmt::format("{}: no queries; write some", place.file));
  if (points % kPoints != 0)
    place.refuse(
        fmt::format("the last query has {} of 8 points; add the others", points % kPoints));
  return file;
}

}  // namespace piecework::collision
