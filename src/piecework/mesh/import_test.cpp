#include <piecework/mesh/import.hpp>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>

#include <gtest/gtest.h>

#include <piecework/mesh/checks.hpp>
#include <piecework/mesh/generate.hpp>
#include <piecework/mesh/mesh_test_util.hpp>
#include <piecework/mesh/topology.hpp>

namespace piecework::mesh {
namespace {

using Import = FolderTest;

ImportOptions with_repair() {
  ImportOptions options;
  options.repair = true;
  return options;
}

const std::string kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
const std::string kSquareFaces = "f 1 2 3\nf 1 3 4\n";

TEST_F(Import, QuadsGroupsAndTextureCoordinatesStay) {
  const MeshDocument document = import_mesh(
      write("a.obj", kSquare + "v 2 0 0\nv 2 1 0\nvt 0 0\nvt 2 0\nvt 2 2\nvt 0 2\n"
                               "g left\nf 1/1 2/2 3/3 4/4\ng right\nf 2/1 5/2 6/3 3/4\n"),
      {});
  EXPECT_EQ(document.mesh.num_vertices(), 6);
  EXPECT_EQ(document.mesh.num_triangles(), 4);
  EXPECT_TRUE(document.vertex_map.empty());
  EXPECT_EQ(document.layout.num_vertices, 6);
  EXPECT_EQ(document.layout.polygon_begin, (std::vector<int>{0, 4, 8}));
  ASSERT_EQ(document.corner_uv.size(), 12U);
  EXPECT_EQ(document.corner_uv[1], Vec2(2, 0));
  EXPECT_EQ(document.vertex_sets.at("left"), (std::vector<int>{0, 1, 2, 3}));
  EXPECT_EQ(document.vertex_sets.at("right"), (std::vector<int>{1, 2, 4, 5}));
  EXPECT_EQ(document.vertex_sets.at("border"), (std::vector<int>{0, 1, 2, 3, 4, 5}));
  EXPECT_TRUE(document.notes.empty());
}

TEST_F(Import, UnitsAndAxesAreAppliedOnce) {
  const auto path = write("a.obj", "v 1 2 3\nv 2 2 3\nv 1 4 3\nf 1 2 3\n");
  ImportOptions options;
  options.unit_in_metres = 0.5;
  EXPECT_EQ(import_mesh(path, options).mesh.positions.row(0), Eigen::RowVector3d(0.5, 1, 1.5));
  // The file's up axis becomes y, and turning keeps right hands right: e1 x e2 = e3 is turned
  // along.
  for (const UpAxis axis : {UpAxis::X, UpAxis::Z}) {
    options.up_axis = axis;
    const Positions turned = import_mesh(path, options).mesh.positions;
    const int up = axis == UpAxis::X ? 0 : 2;
    const Eigen::RowVector3d file(1, 2, 3);
    EXPECT_EQ(turned(0, 1), 0.5 * file(up));
    const Vec3 e1 = (turned.row(1) - turned.row(0)).transpose();
    const Vec3 e2 = (turned.row(2) - turned.row(0)).transpose();
    const Vec3 expected = axis == UpAxis::X ? Vec3(0, 0, 0.5) : Vec3(0, 0.5, 0);
    EXPECT_EQ(Vec3(e1.y() * e2.z() - e1.z() * e2.y(), e1.z() * e2.x() - e1.x() * e2.z(),
                   e1.x() * e2.y() - e1.y() * e2.x()),
              expected);
  }
  options.unit_in_metres = 0;
  EXPECT_TRUE(contains(import_error(path, options), "a.obj: units: 0 metres per unit; give a"));
  options.unit_in_metres = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(contains(import_error(path, options), "units: nan"));
}

// --- welding -------------------------------------------------------------------------------------

/// The square as two triangles that share no vertex; one zero is negative.
const std::string kSplitSquare =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv -0.0 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 4 5 6\n";

TEST_F(Import, WeldJoinsSplitVertices) {
  const auto path = write("a.obj", kSplitSquare);
  const MeshDocument document = import_mesh(path, {});
  EXPECT_EQ(document.mesh.num_vertices(), 4);
  EXPECT_EQ(document.mesh.triangles, (Triangles{{0, 1, 2}, {0, 2, 3}}));
  EXPECT_EQ(document.vertex_map, (std::vector<int>{0, 1, 2, 0, 2, 3}));
  EXPECT_TRUE(has_note(document, "welded 6 vertices to 4"));
  ImportOptions options;
  options.weld = false;
  EXPECT_EQ(import_mesh(path, options).mesh.num_vertices(), 6);
}

TEST_F(Import, GroupsAreNotWeldedToEachOther) {
  const MeshDocument document = import_mesh(write("a.obj",
                                                  "g a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"
                                                  "g b\nv 0 0 0\nv 1 1 0\nv 0 1 0\nf 4 5 6\n"),
                                            {});
  EXPECT_EQ(document.mesh.num_vertices(), 6);
  EXPECT_TRUE(document.vertex_map.empty());
}

TEST_F(Import, TouchingPointsAreNotWelded) {
  const MeshDocument document = import_mesh(
      write("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 0 0\nv -1 0 0\nv -1 -1 0\nf 1 2 3\nf 4 5 6\n"),
      {});
  EXPECT_EQ(document.mesh.num_vertices(), 6);
}

/// A closed tetrahedron on the vertices first + 1 ... first + 4.
std::string tetrahedron_faces(int first) {
  std::string faces;
  for (const Triangle& t : Triangles{{1, 3, 2}, {1, 2, 4}, {2, 3, 4}, {3, 1, 4}})
    faces += "f " + std::to_string(first + t[0]) + " " + std::to_string(first + t[1]) + " " +
             std::to_string(first + t[2]) + "\n";
  return faces;
}

TEST_F(Import, CoincidentClosedLayersStayApart) {
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
  const MeshDocument document = import_mesh(
      write("a.obj", vertices + vertices + tetrahedron_faces(0) + tetrahedron_faces(4)), {});
  EXPECT_EQ(document.mesh.num_vertices(), 8);
  EXPECT_TRUE(document.vertex_sets.at("border").empty());
}

TEST_F(Import, CoincidentOpenLayersAreExplained) {
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  const auto path = write("a.obj", vertices + vertices + "f 1 2 3\nf 4 5 6\n");
  EXPECT_TRUE(contains(import_error(path), "`weld: false`"));
  ImportOptions options;
  options.weld = false;
  EXPECT_EQ(import_mesh(path, options).mesh.num_triangles(), 2);
}

// --- bad meshes and repairs ----------------------------------------------------------------------

struct BadMesh {
  const char* name;
  std::string obj;
  const char* error;
  const char* note;  // of the repair; empty if it cannot be repaired
  int triangles = 0;
  int vertices = 0;
};

std::vector<BadMesh> bad_meshes() {
  const std::string bow_tie = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv -1 0 0\nv -1 -1 0\n";
  return {
      {"repeated", kSquare + kSquareFaces + "f 1 1 2\n", "line 7 (face 2): zero area",
       "dropped 1 zero-area triangle, first from line 7", 2, 4},
      {"in line", kSquare + "v 0.5 0 0\n" + kSquareFaces + "f 2 1 5\n", "zero area",
       "dropped 1 zero", 2, 4},
      {"duplicate", kSquare + kSquareFaces + "f 2 3 1\nf 3 2 1\n",
       "line 7 (face 2): duplicate, an earlier triangle has the same vertices (and 1 more)",
       "dropped 2 duplicate", 2, 4},
      {"three on an edge", kSquare + "v 0 0 1\n" + kSquareFaces + "f 1 3 5\n",
       "edge from line 1 (vertex 0) to line 3 (vertex 2): more than two triangles on it: line 6 "
       "(face 0), line 7 (face 1) and line 8 (face 2)",
       "dropped 1 out-of-manifold", 2, 4},
      {"three on an edge, the second turned", kSquare + "v 0 0 1\nf 1 2 3\nf 3 1 5\nf 1 3 4\n",
       "more than two triangles on it",
       "dropped 1 out-of-manifold triangle, first from line 7 (face 1)", 2, 4},
      {"flipped", kSquare + "f 1 2 3\nf 1 4 3\n",
       "inconsistent orientation, line 5 (face 0) and line 6 (face 1)", "turned 1 triangle", 2, 4},
      {"bow-tie", bow_tie + "f 1 2 3\nf 1 4 5\n", "line 1 (vertex 0): bow-tie",
       "split 1 bow-tie vertex; 1 vertex added after the last one", 2, 6},
      {"isolated", kSquare + "v 5 5 5\nv 6 6 6\n" + kSquareFaces,
       "line 5 (vertex 4): isolated, no face uses it (and 1 more)", "dropped 2 isolated vertices",
       2, 4},
      {"huge", "v 0 0 0\nv 1e13 0 0\nv 0 1 0\nf 1 2 3\n",
       "line 2 (vertex 1): position (1e+13, 0, 0) m is more than 1e+12 m from the origin", "", 0,
       0},
      {"rounded away", "v 1e9 0 0\nv 1000000000.000001 0 0\nv 1e9 0.000001 0\nf 1 2 3\n",
       "rounding steps", "", 0, 0},
      {"all flat", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "zero area", "", 0, 0},
      {"Moebius",
       "v 0 0 0\nv 2 0 0\nv 3 1 1\nv 0 2 0\nv -1 1 2\nf 1 2 3\nf 2 3 4\nf 3 4 5\nf 4 5 1\nf 5 1 "
       "2\n",
       "inconsistent orientation", "", 0, 0},
  };
}

TEST_F(Import, BadMeshesAreRefusedAndMendedOnRequest) {
  for (const BadMesh& bad : bad_meshes()) {
    SCOPED_TRACE(bad.name);
    const auto path = write("bad.obj", bad.obj);
    const std::string error = import_error(path);
    EXPECT_TRUE(contains(error, bad.error));
    EXPECT_TRUE(contains(error, "bad.obj: "));
    EXPECT_TRUE(contains(error, "; "));
    if (bad.note[0] == '\0') {
      EXPECT_NE(import_error(path, with_repair()), "");
      continue;
    }
    EXPECT_TRUE(contains(error, "`repair: true`"));
    const MeshDocument mended = import_mesh(path, with_repair());
    EXPECT_TRUE(has_note(mended, bad.note)) << testing::PrintToString(mended.notes);
    EXPECT_EQ(mended.mesh.num_triangles(), bad.triangles);
    EXPECT_EQ(mended.mesh.num_vertices(), bad.vertices);
    EXPECT_NO_THROW(validate(mended.mesh, "mended"));
  }
}

TEST_F(Import, MoebiusStripsAreNamed) {
  for (const BadMesh& bad : bad_meshes()) {
    if (std::string(bad.name) != "Moebius") continue;
    EXPECT_TRUE(contains(import_error(write("m.obj", bad.obj), with_repair()), "one-sided"));
  }
}

TEST_F(Import, RepairKeepsTextureCoordinatesWithTheirCorners) {
  const MeshDocument document =
      import_mesh(write("a.obj", kSquare + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
                                           "f 1/1 1/1 2/2\nf 1/1 2/2 3/3\nf 1/1 4/4 3/3\n"),
                  with_repair());
  ASSERT_EQ(document.mesh.num_triangles(), 2);
  ASSERT_EQ(document.corner_uv.size(), 6U);
  for (int t = 0; t < 2; ++t) {
    for (int k = 0; k < 3; ++k) {
      const auto x = document.mesh.positions.row(document.mesh.triangles[t][k]);
      EXPECT_EQ(document.corner_uv[3 * t + k], Vec2(x(0), x(1)));
    }
  }
}

TEST_F(Import, IsolatedVerticesKeepTheirPlaceInTheFile) {
  const MeshDocument document = import_mesh(
      write("a.obj", "v 7 7 7\nv 0 0 0\nv 1 0 0\nv 8 8 8\nv 1 1 0\nf 2 3 5\n"), with_repair());
  EXPECT_EQ(document.vertex_map, (std::vector<int>{-1, 0, 1, -1, 2}));
  EXPECT_EQ(document.layout.num_vertices, 5);
  ASSERT_EQ(document.layout.positions.rows(), 2);
  EXPECT_EQ(document.layout.positions.row(1), Eigen::RowVector3d(8, 8, 8));
}

TEST_F(Import, SplitFansFollowInTheFilesPolygons) {
  const MeshDocument document =
      import_mesh(write("a.obj",
                        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 0 0\nv -1 -1 0\n"
                        "v 0 -1 0\nf 1 2 3 4\nf 1 5 6 7\n"),
                  with_repair());
  EXPECT_EQ(document.mesh.num_vertices(), 8);
  EXPECT_EQ(document.num_file_vertices(), 8);
  EXPECT_EQ(document.layout.polygon_vertex, (std::vector<int>{0, 1, 2, 3, 7, 4, 5, 6}));
  EXPECT_EQ(document.mesh.positions.row(7), Eigen::RowVector3d(0, 0, 0));
}

TEST_F(Import, MostTrianglesKeepTheirOrientation) {
  // A fan of five triangles; two are turned against the other three.
  const MeshDocument document =
      import_mesh(write("a.obj",
                        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 1 0\nv -1 0 0\nv -1 -1 0\n"
                        "f 1 3 2\nf 1 3 4\nf 1 4 5\nf 1 5 6\nf 1 7 6\n"),
                  with_repair());
  EXPECT_TRUE(has_note(document, "turned 2 triangles"));
  EXPECT_EQ(document.mesh.triangles[2], (Triangle{0, 3, 4}));
}

TEST_F(Import, SliversAndFarMeshesPass) {
  EXPECT_EQ(import_error(write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1e-7\nf 1 2 3\n")), "");
  EXPECT_EQ(import_error(write("b.obj", "v 0 0 0\nv 1e-9 0 0\nv 0 0 1e-9\nf 1 2 3\n")), "");
  const auto far = write("c.obj", "v 1e7 0 0\nv 10000000.001 0 0\nv 1e7 0 0.001\nf 1 2 3\n");
  EXPECT_TRUE(has_note(import_mesh(far, {}), "far from the origin"));
}

TEST_F(Import, PartialTextureCoordinatesAreNoted) {
  const MeshDocument document =
      import_mesh(write("a.obj", kSquare + "vt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\nf 1 3 4\n"), {});
  EXPECT_TRUE(document.corner_uv.empty());
  EXPECT_TRUE(has_note(document, "no texture coordinates"));
}

TEST_F(Import, AGroupNamedBorderDoesNotReplaceTheBorder) {
  const MeshDocument document = import_mesh(
      write("a.obj", kSquare + "v 2 0 0\ng border\nf 1 2 3\ng b\nf 1 3 4\nf 2 5 3\n"), {});
  EXPECT_EQ(document.vertex_sets.at("border").size(), 5U);
  EXPECT_TRUE(has_note(document, "'border'"));
}

TEST_F(Import, TooManyTrianglesAreRefused) {
  ImportOptions options;
  options.max_triangles = 1;
  EXPECT_TRUE(contains(import_error(write("a.obj", kSquare + kSquareFaces), options),
                       "line 6: more than 1 triangles"));
}

TEST_F(Import, FilesThatAreNone) {
  EXPECT_TRUE(contains(import_error(folder_ / "no.obj"), "no.obj: file not found"));
  EXPECT_TRUE(contains(import_error(folder_ / "no.ply"), "no.ply: file not found"));
  std::filesystem::create_directory(folder_ / "folder.obj");
  EXPECT_TRUE(contains(import_error(folder_ / "folder.obj"), "not a regular file"));
  EXPECT_TRUE(contains(import_error(write("e.stl", "")), "e.stl: file is empty"));
  EXPECT_TRUE(contains(import_error(write("a.fbx", "x")), "unknown kind of mesh file '.fbx'"));
  EXPECT_TRUE(contains(import_error(write("noext", "x")), "unknown kind of mesh file ''"));
  EXPECT_EQ(import_error(write("UPPER.OBJ", kSquare + kSquareFaces)), "");
}

// --- through assimp ------------------------------------------------------------------------------

const std::string kPlyHead =
    "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
    "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    "2 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

TEST_F(Import, PlyKeepsVertexOrderAndQuads) {
  const MeshDocument document = import_mesh(write("a.ply", kPlyHead + "4 1 2 3 4\n3 2 0 3\n"), {});
  ASSERT_EQ(document.mesh.num_vertices(), 5);
  EXPECT_EQ(document.mesh.positions.row(0), Eigen::RowVector3d(2, 1, 0));
  EXPECT_EQ(document.layout.polygon_vertex, (std::vector<int>{1, 2, 3, 4, 2, 0, 3}));
  EXPECT_EQ(document.mesh.num_triangles(), 3);
  EXPECT_TRUE(document.vertex_map.empty());
}

TEST_F(Import, BrokenPlyFiles) {
  EXPECT_TRUE(contains(import_error(write("a.ply", kPlyHead + "3 1 2 77\n3 0 1 2\n")),
                       "face 0: vertex index 77 is out of range, there are 5 vertices"));
  EXPECT_NE(import_error(write("b.ply", kPlyHead + "3 1 2\n")), "");
  EXPECT_TRUE(contains(import_error(write("c.ply", "not a ply\n")), "c.ply: cannot be read"));
  EXPECT_TRUE(contains(import_error(write("d.ply", kPlyHead + "3 1 2 3\n3 1 3 4\n")),
                       "vertex 0: isolated"));
}

TEST_F(Import, StlVerticesAreJoined) {
  std::string stl = "solid square\n";
  for (const char* corners :
       {"vertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\n", "vertex 0 0 0\nvertex 1 1 0\nvertex 0 1 0\n"})
    stl += std::string("facet normal 0 0 1\nouter loop\n") + corners + "endloop\nendfacet\n";
  const MeshDocument document = import_mesh(write("a.stl", stl + "endsolid square\n"), {});
  EXPECT_EQ(document.mesh.num_vertices(), 4);
  EXPECT_EQ(document.mesh.triangles, (Triangles{{0, 1, 2}, {0, 2, 3}}));
  EXPECT_TRUE(document.vertex_map.empty()) << "an STL file has no vertices to keep the order of";
  EXPECT_EQ(document.num_file_vertices(), 4);
}

template <class T>
void append_bytes(std::string& bytes, std::initializer_list<T> values) {
  for (const T value : values) bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// A square of two triangles in a glTF whose node has the given transform keys.
std::string gltf(const std::string& uri, const std::string& node_keys) {
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],"nodes":[
    {"name":"first","mesh":0},{"name":"second","mesh":0)" +
         node_keys + R"(}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3",
                  "min":[0,0,0],"max":[1,1,0]},
                 {"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}],
    "bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":48},
                   {"buffer":0,"byteOffset":48,"byteLength":12}],
    "buffers":[{"byteLength":60,"uri":")" +
         uri + R"("}]})";
}

std::string gltf_buffer() {
  std::string bytes;
  append_bytes<float>(bytes, {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0});
  append_bytes<std::uint16_t>(bytes, {0, 1, 2, 0, 2, 3});
  return bytes;
}

TEST_F(Import, GltfNodesAreGroupsWithTheirTransforms) {
  write("square.bin", gltf_buffer());
  const MeshDocument document = import_mesh(
      write("a.gltf", gltf("square.bin", R"(,"translation":[0,0,5],"scale":[2,1,-1])")), {});
  ASSERT_EQ(document.mesh.num_vertices(), 8);
  EXPECT_EQ(document.mesh.positions.row(5), Eigen::RowVector3d(2, 0, 5));
  EXPECT_EQ(document.vertex_sets.at("first"), (std::vector<int>{0, 1, 2, 3}));
  EXPECT_EQ(document.vertex_sets.at("second"), (std::vector<int>{4, 5, 6, 7}));
  // The second node is mirrored: its triangles run the other way in x and y.
  const auto turn = [&](int t) {
    const Triangle& v = document.mesh.triangles[t];
    const Positions& x = document.mesh.positions;
    const auto e1 = x.row(v[1]) - x.row(v[0]);
    const auto e2 = x.row(v[2]) - x.row(v[0]);
    return e1(0) * e2(1) - e1(1) * e2(0);
  };
  EXPECT_GT(turn(0), 0);
  EXPECT_LT(turn(2), 0);
}

TEST_F(Import, GltfOpensNothingOutsideItsFolder) {
  std::filesystem::create_directories(folder_ / "inner");
  write("outside.bin", gltf_buffer());
  write("inner/inside.bin", gltf_buffer());
  std::filesystem::create_symlink(folder_ / "outside.bin", folder_ / "inner/link.bin");
  EXPECT_EQ(import_error(write("inner/ok.gltf", gltf("inside.bin", ""))), "");
  EXPECT_EQ(import_error(write("below.gltf", gltf("inner/inside.bin", ""))), "");
  EXPECT_TRUE(
      contains(import_error(write("inner/up.gltf", gltf("../outside.bin", ""))), "could not open"));
  EXPECT_TRUE(
      contains(import_error(write("inner/abs.gltf", gltf((folder_ / "outside.bin").string(), ""))),
               "could not open"));
  EXPECT_TRUE(
      contains(import_error(write("inner/link.gltf", gltf("link.bin", ""))), "could not open"));
}

// The bytes of a fuzzed file that kills assimp's PLY reader must not kill ours.
TEST_F(Import, AFileThatCrashesAssimpIsAnError) {
  std::string ply =
      "ply\nformat binary_little_endian 1.0\ncomment x\nelement vertex 8\nproperty float x\n"
      "property float y\nproperty ";
  ply += std::string("\0\0\0\t\7\0\0\0\3\0\0\0\3\3\0\0\0\7\0\0\0\4\0\0\0\3\3\0\0\0\4\0\0\0\0\0\0\0",
                     38);
  EXPECT_TRUE(contains(import_error(write("crash.ply", ply)), "crash.ply: "));
}

// --- corresponding_positions()
// --------------------------------------------------------------------

TEST_F(Import, RestShapesCorrespondByFileVertex) {
  // The square is cut along its other diagonal once it is a kite; the split vertices go along.
  const std::string faces = "f 1 2 3 4\nf 5 6 7\n";
  const MeshDocument start =
      import_mesh(write("start.obj", kSquare + "v 1 0 0\nv 2 0 0\nv 1 1 0\n" + faces), {});
  const MeshDocument rest =
      import_mesh(write("rest.obj",
                        "v 0 0 0\nv 1 -1 0\nv 5 0 0\nv 1 1 0\nv 1 -1 0\nv 7 0 0\n"
                        "v 5 0 0\n" +
                            faces),
                  {});
  ASSERT_EQ(start.mesh.num_vertices(), 5);
  ASSERT_NE(start.mesh.triangles, rest.mesh.triangles);
  const Positions positions = corresponding_positions(start, rest, "rest.obj");
  ASSERT_EQ(positions.rows(), 5);
  EXPECT_EQ(positions.row(1), Eigen::RowVector3d(1, -1, 0));
  EXPECT_EQ(positions.row(4), Eigen::RowVector3d(7, 0, 0));

  const auto error_of = [&](const std::string& text) -> std::string {
    try {
      corresponding_positions(start, import_mesh(write("other.obj", text), {}), "other.obj");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_TRUE(contains(error_of(kSquare + kSquareFaces), "other.obj: 4 vertices, the mesh it"));
  EXPECT_TRUE(contains(error_of(kSquare + "v 1 0 0\nv 2 0 0\nv 1 1 0\nf 1 2 3 4\nf 6 7 5\n"),
                       "other faces"));
  EXPECT_TRUE(contains(error_of(kSquare + "v 1 0.5 0\nv 2 0 0\nv 1 1 0\n" + faces),
                       "vertices 1 and 4 are apart"));
}

// --- validate() ----------------------------------------------------------------------------------

TEST(Validate, AcceptsGeneratedMeshesAndRefusesBrokenOnes) {
  GeneratorOptions options;
  options.columns = options.rows = 5;
  const TriangleMesh good = generate(GeneratorKind::Sheet, options).mesh;
  const auto error_of = [](const TriangleMesh& mesh) -> std::string {
    try {
      validate(mesh, "cloth 'a'");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(error_of(good), "");
  TriangleMesh bad = good;
  bad.triangles[3][1] = 25;
  EXPECT_TRUE(contains(error_of(bad), "cloth 'a': triangle 3 ("));
  EXPECT_TRUE(contains(error_of(bad), "vertex index 25 is out of range, there are 25 vertices"));
  bad = good;
  bad.triangles[3][1] = -1;
  EXPECT_TRUE(contains(error_of(bad), "vertex index -1"));
  bad = good;
  bad.positions(7, 1) = std::numeric_limits<double>::infinity();
  bad.positions(8, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(contains(error_of(bad), "vertex 7: position (0.5, inf, 0.25) is not finite (and 1"));
  bad = good;
  bad.positions.row(6) = bad.positions.row(7).eval();
  EXPECT_TRUE(contains(error_of(bad), "zero area"));
  bad.triangles.clear();
  EXPECT_TRUE(contains(error_of(bad), "no triangles"));
}

}  // namespace
}  // namespace piecework::mesh
