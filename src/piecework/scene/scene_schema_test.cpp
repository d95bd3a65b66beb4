// The JSON Schema, judged by a small validator of its own that knows no more of draft-07 than the
// schema uses, and refuses keywords that it does not know.

#include <cmath>
#include <fstream>
#include <set>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/scene/scene_io.hpp>

namespace piecework::scene {
namespace {

using Json = nlohmann::json;

bool has_type(const Json& value, const std::string& type) {
  if (type == "object") return value.is_object();
  if (type == "array") return value.is_array();
  if (type == "string") return value.is_string();
  if (type == "boolean") return value.is_boolean();
  if (type == "null") return value.is_null();
  if (type == "number") return value.is_number();
  if (type == "integer") return value.is_number() && value == std::floor(value.get<double>());
  throw std::logic_error("unknown type " + type);
}

/// One keyword of a schema. Keywords for other types hold trivially, as draft-07 says.
bool holds(const std::string& keyword, const Json& rule, const Json& schema, const Json& value);

bool valid(const Json& schema, const Json& value) {
  for (const auto& [keyword, rule] : schema.items())
    if (!holds(keyword, rule, schema, value)) return false;
  return true;
}

bool holds_for_object(const std::string& keyword, const Json& rule, const Json& schema,
                      const Json& value) {
  if (keyword == "required")
    return std::all_of(rule.begin(), rule.end(),
                       [&](const Json& key) { return value.contains(key); });
  if (keyword == "minProperties") return value.size() >= rule.get<std::size_t>();
  for (const auto& [key, item] : value.items()) {
    const bool known = schema.contains("properties") && schema["properties"].contains(key);
    if (keyword == "propertyNames" && !valid(rule, key)) return false;
    if (keyword == "properties" && known && !valid(rule[key], item)) return false;
    if (keyword != "additionalProperties" || known) continue;
    if (rule.is_boolean() ? !rule.get<bool>() : !valid(rule, item)) return false;
  }
  return true;
}

bool holds(const std::string& keyword, const Json& rule, const Json& schema, const Json& value) {
  static const std::set<std::string> notes = {"$schema", "$comment", "title",  "description",
                                              "default", "x-unit",   "x-since"};
  static const std::set<std::string> of_objects = {"required", "minProperties", "propertyNames",
                                                   "properties", "additionalProperties"};
  if (notes.contains(keyword)) return true;
  if (of_objects.contains(keyword))
    return !value.is_object() || holds_for_object(keyword, rule, schema, value);
  const auto fits = [&](const Json& item) { return valid(item, value); };
  if (keyword == "anyOf") return std::any_of(rule.begin(), rule.end(), fits);
  if (keyword == "oneOf") return std::count_if(rule.begin(), rule.end(), fits) == 1;
  if (keyword == "enum") return std::find(rule.begin(), rule.end(), value) != rule.end();
  if (keyword == "type" && rule.is_string()) return has_type(value, rule);
  if (keyword == "type")
    return std::any_of(rule.begin(), rule.end(), [&](const Json& t) { return has_type(value, t); });
  if (keyword == "minLength") return !value.is_string() || value.get<std::string>().size() >= rule;
  if (keyword == "minItems") return !value.is_array() || value.size() >= rule;
  if (keyword == "maxItems") return !value.is_array() || value.size() <= rule;
  if (keyword == "items")
    return !value.is_array() ||
           std::all_of(value.begin(), value.end(), [&](const Json& v) { return valid(rule, v); });
  if (keyword == "minimum") return !value.is_number() || value >= rule;
  if (keyword == "maximum") return !value.is_number() || value <= rule;
  if (keyword == "exclusiveMinimum") return !value.is_number() || value > rule;
  throw std::logic_error("unknown keyword " + keyword);
}

const Json& schema() {
  static const Json parsed = Json::parse(json_schema());
  return parsed;
}

Json with_comments(const std::string& text) { return Json::parse(text, nullptr, true, true); }

TEST(SceneSchema, AcceptsTheShippedScenesAsWrittenAndResolved) {
  int scenes = 0;
  for (const BuiltinScene& builtin : builtin_scenes()) {
    SCOPED_TRACE(builtin.name);
    EXPECT_TRUE(valid(schema(), with_comments(read_file(builtin.path))));
    EXPECT_TRUE(valid(schema(), Json::parse(resolved_json(load_scene(builtin.path)))));
    ++scenes;
  }
  EXPECT_GE(scenes, 4);
}

/// Every pointer of a document, containers included.
std::vector<Json::json_pointer> pointers(const Json& json,
                                         const Json::json_pointer& here = Json::json_pointer()) {
  std::vector<Json::json_pointer> all = {here};
  if (json.is_structured())
    for (const auto& [key, item] : json.items())
      for (const auto& inner :
           pointers(item, json.is_array() ? here / std::stoul(key) : here / key))
        all.push_back(inner);
  return all;
}

bool reads(const Json& json) {
  try {
    (void)parse_scene(json.dump(), "s.json");
    return true;
  } catch (const InputError&) {
    return false;
  }
}

// Each value of each shipped scene in turn is replaced by something else, removed, or joined by an
// unknown key. What the schema refuses, the reader must refuse; what only the reader refuses are
// rules between keys, which draft-07 cannot say.
TEST(SceneSchema, NeverRefusesWhatTheReaderTakes) {
  int refused = 0, taken = 0;
  for (const BuiltinScene& builtin : builtin_scenes()) {
    const Json scene = with_comments(read_file(builtin.path));
    for (const auto& pointer : pointers(scene)) {
      std::vector<Json> changed;
      for (const Json& value : {Json(), Json(true), Json(-1), Json(0), Json(0.5), Json(3),
                                Json(1e9), Json(""), Json("x"), Json::array(), Json::object()}) {
        changed.push_back(scene);
        changed.back()[pointer] = value;
      }
      if (scene[pointer].is_object()) {
        changed.push_back(scene);
        changed.back()[pointer]["unknown"] = 1;
        EXPECT_FALSE(valid(schema(), changed.back())) << pointer;  // additionalProperties
      }
      if (!pointer.empty() && scene[pointer.parent_pointer()].is_object()) {
        changed.push_back(scene);
        changed.back()[pointer.parent_pointer()].erase(pointer.back());
      }
      for (const Json& json : changed) {
        const bool fits = valid(schema(), json);
        (fits ? taken : refused) += 1;
        if (!fits) {
          EXPECT_FALSE(reads(json)) << builtin.name << " " << pointer;
        }
      }
    }
  }
  EXPECT_GT(refused, 1000);
  EXPECT_GT(taken, 100);
}

TEST(SceneSchema, RefusesByEachKindOfRule) {
  const Json good = with_comments(read_file(builtin_scenes().at(1).path));
  ASSERT_TRUE(valid(schema(), good));
  const auto changed = [&](const char* pointer, const Json& value) {
    Json json = good;
    json[Json::json_pointer(pointer)] = value;
    return valid(schema(), json);
  };
  EXPECT_TRUE(changed("/step/h", 0.5));
  EXPECT_FALSE(changed("/step/h", 0));                               // exclusiveMinimum
  EXPECT_FALSE(changed("/solver/domains", 0));                       // minimum
  EXPECT_FALSE(changed("/solver/domains", 65537));                   // maximum
  EXPECT_FALSE(changed("/solver/domains", 1.5));                     // integer
  EXPECT_FALSE(changed("/solver/method", "pd"));                     // enum
  EXPECT_FALSE(changed("/gravity", Json::array({0, 1})));            // minItems
  EXPECT_FALSE(changed("/gravity", Json::array({0, 1, 2, 3})));      // maxItems
  EXPECT_FALSE(changed("/materials", Json::object()));               // minProperties
  EXPECT_FALSE(changed("/materials/x", {{"density", -1}}));          // named entries
  EXPECT_FALSE(changed("/cloths/0/mesh", Json::object()));           // oneOf
  EXPECT_FALSE(changed("/cloths/0/mesh/file", "x.obj"));             // oneOf, both
  EXPECT_FALSE(changed("/cloths/0/pins/0/region", Json::object()));  // anyOf
  EXPECT_FALSE(changed("/cloths/0/name", ""));                       // minLength
  EXPECT_TRUE(changed("/gravity", nullptr));
  EXPECT_TRUE(changed("/wind", nullptr));
  EXPECT_FALSE(changed("/step", nullptr));
}

/// Default of a key, "step.h"; "[]" enters the items of a list, "{}" the named entries.
Json default_of(const std::string& path) {
  const Json* at = &schema();
  std::size_t begin = 0;
  while (begin <= path.size()) {
    const std::size_t end = std::min(path.find('.', begin), path.size());
    const std::string step = path.substr(begin, end - begin);
    if (step == "[]")
      at = &at->at("items");
    else if (step == "{}")
      at = &at->at("additionalProperties");
    else
      at = &at->at("properties").at(step);
    begin = end + 1;
  }
  return at->value("default", Json("none"));
}

TEST(SceneSchema, DefaultsAreThoseOfTheStructs) {
  const Step step;
  EXPECT_EQ(default_of("step.h"), step.h);
  EXPECT_EQ(default_of("step.steps"), step.steps);
  EXPECT_EQ(default_of("step.output_every"), step.output_every);
  EXPECT_EQ(default_of("gravity"), Json(*Scene{}.gravity));
  EXPECT_EQ(default_of("wind"), "none");
  EXPECT_EQ(default_of("damping"), "none");
  const Wind wind;
  EXPECT_EQ(default_of("wind.velocity"), Json(wind.velocity));
  EXPECT_EQ(default_of("wind.air_density"), wind.air_density);
  EXPECT_EQ(default_of("wind.normal_drag"), wind.normal_drag);
  EXPECT_EQ(default_of("wind.tangential_drag"), wind.tangential_drag);
  EXPECT_EQ(default_of("wind.gust_amplitude"), wind.gust_amplitude);
  EXPECT_EQ(default_of("wind.gust_period"), wind.gust_period);
  const Solver solver;
  EXPECT_EQ(default_of("solver.method"), solver.method);
  EXPECT_EQ(default_of("solver.global"), solver.global);
  EXPECT_EQ(default_of("solver.local"), solver.local);
  EXPECT_EQ(default_of("solver.domains"), solver.domains);
  EXPECT_EQ(default_of("solver.threads"), solver.threads);
  EXPECT_EQ(default_of("solver.hessian"), solver.hessian);
  EXPECT_EQ(default_of("solver.linear"), solver.linear);
  EXPECT_EQ(default_of("solver.chebyshev_rho"), "none");
  const Quality quality;
  EXPECT_EQ(default_of("quality.stop"), quality.stop);
  EXPECT_EQ(default_of("quality.tolerance"), quality.tolerance);
  EXPECT_EQ(default_of("quality.max_iterations"), quality.max_iterations);
  EXPECT_EQ(default_of("quality.min_iterations"), quality.min_iterations);
  EXPECT_EQ(default_of("quality.precision"), quality.precision);
  EXPECT_EQ(default_of("quality.preset"), quality.preset);
  const Camera camera;
  EXPECT_EQ(default_of("camera.position"), "none");
  EXPECT_EQ(default_of("camera.target"), "none");
  EXPECT_EQ(default_of("camera.fov"), camera.fov);
  EXPECT_EQ(default_of("camera.azimuth"), camera.azimuth);
  EXPECT_EQ(default_of("camera.elevation"), camera.elevation);
  EXPECT_EQ(default_of("camera.ground"), "none");
  const Render render;
  EXPECT_EQ(default_of("render.color"), render.color);
  EXPECT_EQ(default_of("render.size"), Json(render.size));
  EXPECT_EQ(default_of("render.borders"), render.borders);
  EXPECT_EQ(default_of("render.mesh_lines"), render.mesh_lines);
}

TEST(SceneSchema, DefaultsOfClothsAreThoseOfTheStructs) {
  const Material material;
  EXPECT_EQ(default_of("materials.{}.density"), material.density);
  EXPECT_EQ(default_of("materials.{}.stretching"), material.stretching);
  EXPECT_EQ(default_of("materials.{}.thickness"), material.thickness);
  EXPECT_EQ(default_of("materials.{}.bending"), "none");
  const Cloth cloth;
  EXPECT_EQ(default_of("cloths.[].name"), cloth.name);
  EXPECT_EQ(default_of("cloths.[].material"), "none");
  EXPECT_EQ(default_of("cloths.[].rest"), cloth.rest);
  EXPECT_EQ(default_of("cloths.[].translate"), Json(cloth.translate));
  EXPECT_EQ(default_of("cloths.[].rotate"), Json(cloth.rotate));
  EXPECT_EQ(default_of("cloths.[].scale"), Json(cloth.scale));
  EXPECT_EQ(default_of("cloths.[].velocity"), Json(cloth.velocity));
  const Mesh mesh;
  EXPECT_EQ(default_of("cloths.[].mesh.generator"), "none");
  EXPECT_EQ(default_of("cloths.[].mesh.width"), mesh.width);
  EXPECT_EQ(default_of("cloths.[].mesh.height"), mesh.height);
  EXPECT_EQ(default_of("cloths.[].mesh.radius"), mesh.radius);
  EXPECT_EQ(default_of("cloths.[].mesh.columns"), mesh.columns);
  EXPECT_EQ(default_of("cloths.[].mesh.rows"), mesh.rows);
  EXPECT_EQ(default_of("cloths.[].mesh.pattern"), mesh.pattern);
  EXPECT_EQ(default_of("cloths.[].mesh.jitter"), mesh.jitter);
  EXPECT_EQ(default_of("cloths.[].mesh.seed"), mesh.seed);
  EXPECT_EQ(default_of("cloths.[].mesh.patches_x"), mesh.patches_x);
  EXPECT_EQ(default_of("cloths.[].mesh.patches_y"), mesh.patches_y);
  EXPECT_EQ(default_of("cloths.[].mesh.units"), mesh.units);
  EXPECT_EQ(default_of("cloths.[].mesh.up_axis"), mesh.up_axis);
  EXPECT_EQ(default_of("cloths.[].mesh.repair"), mesh.repair);
  EXPECT_EQ(default_of("cloths.[].mesh.weld"), mesh.weld);
  const Pin pin;
  EXPECT_EQ(default_of("cloths.[].pins.[].velocity"), Json(pin.velocity));
  EXPECT_EQ(default_of("cloths.[].pins.[].axis"), Json(pin.axis));
  EXPECT_EQ(default_of("cloths.[].pins.[].center"), Json(pin.center));
  EXPECT_EQ(default_of("cloths.[].pins.[].rate"), pin.rate);
  EXPECT_EQ(default_of("cloths.[].pins.[].start"), pin.start);
  EXPECT_EQ(default_of("cloths.[].pins.[].stop"), "none");
  EXPECT_EQ(default_of("cloths.[].loads.[].force"), "none");
  EXPECT_EQ(default_of("cloths.[].loads.[].start"), Load{}.start);
  EXPECT_EQ(default_of("seams.[].reversed"), Seam{}.reversed);
  EXPECT_EQ(default_of("seams.[].cloth"), "none");
  EXPECT_EQ(default_of("seams.[].distance"), "none");
  EXPECT_EQ(default_of("seams.[].close_time"), "none");
}

}  // namespace
}  // namespace piecework::scene
