// The table of keys as JSON Schema (draft-07), for editors and other programs.

#include <cmath>

#include <fmt/format.h>

#include <piecework/scene/scene_fields.hpp>
#include <piecework/scene/scene_io.hpp>
#include <piecework/scene/scene_json.hpp>
#include <piecework/scene/scene_presets.hpp>

namespace piecework::scene {
namespace {

/// Whole numbers without ".0".
OrderedJson limit(double value) {
  constexpr double kExact = 1e15;
  if (std::abs(value) <= kExact && value == std::floor(value))
    return static_cast<std::int64_t>(value);
  return value;
}

OrderedJson number_schema(const char* type, const Range& range) {
  OrderedJson schema = {{"type", type}};
  if (std::isfinite(range.min))
    schema[range.above ? "exclusiveMinimum" : "minimum"] = limit(range.min);
  if (std::isfinite(range.max)) schema["maximum"] = limit(range.max);
  return schema;
}

OrderedJson type_schema(const double&, const Range& range) {
  return number_schema("number", range);
}
OrderedJson type_schema(const int&, const Range& range) { return number_schema("integer", range); }
OrderedJson type_schema(const bool&, const Range&) { return {{"type", "boolean"}}; }

OrderedJson type_schema(const std::string&, const Range& range) {
  OrderedJson schema = {{"type", "string"}};
  if (range.not_empty) schema["minLength"] = 1;
  return schema;
}

template <class T, std::size_t N>
OrderedJson type_schema(const std::array<T, N>& value, const Range& range) {
  return {
      {"type", "array"}, {"items", type_schema(value[0], range)}, {"minItems", N}, {"maxItems", N}};
}

template <class T>
OrderedJson type_schema(const std::vector<T>&, const Range& range) {
  OrderedJson schema = {{"type", "array"}, {"items", type_schema(T{}, range)}};
  if (range.not_empty) schema["minItems"] = 1;
  return schema;
}

template <class T>
OrderedJson type_schema(const std::optional<T>&, const Range& range) {
  OrderedJson schema = type_schema(T{}, range);
  schema["type"] = {schema["type"], "null"};
  return schema;
}

class SchemaWriter {
 public:
  void about(const char* title, const char* doc) {
    json_["title"] = title;
    json_["description"] = doc;
    json_["type"] = "object";
    json_["additionalProperties"] = false;
    json_["properties"] = OrderedJson::object();
  }

  template <class T>
  void value(const Key& key, T& member, const Range& range = {}) {
    OrderedJson& schema = add(key, type_schema(member, range));
    if (!key.required && !says_nothing(member)) schema["default"] = to_json_value(member);
  }

  void choice(const Key& key, std::string& member, const Choices& choices) {
    OrderedJson& schema = add(key, {{"type", "string"}, {"enum", OrderedJson::array()}});
    std::string doc = schema["description"];
    for (const Choice& choice : choices) {
      schema["enum"].push_back(choice.name);
      doc += fmt::format("\n{}: {}", choice.name, choice.doc);
    }
    schema["description"] = doc;
    if (!member.empty()) schema["default"] = member;
  }

  template <class T>
  void preset(const Key& key, std::string& member, T&, const Presets<T>& presets) {
    choice(key, member, preset_choices(presets));
  }

  template <class T>
  void object(const Key& key, T&) {
    add(key, of<T>());
  }

  template <class T>
  void object(const Key& key, std::optional<T>&) {
    add(key, of<T>())["type"] = {"object", "null"};
  }

  template <class T>
  void list(const Key& key, std::vector<T>&) {
    OrderedJson& schema = add(key, {{"type", "array"}, {"items", of<T>()}});
    if (key.required) schema["minItems"] = 1;
  }

  template <class T>
  void map(const Key& key, std::map<std::string, T>&) {
    OrderedJson& schema = add(key, {{"type", "object"},
                                    {"propertyNames", {{"minLength", 1}}},
                                    {"additionalProperties", of<T>()}});
    if (key.required) schema["minProperties"] = 1;
  }

  void exactly_one(const Names& names) { require_some("oneOf", names); }
  void at_least_one(const Names& names) { require_some("anyOf", names); }

  template <class T>
  static OrderedJson of() {
    SchemaWriter writer;
    T defaults;
    fields(writer, defaults);
    return writer.json_;
  }

 private:
  OrderedJson& add(const Key& key, OrderedJson schema) {
    std::string doc = key.doc;
    if (key.condition[0] != '\0') doc += fmt::format(" (only with {})", key.condition);
    schema["description"] = doc;
    if (key.unit[0] != '\0') schema["x-unit"] = key.unit;
    schema["x-since"] = key.since;
    if (key.required) json_["required"].push_back(key.name);
    return json_["properties"][key.name] = std::move(schema);
  }

  void require_some(const char* rule, const Names& names) {
    for (const char* name : names) json_[rule].push_back({{"required", {name}}});
  }

  OrderedJson json_ = OrderedJson::object();
};

}  // namespace

std::string json_schema() {
  OrderedJson schema = {{"$schema", "http://json-schema.org/draft-07/schema#"},
                        {"$comment", "Piecework scene; comments (// and /* */) are allowed"}};
  schema.update(SchemaWriter::of<Scene>());
  return to_text(schema);
}

}  // namespace piecework::scene
