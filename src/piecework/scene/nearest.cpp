#include <piecework/scene/nearest.hpp>

#include <algorithm>

#include <fmt/format.h>

#include <piecework/scene/document.hpp>

namespace piecework::scene {
namespace {

constexpr std::size_t kMaxLength = 100;

std::string plain(std::string_view name) {
  std::string out(name);
  for (char& c : out) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    if (c == '-' || c == ' ') c = '_';
  }
  return out;
}

}  // namespace

std::size_t edit_distance(std::string_view first, std::string_view second) {
  const std::string a = plain(first), b = plain(second);
  std::vector<std::size_t> before_last(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    before_last.swap(last);
    last.swap(row);
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, replaced});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before_last[j - 2] + 1);
    }
  }
  return row[b.size()];
}

std::string nearest(std::string_view name, const std::vector<std::string>& candidates) {
  std::string best;
  std::size_t best_distance = kMaxLength;
  for (const std::string& candidate : candidates) {
    const std::size_t length = std::max(name.size(), candidate.size());
    if (length > kMaxLength) continue;
    const std::size_t distance = edit_distance(name, candidate);
    if (distance * 5 <= length * 2 && distance < best_distance) {
      best = candidate;
      best_distance = distance;
    }
  }
  return best;
}

std::string suggestion(std::string_view name, const std::vector<std::string>& candidates,
                       const std::string& what) {
  if (const std::string best = nearest(name, candidates); !best.empty())
    return fmt::format("did you mean \"{}\"?", printable(best));
  constexpr std::size_t kMaxListed = 30;
  std::string text = fmt::format("known {}: ", what);
  for (std::size_t i = 0; i < candidates.size() && i < kMaxListed; ++i)
    text += (i > 0 ? ", " : "") + printable(candidates[i]);
  return text + (candidates.size() > kMaxListed ? ", ..." : "");
}

}  // namespace piecework::scene
