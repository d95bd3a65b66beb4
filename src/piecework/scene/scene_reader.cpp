// Text -> Scene: a visitor of the table of keys that fills the members.

#include <cmath>
#include <filesystem>
#include <set>

#include <fmt/format.h>

#include <piecework/scene/document.hpp>
#include <piecework/scene/nearest.hpp>
#include <piecework/scene/scene_fields.hpp>
#include <piecework/scene/scene_io.hpp>
#include <piecework/scene/scene_rules.hpp>

namespace piecework::scene {
namespace {

/// Base of visitors that only look at the names of keys.
struct IgnoreRules {
  void about(const char*, const char*) {}
  void exactly_one(const Names&) {}
  void at_least_one(const Names&) {}
};

/// Names of the keys of one struct.
struct KeyNames : IgnoreRules {
  std::vector<std::string> names;
  template <class T>
  void value(const Key& key, T&, const Range& = {}) {
    names.emplace_back(key.name);
  }
  void choice(const Key& key, std::string&, const Choices&) { names.emplace_back(key.name); }
  template <class T>
  void preset(const Key& key, std::string&, T&, const Presets<T>&) {
    names.emplace_back(key.name);
  }
  template <class T>
  void object(const Key& key, T&) {
    names.emplace_back(key.name);
  }
  template <class T>
  void list(const Key& key, T&) {
    names.emplace_back(key.name);
  }
  template <class T>
  void map(const Key& key, T&) {
    names.emplace_back(key.name);
  }
};

/// The first place in the whole scene that knows the key `wanted`, dotted; "cloths.0.pins".
struct KeyFinder : IgnoreRules {
  std::string wanted, path, found;
  void see(const Key& key) {
    if (found.empty() && wanted == key.name) found = path + key.name;
  }
  template <class T>
  void enter(const Key& key, T& member, const std::string& item) {
    see(key);
    const std::string outer = path;
    path += key.name + item + ".";
    fields(*this, member);
    path = outer;
  }
  template <class T>
  void value(const Key& key, T&, const Range& = {}) {
    see(key);
  }
  void choice(const Key& key, std::string&, const Choices&) { see(key); }
  template <class T>
  void preset(const Key& key, std::string&, T&, const Presets<T>&) {
    see(key);
  }
  template <class T>
  void object(const Key& key, T& member) {
    enter(key, member, "");
  }
  template <class T>
  void object(const Key& key, std::optional<T>&) {
    T member;
    enter(key, member, "");
  }
  template <class T>
  void list(const Key& key, std::vector<T>&) {
    T member;
    enter(key, member, ".0");
  }
  template <class T>
  void map(const Key& key, std::map<std::string, T>&) {
    T member;
    enter(key, member, ".NAME");
  }
};

std::string quoted(const Names& names, const char* joint) {
  std::string text;
  for (const char* name : names) text += fmt::format("{}\"{}\"", text.empty() ? "" : joint, name);
  return text;
}

std::string range_words(const Range& range, bool integer) {
  const bool low = std::isfinite(range.min);
  const bool high =
      std::isfinite(range.max) && !(integer && range.max >= std::numeric_limits<int>::max());
  std::string text;
  if (low) text += fmt::format("{} {}", range.above ? "above" : "of at least", range.min);
  if (high) text += fmt::format("{}at most {}", low ? " and " : "of ", range.max);
  return text;
}

/// A pointer that costs nothing until it is needed: a chain of steps on the stack.
struct Trail {
  const Trail* parent = nullptr;
  std::string_view key;
  std::size_t index = 0;

  [[nodiscard]] std::string text() const {
    if (parent == nullptr) return "";
    return parent->text() + (key.data() ? pointer_step(key) : fmt::format("/{}", index));
  }
};

class Reader {
 public:
  Reader(const Document& document, const Node& node, const Trail& trail)
      : document_(document), node_(node), trail_(trail) {}

  /// Fills `target`, a struct with fields(), from this reader's object.
  template <class T>
  void read_struct(T& target) {
    if (node_.object() == nullptr)
      wrong_type(node_, trail_, "an object", "write { \"key\": value, ... }");
    refuse_unknown(target);
    fields(*this, target);
  }

  void about(const char*, const char*) {}

  template <class T>
  void value(const Key& key, T& member, const Range& range = {}) {
    if (const Node* node = given(key)) read(*node, {&trail_, key.name}, member, range);
  }

  void choice(const Key& key, std::string& member, const Choices& choices) {
    const Node* node = given(key);
    if (node == nullptr) return;
    const Trail trail{&trail_, key.name};
    read(*node, trail, member, {});
    std::vector<std::string> names;
    for (const Choice& choice : choices) {
      if (member == choice.name) return;
      names.emplace_back(choice.name);
    }
    stop(*node, trail, fmt::format("unknown value \"{}\"", printable(member)),
         suggestion(member, names, "values"));
  }

  /// Keys declared later overwrite what the preset set, in whatever order the text has them.
  template <class T>
  void preset(const Key& key, std::string& member, T& target, const Presets<T>& presets) {
    Choices choices;
    for (const Preset<T>& preset : presets) choices.push_back({preset.name, preset.doc});
    choice(key, member, choices);
    const std::string chosen = member;  // a member of target
    for (const Preset<T>& preset : presets)
      if (chosen == preset.name) target = preset.values;
    member = chosen;
  }

  template <class T>
  void object(const Key& key, T& member) {
    if (const Node* node = given(key)) nested(*node, {&trail_, key.name}, member);
  }

  template <class T>
  void object(const Key& key, std::optional<T>& member) {
    const Node* node = given(key);
    if (node == nullptr) return;
    member.reset();
    if (!node->is_null()) nested(*node, {&trail_, key.name}, member.emplace());
  }

  template <class T>
  void list(const Key& key, std::vector<T>& member) {
    const Node* node = given(key);
    if (node == nullptr) return;
    const Trail trail{&trail_, key.name};
    const List& items = expect_list(*node, trail);
    if (key.required && items.empty())
      stop(*node, trail, fmt::format("\"{}\" is empty", key.name), "list at least one");
    member.clear();
    for (std::size_t i = 0; i < items.size(); ++i)
      nested(items[i], {&trail, {}, i}, member.emplace_back());
  }

  template <class T>
  void map(const Key& key, std::map<std::string, T>& member) {
    const Node* node = given(key);
    if (node == nullptr) return;
    const Trail trail{&trail_, key.name};
    const List* members = node->object();
    if (members == nullptr)
      wrong_type(*node, trail, "an object of named entries", "write { \"name\": { ... }, ... }");
    if (key.required && members->empty())
      stop(*node, trail, fmt::format("\"{}\" is empty", key.name), "define at least one");
    member.clear();
    for (const Node& entry : *members) {
      if (entry.key.empty())
        fail(document_, entry.key_place, trail.text(), "an entry without a name", "name it");
      nested(entry, {&trail, entry.key}, member[entry.key]);
    }
  }

  void exactly_one(const Names& names) const {
    const int count = count_given(names);
    if (count == 0)
      stop(node_, trail_, fmt::format("neither {} is given", quoted(names, " nor ")), "give one");
    if (count > 1)
      stop(node_, trail_, fmt::format("{} exclude each other", quoted(names, " and ")),
           "remove one");
  }

  void at_least_one(const Names& names) const {
    if (count_given(names) == 0)
      stop(node_, trail_, fmt::format("{} is missing", quoted(names, " or ")), "give at least one");
  }

 private:
  /// The value of a key if it is given. Refuses missing keys and keys that do not apply.
  const Node* given(const Key& key) const {
    const Node* node = node_.find(key.name);
    if (node == nullptr && key.required)
      fail(document_, node_.place, trail_.text(), fmt::format("\"{}\" is missing", key.name),
           fmt::format("add it: {}", key.doc));
    if (node != nullptr && !key.applies)
      stop(*node, {&trail_, key.name},
           fmt::format("\"{}\" has no effect here, it belongs to {}", key.name, key.condition),
           "remove it");
    return node;
  }

  int count_given(const Names& names) const {
    int count = 0;
    for (const char* name : names) {
      const Node* node = node_.find(name);
      if (node != nullptr && !node->is_null()) ++count;
    }
    return count;
  }

  template <class T>
  void refuse_unknown(T& target) const {
    KeyNames known;
    fields(known, target);
    const std::set<std::string> names(known.names.begin(), known.names.end());
    for (const Node& member : *node_.object()) {
      if (names.contains(member.key)) continue;
      fail(document_, member.key_place, Trail{&trail_, member.key}.text(),
           fmt::format("unknown key \"{}\"", printable(member.key)),
           remedy(member.key, known.names));
    }
  }

  static std::string remedy(const std::string& key, const std::vector<std::string>& names) {
    if (nearest(key, names).empty()) {
      KeyFinder finder;
      finder.wanted = key;
      Scene scene;
      fields(finder, scene);
      if (!finder.found.empty()) return fmt::format("did you mean \"{}\"?", finder.found);
    }
    return suggestion(key, names, "keys here");
  }

  template <class T>
  void nested(const Node& node, const Trail& trail, T& member) const {
    Reader(document_, node, trail).read_struct(member);
  }

  void read(const Node& node, const Trail& trail, double& member, const Range& range) const {
    member = number(node, trail, range, /*integer=*/false);
  }

  void read(const Node& node, const Trail& trail, int& member, const Range& range) const {
    Range limits = range;
    limits.min = std::max<double>(range.min, std::numeric_limits<int>::min());
    limits.max = std::min<double>(range.max, std::numeric_limits<int>::max());
    member = static_cast<int>(number(node, trail, limits, /*integer=*/true));
  }

  void read(const Node& node, const Trail& trail, bool& member, const Range&) const {
    const bool* truth = std::get_if<bool>(&node.data);
    if (truth == nullptr)
      wrong_type(node, trail, "true or false", "write one of them, without quotes");
    member = *truth;
  }

  void read(const Node& node, const Trail& trail, std::string& member, const Range& range) const {
    const std::string* text = std::get_if<std::string>(&node.data);
    if (text == nullptr) wrong_type(node, trail, "a text", "write it in double quotes");
    if (range.not_empty && text->empty()) stop(node, trail, "the text is empty", "write a name");
    for (char c : *text)
      if (static_cast<unsigned char>(c) < 0x20 && (c != '\n' || range.not_empty))
        stop(node, trail, fmt::format("\"{}\" has a control character", printable(*text)),
             "remove it");
    member = *text;
  }

  template <class T>
  void read(const Node& node, const Trail& trail, std::optional<T>& member,
            const Range& range) const {
    member.reset();
    if (!node.is_null()) read(node, trail, member.emplace(), range);
  }

  template <class T, std::size_t N>
  void read(const Node& node, const Trail& trail, std::array<T, N>& member,
            const Range& range) const {
    const List& items = expect_list(node, trail);
    if (items.size() != N)
      stop(node, trail, fmt::format("expected a list of {}, found {}", N, items.size()),
           fmt::format("write {} values", N));
    for (std::size_t i = 0; i < N; ++i) read(items[i], {&trail, {}, i}, member[i], range);
  }

  template <class T>
  void read(const Node& node, const Trail& trail, std::vector<T>& member,
            const Range& range) const {
    const List& items = expect_list(node, trail);
    if (range.not_empty && items.empty())
      stop(node, trail, "the list is empty", "list at least one, or remove the key");
    member.clear();
    member.resize(items.size());
    for (std::size_t i = 0; i < items.size(); ++i)
      read(items[i], {&trail, {}, i}, member[i], range);
  }

  double number(const Node& node, const Trail& trail, const Range& range, bool integer) const {
    const double* value = std::get_if<double>(&node.data);
    if (value == nullptr)
      wrong_type(node, trail, integer ? "a whole number" : "a number",
                 integer ? "write it without quotes, such as 16"
                         : "write it without quotes, such as 0.5 or 1e-3");
    if (integer && *value != std::floor(*value))
      wrong_type(node, trail, "a whole number", "round it");
    const bool low = range.above ? *value > range.min : *value >= range.min;
    if (!low || *value > range.max)
      stop(node, trail, fmt::format("{} is out of range", *value),
           fmt::format("choose a value {}", range_words(range, integer)));
    return *value;
  }

  const List& expect_list(const Node& node, const Trail& trail) const {
    if (node.list() == nullptr) wrong_type(node, trail, "a list", "write [ ... ]");
    return *node.list();
  }

  [[noreturn]] void wrong_type(const Node& node, const Trail& trail, const char* expected,
                               const char* remedy) const {
    stop(node, trail, fmt::format("expected {}, found {}", expected, describe(node)), remedy);
  }

  [[noreturn]] void stop(const Node& node, const Trail& trail, const std::string& problem,
                         const std::string& remedy) const {
    fail(document_, node.place, trail.text(), problem, remedy);
  }

  const Document& document_;
  const Node& node_;
  const Trail& trail_;
};

}  // namespace

Scene parse_scene(std::string_view text, const std::string& source,
                  const std::vector<Override>& overrides) {
  Document document = parse_document(text, source);
  for (const auto& [path, value] : overrides) apply_override(document, path, value);
  return read_scene(document);
}

Scene read_scene(const Document& document) {
  const std::string& source = document.sources.front();
  Scene scene;
  const Trail top;
  Reader(document, document.root, top).read_struct(scene);
  check_rules(scene, document);
  if (scene.name.empty()) scene.name = std::filesystem::path(source).stem().string();
  scene.source = source;
  return scene;
}

}  // namespace piecework::scene
