#include <piecework/mesh/generate.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <set>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <piecework/core/error.hpp>
#include <piecework/mesh/import.hpp>
#include <piecework/mesh/topology.hpp>

namespace piecework::mesh {
namespace {

constexpr GeneratorKind kKinds[] = {GeneratorKind::Sheet, GeneratorKind::Strip, GeneratorKind::Tube,
                                    GeneratorKind::Disc, GeneratorKind::Quilt};

GeneratorOptions small_options() {
  GeneratorOptions options;
  options.width = 2.0;
  options.height = 0.75;
  options.columns = 41;
  options.rows = 6;
  options.radius = 0.4;
  return options;
}

/// Options that every kind accepts.
GeneratorOptions options_for(GeneratorKind kind) {
  GeneratorOptions options = small_options();
  if (kind == GeneratorKind::Quilt) {
    options.patches_x = 3;
    options.rows = 17;
  }
  return options;
}

GeneratorOptions delaunay_options(int columns, int rows, double jitter = 0.3) {
  GeneratorOptions options = small_options();
  options.columns = columns;
  options.rows = rows;
  options.pattern = SheetPattern::Delaunay;
  options.jitter = jitter;
  return options;
}

Vec3 corner(const TriangleMesh& mesh, int triangle, int k) {
  return mesh.positions.row(mesh.triangles[triangle][k]).transpose();
}

/// Area times unit normal.
Vec3 area_vector(const TriangleMesh& mesh, int t) {
  const Vec3 a = corner(mesh, t, 0);
  return 0.5 * (corner(mesh, t, 1) - a).cross(corner(mesh, t, 2) - a);
}

double area(const TriangleMesh& mesh) {
  double sum = 0;
  for (int t = 0; t < mesh.num_triangles(); ++t) sum += area_vector(mesh, t).norm();
  return sum;
}

int euler_characteristic(const TriangleMesh& mesh) {
  return mesh.num_vertices() - static_cast<int>(find_edges(mesh.triangles).size()) +
         mesh.num_triangles();
}

std::string error_of(GeneratorKind kind, const GeneratorOptions& options) {
  try {
    generate(kind, options);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Generate, EveryKindIsAValidMeshOfItsTopology) {
  const std::map<GeneratorKind, int> euler{{GeneratorKind::Sheet, 1},
                                           {GeneratorKind::Strip, 1},
                                           {GeneratorKind::Tube, 0},
                                           {GeneratorKind::Disc, 1},
                                           {GeneratorKind::Quilt, 1}};
  for (const GeneratorKind kind : kKinds) {
    SCOPED_TRACE(to_string(kind));
    const MeshDocument document = generate(kind, options_for(kind));
    EXPECT_NO_THROW(validate(document.mesh, "generated"));
    EXPECT_EQ(euler_characteristic(document.mesh), euler.at(kind));
    EXPECT_EQ(document.vertex_sets.at("border"),
              border_vertices(find_edges(document.mesh.triangles)));
  }
}

// A flat rest shape has the very edge lengths and the orientation of the mesh, seam included.
TEST(Generate, TextureCoordinatesAreIsometric) {
  for (const GeneratorKind kind : kKinds) {
    SCOPED_TRACE(to_string(kind));
    const MeshDocument document = generate(kind, options_for(kind));
    const TriangleMesh& mesh = document.mesh;
    ASSERT_EQ(document.corner_uv.size(), 3 * mesh.triangles.size());
    for (int t = 0; t < mesh.num_triangles(); ++t) {
      const Vec2* uv = &document.corner_uv[3 * t];
      for (int k = 0; k < 3; ++k)
        ASSERT_NEAR((uv[(k + 1) % 3] - uv[k]).norm(),
                    (corner(mesh, t, (k + 1) % 3) - corner(mesh, t, k)).norm(), 1e-12);
      const Vec2 e1 = uv[1] - uv[0];
      const Vec2 e2 = uv[2] - uv[0];
      ASSERT_NEAR(0.5 * (e1.x() * e2.y() - e1.y() * e2.x()), area_vector(mesh, t).norm(), 1e-12);
    }
  }
}

TEST(Generate, FlatMeshesCoverTheirAreaAndFaceUp) {
  for (const SheetPattern pattern :
       {SheetPattern::Alternating, SheetPattern::OneDiagonal, SheetPattern::Delaunay}) {
    GeneratorOptions options = small_options();
    options.pattern = pattern;
    const TriangleMesh mesh = generate(GeneratorKind::Sheet, options).mesh;
    EXPECT_EQ(mesh.num_triangles(), 2 * 40 * 5);
    for (int t = 0; t < mesh.num_triangles(); ++t) ASSERT_GT(area_vector(mesh, t).y(), 0);
    EXPECT_NEAR(area(mesh), 1.5, 1e-12);
  }
  const TriangleMesh quilt = generate(GeneratorKind::Quilt, options_for(GeneratorKind::Quilt)).mesh;
  for (int t = 0; t < quilt.num_triangles(); ++t) ASSERT_GT(area_vector(quilt, t).y(), 0);
  EXPECT_NEAR(area(quilt), 1.5, 1e-12);
}

TEST(Generate, SheetNumbersVerticesRowByRow) {
  GeneratorOptions options = small_options();
  options.columns = 4;
  options.rows = 3;
  const MeshDocument document = generate(GeneratorKind::Sheet, options);
  const Positions& x = document.mesh.positions;
  ASSERT_EQ(x.rows(), 12);
  EXPECT_EQ(x.row(0), Eigen::RowVector3d(0, 0, 0));
  EXPECT_EQ(x.row(3), Eigen::RowVector3d(2, 0, 0));
  EXPECT_EQ(x.row(8), Eigen::RowVector3d(0, 0, 0.75));
  EXPECT_EQ(x.row(11), Eigen::RowVector3d(2, 0, 0.75));
  EXPECT_FALSE(std::signbit(x(0, 2)));
  const auto& sets = document.vertex_sets;
  EXPECT_EQ(sets.at("corners"), (std::vector<int>{0, 3, 8, 11}));
  EXPECT_EQ(sets.at("left"), (std::vector<int>{0, 4, 8}));
  EXPECT_EQ(sets.at("right"), (std::vector<int>{3, 7, 11}));
  EXPECT_EQ(sets.at("bottom"), (std::vector<int>{0, 1, 2, 3}));
  EXPECT_EQ(sets.at("top"), (std::vector<int>{8, 9, 10, 11}));
  EXPECT_EQ(sets.at("border"), (std::vector<int>{0, 1, 2, 3, 4, 7, 8, 9, 10, 11}));
}

// Alternating diagonals give inner vertices 4 or 8 triangles, one diagonal gives 6.
TEST(Generate, PatternsHaveTheirValences) {
  GeneratorOptions options = small_options();
  const auto inner_valences = [&] {
    const MeshDocument document = generate(GeneratorKind::Sheet, options);
    const Adjacency around =
        vertex_triangles(document.mesh.triangles, document.mesh.num_vertices());
    const std::vector<int>& border = document.vertex_sets.at("border");
    std::set<int> valences;
    for (int v = 0; v < document.mesh.num_vertices(); ++v) {
      if (!std::binary_search(border.begin(), border.end(), v))
        valences.insert(around.begin[v + 1] - around.begin[v]);
    }
    return valences;
  };
  EXPECT_EQ(inner_valences(), (std::set<int>{4, 8}));
  options.pattern = SheetPattern::OneDiagonal;
  EXPECT_EQ(inner_valences(), (std::set<int>{6}));
  options.pattern = SheetPattern::Delaunay;
  EXPECT_GT(inner_valences().size(), 3U);  // irregular
}

// The oracle computes circumcentres in long double and looks at every vertex.
TEST(Generate, DelaunaySheetsAreDelaunay) {
  using Real = long double;
  for (const double jitter : {0.0, 0.2, 0.45}) {
    SCOPED_TRACE(jitter);
    const TriangleMesh mesh = generate(GeneratorKind::Sheet, delaunay_options(15, 12, jitter)).mesh;
    const auto x = [&](int v) { return static_cast<Real>(mesh.positions(v, 0)); };
    const auto z = [&](int v) { return static_cast<Real>(mesh.positions(v, 2)); };
    for (const auto& [a, b, c] : mesh.triangles) {
      const Real bx = x(b) - x(a), bz = z(b) - z(a), cx = x(c) - x(a), cz = z(c) - z(a);
      const Real d = 2 * (bx * cz - bz * cx);
      const Real ux = (cz * (bx * bx + bz * bz) - bz * (cx * cx + cz * cz)) / d;
      const Real uz = (bx * (cx * cx + cz * cz) - cx * (bx * bx + bz * bz)) / d;
      const Real radius_sq = ux * ux + uz * uz;
      for (int v = 0; v < mesh.num_vertices(); ++v) {
        const Real dx = x(v) - x(a) - ux, dz = z(v) - z(a) - uz;
        ASSERT_GE(dx * dx + dz * dz, radius_sq * (1 - 1e-9L)) << v;
      }
    }
  }
}

TEST(Generate, JitterMovesInnerVerticesOnlyAndDependsOnTheSeed) {
  GeneratorOptions options = delaunay_options(20, 10);
  const MeshDocument jittered = generate(GeneratorKind::Sheet, options);
  const MeshDocument again = generate(GeneratorKind::Sheet, options);
  EXPECT_TRUE(jittered.mesh.positions == again.mesh.positions);
  EXPECT_EQ(jittered.mesh.triangles, again.mesh.triangles);
  options.seed = 2;
  EXPECT_FALSE(jittered.mesh.positions == generate(GeneratorKind::Sheet, options).mesh.positions);
  options.pattern = SheetPattern::Alternating;
  const MeshDocument regular = generate(GeneratorKind::Sheet, options);
  const Vec3 cell(2.0 / 19, 0, 0.75 / 9);
  const std::vector<int>& border = regular.vertex_sets.at("border");
  for (int v = 0; v < 200; ++v) {
    const Vec3 moved = (jittered.mesh.positions - regular.mesh.positions).row(v).transpose();
    EXPECT_LE(std::abs(moved.x()), 0.3 * cell.x());
    EXPECT_LE(std::abs(moved.z()), 0.3 * cell.z());
    EXPECT_EQ(moved.norm() == 0, std::binary_search(border.begin(), border.end(), v));
  }
}

TEST(Generate, TubeIsClosedAroundYAndFacesOutwards) {
  const MeshDocument document = generate(GeneratorKind::Tube, small_options());
  const TriangleMesh& mesh = document.mesh;
  EXPECT_EQ(mesh.num_vertices(), 41 * 6);
  EXPECT_EQ(mesh.num_triangles(), 2 * 41 * 5);
  for (int v = 0; v < mesh.num_vertices(); ++v)
    EXPECT_NEAR(std::hypot(mesh.positions(v, 0), mesh.positions(v, 2)), 0.4, 1e-15);
  for (int t = 0; t < mesh.num_triangles(); ++t) {
    Vec3 middle = corner(mesh, t, 0) + corner(mesh, t, 1) + corner(mesh, t, 2);
    middle.y() = 0;
    EXPECT_GT(area_vector(mesh, t).dot(middle), 0);
  }
  const std::vector<int>& bottom = document.vertex_sets.at("bottom");
  const std::vector<int>& top = document.vertex_sets.at("top");
  ASSERT_EQ(bottom.size(), 41U);
  ASSERT_EQ(top.size(), 41U);
  for (int v : bottom) EXPECT_EQ(mesh.positions(v, 1), 0);
  for (int v : top) EXPECT_EQ(mesh.positions(v, 1), 0.75);
  EXPECT_EQ(document.vertex_sets.at("border").size(), 82U);
}

TEST(Generate, DiscTrianglesAreNearlyEquilateral) {
  GeneratorOptions options;
  options.rows = 20;
  options.columns = 120;
  const MeshDocument document = generate(GeneratorKind::Disc, options);
  const TriangleMesh& mesh = document.mesh;
  EXPECT_EQ(document.vertex_sets.at("center"), std::vector<int>{0});
  EXPECT_EQ(document.vertex_sets.at("border").size(), 120U);
  EXPECT_NEAR(area(mesh), 60 * 0.25 * std::sin(2 * std::numbers::pi / 120), 1e-12);
  for (int t = 0; t < mesh.num_triangles(); ++t) {
    double longest = 0;
    for (int k = 0; k < 3; ++k)
      longest = std::max(longest, (corner(mesh, t, (k + 1) % 3) - corner(mesh, t, k)).norm());
    ASSERT_GT(area_vector(mesh, t).y(), 0.25 * longest * longest * 0.8) << t;  // equilateral: 0.433
  }
}

TEST(Generate, DiscsOfOddSizesAreValid) {
  for (int rows = 1; rows < 12; ++rows) {
    for (int columns : {3, 4, 5, 7, 11, 30, 200}) {
      GeneratorOptions options;
      options.rows = rows;
      options.columns = columns;
      const std::string error = error_of(GeneratorKind::Disc, options);
      if (!error.empty()) {
        EXPECT_NE(error.find("too few for"), std::string::npos) << error;
        continue;
      }
      const TriangleMesh mesh = generate(GeneratorKind::Disc, options).mesh;
      EXPECT_NO_THROW(validate(mesh, "disc"));
      for (int t = 0; t < mesh.num_triangles(); ++t) ASSERT_GT(area_vector(mesh, t).y(), 0);
      EXPECT_NEAR(area(mesh), 0.5 * columns * 0.25 * std::sin(2 * std::numbers::pi / columns),
                  1e-12);
    }
  }
}

TEST(Generate, QuiltPatchesConformAndDiffer) {
  GeneratorOptions options = options_for(GeneratorKind::Quilt);
  options.patches_y = 2;
  const MeshDocument document = generate(GeneratorKind::Quilt, options);
  const TriangleMesh& mesh = document.mesh;
  const auto& groups = document.layout.groups;
  ASSERT_EQ(groups.size(), 6U);
  EXPECT_EQ(groups[4].name, "patch_1_1");

  std::vector<int> patch(mesh.triangles.size());
  std::vector<double> patch_area(6, 0.0);
  std::set<int> sizes;
  for (int g = 0; g < 6; ++g) {
    const int last = g < 5 ? groups[g + 1].first_polygon : mesh.num_triangles();
    sizes.insert(last - groups[g].first_polygon);
    for (int t = groups[g].first_polygon; t < last; ++t) {
      patch[t] = g;
      patch_area[g] += area_vector(mesh, t).norm();
      for (int v : mesh.triangles[t]) {
        const std::vector<int>& set = document.vertex_sets.at(groups[g].name);
        EXPECT_TRUE(std::binary_search(set.begin(), set.end(), v));
      }
    }
  }
  EXPECT_GE(sizes.size(), 3U);  // the densities differ
  for (double value : patch_area) EXPECT_NEAR(value, 1.5 / 6, 1e-12);

  // 13 x 8 border cells per patch. Every edge on a shared border has a triangle on both sides.
  int num_outer = 0;
  int num_shared = 0;
  for (const Edge& edge : find_edges(mesh.triangles)) {
    num_outer += edge.triangles[1] < 0;
    num_shared += edge.triangles[1] >= 0 && patch[edge.triangles[0]] != patch[edge.triangles[1]];
  }
  EXPECT_EQ(num_outer, 2 * (39 + 16));
  EXPECT_EQ(num_shared, 2 * 16 + 39);
  EXPECT_EQ(document.vertex_sets.at("left").size(), 17U);
  EXPECT_EQ(document.vertex_sets.at("top").size(), 40U);
  ASSERT_EQ(document.vertex_sets.at("corners").size(), 4U);
  EXPECT_EQ(document.vertex_sets.at("corners").front(), 0);
  EXPECT_EQ(mesh.positions.row(0), Eigen::RowVector3d(0, 0, 0));
}

TEST(Generate, SmallestQuiltsAreValid) {
  GeneratorOptions options;
  options.columns = options.rows = 10;
  options.patches_x = options.patches_y = 3;
  options.jitter = 0.45;
  const MeshDocument document = generate(GeneratorKind::Quilt, options);
  EXPECT_NO_THROW(validate(document.mesh, "quilt"));
  EXPECT_NEAR(area(document.mesh), 1.0, 1e-12);
}

TEST(Generate, RefusesBadParametersByName) {
  struct Case {
    GeneratorKind kind;
    void (*change)(GeneratorOptions&);
    const char* text;
  };
  const Case cases[] = {
      {GeneratorKind::Sheet, [](GeneratorOptions& o) { o.width = 0; }, "sheet: width: 0 m"},
      {GeneratorKind::Sheet, [](GeneratorOptions& o) { o.height = -1; }, "height: -1 m"},
      {GeneratorKind::Strip,
       [](GeneratorOptions& o) { o.width = std::numeric_limits<double>::quiet_NaN(); },
       "strip: width: nan m"},
      {GeneratorKind::Sheet,
       [](GeneratorOptions& o) { o.height = std::numeric_limits<double>::infinity(); },
       "height: inf m"},
      {GeneratorKind::Sheet, [](GeneratorOptions& o) { o.rows = 1; }, "rows: 1 is too few"},
      {GeneratorKind::Sheet, [](GeneratorOptions& o) { o.columns = -5; }, "columns: -5 is too"},
      {GeneratorKind::Sheet, [](GeneratorOptions& o) { o.columns = o.rows = 4000; },
       "31984002 triangles"},
      {GeneratorKind::Sheet,
       [](GeneratorOptions& o) { o.columns = o.rows = std::numeric_limits<int>::max(); },
       "triangles; give fewer"},
      {GeneratorKind::Sheet,
       [](GeneratorOptions& o) {
         o.pattern = SheetPattern::Delaunay;
         o.jitter = 0.5;
       },
       "jitter: 0.5"},
      {GeneratorKind::Strip,
       [](GeneratorOptions& o) {
         o.width = 1e6;
         o.height = 1e-6;
       },
       "times longer than wide"},
      {GeneratorKind::Tube, [](GeneratorOptions& o) { o.columns = 2; }, "tube: columns: 2 is"},
      {GeneratorKind::Tube, [](GeneratorOptions& o) { o.radius = 0; }, "radius: 0 m"},
      {GeneratorKind::Disc, [](GeneratorOptions& o) { o.rows = 0; }, "disc: rows: 0 is too few"},
      {GeneratorKind::Disc, [](GeneratorOptions& o) { o.columns = 5; }, "too few for 6 rings"},
      {GeneratorKind::Quilt, [](GeneratorOptions& o) { o.patches_x = 0; }, "quilt: patches_x: 0"},
      {GeneratorKind::Quilt, [](GeneratorOptions& o) { o.patches_y = 2; }, "rows: 6 is too few"},
      {GeneratorKind::Quilt,
       [](GeneratorOptions& o) { o.patches_x = std::numeric_limits<int>::max(); }, "at most 1000"},
  };
  for (const Case& bad : cases) {
    GeneratorOptions options = small_options();
    bad.change(options);
    const std::string error = error_of(bad.kind, options);
    EXPECT_NE(error.find(bad.text), std::string::npos) << bad.text << " / " << error;
  }
}

TEST(Generate, NamesOfKindsAndPatterns) {
  EXPECT_STREQ(to_string(GeneratorKind::Quilt), "quilt");
  EXPECT_STREQ(to_string(GeneratorKind::Disc), "disc");
  EXPECT_STREQ(to_string(SheetPattern::Alternating), "alternating");
  EXPECT_STREQ(to_string(SheetPattern::OneDiagonal), "one_diagonal");
  EXPECT_STREQ(to_string(SheetPattern::Delaunay), "delaunay");
}

// The sizes that the benchmarks use.
TEST(Generate, BenchmarkSheetHasTheStatedSize) {
  const TriangleMesh mesh = generate(GeneratorKind::Sheet, delaunay_options(447, 447)).mesh;
  EXPECT_EQ(mesh.num_vertices(), 199809);
  EXPECT_EQ(mesh.num_triangles(), 2 * 446 * 446);
  for (int t = 0; t < mesh.num_triangles(); ++t) ASSERT_GT(area_vector(mesh, t).y(), 0);
}

}  // namespace
}  // namespace piecework::mesh
