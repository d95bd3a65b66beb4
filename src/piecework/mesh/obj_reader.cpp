#include <piecework/mesh/obj_reader.hpp>

#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <vector>

#include <fmt/format.h>

#include <piecework/core/error.hpp>

namespace piecework::mesh {
namespace {

/// Splits the text into lines of words: "\" at the end of a line joins the next, "#" starts a
/// comment.
class LineReader {
 public:
  explicit LineReader(std::string_view text) : rest_(text) {
    constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
    if (rest_.starts_with(kByteOrderMark)) rest_.remove_prefix(kByteOrderMark.size());
  }

  /// Reads the words of the next line; false at the end of the text.
  bool next(std::vector<std::string_view>& words) {
    words.clear();
    if (rest_.empty()) return false;
    first_line_ = last_line_ + 1;
    while (!rest_.empty() && read_physical_line(words)) {
    }
    return true;
  }

  /// Number of the line last read, from 1 (the first one of joined lines).
  [[nodiscard]] int line() const { return first_line_; }

 private:
  /// Appends the words up to the next line break; true if the line is continued.
  bool read_physical_line(std::vector<std::string_view>& words) {
    ++last_line_;
    const std::size_t end = rest_.find('\n');
    std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    while (!line.empty() && is_space(line.back())) line.remove_suffix(1);
    const bool continued = !line.empty() && line.back() == '\\';
    if (continued) line.remove_suffix(1);
    for (std::size_t i = 0; i < line.size();) {
      if (is_space(line[i])) {
        ++i;
        continue;
      }
      if (line[i] == '#') return false;
      std::size_t stop = i;
      while (stop < line.size() && !is_space(line[stop])) ++stop;
      words.push_back(line.substr(i, stop - i));
      i = stop;
    }
    return continued;
  }

  static bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v'; }

  std::string_view rest_;
  int first_line_ = 0;
  int last_line_ = 0;
};

/// Bytes of a broken file that would garble a terminal are shown as '?'.
std::string printable(std::string_view word) {
  constexpr std::size_t kLongest = 40;
  std::string text(word.substr(0, kLongest));
  for (char& c : text) {
    if (c < 0x20 || c > 0x7e) c = '?';
  }
  return word.size() > kLongest ? text + "..." : text;
}

class ObjParser {
 public:
  ObjParser(const std::string& file, std::string_view text, std::size_t max_triangles)
      : lines_(text), guard_(file, max_triangles) {
    mesh_.file = file;
    mesh_.layout.polygon_begin.push_back(0);
  }

  RawMesh run() {
    while (lines_.next(words_)) {
      if (!words_.empty()) read_statement();
    }
    if (mesh_.num_polygons() == 0)
      throw InputError(
          fmt::format("{}: no faces; export the mesh with its faces ('f' lines)", mesh_.file));
    check_indices();
    finish_layout();
    return std::move(mesh_);
  }

 private:
  void read_statement() {
    const std::string_view keyword = words_.front();
    if (keyword == "v") {
      read_vertex();
    } else if (keyword == "vt") {
      read_texture_coordinate();
    } else if (keyword == "f") {
      read_face();
    } else if (keyword == "g" || keyword == "o") {
      read_group();
    } else if (keyword == "l" || keyword == "p") {
      ++num_skipped_elements_;
    }
  }

  [[noreturn]] void fail(const std::string& problem, const char* remedy) const {
    throw InputError(fmt::format("{}:{}: {}; {}", mesh_.file, lines_.line(), problem, remedy));
  }

  double number(std::string_view word) const {
    const std::string_view digits = word.starts_with('+') ? word.substr(1) : word;
    double value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error == std::errc::result_out_of_range) {
      value = std::strtod(std::string(digits).c_str(), nullptr);  // infinite, or 0 and denormals
    } else if (error != std::errc() || digits.empty()) {
      fail(fmt::format("'{}' is not a number", printable(word)), "correct or re-export the file");
    }
    if (error == std::errc() && end != digits.data() + digits.size())
      fail(fmt::format("'{}' is not a number", printable(word)), "correct or re-export the file");
    if (!std::isfinite(value))
      fail(fmt::format("'{}' is not a finite number", printable(word)),
           "correct the value, or remove the vertex and its faces");
    return value;
  }

  void read_vertex() {
    const std::size_t count = words_.size() - 1;
    if (count < 3)
      fail(fmt::format("vertex with {} coordinates, 3 are needed", count),
           "complete the line; the file may be truncated");
    if (count == 5 || count > 7)
      fail(fmt::format("vertex with {} numbers; x y z [w] [r g b] are allowed", count),
           "correct or re-export the file");
    std::array<double, 7> values{};
    for (std::size_t i = 0; i < count; ++i) values[i] = number(words_[i + 1]);
    mesh_.positions.emplace_back(values[0], values[1], values[2]);
    mesh_.vertex_line.push_back(lines_.line());
    guard_.check_vertices(mesh_.positions.size());
  }

  void read_texture_coordinate() {
    const std::size_t count = words_.size() - 1;
    if (count < 1 || count > 3)
      fail(fmt::format("texture coordinate with {} numbers, 2 are needed", count),
           "complete the line; the file may be truncated");
    const double u = number(words_[1]);
    const double v = count > 1 ? number(words_[2]) : 0.0;
    mesh_.layout.uv.emplace_back(u, v);
  }

  /// Index from 0 of a 1-based or negative (relative) reference. Positive ones may point ahead in
  /// the file and are checked at its end.
  int index(std::string_view word, std::size_t count, const char* what) const {
    long long value = 0;
    const char* last = word.data() + word.size();
    const auto [end, error] = std::from_chars(word.data(), last, value);
    const bool too_large = error == std::errc::result_out_of_range;
    if (word.empty() || end != last || (error != std::errc() && !too_large))
      fail(fmt::format("'{}' is not a {} index", printable(word), what),
           "correct or re-export the file");
    if (too_large || value > std::numeric_limits<int>::max())
      fail(fmt::format("{} index {} is out of range", what, printable(word)),
           "correct or re-export the file");
    if (value == 0)
      fail(fmt::format("{} index 0; OBJ counts from 1", what), "correct or re-export the file");
    if (value > 0) return static_cast<int>(value - 1);
    if (-value > static_cast<long long>(count))
      fail(fmt::format("{} index {} is out of range; {} are defined so far", what, value, count),
           "correct or re-export the file");
    return static_cast<int>(static_cast<long long>(count) + value);
  }

  void read_face() {
    const std::size_t corners = words_.size() - 1;
    if (corners < 3)
      fail(fmt::format("face with {} corner{}, at least 3 are needed", corners,
                       corners == 1 ? "" : "s"),
           "complete or remove the line; the file may be truncated");
    guard_.add_polygon(corners, "line", lines_.line());
    FileLayout& layout = mesh_.layout;
    start_group();
    for (std::size_t i = 1; i < words_.size(); ++i) {
      std::string_view word = words_[i];
      const std::size_t slash = word.find('/');
      layout.polygon_vertex.push_back(
          index(word.substr(0, slash), mesh_.positions.size(), "vertex"));
      word = slash == std::string_view::npos ? std::string_view() : word.substr(slash + 1);
      const std::string_view texture = word.substr(0, word.find('/'));
      layout.polygon_uv.push_back(
          texture.empty() ? -1 : index(texture, layout.uv.size(), "texture coordinate"));
    }
    layout.polygon_begin.push_back(static_cast<int>(layout.polygon_vertex.size()));
    mesh_.polygon_line.push_back(lines_.line());
  }

  void read_group() {
    group_.clear();
    for (std::size_t i = 1; i < words_.size(); ++i) {
      if (i > 1) group_ += ' ';
      group_ += words_[i];
    }
  }

  /// Opens a group at the next polygon unless it goes on with the one before.
  void start_group() {
    auto& groups = mesh_.layout.groups;
    if (groups.empty() || groups.back().name != group_)
      groups.push_back({group_, mesh_.num_polygons()});
  }

  void check_indices() const {
    const FileLayout& layout = mesh_.layout;
    for (int polygon = 0; polygon < mesh_.num_polygons(); ++polygon) {
      for (int c = layout.polygon_begin[polygon]; c < layout.polygon_begin[polygon + 1]; ++c) {
        check_index(layout.polygon_vertex[c], mesh_.positions.size(), "vertex", "vertices",
                    polygon);
        check_index(layout.polygon_uv[c], layout.uv.size(), "texture coordinate",
                    "texture coordinates", polygon);
      }
    }
  }

  void check_index(int index, std::size_t count, const char* what, const char* plural,
                   int polygon) const {
    if (index < static_cast<int>(count)) return;
    throw InputError(fmt::format(
        "{}:{}: {} index {} is out of range, the file has {} {}; correct or re-export the file",
        mesh_.file, mesh_.polygon_line[polygon], what, static_cast<long long>(index) + 1, count,
        plural));
  }

  void finish_layout() {
    FileLayout& layout = mesh_.layout;
    if (layout.groups.size() == 1 && layout.groups.front().name.empty()) layout.groups.clear();
    bool any_uv = false;
    for (int uv : layout.polygon_uv) any_uv = any_uv || uv >= 0;
    if (!any_uv) layout.polygon_uv.clear();
    if (num_skipped_elements_ > 0)
      mesh_.notes.push_back(
          fmt::format("skipped {} line and point elements", num_skipped_elements_));
  }

  RawMesh mesh_;
  LineReader lines_;
  SizeGuard guard_;
  std::vector<std::string_view> words_;
  std::string group_;
  int num_skipped_elements_ = 0;
};

}  // namespace

RawMesh read_obj(const std::string& file, std::string_view text, std::size_t max_triangles) {
  return ObjParser(file, text, max_triangles).run();
}

}  // namespace piecework::mesh
