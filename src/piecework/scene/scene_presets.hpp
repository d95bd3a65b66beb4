#pragma once

// Private to the module, and included by .cpp files only: presets in words.

#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <piecework/scene/scene_fields.hpp>
#include <piecework/scene/scene_json.hpp>

namespace piecework::scene {

/// Visitor: the plain keys of a struct with their values as JSON text, in the order of the table.
struct PlainValues {
  std::vector<std::pair<std::string, std::string>> items;

  void about(const char*, const char*) {}
  void exactly_one(const Names&) {}
  void at_least_one(const Names&) {}
  template <class T>
  void value(const Key& key, T& member, const Range& = {}) {
    items.emplace_back(key.name, to_json_value(member).dump());
  }
  void choice(const Key& key, std::string& member, const Choices&) { value(key, member); }
  template <class T>
  void preset(const Key&, std::string&, T&, const Presets<T>&) {}
  template <class T>
  void object(const Key&, T&) {}
  template <class T>
  void list(const Key&, T&) {}
  template <class T>
  void map(const Key&, T&) {}

  template <class T>
  static PlainValues of(T target) {
    PlainValues visitor;
    fields(visitor, target);
    return visitor;
  }
};

/// "stop "error", tolerance 0.1": what a preset sets to other values than the defaults.
template <class T>
std::string preset_values(const Preset<T>& preset) {
  const PlainValues defaults = PlainValues::of(T{}), set = PlainValues::of(preset.values);
  std::string text;
  for (std::size_t i = 0; i < set.items.size(); ++i)
    if (set.items[i] != defaults.items[i])
      text +=
          fmt::format("{}{} {}", text.empty() ? "" : ", ", set.items[i].first, set.items[i].second);
  return text.empty() ? "the defaults of the other keys" : text;
}

/// The presets as the values of a choice.
template <class T>
Choices preset_choices(const Presets<T>& presets) {
  Choices choices;
  for (const Preset<T>& preset : presets)
    choices.push_back({preset.name, fmt::format("{}: {}", preset.doc, preset_values(preset))});
  return choices;
}

}  // namespace piecework::scene
