#include <piecework/colliders/sequence.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/error.hpp>

namespace piecework::colliders {
namespace {

constexpr int kMaxDigits = 20;
constexpr double kMaxNumbers = 1e9;  // 8 GB. Chosen.

/// Digits that "", ":04" or ":04d" asks for, or -1.
int digits_of(std::string_view format) {
  if (format.empty()) return 1;
  if (!format.starts_with(":0")) return -1;
  format.remove_prefix(2);
  if (format.ends_with('d')) format.remove_suffix(1);
  int digits = -1;
  const auto [end, error] = std::from_chars(format.data(), format.data() + format.size(), digits);
  const bool whole = error == std::errc() && end == format.data() + format.size();
  return whole && digits >= 1 && digits <= kMaxDigits ? digits : -1;
}

/// Frames in the order of time, |V| x 3 each.
struct Frames {
  std::vector<Positions> positions;
  double fps, start;

  void at(double time, Positions& out) const {
    const double last = static_cast<double>(positions.size() - 1);
    const double place = std::clamp((time - start) * fps, 0.0, last);
    const auto before = static_cast<std::size_t>(std::floor(place));
    const double share = place - std::floor(place);
    out = positions[before];
    if (share > 0) out += share * (positions[before + 1] - positions[before]);
  }
};

}  // namespace

std::string frame_file(const std::string& pattern, int frame) {
  const std::size_t open = pattern.find('{');
  const std::size_t close = pattern.find('}');
  const bool once = open != std::string::npos && close != std::string::npos && open < close &&
                    pattern.find('{', open + 1) == std::string::npos &&
                    pattern.find('}', close + 1) == std::string::npos;
  const int digits =
      once ? digits_of(std::string_view(pattern).substr(open + 1, close - open - 1)) : -1;
  if (digits < 0)
    throw InputError(fmt::format(
        "{}: no single place for the number of the frame; write one, as in frame_{{:04}}.obj",
        pattern));
  return fmt::format("{}{:0{}}{}", pattern.substr(0, open), frame, digits,
                     pattern.substr(close + 1));
}

MeshSequence load_sequence(const SequenceFiles& files) {
  if (files.last < files.first)
    throw InputError(fmt::format("{}: the last frame ({}) comes before the first one ({})",
                                 files.pattern, files.last, files.first));
  mesh::MeshDocument first =
      mesh::import_mesh(frame_file(files.pattern, files.first), files.import);
  const double count = files.last - files.first + 1.0;
  if (count * static_cast<double>(first.mesh.positions.size()) > kMaxNumbers)
    throw InputError(
        fmt::format("{}: {} frames of {} vertices take more than 8 GB; give fewer or simpler ones",
                    files.pattern, count, first.mesh.num_vertices()));
  const auto frames = std::make_shared<Frames>();
  frames->fps = files.fps;
  frames->start = files.start;
  frames->positions.push_back(first.mesh.positions);
  for (int frame = files.first + 1; frame <= files.last; ++frame) {
    const std::string file = frame_file(files.pattern, frame);
    frames->positions.push_back(
        mesh::corresponding_positions(first, mesh::import_mesh(file, files.import), file));
  }
  return {std::move(first.mesh), [frames](double time, Positions& out) { frames->at(time, out); },
          std::move(first.notes)};
}

}  // namespace piecework::colliders
