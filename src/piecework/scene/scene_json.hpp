#pragma once

// Private to the module, and included by .cpp files only: values of scene members as JSON.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace piecework::scene {

/// Objects keep the order in which their keys were added.
using OrderedJson = nlohmann::ordered_json;

/// A member as it is written in a scene; null for an absent optional.
template <class T>
OrderedJson to_json_value(const T& value) {
  return OrderedJson(value);
}
template <class T>
OrderedJson to_json_value(const std::optional<T>& value) {
  return value ? to_json_value(*value) : OrderedJson(nullptr);
}

/// True if leaving the key out says the same: an absent optional, an empty text or list.
template <class T>
bool says_nothing(const T&) {
  return false;
}
template <class T>
bool says_nothing(const std::optional<T>& value) {
  return !value;
}
template <class T>
bool says_nothing(const std::vector<T>& value) {
  return value.empty();
}
inline bool says_nothing(const std::string& value) { return value.empty(); }

/// JSON text with two spaces per level and lists of plain values on one line, newline at the end.
std::string to_text(const OrderedJson& json);

}  // namespace piecework::scene
