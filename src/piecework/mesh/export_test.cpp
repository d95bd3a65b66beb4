#include <piecework/mesh/export.hpp>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <sstream>

#include <gtest/gtest.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/mesh/generate.hpp>
#include <piecework/mesh/mesh_test_util.hpp>

namespace piecework::mesh {
namespace {

using Export = FolderTest;

template <class T>
T take(const std::string& bytes, std::size_t& at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  at += sizeof value;
  return value;
}

/// What any of the formats holds.
struct Content {
  std::vector<Vec3> vertices;
  std::vector<std::vector<int>> faces;
  std::vector<int> domain;
};

/// Reads the one kind of PLY that we write; the library's own reader is not asked.
Content read_ply(const std::filesystem::path& path) {
  const std::string bytes = read_file(path);
  const std::size_t head_size = bytes.find("end_header\n") + 11;
  std::istringstream head(bytes.substr(0, head_size));
  std::string word;
  std::map<std::string, std::size_t> count;
  bool has_domain = false;
  bool wide = false;
  EXPECT_EQ(bytes.rfind("ply\nformat binary_little_endian 1.0\n", 0), 0U);
  while (head >> word) {
    if (word == "element") {
      head >> word;
      head >> count[word];
    }
    has_domain = has_domain || word == "domain";
    wide = wide || word == "ushort";
  }
  Content content;
  std::size_t at = head_size;
  for (std::size_t v = 0; v < count["vertex"]; ++v) {
    const auto x = take<double>(bytes, at);
    const auto y = take<double>(bytes, at);
    content.vertices.emplace_back(x, y, take<double>(bytes, at));
  }
  for (std::size_t f = 0; f < count["face"]; ++f) {
    const int corners = wide ? take<std::uint16_t>(bytes, at) : take<std::uint8_t>(bytes, at);
    content.faces.emplace_back();
    for (int i = 0; i < corners; ++i) content.faces.back().push_back(take<std::int32_t>(bytes, at));
    if (has_domain) content.domain.push_back(take<std::int32_t>(bytes, at));
  }
  EXPECT_EQ(at, bytes.size());
  return content;
}

template <class T>
std::vector<T> vtp_array(const std::string& bytes, const std::string& name) {
  const std::size_t tag = bytes.find("Name=\"" + name + "\"");
  const std::size_t offset = bytes.find("offset=\"", tag) + 8;
  std::size_t at = bytes.find("<AppendedData encoding=\"raw\">");
  at = bytes.find('_', at) + 1 + std::stoul(bytes.substr(offset));
  std::vector<T> values(take<std::uint64_t>(bytes, at) / sizeof(T));
  for (T& value : values) value = take<T>(bytes, at);
  return values;
}

Content read_vtp(const std::filesystem::path& path) {
  const std::string bytes = read_file(path);
  Content content;
  const auto points = vtp_array<double>(bytes, "Points");
  for (std::size_t i = 0; i < points.size(); i += 3)
    content.vertices.emplace_back(points[i], points[i + 1], points[i + 2]);
  const auto connectivity = vtp_array<std::int64_t>(bytes, "connectivity");
  std::int64_t begin = 0;
  for (const std::int64_t end : vtp_array<std::int64_t>(bytes, "offsets")) {
    content.faces.emplace_back(connectivity.begin() + begin, connectivity.begin() + end);
    begin = end;
  }
  if (bytes.find("Name=\"domain\"") != std::string::npos)
    content.domain = vtp_array<std::int32_t>(bytes, "domain");
  EXPECT_TRUE(
      contains(bytes, "NumberOfPoints=\"" + std::to_string(content.vertices.size()) + "\""));
  EXPECT_TRUE(contains(bytes, "NumberOfPolys=\"" + std::to_string(content.faces.size()) + "\""));
  return content;
}

/// Two quads in two groups with a split vertex column, an unused vertex first and last, and seams
/// in uv.
const char* const kGarment =
    "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 8 8 8\n"
    "vt 0.125 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    "f 2/1 3/2 4/3 5/4\nf 6/1 7/2 8/3 9/4\n";

MeshDocument import_with_repair(const std::filesystem::path& path) {
  ImportOptions options;
  options.repair = true;
  return import_mesh(path, options);
}

/// Positions that need every bit.
Positions awkward(const MeshDocument& document) {
  Positions x = document.mesh.positions;
  for (Eigen::Index i = 0; i < x.size(); ++i)
    x.data()[i] = x.data()[i] / 3.0 + 0.1 * static_cast<double>(i) + 1e-17;
  return x;
}

std::vector<int> numbered_domains(const MeshDocument& document) {
  std::vector<int> domain(document.mesh.triangles.size());
  for (std::size_t t = 0; t < domain.size(); ++t) domain[t] = static_cast<int>(t % 7);
  return domain;
}

TEST_F(Export, PlyHoldsTheExactBits) {
  GeneratorOptions options;
  options.columns = options.rows = 8;
  const MeshDocument sheet = generate(GeneratorKind::Sheet, options);
  const Positions x = awkward(sheet);
  const ExportPart part{&sheet, x, "sheet", numbered_domains(sheet)};
  export_meshes(folder_ / "a.ply", ExportFormat::Ply, {&part, 1});
  const Content content = read_ply(folder_ / "a.ply");
  ASSERT_EQ(content.vertices.size(), 64U);
  for (int v = 0; v < 64; ++v) EXPECT_EQ(content.vertices[v].transpose(), x.row(v));
  ASSERT_EQ(content.faces.size(), 98U);
  for (int t = 0; t < 98; ++t) {
    const Triangle& triangle = sheet.mesh.triangles[t];
    EXPECT_EQ(content.faces[t], std::vector<int>(triangle.begin(), triangle.end()));
  }
  EXPECT_EQ(content.domain, part.triangle_domain);
}

TEST_F(Export, PlyComesBackThroughTheImporter) {
  GeneratorOptions options;
  options.columns = options.rows = 8;
  const MeshDocument sheet = generate(GeneratorKind::Sheet, options);
  const ExportPart part{&sheet, sheet.mesh.positions, "sheet", numbered_domains(sheet)};
  export_meshes(folder_ / "a.ply", ExportFormat::Ply, {&part, 1});
  const MeshDocument back = import_mesh(folder_ / "a.ply", {});
  EXPECT_EQ(back.mesh.triangles, sheet.mesh.triangles);
  EXPECT_LT((back.mesh.positions - sheet.mesh.positions).cwiseAbs().maxCoeff(), 1e-7);
}

TEST_F(Export, FilesKeepTheUsersVerticesAndPolygons) {
  const MeshDocument document = import_with_repair(write("in.obj", kGarment));
  ASSERT_EQ(document.mesh.num_vertices(), 6);
  const Positions x = awkward(document);
  const ExportPart part{&document, x, "garment", {}};
  for (const ExportFormat format : {ExportFormat::Ply, ExportFormat::Vtp}) {
    const auto path = folder_ / (std::string("out.") + extension(format));
    export_meshes(path, format, {&part, 1});
    const Content content = format == ExportFormat::Ply ? read_ply(path) : read_vtp(path);
    ASSERT_EQ(content.vertices.size(), 10U);
    EXPECT_EQ(content.vertices[9], Vec3(8, 8, 8));
    EXPECT_EQ(content.vertices[0], Vec3(9, 9, 9)) << "the unused vertex stays where it was";
    EXPECT_EQ(content.vertices[1].transpose(), x.row(0));
    EXPECT_EQ(content.vertices[2], content.vertices[5]) << "welded";
    EXPECT_EQ(content.faces, (std::vector<std::vector<int>>{{1, 2, 3, 4}, {5, 6, 7, 8}}));
    EXPECT_TRUE(content.domain.empty());
  }
}

TEST_F(Export, ObjRoundTripIsExact) {
  const MeshDocument document = import_with_repair(
      write("in.obj", std::string(kGarment) + "g tail end\nv 3 0 0\nf 7 11 8\n"));
  const Positions x = document.mesh.positions / 3.0;  // no distortion: quads are cut the same way
  const ExportPart part{&document, x, "garment", {}};
  export_meshes(folder_ / "out.obj", ExportFormat::Obj, {&part, 1});
  const MeshDocument back = import_with_repair(folder_ / "out.obj");
  EXPECT_TRUE(back.mesh.positions == x);
  EXPECT_EQ(back.mesh.triangles, document.mesh.triangles);
  EXPECT_EQ(back.vertex_map, document.vertex_map);
  EXPECT_EQ(back.layout.polygon_begin, document.layout.polygon_begin);
  EXPECT_EQ(back.layout.polygon_vertex, document.layout.polygon_vertex);
  EXPECT_EQ(back.layout.polygon_uv, document.layout.polygon_uv);
  EXPECT_EQ(back.layout.uv, document.layout.uv);
  ASSERT_EQ(back.layout.groups.size(), 2U);
  EXPECT_EQ(back.layout.groups[1].name, "tail end");
  EXPECT_EQ(back.layout.groups[1].first_polygon, 2);
}

TEST_F(Export, SeveralPartsShareOneFile) {
  GeneratorOptions options;
  options.columns = options.rows = 3;
  const MeshDocument sheet = generate(GeneratorKind::Sheet, options);
  const MeshDocument document = import_with_repair(write("in.obj", kGarment));
  const std::vector<ExportPart> parts{
      {&sheet, sheet.mesh.positions, "one", numbered_domains(sheet)},
      {&document, document.mesh.positions, "two\nlines", {}}};
  export_meshes(folder_ / "a.ply", ExportFormat::Ply, parts);
  const Content ply = read_ply(folder_ / "a.ply");
  EXPECT_EQ(ply.vertices.size(), 19U);
  ASSERT_EQ(ply.faces.size(), 10U);
  EXPECT_EQ(ply.faces[9], (std::vector<int>{14, 15, 16, 17}));
  EXPECT_TRUE(ply.domain.empty()) << "one part has no domains";

  export_meshes(folder_ / "a.vtp", ExportFormat::Vtp, parts);
  const Content vtp = read_vtp(folder_ / "a.vtp");
  EXPECT_EQ(vtp.faces, ply.faces);
  ASSERT_EQ(vtp.domain.size(), 10U);
  EXPECT_EQ(vtp.domain[7], 0);
  EXPECT_EQ(vtp.domain[8], -1);

  export_meshes(folder_ / "a.obj", ExportFormat::Obj, parts);
  ImportOptions with_repair;
  with_repair.repair = true;  // for the unused vertex
  const MeshDocument back = import_mesh(folder_ / "a.obj", with_repair);
  EXPECT_EQ(back.mesh.num_triangles(), 12);
  EXPECT_TRUE(back.vertex_sets.contains("one"));
  EXPECT_TRUE(back.vertex_sets.contains("two_lines"));
}

// A quad may be cut by a domain border, so VTP lists its triangles.
TEST_F(Export, VtpWithDomainsListsTriangles) {
  const MeshDocument document = import_with_repair(write("in.obj", kGarment));
  const ExportPart part{&document, document.mesh.positions, "garment", {4, 5, 6, 7}};
  export_meshes(folder_ / "a.vtp", ExportFormat::Vtp, {&part, 1});
  const Content vtp = read_vtp(folder_ / "a.vtp");
  ASSERT_EQ(vtp.faces.size(), 4U);
  EXPECT_EQ(vtp.domain, (std::vector<int>{4, 5, 6, 7}));
  for (int t = 0; t < 4; ++t) {
    for (int k = 0; k < 3; ++k)
      EXPECT_EQ(vtp.vertices[vtp.faces[t][k]].transpose(),
                document.mesh.positions.row(document.mesh.triangles[t][k]));
  }
  export_meshes(folder_ / "a.ply", ExportFormat::Ply, {&part, 1});
  EXPECT_EQ(read_ply(folder_ / "a.ply").faces.size(), 2U);
}

TEST_F(Export, PolygonsOfMoreThan255CornersFit) {
  std::ostringstream obj;
  for (int i = 0; i < 300; ++i)
    obj << "v " << std::cos(0.02 * i) << ' ' << std::sin(0.02 * i) << " 0\n";
  obj << 'f';
  for (int i = 1; i <= 300; ++i) obj << ' ' << i;
  const MeshDocument document = import_mesh(write("in.obj", obj.str()), {});
  const ExportPart part{&document, document.mesh.positions, "big", {}};
  export_meshes(folder_ / "a.ply", ExportFormat::Ply, {&part, 1});
  const Content ply = read_ply(folder_ / "a.ply");
  ASSERT_EQ(ply.faces.size(), 1U);
  EXPECT_EQ(ply.faces[0].size(), 300U);
}

TEST_F(Export, FailureIsAnOutputErrorAndKeepsTheOldFile) {
  GeneratorOptions options;
  options.columns = options.rows = 2;
  const MeshDocument sheet = generate(GeneratorKind::Sheet, options);
  const ExportPart part{&sheet, sheet.mesh.positions, "", {}};
  EXPECT_THROW(export_meshes(folder_ / "missing" / "a.ply", ExportFormat::Ply, {&part, 1}),
               OutputError);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "missing"));
}

TEST(ExportFormats, HaveExtensions) {
  EXPECT_STREQ(extension(ExportFormat::Ply), "ply");
  EXPECT_STREQ(extension(ExportFormat::Obj), "obj");
  EXPECT_STREQ(extension(ExportFormat::Vtp), "vtp");
}

}  // namespace
}  // namespace piecework::mesh
