// The table of keys as a page of Markdown, for people.

#include <cmath>
#include <set>

#include <fmt/format.h>

#include <piecework/scene/scene_fields.hpp>
#include <piecework/scene/scene_io.hpp>
#include <piecework/scene/scene_json.hpp>
#include <piecework/scene/scene_presets.hpp>

namespace piecework::scene {
namespace {

constexpr const char* kIntroduction = R"(# Scene reference

A scene is a JSON file; `//` and `/* */` comments are allowed. Units are SI, y is up. This page is
made by `piecework schema --markdown` from the declarations that read the file; `piecework schema`
prints the same as a JSON Schema for editors.

```json
{
  // One square of cotton, held by two corners.
  "step": { "h": 0.008333333333333333, "steps": 60 },
  "materials": {
    "cotton": { "density": 0.5, "stretching": 0.821e6, "thickness": 0.318e-3, "bending": 7.014e-6 }
  },
  "cloths": [
    {
      "mesh": { "generator": "sheet", "columns": 50, "rows": 50 },
      "material": "cotton",
      "pins": [ { "region": { "vertices": [0, 49] } } ]
    }
  ],
  "expect": [ { "quantity": "center_y", "max": -0.3 } ]
}
```

- What a scene does not name is off and costs nothing; `null` switches an optional key off again.
- Errors read `file:line:column: /json/pointer: problem; remedy`; `/` alone is the whole scene.
- `--set solver.domains=16` or `--set /cloths/0/material=silk` sets any key before the scene is
  checked: list items by number (one more than the last appends), the value as JSON or as plain
  text. Its errors name the override instead of file and line.
- Unknown keys, duplicate keys, numbers that overflow, files above 64 MB and nesting deeper than 64
  are refused.
)";

std::string escaped(std::string_view text) {
  std::string out;
  for (char c : text) {
    if (c == '|') out += '\\';
    out += c;
  }
  return out;
}

std::string type_name(const double&) { return "number"; }
std::string type_name(const int&) { return "integer"; }
std::string type_name(const bool&) { return "true, false"; }
std::string type_name(const std::string&) { return "text"; }
template <class T, std::size_t N>
std::string type_name(const std::array<T, N>& value) {
  return fmt::format("{} x {}", N, type_name(value[0]));
}
template <class T>
std::string type_name(const std::vector<T>&) {
  return fmt::format("list of {}", type_name(T{}));
}
template <class T>
std::string type_name(const std::optional<T>&) {
  return type_name(T{});
}

std::string range_text(const Range& range) {
  const bool low = std::isfinite(range.min);
  const bool high = std::isfinite(range.max) && range.max < std::numeric_limits<int>::max();
  if (low && high && range.above) return fmt::format("above {}, up to {}", range.min, range.max);
  if (low && high) return fmt::format("{} ... {}", range.min, range.max);
  if (low) return fmt::format("{} {}", range.above ? ">" : ">=", range.min);
  return high ? fmt::format("<= {}", range.max) : "";
}

/// Collects one section per struct, in the order in which the structs are first named.
class Page {
 public:
  std::string text = kIntroduction;
  std::set<std::string> known;  ///< titles of the sections so far
};

class SectionWriter {
 public:
  explicit SectionWriter(Page& page) : page_(page) {}

  void about(const char* title, const char* doc) {
    title_ = title;
    text_ = fmt::format(
        "\n## {}\n\n{}\n\n| key | type | unit | default | "
        "range | meaning | since |\n"
        "| --- | --- | --- | --- | --- | --- | --- |\n",
        title, doc);
  }

  template <class T>
  void value(const Key& key, T& member, const Range& range = {}) {
    const std::string unset = says_nothing(member) ? "" : "`" + to_json_value(member).dump() + "`";
    row(key, type_name(member), unset, range_text(range));
  }

  void choice(const Key& key, std::string& member, const Choices& choices) {
    row(key, "choice", member.empty() ? "" : fmt::format("`\"{}\"`", member), "see below");
    choices_ += fmt::format("\nValues of `{}`:\n\n", key.name);
    for (const Choice& choice : choices)
      choices_ += fmt::format("- `\"{}\"`: {}\n", choice.name, choice.doc);
  }

  template <class T>
  void preset(const Key& key, std::string& member, T&, const Presets<T>& presets) {
    choice(key, member, preset_choices(presets));
  }

  template <class T>
  void object(const Key& key, T&) {
    row(key, link<T>(), "", "");
  }
  template <class T>
  void object(const Key& key, std::optional<T>&) {
    row(key, link<T>(), "", "");
  }
  template <class T>
  void list(const Key& key, std::vector<T>&) {
    row(key, "list of " + link<T>(), "", "");
  }
  template <class T>
  void map(const Key& key, std::map<std::string, T>&) {
    row(key, link<T>() + " by name", "", "");
  }

  void exactly_one(const Names& names) { rules_ += sentence("Exactly one of", names); }
  void at_least_one(const Names& names) { rules_ += sentence("At least one of", names); }

  /// Adds the section of T and those of its members, unless they are there; gives its title.
  template <class T>
  static std::string add_section(Page& page) {
    SectionWriter writer(page);
    T defaults;
    std::string inner;
    std::swap(page.text, inner);  // sections of members follow this one
    fields(writer, defaults);
    std::swap(page.text, inner);
    if (page.known.insert(writer.title_).second)
      page.text += writer.text_ + writer.rules_ + writer.choices_ + inner;
    return writer.title_;
  }

 private:
  void row(const Key& key, const std::string& type, const std::string& unset,
           const std::string& range) {
    const std::string condition =
        key.condition[0] == '\0' ? "" : fmt::format(" Only with {}.", key.condition);
    text_ += fmt::format("| `{}` | {} | {} | {} | {} | {}.{} | {} |\n", key.name, type, key.unit,
                         key.required ? "required" : unset, range, escaped(key.doc), condition,
                         key.since);
  }

  template <class T>
  std::string link() {
    const std::string title = add_section<T>(page_);
    std::string anchor = title;
    for (char& c : anchor) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    return fmt::format("[{}](#{})", title, anchor);
  }

  static std::string sentence(const char* what, const Names& names) {
    std::string text;
    for (const char* name : names) text += fmt::format("{}`{}`", text.empty() ? "" : ", ", name);
    return fmt::format("\n{} {} must be given.\n", what, text);
  }

  Page& page_;
  std::string title_, text_, rules_, choices_;
};

}  // namespace

std::string reference_markdown() {
  Page page;
  SectionWriter::add_section<Scene>(page);
  return page.text;
}

}  // namespace piecework::scene
