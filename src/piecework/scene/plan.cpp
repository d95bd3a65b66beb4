#include <piecework/scene/plan.hpp>

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/scene/document.hpp>
#include <piecework/scene/nearest.hpp>
#include <piecework/scene/scene_json.hpp>

namespace piecework::scene {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string>& known_keys() {
  static const std::vector<std::string> keys = {"name", "description", "scene", "steps",    "set",
                                                "vary", "zip",         "cases", "reference"};
  return keys;
}

OrderedJson to_json(const Node& node) {
  constexpr double kExact = 1e15;
  if (const List* list = node.list()) {
    OrderedJson json = OrderedJson::array();
    for (const Node& item : *list) json.push_back(to_json(item));
    return json;
  }
  if (const List* members = node.object()) {
    OrderedJson json = OrderedJson::object();
    for (const Node& member : *members) json[member.key] = to_json(member);
    return json;
  }
  if (const bool* truth = std::get_if<bool>(&node.data)) return *truth;
  if (const std::string* text = std::get_if<std::string>(&node.data)) return *text;
  const double* number = std::get_if<double>(&node.data);
  if (number == nullptr) return nullptr;
  if (std::abs(*number) <= kExact && *number == std::floor(*number))
    return static_cast<std::int64_t>(*number);  // 16, not 16.0
  return *number;
}

/// Settings that vary together: item i of every key belongs to alternative i.
using Alternatives = std::vector<Case>;

class PlanReader {
 public:
  explicit PlanReader(const Document& document) : document_(document) {}

  Plan read() {
    const Node& root = document_.root;
    if (root.object() == nullptr)
      fail(document_, root.place, "", fmt::format("expected an object, found {}", describe(root)),
           "write { \"scene\": ..., \"vary\": { ... } }");
    refuse_unknown(root);
    plan_.name = text("name");
    plan_.description = text("description");
    plan_.scene = text("scene");
    if (plan_.scene.empty())
      fail(document_, "", "\"scene\" is missing", "name a scene file, or a built-in scene");
    read_common();
    read_cases();
    if (const Node* node = root.find("reference")) plan_.reference = settings(*node, "/reference");
    return std::move(plan_);
  }

 private:
  void refuse_unknown(const Node& root) const {
    for (const Node& member : *root.object())
      if (std::find(known_keys().begin(), known_keys().end(), member.key) == known_keys().end())
        fail(document_, member.key_place, pointer_step(member.key),
             fmt::format("unknown key \"{}\"", printable(member.key)), remedy(member.key));
  }

  /// A key of the scene at the top of the plan is the likeliest mistake.
  static std::string remedy(const std::string& key) {
    if (key.find('.') == std::string::npos || !nearest(key, known_keys()).empty())
      return suggestion(key, known_keys(), "keys here");
    return "move it into \"set\" (one value) or \"vary\" (a list of values)";
  }

  std::string text(const char* key) const {
    const Node* node = document_.root.find(key);
    if (node == nullptr) return "";
    const std::string* value = std::get_if<std::string>(&node->data);
    if (value == nullptr || value->empty())
      fail(document_, node->place, pointer_step(key),
           fmt::format("expected a text, found {}", describe(*node)), "write it in double quotes");
    return *value;
  }

  Setting setting(const Node& key, const Node& value, const std::string& pointer) const {
    return {key.key, to_json(value).dump(),
            fmt::format("{}:{}:{}: {}", document_.sources.front(), value.place.line,
                        value.place.column, pointer)};
  }

  const List& object(const Node& node, const std::string& pointer, const char* example) const {
    if (node.object() == nullptr)
      fail(document_, node.place, pointer,
           fmt::format("expected an object, found {}", describe(node)),
           fmt::format("write {}", example));
    return *node.object();
  }

  const List& list(const Node& node, const std::string& pointer, const char* example) const {
    if (node.list() == nullptr || node.list()->empty())
      fail(document_, node.place, pointer,
           node.list() ? std::string("the list is empty")
                       : fmt::format("expected a list, found {}", describe(node)),
           fmt::format("write {}", example));
    return *node.list();
  }

  /// One value per key: "set", "reference", an item of "cases".
  Case settings(const Node& node, const std::string& pointer) const {
    Case found;
    for (const Node& member : object(node, pointer, "{ \"solver.domains\": 16 }"))
      found.push_back(setting(member, member, pointer + pointer_step(member.key)));
    return found;
  }

  void read_common() {
    const Node& root = document_.root;
    if (const Node* node = root.find("set")) plan_.common = settings(*node, "/set");
    if (const Node* node = root.find("steps")) {
      Setting steps = setting(*node, *node, "/steps");
      steps.key = "step.steps";
      plan_.common.push_back(steps);
    }
  }

  /// One list of values per key: "vary", an item of "zip". Notes the keys.
  std::vector<Alternatives> lists(const Node& node, const std::string& pointer) {
    std::vector<Alternatives> found;
    for (const Node& member : object(node, pointer, "{ \"solver.domains\": [16, 32] }")) {
      const std::string here = pointer + pointer_step(member.key);
      if (std::find(plan_.keys.begin(), plan_.keys.end(), member.key) != plan_.keys.end())
        fail(document_, member.key_place, here,
             fmt::format("\"{}\" varies already", printable(member.key)), "remove one of the two");
      plan_.keys.push_back(member.key);
      Alternatives& values = found.emplace_back();
      const List& items = list(member, here, "a list of values, such as [16, 32]");
      for (std::size_t i = 0; i < items.size(); ++i)
        values.push_back({setting(member, items[i], fmt::format("{}/{}", here, i))});
    }
    return found;
  }

  /// The keys of one group of "zip" as one factor of the product.
  Alternatives zipped(const Node& node, const std::string& pointer) {
    Alternatives together;
    for (const Alternatives& values : lists(node, pointer)) {
      if (!together.empty() && values.size() != together.size())
        fail(document_, pointer + pointer_step(values[0][0].key),
             fmt::format("{} values, but \"{}\" has {}", values.size(),
                         printable(together[0][0].key), together.size()),
             "lists of one group must be equally long");
      together.resize(values.size());
      for (std::size_t i = 0; i < values.size(); ++i) together[i].push_back(values[i][0]);
    }
    if (together.empty())
      fail(document_, node.place, pointer, "the group is empty",
           "name keys with lists of values, or remove it");
    return together;
  }

  void read_cases() {
    const Node& root = document_.root;
    std::vector<Alternatives> factors;
    if (const Node* node = root.find("vary")) factors = lists(*node, "/vary");
    if (const Node* node = root.find("zip")) {
      const List& groups = list(*node, "/zip", "[ { \"step.h\": [...], \"step.steps\": [...] } ]");
      for (std::size_t i = 0; i < groups.size(); ++i)
        factors.push_back(zipped(groups[i], fmt::format("/zip/{}", i)));
    }
    if (!factors.empty()) multiply(factors);
    if (const Node* node = root.find("cases")) add_cases(*node);
    if (plan_.cases.empty())
      fail(document_, "", "there is no case", "add \"vary\", \"zip\" or \"cases\"");
  }

  void multiply(const std::vector<Alternatives>& factors) {
    std::size_t count = 1;
    for (const Alternatives& factor : factors) {
      count *= factor.size();
      refuse_more(count);
    }
    for (std::size_t index = 0; index < count; ++index) {
      Case settings;
      std::size_t stride = count;
      for (const Alternatives& factor : factors) {
        stride /= factor.size();
        const Case& chosen = factor[index / stride % factor.size()];
        settings.insert(settings.end(), chosen.begin(), chosen.end());
      }
      plan_.cases.push_back(std::move(settings));
    }
  }

  void add_cases(const Node& node) {
    const List& items = list(node, "/cases", "a list of objects: [ { \"solver.domains\": 1 } ]");
    refuse_more(plan_.cases.size() + items.size());
    for (std::size_t i = 0; i < items.size(); ++i) {
      plan_.cases.push_back(settings(items[i], fmt::format("/cases/{}", i)));
      for (const Setting& setting : plan_.cases.back())
        if (std::find(plan_.keys.begin(), plan_.keys.end(), setting.key) == plan_.keys.end())
          plan_.keys.push_back(setting.key);
    }
  }

  void refuse_more(std::size_t count) const {
    if (count > kMaxCases)
      fail(document_, "", fmt::format("{} cases or more; the limit is {}", count, kMaxCases),
           "shorten the lists, or split the plan");
  }

  const Document& document_;
  Plan plan_;
};

/// The scene that a plan in `folder` means.
fs::path find_scene(const Document& document, const fs::path& folder, const fs::path& name) {
  constexpr std::size_t kMaxPath = 200;
  std::error_code ignored;
  const fs::path beside = (folder / name).lexically_normal();
  if (fs::exists(beside, ignored)) return beside;
  std::vector<std::string> known;
  for (const BuiltinScene& builtin : builtin_scenes()) {
    if (name == builtin.name) return builtin.path;
    known.push_back(builtin.name);
  }
  fail(document, "/scene",
       fmt::format("{}: no such file, nor a built-in scene", printable(beside.string(), kMaxPath)),
       known.empty() ? "names start at the plan's folder"
                     : suggestion(name.stem().string(), known, "built-in scenes"));
}

Plan read_plan(const Document& document) {
  Plan plan = PlanReader(document).read();
  plan.source = document.sources.front();
  if (plan.name.empty()) plan.name = plan.source.stem().string();
  return plan;
}

}  // namespace

Plan parse_plan(std::string_view text, const std::string& source) {
  return read_plan(parse_document(text, source));
}

Plan load_plan(const fs::path& path) {
  const Document document = parse_document(read_file(path, kMaxTextBytes), path.string());
  Plan plan = read_plan(document);
  plan.scene = find_scene(document, path.parent_path(), plan.scene);
  return plan;
}

}  // namespace piecework::scene
