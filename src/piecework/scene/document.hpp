#pragma once

// Private to the module: JSON text as a tree of values that remember where they were written.

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace piecework::scene {

/// Where a value was written. Line and column count from 1, columns in characters; line 0: the
/// source is an override, which has no lines.
struct Place {
  std::uint32_t source = 0;  ///< index into Document::sources
  std::uint32_t line = 0;
  std::uint32_t column = 0;
};

struct Node;
using List = std::vector<Node>;
struct Object {
  List members;
};

struct Node {
  std::variant<std::nullptr_t, bool, double, std::string, List, Object> data;
  Place place;
  std::string key;  ///< of members of objects
  Place key_place;

  [[nodiscard]] bool is_null() const { return std::holds_alternative<std::nullptr_t>(data); }
  [[nodiscard]] const List* list() const { return std::get_if<List>(&data); }
  /// Members in the order of the text, or nullptr if this is no object.
  [[nodiscard]] const List* object() const {
    const Object* object = std::get_if<Object>(&data);
    return object ? &object->members : nullptr;
  }
  /// Value of a member, or nullptr if this is no object or has no such member.
  [[nodiscard]] const Node* find(std::string_view name) const;
};

struct Document {
  std::vector<std::string> sources;  ///< file name first, then one per override
  Node root;
};

/// Larger texts, deeper nesting and more values than this are refused.
inline constexpr std::size_t kMaxTextBytes = std::size_t{64} << 20;
inline constexpr std::size_t kMaxDepth = 64;
inline constexpr std::size_t kMaxValues = 2'000'000;

/// Parses JSON with // and /* */ comments.
/// \throws InputError with line, column and pointer: syntax errors, numbers that overflow,
///         duplicate keys, and the limits above.
Document parse_document(std::string_view text, const std::string& source);

/// Sets the value at `path` (dotted or a JSON pointer), making objects on the way where there is
/// nothing yet. `value` is JSON, or a plain string if it is not.
/// \throws InputError if the path is malformed, leads through a scalar or past the end of a list.
/// \param source  how messages about the value begin; empty: "--set path=value".
void apply_override(Document& document, const std::string& path, const std::string& value,
                    const std::string& source = "");

/// Throws "<source>:<line>:<column>: <pointer>: <problem>; <remedy>". The root's pointer is printed
/// as "/".
[[noreturn]] void fail(const Document& document, const Place& place, const std::string& pointer,
                       const std::string& problem, const std::string& remedy);

/// The same for whatever is at `pointer`, or the nearest existing value above it.
[[noreturn]] void fail(const Document& document, const std::string& pointer,
                       const std::string& problem, const std::string& remedy);

/// One step of a JSON pointer: "/" and the key with ~ and / escaped.
std::string pointer_step(std::string_view key);

/// `text` fit for a message: control characters escaped, at most `max_length` characters.
std::string printable(std::string_view text, std::size_t max_length = 60);

/// What a value is, for messages: "the number 3", "the text \"abc\"", "a list", ...
std::string describe(const Node& node);

}  // namespace piecework::scene
