#include <piecework/scene/document.hpp>

#include <charconv>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/scene/json_parser.hpp>

namespace piecework::scene {
namespace {

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> parts(1);
  for (char c : text) {
    if (c == separator)
      parts.emplace_back();
    else
      parts.back().push_back(c);
  }
  return parts;
}

std::string unescape(std::string_view step) {
  std::string key;
  for (std::size_t i = 0; i < step.size(); ++i) {
    const bool escape = step[i] == '~' && i + 1 < step.size();
    if (escape && step[i + 1] == '1')
      key += '/', ++i;
    else if (escape && step[i + 1] == '0')
      key += '~', ++i;
    else
      key += step[i];
  }
  return key;
}

/// Steps of "a.b.0" or "/a/b/0".
std::vector<std::string> parse_path(std::string_view path) {
  if (path.empty() || path.front() != '/') return split(path, '.');
  std::vector<std::string> steps = split(path.substr(1), '/');
  for (std::string& step : steps) step = unescape(step);
  return steps;
}

bool is_index(const std::string& step) {
  return !step.empty() && step.find_first_not_of("0123456789") == std::string::npos;
}

std::string override_source(const std::string& path, const std::string& value) {
  return fmt::format("--set {}={}", printable(path), printable(value));
}

Node* member(Object& object, const std::string& key) {
  for (Node& node : object.members)
    if (node.key == key) return &node;
  return nullptr;
}

/// The child of `node` that the override goes through next; makes it where there is none.
Node& descend(Document& document, Node& node, const Place& place, const std::string& pointer,
              const std::string& step) {
  if (node.is_null() && node.place.line == 0 && node.place.source == place.source) {
    if (is_index(step))
      node.data = List{};
    else
      node.data = Object{};
  }
  if (auto* object = std::get_if<Object>(&node.data)) {
    if (Node* found = member(*object, step)) return *found;
    object->members.push_back({nullptr, place, step, place});
    return object->members.back();
  }
  auto* list = std::get_if<List>(&node.data);
  if (list == nullptr)
    fail(document, place, pointer, fmt::format("is {}, it has no \"{}\"", describe(node), step),
         "set the whole value, or correct the path");
  std::size_t index = list->size() + 1;
  if (is_index(step)) std::from_chars(step.data(), step.data() + step.size(), index);
  if (index > list->size())
    fail(document, place, pointer,
         fmt::format("has no item \"{}\", it is a list of {}", printable(step), list->size()),
         list->empty()
             ? "set the whole list"
             : fmt::format("use a number from 0 to {}, {} to append, or set the whole list",
                           list->size() - 1, list->size()));
  if (index == list->size()) list->push_back({nullptr, place, {}, {}});
  return (*list)[index];
}

}  // namespace

const Node* Node::find(std::string_view name) const {
  if (const List* members = object())
    for (const Node& member : *members)
      if (member.key == name) return &member;
  return nullptr;
}

Document parse_document(std::string_view text, const std::string& source) {
  Document document;
  document.sources.push_back(source);
  document.root = parse_json(document, text, "");
  return document;
}

void apply_override(Document& document, const std::string& path, const std::string& value,
                    const std::string& source) {
  const Place place{static_cast<std::uint32_t>(document.sources.size()), 0, 0};
  document.sources.push_back(source.empty() ? override_source(path, value) : source);
  const std::vector<std::string> steps = parse_path(path);
  std::string pointer;
  for (const std::string& step : steps) {
    if (step.empty() || steps.size() > kMaxDepth)
      fail(document, place, pointer, "the path of the override is malformed",
           "write it like solver.domains=16 or cloths.0.pins.0.stop=2");
    pointer += pointer_step(step);
  }
  Node parsed = parse_override(document, value, pointer);

  Node* node = &document.root;
  pointer.clear();
  for (const std::string& step : steps) {
    node = &descend(document, *node, place, pointer, step);
    pointer += pointer_step(step);
  }
  node->data = std::move(parsed.data);
  node->place = place;
}

void fail(const Document& document, const Place& place, const std::string& pointer,
          const std::string& problem, const std::string& remedy) {
  std::string where = document.sources.at(place.source);
  if (place.line > 0) where += fmt::format(":{}:{}", place.line, place.column);
  constexpr std::size_t kMaxPointer = 200;
  const std::string what = pointer.empty() ? "/" : printable(pointer, kMaxPointer);
  throw InputError(fmt::format("{}: {}: {}; {}", where, what, problem, remedy));
}

void fail(const Document& document, const std::string& pointer, const std::string& problem,
          const std::string& remedy) {
  const Node* node = &document.root;
  if (!pointer.empty()) {
    for (const std::string& step : parse_path(pointer)) {
      const Node* child = node->find(step);
      std::size_t index = 0;
      if (const List* list = node->list();
          list && std::from_chars(step.data(), step.data() + step.size(), index).ec == std::errc{})
        child = index < list->size() ? &(*list)[index] : nullptr;
      if (child == nullptr) break;
      node = child;
    }
  }
  fail(document, node->place, pointer, problem, remedy);
}

std::string pointer_step(std::string_view key) {
  std::string step = "/";
  for (char c : key) {
    if (c == '~')
      step += "~0";
    else if (c == '/')
      step += "~1";
    else
      step += c;
  }
  return step;
}

std::string printable(std::string_view text, std::size_t max_length) {
  std::string out;
  std::size_t characters = 0;
  for (char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool continuation = (byte & 0xC0U) == 0x80U;
    if (!continuation && ++characters > max_length) return out + "...";
    if (byte < 0x20 || byte == 0x7F)
      out += fmt::format("\\x{:02x}", byte);
    else
      out += c;
  }
  return out;
}

std::string describe(const Node& node) {
  if (node.is_null()) return "null";
  if (node.list()) return "a list";
  if (node.object()) return "an object";
  if (const bool* truth = std::get_if<bool>(&node.data)) return *truth ? "true" : "false";
  if (const double* number = std::get_if<double>(&node.data))
    return fmt::format("the number {}", *number);
  return fmt::format("the text \"{}\"", printable(std::get<std::string>(node.data)));
}

}  // namespace piecework::scene
