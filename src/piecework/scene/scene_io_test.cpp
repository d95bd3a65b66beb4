#include <piecework/scene/scene_io.hpp>

#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include <gtest/gtest.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>

namespace piecework::scene {
namespace {

namespace fs = std::filesystem;
using Vector = std::array<double, 3>;

constexpr const char* kMinimal = R"({
  "materials": { "m": {} },
  "cloths": [ { "mesh": { "generator": "sheet" }, "material": "m" } ]
})";

// Every key, each with a value that is not its default.
constexpr const char* kEveryKey = R"({
  "name": "all", "description": "every key\nof a scene",
  "step": { "h": 0.01, "steps": 8, "output_every": 2 },
  "gravity": [1, 2, 3],
  "wind": { "velocity": [4, 5, 6], "air_density": 1.1, "normal_drag": 2, "tangential_drag": 0.5,
            "gust_amplitude": 0.25, "gust_period": 3 },
  "damping": 0.125,
  "solver": { "method": "vanilla_pd", "global": "primal_dual", "local": "jacobi", "domains": 5,
              "corner_fraction": 0.25, "interface": "dense", "seams": "dual", "contact": "adaptive",
              "domain_weights": [1, 1, 1, 0.5, 0.25],
              "threads": 3, "hessian": "unprojected", "linear": "pcg", "chebyshev_rho": 0.75 },
  "quality": { "stop": "dx_rms", "tolerance": 1e-3, "max_iterations": 11, "min_iterations": 2,
               "accelerate": "anderson", "window": 7, "precision": "single", "ccd": "newton",
               "newton": "never", "friction_renewals": 3, "pcg_tol": 0.5, "pcg_max": 9,
               "sd_iterations": 5,
               "preset": "reference" },
  "self_collision": true, "friction": 0.5, "kinetic_friction": 0.25,
  "contact": { "distance": 0.002, "stiffness": 100, "barrier": "ipc", "slip_speed": 0.01,
               "check": false },
  "materials": { "m/1": { "density": 0.1, "stretching": 3e5, "thickness": 1e-3, "bending": 2e-6 },
                 "soft": { "density": 0.2 } },
  "cloths": [
    { "name": "one",
      "mesh": { "generator": "quilt", "width": 2, "height": 3, "radius": 4, "columns": 5, "rows": 6,
                "pattern": "delaunay", "jitter": 0.125, "seed": 8, "patches_x": 9, "patches_y": 10 },
      "material": "m/1", "rest": "uv",
      "translate": [1, 0, 0], "rotate": [0, 90, 0], "scale": [1, 2, 1], "velocity": [0, 0, 7],
      "pins": [ { "region": { "vertices": [3, 1], "sets": ["left", "top"],
                              "box": [[0, 0, 0], [1, 2, 3]], "sphere": [1, 2, 3, 4] },
                  "velocity": [0, 1, 0], "axis": [1, 0, 0], "center": [0, 0, 1], "rate": 0.5,
                  "start": 1, "stop": 2, "release": 3 } ],
      "loads": [ { "region": { "sets": ["border"] }, "force": [0, -5, 0], "start": 1, "stop": 2 } ] },
    { "name": "two",
      "mesh": { "file": "m.obj", "units": 0.01, "up_axis": "z", "repair": true, "weld": false },
      "material": "soft", "rest": "file", "rest_file": "r.obj" } ],
  "seams": [
    { "name": "hem", "cloth": "one", "to": "two", "stitches": [[1, 2, 3, 0.25], [4, 5, 6, 1]] },
    { "cloth": "one", "chain": [1, 2, 3], "to_chain": [9, 8], "close_time": 0.5 },
    { "cloth": "two", "to": "one", "set": "left", "to_set": "right", "reversed": true },
    { "cloth": "two", "file": "two.seams.json" },
    { "cloth": "two", "distance": 0.01 } ],
  "colliders": [
    { "name": "floor", "shape": "plane", "point": [0, 1, 0], "normal": [1, 1, 0] },
    { "name": "post", "shape": "cylinder", "from": [1, 0, 0], "to": [1, 2, 0], "radius": 0.25,
      "rounding": 0.125, "friction": 0.5, "kinetic_friction": 0.125, "thickness": 0.002 },
    { "name": "crate", "shape": "box", "center": [1, 2, 3], "size": [3, 2, 1],
      "surface": "triangles", "segments": 9,
      "motion": { "velocity": [1, 0, 0], "axis": [0, 0, 1], "center": [0, 5, 0], "rate": 2,
                  "start": 1, "stop": 3 } },
    { "name": "wedge", "shape": "half_spaces",
      "planes": [ { "point": [1, 0, 0], "normal": [1, 1, 0] }, { "normal": [0, 0, 1] } ] },
    { "name": "rock", "shape": "mesh", "mesh": { "generator": "stairs", "depth": 3 },
      "translate": [1, 2, 3], "rotate": [0, 45, 0], "scale": [1, 2, 3] },
    { "name": "jelly", "shape": "mesh",
      "sequence": { "pattern": "j_{}.obj", "first": 2, "last": 9, "fps": 25, "start": 0.5,
                    "units": 0.01, "up_axis": "z" } },
    { "name": "figure", "shape": "mesh",
      "avatar": { "file": "a.glb", "clip": "walk", "start_time": 1, "lead_in": 2,
                  "lead": "first_pose", "units": 0.01, "up_axis": "x" } } ],
  "camera": { "position": [1, 2, 3], "target": [0, 1, 0], "fov": 40, "azimuth": 10, "elevation": 5,
              "ground": -1 },
  "render": { "color": "strain", "size": [320, 200], "borders": false, "mesh_lines": true },
  "expect": [ { "quantity": "vertex_z", "at": 0.05, "vertex": 4, "cloth": "two", "min": -1,
                "max": 1 } ]
})";

Cloth expected_first_cloth() {
  Cloth cloth;
  cloth.name = "one";
  cloth.mesh.generator = "quilt";
  cloth.mesh.width = 2, cloth.mesh.height = 3, cloth.mesh.radius = 4;
  cloth.mesh.columns = 5, cloth.mesh.rows = 6;
  cloth.mesh.pattern = "delaunay", cloth.mesh.jitter = 0.125, cloth.mesh.seed = 8;
  cloth.mesh.patches_x = 9, cloth.mesh.patches_y = 10;
  cloth.material = "m/1", cloth.rest = "uv";
  cloth.translate = {1, 0, 0}, cloth.rotate = {0, 90, 0}, cloth.scale = {1, 2, 1};
  cloth.velocity = {0, 0, 7};
  Pin pin;
  pin.region.vertices = {3, 1}, pin.region.sets = {"left", "top"};
  pin.region.box = {Vector{0, 0, 0}, Vector{1, 2, 3}};
  pin.region.sphere = {1, 2, 3, 4};
  pin.velocity = {0, 1, 0}, pin.axis = {1, 0, 0}, pin.center = {0, 0, 1}, pin.rate = 0.5;
  pin.start = 1, pin.stop = 2, pin.release = 3;
  Load load;
  load.region.sets = {"border"};
  load.force = {0, -5, 0}, load.start = 1, load.stop = 2;
  cloth.pins = {pin}, cloth.loads = {load};
  return cloth;
}

Cloth expected_second_cloth() {
  Cloth cloth;
  cloth.name = "two";
  cloth.mesh.file = "m.obj", cloth.mesh.units = 0.01, cloth.mesh.up_axis = "z";
  cloth.mesh.repair = true, cloth.mesh.weld = false;
  cloth.material = "soft", cloth.rest = "file", cloth.rest_file = "r.obj";
  return cloth;
}

std::vector<Seam> expected_seams() {
  std::vector<Seam> seams(5);
  seams[0].name = "hem", seams[0].cloth = "one", seams[0].to = "two";
  seams[0].stitches = {{1, 2, 3, 0.25}, {4, 5, 6, 1}};
  seams[1].cloth = "one", seams[1].chain = {1, 2, 3}, seams[1].to_chain = {9, 8};
  seams[1].close_time = 0.5;
  seams[2].cloth = "two", seams[2].to = "one", seams[2].set = "left", seams[2].to_set = "right";
  seams[2].reversed = true;
  seams[3].cloth = "two", seams[3].file = "two.seams.json";
  seams[4].cloth = "two", seams[4].distance = 0.01;
  return seams;
}

std::vector<Collider> expected_colliders() {
  std::vector<Collider> c(7);
  c[0].name = "floor", c[0].shape = "plane", c[0].point = {0, 1, 0}, c[0].normal = {1, 1, 0};
  c[1].name = "post", c[1].shape = "cylinder", c[1].from = {1, 0, 0}, c[1].to = {1, 2, 0};
  c[1].radius = 0.25, c[1].rounding = 0.125, c[1].friction = 0.5, c[1].kinetic_friction = 0.125,
  c[1].thickness = 0.002;
  c[2].name = "crate", c[2].shape = "box", c[2].center = {1, 2, 3}, c[2].size = {3, 2, 1};
  c[2].surface = "triangles", c[2].segments = 9;
  c[2].motion = Motion{{1, 0, 0}, {0, 0, 1}, {0, 5, 0}, 2, 1, 3};
  c[3].name = "wedge", c[3].shape = "half_spaces";
  c[3].planes = {{{1, 0, 0}, {1, 1, 0}}, {{0, 0, 0}, {0, 0, 1}}};
  c[4].name = "rock", c[4].shape = "mesh", c[4].mesh.emplace();
  c[4].mesh->generator = "stairs", c[4].mesh->depth = 3;
  c[4].translate = {1, 2, 3}, c[4].rotate = {0, 45, 0}, c[4].scale = {1, 2, 3};
  c[5].name = "jelly", c[5].shape = "mesh";
  c[5].sequence = Sequence{"j_{}.obj", 2, 9, 25, 0.5, 0.01, "z"};
  c[6].name = "figure", c[6].shape = "mesh";
  c[6].avatar = Avatar{"a.glb", "walk", 1, 2, "first_pose", 0.01, "x"};
  return c;
}

Scene expected_every_key() {
  Scene scene;
  scene.name = "all", scene.description = "every key\nof a scene", scene.source = "x/s.json";
  scene.step = {0.01, 8, 2};
  scene.gravity = {1, 2, 3};
  scene.wind = Wind{{4, 5, 6}, 1.1, 2, 0.5, 0.25, 3};
  scene.damping = 0.125;
  scene.solver = {"vanilla_pd",  "primal_dual", "jacobi", 5,          {1, 1, 1, 0.5, 0.25},
                  0.25,          "dense",       "dual",   "adaptive", 3,
                  "unprojected", "pcg",         0.75};
  scene.quality = {"dx_rms", 1e-3,    11, 2,   "anderson", 7, "single",
                   "newton", "never", 3,  0.5, 9,          5, "reference"};
  scene.self_collision = true, scene.friction = 0.5, scene.kinetic_friction = 0.25;
  scene.contact = {0.002, 100, "ipc", 0.01, false};
  scene.materials = {{"m/1", {0.1, 3e5, 1e-3, 2e-6}}, {"soft", {0.2, 2e4, 1, std::nullopt}}};
  scene.seams = expected_seams();
  scene.colliders = expected_colliders();
  scene.cloths = {expected_first_cloth(), expected_second_cloth()};
  scene.camera = {Vector{1, 2, 3}, Vector{0, 1, 0}, 40, 10, 5, -1};
  scene.render = {"strain", {320, 200}, false, true};
  scene.expect = {{"vertex_z", 0.05, 4, "two", -1, 1}};
  return scene;
}

TEST(SceneIo, ReadsEveryKeyIntoItsMember) {
  const Scene scene = parse_scene(kEveryKey, "x/s.json");
  EXPECT_TRUE(scene == expected_every_key());
  Scene other = scene;
  other.cloths[0].pins[0].region.sets[1] = "bottom";
  EXPECT_FALSE(scene == other);
}

TEST(SceneIo, FillsInTheDefaultsOfTheStructs) {
  Scene expected;
  expected.name = "s", expected.source = "x/s.json";
  expected.materials["m"] = Material{};
  expected.cloths.resize(1);
  expected.cloths[0].mesh.generator = "sheet", expected.cloths[0].material = "m";
  EXPECT_TRUE(parse_scene(kMinimal, "x/s.json") == expected);
}

TEST(SceneIo, ResolvedScenesReadBackToTheSameData) {
  for (const char* text : {kMinimal, kEveryKey}) {
    const Scene scene = parse_scene(text, "x/s.json");
    const std::string resolved = resolved_json(scene);
    EXPECT_TRUE(parse_scene(resolved, "x/s.json") == scene) << resolved;
    EXPECT_EQ(resolved_json(parse_scene(resolved, "other")), resolved);
  }
}

TEST(SceneIo, DoublesSurviveToTheLastBit) {
  Scene scene = parse_scene(kMinimal, "s");
  for (double h : {1.0 / 120, 0.1, 5e-324, 1.0000000000000002, 9.999999999999998}) {
    scene.step.h = h;
    EXPECT_EQ(parse_scene(resolved_json(scene), "s").step.h, h);
  }
}

TEST(SceneIo, WhatIsOffIsNotWritten) {
  const std::string resolved = resolved_json(parse_scene(kMinimal, "s"));
  for (const char* key : {"wind", "damping", "bending", "pins", "loads", "expect", "file", "units",
                          "rest_file", "position", "ground", "null", "description"})
    EXPECT_EQ(resolved.find("\"" + std::string(key) + "\""), std::string::npos) << key;
  EXPECT_NE(resolved.find("\"gravity\": [0.0, -9.81, 0.0]"), std::string::npos) << resolved;
}

TEST(SceneIo, NullSwitchesOff) {
  const std::vector<Override> off = {{"gravity", "null"},
                                     {"wind", "null"},
                                     {"damping", "null"},
                                     {"materials.soft.bending", "null"}};
  const Scene scene = parse_scene(kEveryKey, "s", off);
  EXPECT_FALSE(scene.gravity || scene.wind || scene.damping || scene.materials.at("soft").bending);
  const std::string resolved = resolved_json(scene);
  EXPECT_NE(resolved.find("\"gravity\": null"), std::string::npos) << resolved;
  EXPECT_EQ(resolved.find("\"wind\""), std::string::npos);
  EXPECT_FALSE(parse_scene(resolved, "s").gravity);
}

TEST(SceneIo, OverridesReachEveryKindOfKey) {
  const Scene scene = parse_scene(kEveryKey, "s",
                                  {{"solver.domains", "16"},
                                   {"solver.domain_weights", "[]"},
                                   {"step.h", "1e-3"},
                                   {"render.borders", "true"},
                                   {"quality.stop", "gradient"},
                                   {"quality.stop", "error"},
                                   {"name", "2024-01 trial"},
                                   {"description", "\"42\""},
                                   {"gravity.1", "-5"},
                                   {"/materials/m~11/density", "0.75"},
                                   {"cloths.0.pins.0.region", "{\"sets\": [\"right\"] /* all */}"},
                                   {"cloths.1.pins.0.region.sets.0", "border"},
                                   {"expect.1", "{\"quantity\": \"max_speed\", \"max\": 3}"}});
  EXPECT_EQ(scene.solver.domains, 16);
  EXPECT_TRUE(scene.solver.domain_weights.empty());
  EXPECT_EQ(scene.step.h, 1e-3);
  EXPECT_TRUE(scene.render.borders);
  EXPECT_EQ(scene.quality.stop, "error");
  EXPECT_EQ(scene.name, "2024-01 trial");
  EXPECT_EQ(scene.description, "42");
  EXPECT_EQ(scene.gravity, (Vector{1, -5, 3}));
  EXPECT_EQ(scene.materials.at("m/1").density, 0.75);
  EXPECT_EQ(scene.cloths[0].pins[0].region.sets, std::vector<std::string>{"right"});
  EXPECT_TRUE(scene.cloths[0].pins[0].region.vertices.empty());
  EXPECT_EQ(scene.cloths[1].pins.at(0).region.sets, std::vector<std::string>{"border"});
  ASSERT_EQ(scene.expect.size(), 2U);
  EXPECT_EQ(scene.expect[1].max, 3);
}

TEST(SceneIo, PresetsSetTheDefaultsOfQualityAndGivenKeysWin) {
  const auto quality = [](const std::vector<Override>& overrides) {
    return parse_scene(kMinimal, "s", overrides).quality;
  };
  const Quality preview{
      .stop = "error", .tolerance = 0.1, .max_iterations = 20, .preset = "preview"};
  const Quality reference{
      .stop = "gradient", .tolerance = 1e-6, .max_iterations = 2000, .preset = "reference"};
  EXPECT_TRUE(quality({{"quality.preset", "preview"}}) == preview);
  EXPECT_TRUE(quality({{"quality.preset", "reference"}}) == reference);
  EXPECT_TRUE(quality({{"quality.preset", "default"}}) == Quality{});
  Quality finer = reference;
  finer.tolerance = 1e-9;
  EXPECT_TRUE(quality({{"quality.preset", "reference"}, {"quality.tolerance", "1e-9"}}) == finer);
  EXPECT_TRUE(quality({{"quality.tolerance", "1e-9"}, {"quality.preset", "reference"}}) == finer);
}

TEST(SceneIo, ResolvedScenesShowTheNumbersOfThePreset) {
  const Scene scene = parse_scene(kMinimal, "s", {{"quality.preset", "preview"}});
  const std::string resolved = resolved_json(scene);
  for (const char* line : {"\"preset\": \"preview\"", "\"stop\": \"error\"", "\"tolerance\": 0.1",
                           "\"max_iterations\": 20"})
    EXPECT_NE(resolved.find(line), std::string::npos) << line << "\n" << resolved;
  // The numbers are in the file: another table of presets would not change what it means.
  EXPECT_EQ(parse_scene(resolved, "s", {{"quality.preset", "reference"}}).quality.tolerance, 0.1);
}

class SceneFiles : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("piecework_scene_" + std::to_string(::getpid()));
    fs::create_directories(folder_ / "sub");
    ASSERT_EQ(::unsetenv("PIECEWORK_SCENES"), 0);
  }
  void TearDown() override {
    fs::remove_all(folder_);
    ::unsetenv("PIECEWORK_SCENES");
  }
  static std::string message_of(const fs::path& path) {
    try {
      (void)load_scene(path);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  }
  fs::path folder_;
};

TEST_F(SceneFiles, RelativeMeshNamesStartAtTheScenesFolder) {
  write_file_atomically(folder_ / "sub/s.json", kEveryKey);
  const Scene scene =
      load_scene(folder_ / "sub/../sub/s.json", {{"cloths.1.rest_file", "../r.obj"}});
  EXPECT_EQ(scene.cloths[1].mesh.file, (folder_ / "sub/m.obj").string());
  EXPECT_EQ(scene.cloths[1].rest_file, (folder_ / "r.obj").string());
  EXPECT_TRUE(scene.cloths[0].mesh.file.empty());

  // A resolved scene means the same wherever it is put.
  write_file_atomically(folder_ / "resolved.json", resolved_json(scene));
  Scene again = load_scene(folder_ / "resolved.json");
  again.source = scene.source;
  EXPECT_TRUE(again == scene);
}

TEST_F(SceneFiles, ShippedScenesLoadByNameAndReadBack) {
  const std::vector<BuiltinScene> scenes = builtin_scenes();
  std::vector<std::string> names;
  for (const BuiltinScene& builtin : scenes) {
    SCOPED_TRACE(builtin.name);
    names.push_back(builtin.name);
    Scene scene = load_scene(builtin.name);
    EXPECT_TRUE(load_scene(builtin.name + ".json") == scene);
    EXPECT_EQ(scene.name, builtin.name);
    EXPECT_EQ(scene.description, builtin.description);
    EXPECT_FALSE(builtin.description.empty());
    EXPECT_GE(scene.expect.size(), 3U);
    EXPECT_EQ(parse_scene(resolved_json(scene), scene.source), scene);
  }
  for (const char* name : {"cloth_on_stairs", "drape_on_sphere", "flag_in_wind", "folding",
                           "funnel", "garment_on_avatar", "hanging_tablecloth", "knot", "pot_drape",
                           "sewn_bag", "sleeve_push", "stack_of_20", "trampoline", "two_sheets"})
    EXPECT_NE(std::find(names.begin(), names.end(), name), names.end()) << name;
}

// Scene A of the benchmarks; other programs ran exactly these numbers.
TEST_F(SceneFiles, HangingTableclothIsSceneA) {
  const Scene scene = load_scene("hanging_tablecloth");
  const Mesh& mesh = scene.cloths.at(0).mesh;
  EXPECT_EQ(mesh.generator + " " + mesh.pattern, "sheet alternating");
  EXPECT_EQ((std::array{mesh.columns, mesh.rows}), (std::array{100, 100}));
  EXPECT_EQ((std::array{mesh.width, mesh.height}), (std::array{1.0, 1.0}));
  // Held at (0, 0, 0) and (1, 0, 0), which are vertices 0 and 99 (runner/world_test.cpp).
  ASSERT_EQ(scene.cloths[0].pins.size(), 2U);
  EXPECT_EQ(scene.cloths[0].pins[0].region.sphere, (std::array<double, 4>{0, 0, 0, 1e-6}));
  EXPECT_EQ(scene.cloths[0].pins[1].region.sphere, (std::array<double, 4>{1, 0, 0, 1e-6}));
  EXPECT_EQ(scene.step.h, 1.0 / 120);
  EXPECT_EQ(scene.step.steps, 60);
  EXPECT_EQ(scene.gravity, (Vector{0, -9.81, 0}));
  EXPECT_FALSE(scene.wind || scene.damping);
  EXPECT_EQ(scene.solver.domains, 32);
  const Material& cotton = scene.materials.at(scene.cloths[0].material);
  EXPECT_EQ(cotton.density, 0.5);
  EXPECT_NEAR(cotton.stretching * cotton.thickness, 261.08, 0.005);
  const double nu = 0.243, t = 0.318e-3, k_b = 0.821e6 * t * t * t / (24 * (1 - nu * nu));
  EXPECT_NEAR(cotton.bending.value() / (6 * k_b), 1, 2e-4);
}

TEST_F(SceneFiles, UnknownNamesAreAnsweredWithTheNearest) {
  EXPECT_EQ(message_of("hangin_tablecloth"),
            "hangin_tablecloth: no such file, nor a built-in scene; did you mean "
            "\"hanging_tablecloth\"?");
  EXPECT_EQ(message_of("scenes/two_sheet.json"),
            "scenes/two_sheet.json: no such file, nor a built-in scene; did you mean "
            "\"two_sheets\"?");
  EXPECT_TRUE(message_of(folder_).starts_with(
      folder_.string() + ": is a folder, not a scene; known built-in scenes: cloth_on_stairs, "));
}

TEST_F(SceneFiles, EnvironmentNamesTheFolder) {
  write_file_atomically(folder_ / "mine.json", kEveryKey);
  write_file_atomically(folder_ / "broken.json", "{ \"a\": }");
  write_file_atomically(folder_ / "notes.txt", "no scene");
  ASSERT_EQ(::setenv("PIECEWORK_SCENES", folder_.c_str(), 1), 0);
  const std::vector<BuiltinScene> scenes = builtin_scenes();
  ASSERT_EQ(scenes.size(), 2U);
  EXPECT_EQ(scenes[0].name, "broken");
  EXPECT_EQ(scenes[0].description.substr(0, 11), "(unusable: ");
  EXPECT_EQ(scenes[1].description, "every key\nof a scene");
  EXPECT_EQ(load_scene("mine").name, "all");

  ASSERT_EQ(::setenv("PIECEWORK_SCENES", (folder_ / "none").c_str(), 1), 0);
  EXPECT_EQ(message_of("mine"), "PIECEWORK_SCENES: " + (folder_ / "none").string() +
                                    " is not a folder; correct or unset the variable");
}

TEST_F(SceneFiles, FilesComeBeforeBuiltinScenes) {
  const fs::path before = fs::current_path();
  write_file_atomically(folder_ / "two_sheets", kEveryKey);
  fs::create_directories(folder_ / "trampoline");  // say, the output of an earlier run
  fs::current_path(folder_);
  const Scene mine = load_scene("two_sheets"), builtin = load_scene("trampoline");
  fs::current_path(before);
  EXPECT_EQ(mine.name, "all");
  EXPECT_EQ(builtin.name, "trampoline");
}

TEST(SceneReference, DocsAreUpToDate) {
  const fs::path page = fs::path(PIECEWORK_SOURCE_DIR) / "docs/scene.md";
  EXPECT_TRUE(read_file(page) == reference_markdown())
      << "docs/scene.md differs; make it anew: piecework schema --markdown > docs/scene.md";
}

TEST(SceneReference, ItsExampleIsAScene) {
  const std::string page = reference_markdown(), fence = "```json\n";
  const std::size_t begin = page.find(fence) + fence.size(), end = page.find("```", begin);
  const Scene scene = parse_scene(page.substr(begin, end - begin), "docs/scene.md");
  EXPECT_EQ(scene.cloths.size(), 1U);
  EXPECT_EQ(scene.expect.size(), 1U);
}

TEST(SceneReference, NamesEveryKeyOfAFullScene) {
  const std::string page = reference_markdown();
  const std::string text = kEveryKey;
  int keys = 0;
  for (std::size_t at = 0; (at = text.find("\":", at)) != std::string::npos; ++at) {
    const std::size_t begin = text.rfind('"', at - 1) + 1;
    const std::string key = text.substr(begin, at - begin);
    if (key == "m/1" || key == "soft") continue;
    EXPECT_NE(page.find("| `" + key + "` |"), std::string::npos) << key;
    ++keys;
  }
  EXPECT_GT(keys, 80);
}

}  // namespace
}  // namespace piecework::scene
