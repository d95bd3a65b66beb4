#include "seam_file.hpp"

#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>

namespace piecework::runner {
namespace {

using Json = nlohmann::json;

FileSeam chains_of(const Json& seam, std::size_t number) {
  const Json& a = seam.at("a");
  const Json& b = seam.at("b");
  FileSeam result;
  result.name = fmt::format("seam {}", number);
  if (a.contains("panel") && b.contains("panel"))
    result.name += fmt::format(" ({} to {})", a.at("panel").get<std::string>(),
                               b.at("panel").get<std::string>());
  result.chain = a.at("verts").get<std::vector<int>>();
  result.to_chain = b.at("verts").get<std::vector<int>>();
  return result;
}

std::vector<std::array<double, 4>> stitches_of(const Json& list, const std::string& where) {
  const auto stitches = list.get<std::vector<std::array<double, 4>>>();
  for (const auto& stitch : stitches)
    for (std::size_t k = 0; k < 3; ++k)
      if (!(stitch[k] >= 0 && stitch[k] <= std::numeric_limits<int>::max() &&
            stitch[k] == std::floor(stitch[k])))
        throw InputError(fmt::format(
            "{}: {} is no vertex number; stitches are [vertex, a, b, ratio]", where, stitch[k]));
  return stitches;
}

}  // namespace

std::vector<FileSeam> read_seam_file(const std::string& path) {
  std::vector<FileSeam> seams;
  try {
    const Json json = Json::parse(read_file(path));
    for (const Json& seam : json.value("seams", Json::array()))
      seams.push_back(chains_of(seam, seams.size()));
    for (const Json& stitches : json.value("seam_stitches", Json::array())) {
      FileSeam seam;
      seam.name = fmt::format("seam {}", seams.size());
      seam.stitches = stitches_of(stitches, fmt::format("{}: {}", path, seam.name));
      seams.push_back(std::move(seam));
    }
  } catch (const Json::exception& error) {
    throw InputError(fmt::format("{}: no sewing pattern ({}); see `file` of Seam in docs/scene.md",
                                 path, error.what()));
  }
  if (seams.empty())
    throw InputError(
        fmt::format("{}: has neither \"seams\" nor \"seam_stitches\"; name another file", path));
  return seams;
}

}  // namespace piecework::runner
