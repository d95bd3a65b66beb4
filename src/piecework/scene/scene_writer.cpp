// Scene -> text: a visitor of the table of keys that prints the members.

#include <algorithm>

#include <piecework/scene/scene_fields.hpp>
#include <piecework/scene/scene_io.hpp>
#include <piecework/scene/scene_json.hpp>

namespace piecework::scene {
namespace {

class Writer {
 public:
  void about(const char*, const char*) {}
  void exactly_one(const Names&) {}
  void at_least_one(const Names&) {}

  template <class T>
  void value(const Key& key, T& member, const Range& = {}) {
    if (key.applies && (key.on_by_default || !says_nothing(member)))
      json_[key.name] = to_json_value(member);
  }

  void choice(const Key& key, std::string& member, const Choices&) { value(key, member); }

  /// The numbers that follow say all; the name says where they come from.
  template <class T>
  void preset(const Key& key, std::string& member, T&, const Presets<T>&) {
    value(key, member);
  }

  template <class T>
  void object(const Key& key, T& member) {
    json_[key.name] = written(member);
  }

  template <class T>
  void object(const Key& key, std::optional<T>& member) {
    if (member) json_[key.name] = written(*member);
  }

  template <class T>
  void list(const Key& key, std::vector<T>& member) {
    for (T& item : member) json_[key.name].push_back(written(item));
  }

  template <class T>
  void map(const Key& key, std::map<std::string, T>& member) {
    for (auto& [name, item] : member) json_[key.name][name] = written(item);
  }

  template <class T>
  static OrderedJson written(T& target) {
    Writer writer;
    fields(writer, target);
    return writer.json_;
  }

 private:
  OrderedJson json_ = OrderedJson::object();
};

void print(const OrderedJson& json, const std::string& indent, std::string& out) {
  const bool plain = std::none_of(json.begin(), json.end(), [](const OrderedJson& item) {
    return item.is_object() || (item.is_array() && !item.empty() && item.front().is_object());
  });
  if (!json.is_structured() || json.empty()) {
    // Text that is not UTF-8 can only come from a Scene made in memory; it must not stop a run.
    out += json.dump(-1, ' ', false, OrderedJson::error_handler_t::replace);
    return;
  }
  const bool one_line = json.is_array() && plain;
  const std::string inner = one_line ? "" : indent + "  ";
  out += json.is_array() ? "[" : "{";
  bool first = true;
  for (const auto& [key, item] : json.items()) {
    if (!first) out += one_line ? ", " : ",";
    first = false;
    if (!one_line) out += "\n" + inner;
    if (json.is_object())
      out += OrderedJson(key).dump(-1, ' ', false, OrderedJson::error_handler_t::replace) + ": ";
    print(item, inner, out);
  }
  if (!one_line) out += "\n" + indent;
  out += json.is_array() ? "]" : "}";
}

}  // namespace

std::string to_text(const OrderedJson& json) {
  std::string out;
  print(json, "", out);
  return out + "\n";
}

std::string resolved_json(const Scene& scene) {
  Scene copy = scene;  // the table of keys binds members as non-const
  return to_text(Writer::written(copy));
}

}  // namespace piecework::scene
