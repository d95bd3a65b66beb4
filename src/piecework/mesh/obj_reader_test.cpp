#include <piecework/mesh/obj_reader.hpp>

#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <piecework/core/error.hpp>
#include <piecework/core/random.hpp>
#include <piecework/mesh/import.hpp>
#include <piecework/mesh/polygon.hpp>

namespace piecework::mesh {
namespace {

const std::string kThree = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

RawMesh read(const std::string& text) { return read_obj("a.obj", text, kMaxTriangles); }

std::string error_of(const std::string& text, std::size_t max_triangles = kMaxTriangles) {
  try {
    read_obj("a.obj", text, max_triangles);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(ObjReader, KeepsEverythingOfTheFile) {
  const RawMesh mesh = read(
      "\xef\xbb\xbf# comment\r\nmtllib x.mtl\r\n"
      "v 0.1 -2e-3 +3 # here\r\nv 1 0 0 1.0\r\nv 1 1 0 0.5 0.5 0.5\r\nv 0 1 0 1 .1 .2 .3\r\n"
      "vt 0.25 0.5\r\nvt 1\r\nvt 1 1 0\r\nvn 0 0 1\r\ns off\r\n"
      "g front\tpanel\r\nf 1/1/1 2/2/1 3/3/1 4/1\r\n"
      "seam a b\r\nstitch 1 2 3 0.5\r\n"
      "o back\r\nf -4//1 -3 \\\r\n -2\r\nf 1 2/2 4\r\nl 1 2\r\np 1\r\n");
  ASSERT_EQ(mesh.positions.size(), 4U);
  EXPECT_EQ(mesh.positions[0], Vec3(0.1, -2e-3, 3));
  EXPECT_EQ(mesh.positions[3], Vec3(0, 1, 0));
  EXPECT_EQ(mesh.vertex_line, (std::vector<int>{3, 4, 5, 6}));
  const FileLayout& layout = mesh.layout;
  EXPECT_EQ(layout.polygon_begin, (std::vector<int>{0, 4, 7, 10}));
  EXPECT_EQ(layout.polygon_vertex, (std::vector<int>{0, 1, 2, 3, 0, 1, 2, 0, 1, 3}));
  EXPECT_EQ(layout.polygon_uv, (std::vector<int>{0, 1, 2, 0, -1, -1, -1, -1, 1, -1}));
  EXPECT_EQ(layout.uv, (std::vector<Vec2>{{0.25, 0.5}, {1, 0}, {1, 1}}));
  EXPECT_EQ(mesh.polygon_line, (std::vector<int>{13, 17, 19}));
  ASSERT_EQ(layout.groups.size(), 2U);
  EXPECT_EQ(layout.groups[0].name, "front panel");
  EXPECT_EQ(layout.groups[1].name, "back");
  EXPECT_EQ(layout.groups[1].first_polygon, 1);
  ASSERT_EQ(mesh.notes.size(), 1U);
  EXPECT_EQ(mesh.notes[0], "skipped 2 line and point elements");
}

TEST(ObjReader, DoublePrecisionSurvives) {
  const RawMesh mesh = read("v 0.1 1e-320 123456789.12345678\n" + kThree + "f 2 3 4\n");
  EXPECT_EQ(mesh.positions[0], Vec3(0.1, 1e-320, 123456789.12345678));
  EXPECT_EQ(read("v 1e-400 0 0\n" + kThree + "f 2 3 4").positions[0].x(), 0.0);
}

TEST(ObjReader, FacesMayComeBeforeTheirVertices) {
  EXPECT_EQ(read("f 1 2 3\n" + kThree).layout.polygon_vertex, (std::vector<int>{0, 1, 2}));
}

TEST(ObjReader, UnnamedGroupsAreNone) {
  EXPECT_TRUE(read(kThree + "f 1 2 3\n").layout.groups.empty());
  EXPECT_TRUE(read(kThree + "g\nf 1 2 3\n").layout.groups.empty());
  EXPECT_EQ(read(kThree + "f 1 2 3\ng x\nf 1 2 3\n").layout.groups.size(), 2U);
  EXPECT_EQ(read(kThree + "g y\ng x\nf 1 2 3\nf 1 2 3\n").layout.groups.size(), 1U);
}

TEST(ObjReader, ErrorsNameLineAndToken) {
  const struct {
    std::string text;
    const char* error;
  } cases[] = {
      {"v a 0 0\n", "a.obj:1: 'a' is not a number; "},
      {"v 1.5x 0 0\n", "'1.5x' is not a number"},
      {"v + 0 0\n", "'+' is not a number"},
      {"v 0 nan 0\n", "a.obj:1: 'nan' is not a finite number"},
      {"v 0 -inf 0\n", "'-inf' is not a finite number"},
      {"\nv 0 1e999 0\n", "a.obj:2: '1e999' is not a finite number"},
      {"v 0 0\n", "vertex with 2 coordinates"},
      {"v 0 0 0 0 0\n", "vertex with 5 numbers"},
      {"v 0 0 0 red\n", "'red' is not a number"},
      {"vt\n", "texture coordinate with 0 numbers"},
      {"vt 0 inf\n", "'inf' is not a finite number"},
      {kThree + "f 1 2\n", "a.obj:4: face with 2 corners"},
      {kThree + "f\n", "face with 0 corners"},
      {kThree + "f 1 2 x\n", "'x' is not a vertex index"},
      {kThree + "f 1 2 3.5\n", "'3.5' is not a vertex index"},
      {kThree + "f 1 2 /3\n", "'' is not a vertex index"},
      {kThree + "f 0 1 2\n", "a.obj:4: vertex index 0; OBJ counts from 1"},
      {kThree + "f 1 2 4\n", "a.obj:4: vertex index 4 is out of range, the file has 3 vertices"},
      {kThree + "f 1 2 2147483647\n", "vertex index 2147483647 is out of range"},
      {kThree + "f 1 2 99999999999999999999\n", "99999999999999999999 is out of range"},
      {kThree + "f -1 -2 -4\n", "vertex index -4 is out of range; 3 are defined so far"},
      {kThree + "f 1/1 2/1 3/1\n", "texture coordinate index 1 is out of range"},
      {kThree + "f 1/a 2 3\n", "'a' is not a texture coordinate index"},
      {kThree, "a.obj: no faces"},
      {std::string("\0\1\2\3 \xff\xfe\n", 8), "a.obj: no faces"},
      {"v \x01\x02 0 0\n", "'\?\?' is not a number"},
      {"", "a.obj: no faces"},
  };
  for (const auto& bad : cases) {
    const std::string error = error_of(bad.text);
    EXPECT_NE(error.find(bad.error), std::string::npos) << bad.error << " / " << error;
    EXPECT_NE(error.find("; "), std::string::npos) << "no remedy: " << error;
  }
}

TEST(ObjReader, SizesAreLimited) {
  const std::string faces = kThree + "f 1 2 3\nf 1 2 3\nf 1 2 3\n";
  EXPECT_EQ(error_of(faces, 3), "");
  EXPECT_NE(error_of(faces, 2).find("a.obj: line 6: more than 2 triangles"), std::string::npos);
  std::string vertices;
  for (int i = 0; i < 10; ++i) vertices += "v 0 0 0\n";
  EXPECT_NE(error_of(vertices, 2).find("more than 9 vertices"), std::string::npos);
  std::string large = kThree + "f";
  for (int i = 0; i <= kMaxPolygonCorners; ++i) large += " 1";
  EXPECT_NE(error_of(large).find("4097 corners"), std::string::npos);
}

// --- polygons ------------------------------------------------------------------------------------

double signed_area(const Vec3& a, const Vec3& b, const Vec3& c) {
  return 0.5 * ((b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x()));
}

/// A flat polygon is covered exactly if the triangles keep its sense and their areas add up.
void expect_covers(const std::vector<Vec3>& polygon, double smallest = 1e-12) {
  Triangles triangles;
  triangulate_polygon(polygon, triangles);
  ASSERT_EQ(triangles.size(), polygon.size() - 2);
  double shoelace = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i)
    shoelace += signed_area(Vec3::Zero(), polygon[i], polygon[(i + 1) % polygon.size()]);
  double sum = 0;
  for (const auto& [a, b, c] : triangles) {
    const double area = signed_area(polygon[a], polygon[b], polygon[c]);
    EXPECT_GT(area * (shoelace > 0 ? 1 : -1), smallest);
    sum += area;
  }
  EXPECT_NEAR(sum, shoelace, 1e-9);
}

TEST(Polygon, QuadsUseTheShorterDiagonal) {
  Triangles triangles;
  const std::vector<Vec3> kite{{0, 0, 0}, {2, -0.5, 0}, {4, 0, 0}, {2, 0.5, 0}};
  triangulate_polygon(kite, triangles);
  EXPECT_EQ(triangles, (Triangles{{0, 1, 3}, {1, 2, 3}}));
  triangles.clear();
  const std::vector<Vec3> square{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 1e-14}};
  triangulate_polygon(square, triangles);
  EXPECT_EQ(triangles, (Triangles{{0, 1, 2}, {0, 2, 3}}));
}

TEST(Polygon, ConcavePolygonsAreCoveredExactly) {
  expect_covers({{0, 0, 0}, {4, 0, 0}, {0.5, 0.5, 0}, {0, 4, 0}});  // arrow, reflex at 2
  expect_covers({{4, 0, 0}, {0.5, 0.5, 0}, {0, 4, 0}, {0, 0, 0}});  // the same, reflex at 1
  expect_covers({{0, 4, 0}, {0.5, 0.5, 0}, {4, 0, 0}, {0, 0, 0}});  // the other way around
  expect_covers({{0, 0, 0},
                 {3, 0, 0},
                 {3, 3, 0},
                 {2, 3, 0},
                 {2, 1, 0},
                 {1, 1, 0},
                 {1, 3, 0},
                 {0, 3, 0}});                                              // U
  expect_covers({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}});  // vertex on a side
  expect_covers({{0, 0, 0},
                 {1, 0, 0},
                 {2, 0, 0},
                 {2, 1, 0},
                 {2, 2, 0},
                 {1, 2, 0},
                 {0, 2, 0},
                 {0, 1, 0}});  // vertices on all sides
}

// Stars with up to 300 random spikes: star-shaped around the origin, concave at most corners.
TEST(Polygon, RandomStarsAreCoveredExactly) {
  Random random(11);
  for (int corners : {5, 6, 9, 20, 64, 65, 300}) {
    std::vector<Vec3> star;
    for (int i = 0; i < corners; ++i) {
      const double angle = 6.283185307179586 * i / corners;
      const double radius = random.uniform(0.3, 1.0);
      star.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 0);
    }
    expect_covers(star, 0);
  }
}

TEST(Polygon, SelfCrossingAndFlatPolygonsEnd) {
  for (const std::vector<Vec3>& odd : std::vector<std::vector<Vec3>>{
           {{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}},
           {{0, 0, 0}, {2, 0, 0}, {0, 1, 0}, {2, 1, 0}, {1, -1, 0}},
           {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {4, 0, 0}},
           {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}}}) {
    Triangles triangles;
    triangulate_polygon(odd, triangles);
    EXPECT_EQ(triangles.size(), odd.size() - 2);
  }
}

}  // namespace
}  // namespace piecework::mesh
