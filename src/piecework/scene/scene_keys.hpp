#pragma once

// Private to the module: what the table of keys (scene_fields.hpp) says of a key.

#include <initializer_list>
#include <limits>
#include <string>
#include <vector>

namespace piecework::scene {

struct Key {
  const char* name;
  const char* doc;
  const char* unit = "";
  bool required = false;
  /// False: giving the key is an error, since other keys make it meaningless.
  bool applies = true;
  const char* condition = "";  ///< when it applies, in words
  bool on_by_default = false;  ///< an optional that only null switches off
  const char* since = "0.1";   ///< version of Piecework that knows the key first

  [[nodiscard]] Key needed() const {
    Key key = *this;
    key.required = true;
    return key;
  }
  [[nodiscard]] Key on() const {
    Key key = *this;
    key.on_by_default = true;
    return key;
  }
  [[nodiscard]] Key only(bool now, const char* when) const {
    Key key = *this;
    key.applies = now;
    key.condition = when;
    return key;
  }
};

/// Limits of a number, or of each number of a list; of the length of a text or list.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool above = false;      ///< min itself is outside
  bool not_empty = false;  ///< texts and lists
};

constexpr Range between(double min, double max) { return {min, max, false, false}; }
constexpr Range above(double min, double max) { return {min, max, true, false}; }
constexpr Range not_empty() {
  Range range;
  range.not_empty = true;
  return range;
}
constexpr Range indices() { return {0, std::numeric_limits<int>::max(), false, true}; }

/// Sane limits, chosen so that squares and products stay finite.
inline constexpr Range kLengths{-1e6, 1e6, false, false};  // m
inline constexpr Range kTimes{0, 1e9, false, false};       // s

struct Choice {
  std::string name;
  std::string doc;
};
using Choices = std::vector<Choice>;

/// A named set of defaults for one struct; members that a row leaves out keep their own.
template <class T>
struct Preset {
  const char* name;
  const char* doc;
  T values;
};
template <class T>
using Presets = std::vector<Preset<T>>;

using Names = std::initializer_list<const char*>;

}  // namespace piecework::scene
