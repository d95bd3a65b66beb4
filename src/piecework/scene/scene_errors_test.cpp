// Every way to be wrong, with the exact message. The places are marked in the texts with '@', so
// the expected lines and columns come from the test itself.

#include <string>

#include <gtest/gtest.h>

#include <piecework/core/error.hpp>
#include <piecework/scene/document.hpp>
#include <piecework/scene/nearest.hpp>
#include <piecework/scene/scene_io.hpp>

namespace piecework::scene {
namespace {

constexpr const char* kMaterials = R"("materials": { "cotton": {}, "silk": {} })";
constexpr const char* kCloths =
    R"("cloths": [ { "mesh": { "generator": "sheet" }, "material": "cotton" } ])";

std::string message_of(const std::string& text, const std::vector<Override>& overrides = {}) {
  try {
    (void)parse_scene(text, "s.json", overrides);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

struct Fault {
  std::string text;     ///< '@' marks the place of the error
  std::string message;  ///< from the pointer on
};

void expect_fault(const Fault& fault) {
  SCOPED_TRACE(fault.text);
  const std::size_t at = fault.text.find('@');
  ASSERT_NE(at, std::string::npos);
  std::string text = fault.text;
  text.erase(at, 1);
  std::size_t line = 1, column = 1;
  for (std::size_t i = 0; i < at; ++i) {
    column = text[i] == '\n' ? 1 : column + 1;
    if (text[i] == '\n') ++line;
  }
  const std::string expected =
      "s.json:" + std::to_string(line) + ":" + std::to_string(column) + ": " + fault.message;
  EXPECT_EQ(message_of(text), expected);
}

/// A scene that is right but for `keys`, which come first.
std::string with(const std::string& keys) {
  return "{\n  " + keys + ",\n  " + kMaterials + ",\n  " + kCloths + "\n}";
}

std::string with_cloth(const std::string& cloths) {
  return "{ " + std::string(kMaterials) + ",\n \"cloths\": [\n" + cloths + "] }";
}

/// One cloth with more keys.
std::string in_cloth(const std::string& keys) {
  return with_cloth(R"({ "mesh": { "generator": "sheet" }, "material": "cotton",)"
                    "\n" +
                    keys + "}");
}

TEST(SceneErrors, TheBaseScenesAreRight) {
  EXPECT_EQ(message_of(with(R"("name": "x")")), "no error");
  EXPECT_EQ(message_of(in_cloth(R"("name": "x")")), "no error");
}

TEST(SceneErrors, Syntax) {
  const std::string words =
      "text needs double quotes; other words are true, false and null; numbers are finite";
  for (
      const Fault& fault : std::vector<Fault>{
          {"@", "/: syntax error: there is no value; write { \"cloths\": [ ... ] }"},
          {" \n // nothing\n@",
           "/: syntax error: there is no value; write { \"cloths\": [ ... ] }"},
          {"{ \"a\": 1,\n @}", "/: syntax error: a comma before }; remove that comma"},
          {"{ \"a\": [1, 2, @] }", "/a/2: syntax error: a comma before ]; remove that comma"},
          {"{ \"a\": 1\n  @\"b\": 2 }",
           "/: syntax error: unexpected \"b\" after 1; put a comma or a colon between them"},
          {"{ \"a\" @1 }",
           "/a: syntax error: unexpected 1 after \"a\"; put a comma or a colon between them"},
          {"{ \"a\": [1 @2] }",
           "/a/1: syntax error: unexpected 2 after 1; put a comma or a colon between them"},
          {"{ @'a': 1 }", "/: syntax error: unexpected '; write text in double quotes"},
          {"{ @a: 1 }", "/: syntax error: unexpected a; " + words},
          {"{ \"a\": /* x */ @tru, \"b\": 1 }", "/a: syntax error: unexpected tru; " + words},
          {"{ \"step\": { \"h\": @NaN } }", "/step/h: syntax error: unexpected NaN; " + words},
          {"{ \"step\": { \"h\": @-inf } }",
           "/step/h: syntax error: -inf is not a number; write it like 0.5, -3 or 1e-3"},
          {"{ \"a\": @.5 }", "/a: syntax error: .5 is not a number; write it like 0.5, -3 or 1e-3"},
          {"{ \"a\": @1. }", "/a: syntax error: 1. is not a number; write it like 0.5, -3 or 1e-3"},
          {"{ \"a\": @012 }",
           "/: syntax error: 012 is not a number; write it like 0.5, -3 or 1e-3"},
          {"{ \"a\": [1, { \"b\": 2 }@",
           "/a/2: syntax error: the text ends inside what line 1, column 8 began; close it with ]"},
          {"{\n  \"a\": {} @",
           "/: syntax error: the text ends inside what line 1, column 1 began; close it with }"},
          {"{ \"a\": @\"b\n\" }",
           "/a: syntax error: invalid string: control character U+000A (LF) must be escaped to "
           "\\u000A or \\n; correct the string"},
          {"{ \"a\": @\"b",
           "/a: syntax error: invalid string: missing closing quote; correct the string"},
          {"{ \"a\": @\"\\q\" }",
           "/a: syntax error: invalid string: forbidden character after backslash; correct the "
           "string"},
          {"{ \"a\": @\"\xff\" }",
           "/a: syntax error: invalid string: ill-formed UTF-8 byte; correct the string"},
          {"{ \"a\": 1, @/* open",
           "/: syntax error: invalid comment, missing closing '*/'; comments are // to the end of "
           "the line or /* ... */"},
          {"{ \"a\": @/x }",
           "/a: syntax error: invalid comment, expecting '/' or '*' after '/'; comments are // to "
           "the end of the line or /* ... */"},
          {"{}\n@{}",
           "/: syntax error: unexpected { after the end of the scene; remove what follows"},
          {"{ \"a\": 1@] }",
           "/: syntax error: unexpected ']', expected '}'; correct the punctuation here or just "
           "before"}})
    expect_fault(fault);
}

TEST(SceneErrors, PlacesCountCharactersAndKnowComments) {
  for (const Fault& fault : std::vector<Fault>{
           // Columns are characters, not bytes; CRLF ends a line; strings may hold anything.
           {"{ \"name\": \"x\", // comment with \" and {\r\n\t@\"stpe\": 1 }",
            "/stpe: unknown key \"stpe\"; did you mean \"step\"?"},
           {"{ \"name\": \"\\\"// [ \\\\\", /* \n , : */ @\"stpe\": 1 }",
            "/stpe: unknown key \"stpe\"; did you mean \"step\"?"},
           {"{\"name\":\"x\",@\"stpe\":1}", "/stpe: unknown key \"stpe\"; did you mean \"step\"?"},
           {"{ \"step\": { \"steps\": 3/* */,@\"x\": 1 } }",
            "/step/x: unknown key \"x\"; known keys here: h, steps, output_every"}})
    expect_fault(fault);
  EXPECT_EQ(message_of("{ \"name\": \"\xC3\xA4\xE2\x82\xAC\", \"stpe\": 1 }").substr(0, 12),
            "s.json:1:17:");
  EXPECT_EQ(message_of("\xEF\xBB\xBF{ \"stpe\": 1 }").substr(0, 11), "s.json:1:3:");
}

TEST(SceneErrors, Keys) {
  for (
      const Fault& fault : std::vector<Fault>{
          {R"({ "name": "a", @"name": "b" })",
           "/name: duplicate key \"name\"; keep one of the two"},
          {R"({ "step": { "h": 1, @"h": 1 } })",
           "/step/h: duplicate key \"h\"; keep one of the two"},
          {with(R"(@"Solver": {})"), "/Solver: unknown key \"Solver\"; did you mean \"solver\"?"},
          {with(R"("quality": { @"maxIterations": 3 })"),
           "/quality/maxIterations: unknown key \"maxIterations\"; did you mean "
           "\"max_iterations\"?"},
          {with(R"(@"domains": 4)"),
           "/domains: unknown key \"domains\"; did you mean "
           "\"solver.domains\"?"},
          {with(R"("solver": { @"sphere": 4 })"),
           "/solver/sphere: unknown key \"sphere\"; did you mean "
           "\"cloths.0.pins.0.region.sphere\"?"},
          {with(R"(@"humidity": 0.4)"),
           "/humidity: unknown key \"humidity\"; known keys here: name, description, step, "
           "gravity, "
           "wind, damping, self_collision, friction, kinetic_friction, contact, solver, quality, "
           "materials, cloths, "
           "seams, colliders, "
           "camera, render, expect"},
          {with(R"(@"a/b~c": 0.4)"),
           "/a~1b~0c: unknown key \"a/b~c\"; known keys here: name, description, step, gravity, "
           "wind, damping, self_collision, friction, kinetic_friction, contact, solver, quality, "
           "materials, cloths, "
           "seams, colliders, "
           "camera, render, expect"},
          {R"(@{ "cloths": [] })",
           "/: \"materials\" is missing; add it: materials by name; cloths share them"},
          {with_cloth(R"(@{ "mesh": { "generator": "sheet" } })"),
           "/cloths/0: \"material\" is missing; add it: name of an entry of materials"},
          {in_cloth(R"("pins": [ @{} ])"),
           "/cloths/0/pins/0: \"region\" is missing; add it: vertices to hold"},
          {in_cloth(R"("pins": [ { "region": @{} } ])"),
           "/cloths/0/pins/0/region: \"vertices\" or \"sets\" or \"box\" or \"sphere\" is missing; "
           "give at least one"},
          {in_cloth(R"("pins": [ { "region": @{ "box": null } } ])"),
           "/cloths/0/pins/0/region: \"vertices\" or \"sets\" or \"box\" or \"sphere\" is missing; "
           "give at least one"},
          {in_cloth(R"("loads": [ @{ "region": { "sets": ["border"] } } ])"),
           "/cloths/0/loads/0: \"force\" is missing; add it: total force, shared by the vertices "
           "in "
           "proportion to their mass"},
          {with_cloth(R"({ "mesh": @{}, "material": "cotton" })"),
           "/cloths/0/mesh: neither \"generator\" nor \"file\" is given; give one"},
          {with_cloth(R"({ "mesh": @{ "generator": "disc", "file": "a" }, "material": "cotton" })"),
           "/cloths/0/mesh: \"generator\" and \"file\" exclude each other; remove one"},
          {with_cloth(R"({ "mesh": { "file": "a", "width": @2 }, "material": "cotton" })"),
           "/cloths/0/mesh/width: \"width\" has no effect here, it belongs to generator; remove "
           "it"},
          {with_cloth(R"({ "mesh": { "generator": "disc", "units": @2 }, "material": "cotton" })"),
           "/cloths/0/mesh/units: \"units\" has no effect here, it belongs to file; remove it"},
          {in_cloth(R"("rest_file": @"a.obj")"),
           "/cloths/0/rest_file: \"rest_file\" has no effect here, it belongs to \"rest\": "
           "\"file\"; "
           "remove it"},
          {with(R"("expect": [ @{ "quantity": "center_y" } ])"),
           "/expect/0: \"min\" or \"max\" is missing; give at least one"},
          {with(R"("expect": [ { "quantity": "center_y", "max": 1, "vertex": @3 } ])"),
           "/expect/0/vertex: \"vertex\" has no effect here, it belongs to a vertex_* quantity; "
           "remove it"}})
    expect_fault(fault);
}

TEST(SceneErrors, Colliders) {
  const auto in = [](const std::string& collider) {
    return with("\"colliders\": [ " + collider + " ]");
  };
  for (
      const Fault& fault : std::vector<Fault>{
          {in(R"(@{ "radius": 1 })"),
           "/colliders/0: \"shape\" is missing; add it: kind of body; all but mesh are exact "
           "solids"},
          {in(R"({ "shape": "plane", "radius": @1 })"),
           "/colliders/0/radius: \"radius\" has no effect here, it belongs to shape sphere, "
           "capsule, cylinder; remove it"},
          {in(R"({ "shape": "box", "scale": @[1, 2, 3] })"),
           "/colliders/0/scale: \"scale\" has no effect here, it belongs to shape mesh; remove it"},
          {in(R"({ "shape": "box", "mesh": @{ "generator": "pot" } })"),
           "/colliders/0/mesh: \"mesh\" has no effect here, it belongs to shape mesh; remove it"},
          {in(R"(@{ "shape": "mesh" })"),
           "/colliders/0: 0 of \"mesh\", \"sequence\" and \"avatar\" are given; give one of them"},
          {in(R"(@{ "shape": "mesh", "mesh": { "file": "a.obj" }, "avatar": { "file": "b.glb" } })"),
           "/colliders/0: 2 of \"mesh\", \"sequence\" and \"avatar\" are given; give one of them"},
          {in(R"({ "shape": "mesh", "avatar": @{} })"),
           "/colliders/0/avatar: \"file\" is missing; add it: glTF, GLB or FBX file; a relative "
           "name starts at the folder of the scene"},
          {in(R"({ "shape": "mesh", "sequence": { "pattern": "a{}", "first": 3, "last": @2 } })"),
           "/colliders/0/sequence/last: last (2) is below first (3); exchange or correct them"},
          {in(R"({ "shape": "plane", "normal": @[0, 0, 0] })"),
           "/colliders/0/normal: the normal has no direction; write one, such as [0, 1, 0]"},
          {in(R"(@{ "shape": "half_spaces" })"),
           "/colliders/0: \"half_spaces\" without \"planes\"; list at least one"},
          {in(R"({ "shape": "cylinder", "to": @[0, 0, 0] })"),
           "/colliders/0/to: \"from\" and \"to\" are the same point; move one of them"},
          {in(R"({ "shape": "sphere", "motion": { "rate": 1, "axis": @[0, 0, 0] } })"),
           "/colliders/0/motion/axis: the axis of rotation has no direction; write one, such as "
           "[0, 1, 0]"},
          {in(R"({ "shape": "sphere", "motion": { "start": 2, "stop": @1 } })"),
           "/colliders/0/motion/stop: stop (1) is below start (2); exchange or correct them"},
          {in(R"({ "shape": "sphere", "friction": @-1 })"),
           "/colliders/0/friction: -1 is out of range; choose a value of at least 0 and at most "
           "10"},
          {in(R"({ "shape": "sphere", "friction": 0.2, "kinetic_friction": @0.3 })"),
           "/colliders/0/kinetic_friction: friction (0.2) is below kinetic_friction (0.3); "
           "exchange "
           "or correct them"},
          {in(R"({ "shape": "sphere", "kinetic_friction": @0.3 })"),
           "/colliders/0/kinetic_friction: \"kinetic_friction\" without \"friction\"; add "
           "\"friction\", at least as large"},
          {in(R"({ "shape": "plane", "surface": @"triangles" })"),
           "/colliders/0/surface: \"surface\" has no effect here, it belongs to a shape with a "
           "closed "
           "form and an end: sphere, capsule, box, cylinder, half_spaces; remove it"},
          {in(R"({ "shape": "sphere", "segments": @4 })"),
           "/colliders/0/segments: \"segments\" has no effect here, it belongs to surface "
           "triangles; "
           "remove it"},
          {in(R"({ "shape": "half_spaces", "planes": [ {} ], "surface": "triangles",
                   "rounding": @0.1 })"),
           "/colliders/0/rounding: triangles of half-spaces have sharp edges; leave out "
           "\"rounding\", or \"surface\""},
          {in(R"({ "shape": "sphere" }, @{ "shape": "plane" })"),
           "/colliders/1/name: a second collider named \"collider\"; give each collider its own "
           "\"name\""}})
    expect_fault(fault);
}

TEST(SceneErrors, Types) {
  for (
      const Fault& fault : std::vector<Fault>{
          {"@[]", "/: expected an object, found a list; write { \"key\": value, ... }"},
          {with(R"("step": @3)"),
           "/step: expected an object, found the number 3; write { \"key\": value, ... }"},
          {with(R"("step": @null)"),
           "/step: expected an object, found null; write { \"key\": value, ... }"},
          {with(R"("step": { "h": @"0.1" })"),
           "/step/h: expected a number, found the text \"0.1\"; write it without quotes, such as "
           "0.5 "
           "or 1e-3"},
          {with(R"("step": { "h": @null })"),
           "/step/h: expected a number, found null; write it without quotes, such as 0.5 or 1e-3"},
          {with(R"("step": { "steps": @true })"),
           "/step/steps: expected a whole number, found true; write it without quotes, such as 16"},
          {with(R"("step": { "steps": @1.5 })"),
           "/step/steps: expected a whole number, found the number 1.5; round it"},
          {with(R"("render": { "borders": @1 })"),
           "/render/borders: expected true or false, found the number 1; write one of them, "
           "without "
           "quotes"},
          {with(R"("name": @{})"),
           "/name: expected a text, found an object; write it in double quotes"},
          {with(R"("name": @"")"), "/name: the text is empty; write a name"},
          {with(R"("name": @"a\u0000b")"), "/name: \"a\\x00b\" has a control character; remove it"},
          {with(R"("gravity": @-9.81)"),
           "/gravity: expected a list, found the number -9.81; write [ ... ]"},
          {with(R"("gravity": @[0, -9.81])"),
           "/gravity: expected a list of 3, found 2; write 3 values"},
          {with(R"("gravity": [0, @"x", 0])"),
           "/gravity/1: expected a number, found the text \"x\"; write it without quotes, such as "
           "0.5 or 1e-3"},
          {in_cloth(R"("pins": @{})"),
           "/cloths/0/pins: expected a list, found an object; write [ ... ]"},
          {in_cloth(R"("pins": [ { "region": { "vertices": @[] } } ])"),
           "/cloths/0/pins/0/region/vertices: the list is empty; list at least one, or remove the "
           "key"},
          {in_cloth(R"("pins": [ { "region": { "vertices": [0, @-1] } } ])"),
           "/cloths/0/pins/0/region/vertices/1: -1 is out of range; choose a value of at least 0"},
          {in_cloth(R"("pins": [ { "region": { "box": @[0, 0, 0] } } ])"),
           "/cloths/0/pins/0/region/box: expected a list of 2, found 3; write 2 values"},
          {R"({ "materials": @[], "cloths": [] })",
           "/materials: expected an object of named entries, found a list; write { \"name\": { ... "
           "}, ... }"},
          {R"({ "materials": @{}, "cloths": [] })",
           "/materials: \"materials\" is empty; define at least one"},
          {R"({ "materials": { @"": {} }, "cloths": [] })",
           "/materials: an entry without a name; name it"},
          {R"({ "materials": { "a": {} }, "cloths": @[] })",
           "/cloths: \"cloths\" is empty; list at least one"}})
    expect_fault(fault);
}

TEST(SceneErrors, Ranges) {
  for (const Fault& fault : std::vector<Fault>{
           {with(R"("step": { "h": @1e999 })"),
            "/step/h: the number 1e999 is too large; write a finite number below 1.8e308"},
           {with(R"("gravity": [0, @-1e999, 0])"),
            "/gravity/1: the number -1e999 is too large; write a finite number below 1.8e308"},
           {with(R"("step": { "h": @0 })"),
            "/step/h: 0 is out of range; choose a value above 0 and at most 10"},
           {with(R"("step": { "h": @-0.1 })"),
            "/step/h: -0.1 is out of range; choose a value above 0 and at most 10"},
           {with(R"("solver": { "domains": @0 })"),
            "/solver/domains: 0 is out of range; choose a value of at least 1 and at most 65536"},
           {with(R"("solver": { "domains": @65537 })"),
            "/solver/domains: 65537 is out of range; choose a value of at least 1 and at most "
            "65536"},
           {with(R"("solver": { "threads": @1025 })"),
            "/solver/threads: 1025 is out of range; choose a value of at least 0 and at most 1024"},
           {with(R"("solver": { "threads": @18446744073709551615 })"),
            "/solver/threads: 1.8446744073709552e+19 is out of range; choose a value of at least 0 "
            "and at most 1024"},
           {with(R"("damping": @0)"),
            "/damping: 0 is out of range; choose a value above 0 and at most 1000000"},
           {with(R"("render": { "size": [640, @8] })"),
            "/render/size/1: 8 is out of range; choose a value of at least 16 and at most 8192"},
           {in_cloth(R"("pins": [ { "region": { "sphere": [0, 0, 0, @-1] } } ])"),
            "/cloths/0/pins/0/region/sphere/3: the radius must be above 0; write [x, y, z, "
            "radius]"},
           {in_cloth(R"("pins": [ { "region": { "box": @[[0, 2, 0], [1, 1, 1]] } } ])"),
            "/cloths/0/pins/0/region/box: the lowest corner is above the highest along y; write "
            "[[lowest x, y, z], [highest x, y, z]]"}})
    expect_fault(fault);
}

TEST(SceneErrors, ChoicesAndReferences) {
  for (const Fault& fault : std::vector<Fault>{
           {with(R"("solver": { "method": @"vanila_pd" })"),
            "/solver/method: unknown value \"vanila_pd\"; did you mean \"vanilla_pd\"?"},
           {with(R"("quality": { "stop": @"never" })"),
            "/quality/stop: unknown value \"never\"; known values: error, gradient, dx_2, dx_rms, "
            "dx_inf, iterations"},
           {with(R"("quality": { "preset": @"refrence" })"),
            "/quality/preset: unknown value \"refrence\"; did you mean \"reference\"?"},
           {with(R"("solver": { "global": @"trees" })"),
            "/solver/global: unknown value \"trees\"; did you mean \"tree\"?"},
           {with(R"("solver": { "domains": 3, "domain_weights": @[1, 2] })"),
            "/solver/domain_weights: 2 weights for 3 domains; write one per domain, or [] for "
            "equal domains"},
           {with(R"("solver": { "local": @"gauss_seidel", "method": "newton" })"),
            "/solver/local: \"gauss_seidel\" is a part of \"method\": \"dd_pd\" only; write "
            "\"jacobi\", or choose \"dd_pd\" for \"method\""},
           {with(R"("solver": { "local": @"literal_eq12" })"),
            "/solver/local: the printed Eq. 12 may raise the energy, which no acceleration can "
            "take; set \"accelerate\": \"none\" in \"quality\", or choose \"gauss_seidel\""},
           {with(R"("solver": { "seams": @"dual" })"),
            "/solver/seams: multipliers on seams, but \"global\" is \"tree\"; write "
            "\"elimination\", or choose \"primal_dual\" for \"global\""},
           {with(R"("solver": { "domain_weights": @[1] })"),
            "/solver/domain_weights: 1 weights for 32 domains; write one per domain, or [] for "
            "equal domains"},
           {with(R"("expect": [ { "quantity": @"lowestY", "min": 0 } ])"),
            "/expect/0/quantity: unknown value \"lowestY\"; did you mean \"lowest_y\"?"},
           {with_cloth(R"({ "mesh": { "generator": "sheet" }, "material": @"coton" })"),
            "/cloths/0/material: no material \"coton\" is defined; did you mean \"cotton\"?"},
           {with_cloth(R"({ "mesh": { "generator": "sheet" }, "material": @"steel" })"),
            "/cloths/0/material: no material \"steel\" is defined; known materials: cotton, silk"},
           {with_cloth(R"({ "mesh": { "generator": "sheet" }, "material": "silk" },
                          @{ "mesh": { "generator": "sheet" }, "material": "silk" })"),
            "/cloths/1/name: a second cloth named \"cloth\"; give each cloth its own \"name\""},
           {with_cloth(R"({ "name": "a", "mesh": { "generator": "sheet" }, "material": "silk" },
                          { "name": @"a", "mesh": { "generator": "sheet" }, "material": "silk" })"),
            "/cloths/1/name: a second cloth named \"a\"; give each cloth its own \"name\""},
           {with_cloth(
                R"(@{ "mesh": { "generator": "sheet" }, "material": "silk", "rest": "file" })"),
            "/cloths/0: \"rest\" is \"file\" without a \"rest_file\"; name the mesh of the rest "
            "shape"},
           {in_cloth(R"("pins": [ { "region": { "sets": ["left"] }, "start": 2, "stop": @1 } ])"),
            "/cloths/0/pins/0/stop: stop (1) is below start (2); exchange or correct them"},
           {in_cloth(
                R"("pins": [ { "region": { "sets": ["left"] }, "rate": 1, "axis": @[0, 0, 0] } ])"),
            "/cloths/0/pins/0/axis: the axis of rotation has no direction; write one, such as [0, "
            "1, "
            "0]"},
           {in_cloth(R"("loads": [ { "region": { "sets": ["left"] }, "force": [0, 1, 0], "start": 2,
                        "stop": @1 } ])"),
            "/cloths/0/loads/0/stop: stop (1) is below start (2); exchange or correct them"},
           {with(R"("quality": { "min_iterations": 9, "max_iterations": @8 })"),
            "/quality/max_iterations: max_iterations (8) is below min_iterations (9); exchange or "
            "correct them"},
           {with(R"("step": { "steps": 60, "output_every": @7 })"),
            "/step/output_every: 60 steps are no multiple of 7; choose a divisor of \"steps\""},
           {with(R"("camera": { "position": [1, 2, 3], "target": @[1, 2, 3] })"),
            "/camera/target: the camera looks at its own position; move \"target\" or "
            "\"position\""},
           {with(R"("expect": [ { "quantity": "center_y", "min": 1, "max": @0 } ])"),
            "/expect/0/max: max (0) is below min (1); exchange or correct them"},
           {with(R"("expect": [ @{ "quantity": "vertex_y", "min": 1 } ])"),
            "/expect/0: vertex_y does not say which vertex; add \"vertex\", a number from 0"},
           {with(R"("expect": [ { "quantity": "center_y", "min": 1, "cloth": @"cloht" } ])"),
            "/expect/0/cloth: no cloth is named \"cloht\"; did you mean \"cloth\"?"}})
    expect_fault(fault);
  EXPECT_EQ(
      message_of(R"({ "materials": { "m": {} }, "cloths": [
      { "name": "a", "mesh": { "generator": "sheet" }, "material": "m" },
      { "name": "b", "mesh": { "generator": "sheet" }, "material": "m" } ],
      "expect": [ { "quantity": "vertex_y", "vertex": 1, "min": 1 } ] })"),
      "s.json:4:19: /expect/0: vertex_y does not say of which of the 2 cloths; add \"cloth\", "
      "the name of one");
}

TEST(SceneErrors, Limits) {
  const auto nested = [](std::size_t depth) {
    return "{ \"a\": " + std::string(depth - 1, '[') + std::string(depth - 1, ']') + " }";
  };
  const auto message = [](const std::string& text) {
    try {
      (void)parse_document(text, "s.json");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_EQ(message(nested(kMaxDepth)), "no error");
  std::string deep = "s.json:1:71: /a";
  for (std::size_t i = 0; i + 1 < kMaxDepth; ++i) deep += "/0";
  EXPECT_EQ(
      message(nested(kMaxDepth + 1)),
      deep + ": nested deeper than 64 levels; a scene needs fewer than 10; check the brackets");
  EXPECT_EQ(message(std::string(1'000'000, '[')).substr(0, 11), "s.json:1:65");
  EXPECT_EQ(message(std::string(kMaxTextBytes + 1, ' ')),
            "s.json: /: 67108865 bytes, the limit is 67108864; put meshes into mesh files and name "
            "vertices by sets");
  std::string many = "[0";
  for (std::size_t i = 0; i < kMaxValues; ++i) many += ",0";
  EXPECT_NE(message(many + "]").find("more than 2000000 values"), std::string::npos);
  EXPECT_EQ(message(std::string("{}\0x", 4)),
            "s.json: /: byte 2 is zero; this is not a text file; name a scene");
}

struct BadOverride {
  Override change;
  std::string message;
};

TEST(SceneErrors, Overrides) {
  const std::string scene = with(R"("step": { "steps": 3 })");
  ASSERT_EQ(message_of(scene), "no error");
  for (
      const BadOverride& bad : std::vector<BadOverride>{
          {{"solver.domains", "0"},
           "--set solver.domains=0: /solver/domains: 0 is out of range; choose a value of at least "
           "1 and at most 65536"},
          {{"solver.domain", "4"},
           "--set solver.domain=4: /solver/domain: unknown key \"domain\"; did you mean "
           "\"domains\"?"},
          {{"domains", "4"},
           "--set domains=4: /domains: unknown key \"domains\"; did you mean \"solver.domains\"?"},
          {{"/step/h", "NaN"},
           "--set /step/h=NaN: /step/h: expected a number, found the text \"NaN\"; write it "
           "without "
           "quotes, such as 0.5 or 1e-3"},
          {{"step.h", "1e999"},
           "--set step.h=1e999: /step/h: the number 1e999 is too large; write a finite number "
           "below "
           "1.8e308"},
          {{"step.h", "+1"},
           "--set step.h=+1: /step/h: syntax error: +1 is not a number; write it like 0.5, -3 or "
           "1e-3"},
          {{"step.steps.x", "1"},
           "--set step.steps.x=1: /step/steps: is the number 3, it has no \"x\"; set the whole "
           "value, or correct the path"},
          {{"step", "{\"h\": 1, \"x\": 2}"},
           "--set step={\"h\": 1, \"x\": 2}: /step/x: unknown key \"x\"; known keys here: h, "
           "steps, "
           "output_every"},
          {{"gravity", "[0, 1"},
           "--set gravity=[0, 1: /gravity/2: syntax error: the text ends too early; close it with "
           "]"},
          {{"cloths.2.name", "x"},
           "--set cloths.2.name=x: /cloths: has no item \"2\", it is a list of 1; use a number "
           "from "
           "0 to 0, 1 to append, or set the whole list"},
          {{"cloths.x.name", "x"},
           "--set cloths.x.name=x: /cloths: has no item \"x\", it is a list of 1; use a number "
           "from "
           "0 to 0, 1 to append, or set the whole list"},
          {{"gravity.1", "-5"},
           "--set gravity.1=-5: /gravity: has no item \"1\", it is a list of 0; set the whole "
           "list"},
          {{"cloths..name", "x"},
           "--set cloths..name=x: /cloths: the path of the override is malformed; write it like "
           "solver.domains=16 or cloths.0.pins.0.stop=2"},
          {{"", "x"},
           "--set =x: /: the path of the override is malformed; write it like solver.domains=16 or "
           "cloths.0.pins.0.stop=2"},
          {{"name", "\xff"}, "--set name=\xff: /name: the text is not UTF-8; write it in UTF-8"},
          {{"cloths.0.material", "coton"},
           "--set cloths.0.material=coton: /cloths/0/material: no material \"coton\" is defined; "
           "did you mean \"cotton\"?"},
          {{"materials.cottn.density", "1"},
           "--set materials.cottn.density=1: /materials/cottn: no cloth uses a material \"cottn\"; "
           "did you mean \"cotton\"?"}}) {
    EXPECT_EQ(message_of(scene, {bad.change}), bad.message);
  }
}

// Distances counted by hand.
TEST(Nearest, CountsEdits) {
  EXPECT_EQ(edit_distance("", ""), 0U);
  EXPECT_EQ(edit_distance("", "abc"), 3U);
  EXPECT_EQ(edit_distance("steps", "stpes"), 1U);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3U);
  EXPECT_EQ(edit_distance("Max-Iterations", "max_iterations"), 0U);
  EXPECT_EQ(edit_distance("ca", "abc"), 3U);  // optimal string alignment, not full Damerau
}

TEST(Nearest, GivesNoneIfNoneIsAlike) {
  EXPECT_EQ(nearest("h", {"x", "steps"}), "");
  EXPECT_EQ(nearest("stps", {"stop", "steps"}), "steps");
  EXPECT_EQ(nearest("x", {}), "");
  EXPECT_EQ(nearest(std::string(1'000'000, 'a'), {"steps"}), "");
}

}  // namespace
}  // namespace piecework::scene
