#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include <renderer/borders.hpp>
#include <renderer/display_mesh.hpp>

#include <piecework/core/error.hpp>

namespace piecework::render {
namespace {

struct Sheet {
  Positions positions;
  Triangles triangles;
};

Sheet make_sheet(int side, double height) {
  Sheet sheet;
  sheet.positions.resize(side * side, 3);
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      const double x = static_cast<double>(i) / (side - 1);
      const double z = static_cast<double>(j) / (side - 1);
      sheet.positions.row(j * side + i) << x, height * std::sin(5 * x) * std::cos(4 * z), z;
    }
  }
  for (int j = 0; j + 1 < side; ++j) {
    for (int i = 0; i + 1 < side; ++i) {
      const int a = j * side + i;
      sheet.triangles.push_back({a, a + side, a + side + 1});
      sheet.triangles.push_back({a, a + side + 1, a + 1});
    }
  }
  return sheet;
}

Frame frame_of(const Sheet& sheet) {
  Frame frame;
  frame.positions = &sheet.positions;
  frame.triangles = sheet.triangles;
  return frame;
}

using Edge = std::array<int, 2>;
std::map<Edge, int> edge_counts(const std::vector<Triangle>& triangles) {
  std::map<Edge, int> counts;
  for (const Triangle& v : triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      ++counts[{std::min(v[i], v[(i + 1) % 3]), std::max(v[i], v[(i + 1) % 3])}];
    }
  }
  return counts;
}

double area(const DisplayMesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 p = mesh.positions[a].cast<double>();
    sum +=
        0.5 *
        (mesh.positions[b].cast<double>() - p).cross(mesh.positions[c].cast<double>() - p).norm();
  }
  return sum;
}

double outline(const DisplayMesh& mesh) {
  double sum = 0;
  for (const auto& [edge, count] : edge_counts(mesh.triangles)) {
    if (count == 1) {
      sum += static_cast<double>((mesh.positions[edge[0]] - mesh.positions[edge[1]]).norm());
    }
  }
  return sum;
}

TEST(DisplayMesh, IsCentredWithUnitHalfDiagonal) {
  Sheet sheet = make_sheet(9, 0.2);
  for (double scale : {1e-6, 1.0, 1e9}) {
    Sheet moved = sheet;
    moved.positions = (sheet.positions * scale).rowwise() + Eigen::RowVector3d(7, -3, 2) * scale;
    const DisplayMesh mesh = build_display_mesh(frame_of(moved), 0);
    EXPECT_NEAR((mesh.high - mesh.low).norm(), 2, 1e-5);
    EXPECT_NEAR((mesh.high + mesh.low).norm(), 0, 1e-5);
  }
}

TEST(DisplayMesh, NormalsOfATiltedPlaneAndASphere) {
  Sheet sheet = make_sheet(5, 0);
  sheet.positions.col(1) = 0.5 * sheet.positions.col(0);
  const Vec3f expected = Vec3f(-0.5F, 1, 0).normalized();
  for (const Vec3f& n : build_display_mesh(frame_of(sheet), 0).normals) {
    EXPECT_LT((n - expected).norm(), 1e-5F);
  }
}

// Neighbouring triangles wound in opposite directions must not leave vertices without a normal.
TEST(DisplayMesh, NormalsSurviveMixedWinding) {
  Sheet sheet = make_sheet(6, 0);
  for (std::size_t t = 0; t < sheet.triangles.size(); t += 2) {
    std::swap(sheet.triangles[t][1], sheet.triangles[t][2]);
  }
  for (const Vec3f& n : build_display_mesh(frame_of(sheet), 0).normals) {
    EXPECT_NEAR(n.norm(), 1, 1e-5);
    EXPECT_NEAR(std::abs(n.y()), 1, 1e-3);
  }
}

TEST(SplitLongEdges, KeepsTheSurfaceAndLeavesNoGaps) {
  for (int side : {2, 3, 6}) {
    SCOPED_TRACE(side);
    const Sheet sheet = make_sheet(side, 0.3);
    const DisplayMesh coarse = build_display_mesh(frame_of(sheet), 0);
    DisplayMesh fine = coarse;
    split_long_edges(fine, 0.1F, 1'000'000);
    EXPECT_GT(fine.triangles.size(), 4 * coarse.triangles.size());
    EXPECT_EQ(fine.source.size(), fine.triangles.size());
    EXPECT_EQ(fine.normals.size(), fine.positions.size());
    EXPECT_NEAR(area(fine), area(coarse), 1e-5);
    EXPECT_NEAR(outline(fine), outline(coarse), 1e-4) << "a gap would add to the outline";
    for (const auto& [edge, count] : edge_counts(fine.triangles)) {
      EXPECT_LE(count, 2);
      EXPECT_LE((fine.positions[edge[0]] - fine.positions[edge[1]]).norm(), 0.1F);
    }
    for (const Vec3f& n : fine.normals) EXPECT_NEAR(n.norm(), 1, 1e-4);
  }
}

TEST(SplitLongEdges, OrientationAndSourceAreKept) {
  const Sheet sheet = make_sheet(3, 0);
  const DisplayMesh mesh = build_display_mesh(frame_of(sheet), 0.05F);
  std::vector<double> areas(sheet.triangles.size(), 0.0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto [a, b, c] = mesh.triangles[t];
    const Vec3f n =
        (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
    EXPECT_GT(n.y(), 0);
    areas[mesh.source[t]] += 0.5 * static_cast<double>(n.y());
  }
  for (double part : areas) EXPECT_NEAR(part, areas.front(), 1e-5);
}

TEST(SplitLongEdges, RespectsTheCap) {
  const Sheet sheet = make_sheet(2, 0);
  DisplayMesh mesh = build_display_mesh(frame_of(sheet), 0);
  split_long_edges(mesh, 1e-3F, 5000);
  EXPECT_GT(mesh.triangles.size(), 500U);
  EXPECT_LT(mesh.triangles.size(), 20'000U);
}

TEST(DisplayMesh, DegenerateMeshes) {
  EXPECT_TRUE(build_display_mesh(Frame{}, 0.02F).empty());
  const Positions none(0, 3);
  Frame empty;
  empty.positions = &none;
  EXPECT_TRUE(build_display_mesh(empty, 0.02F).empty());
  Sheet point = make_sheet(3, 0);
  point.positions.setConstant(4.0);
  const DisplayMesh mesh = build_display_mesh(frame_of(point), 0.02F);
  for (const Vec3f& n : mesh.normals) EXPECT_NEAR(n.norm(), 1, 1e-5);
}

TEST(DisplayMesh, RejectsBadInput) {
  const Sheet good = make_sheet(3, 0);
  for (double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
        -std::numeric_limits<double>::infinity()}) {
    Sheet sheet = good;
    sheet.positions(4, 2) = bad;
    try {
      build_display_mesh(frame_of(sheet), 0);
      FAIL() << "accepted " << bad;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("vertex 4"), std::string::npos) << error.what();
    }
  }
  for (int bad : {-1, 9}) {
    Sheet sheet = good;
    sheet.triangles[5][1] = bad;
    EXPECT_THROW(build_display_mesh(frame_of(sheet), 0), InputError);
  }
  Sheet huge = good;
  huge.positions(0, 0) = 1.5e308;
  huge.positions(8, 0) = -1.5e308;
  huge.positions(2, 1) = 1.7e308;
  EXPECT_THROW(build_display_mesh(frame_of(huge), 0), InputError);
  Frame no_positions;
  no_positions.triangles = good.triangles;
  EXPECT_THROW(build_display_mesh(no_positions, 0), InputError);
}

/// Edges between triangles of different domains, found through a map of all edges.
std::set<Edge> border_edges(const DisplayMesh& mesh, const std::vector<int>& domain) {
  std::map<Edge, std::set<int>> domains;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& v = mesh.triangles[t];
    for (std::size_t i = 0; i < 3; ++i) {
      const Edge edge{std::min(v[i], v[(i + 1) % 3]), std::max(v[i], v[(i + 1) % 3])};
      domains[edge].insert(domain[mesh.source[t]]);
    }
  }
  std::set<Edge> result;
  for (const auto& [edge, found] : domains) {
    if (found.size() > 1) result.insert(edge);
  }
  return result;
}

std::vector<int> scattered_domains(const Sheet& sheet) {
  std::vector<int> domain;
  for (std::size_t t = 0; t < sheet.triangles.size(); ++t) {
    domain.push_back(static_cast<int>((t / 7 + t / 31) % 4));
  }
  return domain;
}

TEST(Borders, FindsEachBorderEdgeOnce) {
  const Sheet sheet = make_sheet(14, 0.2);
  const std::vector<int> domain = scattered_domains(sheet);
  for (float longest : {0.0F, 0.05F}) {
    const DisplayMesh mesh = build_display_mesh(frame_of(sheet), longest);
    const std::set<Edge> expected = border_edges(mesh, domain);
    ASSERT_GT(expected.size(), 50U);
    const Borders borders = find_borders(mesh, domain, 0.01F);
    std::set<Edge> found;
    for (const auto& [a, b] : borders.edges) found.insert({std::min(a, b), std::max(a, b)});
    EXPECT_EQ(found.size(), borders.edges.size()) << "an edge was found twice";
    EXPECT_TRUE(found == expected);
  }
}

TEST(Borders, TrianglesKnowAllSegmentsThatTouchThem) {
  const Sheet sheet = make_sheet(14, 0.2);
  const std::vector<int> domain = scattered_domains(sheet);
  const DisplayMesh mesh = build_display_mesh(frame_of(sheet), 0);
  const Borders borders = find_borders(mesh, domain, 0.001F);
  std::map<int, std::set<std::pair<float, float>>> known;  // x and z of midpoints, by triangle
  for (std::size_t i = 0; i < borders.triangles.size(); ++i) {
    const auto [first, count] = borders.ranges[i];
    for (int s = first; s < first + count; ++s) {
      const Borders::Segment& segment = borders.segments[s];
      known[borders.triangles[i]].insert(
          {segment.start[0] + segment.end[0], segment.start[2] + segment.end[2]});
    }
  }
  const std::set<Edge> expected = border_edges(mesh, domain);
  int checked = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const auto& [a, b] : expected) {
      const Triangle& v = mesh.triangles[t];
      const bool touches = std::any_of(v.begin(), v.end(), [&](int x) { return x == a || x == b; });
      if (!touches) continue;
      const Vec3f sum = mesh.positions[a] + mesh.positions[b];
      EXPECT_EQ(known[static_cast<int>(t)].count({sum.x(), sum.z()}), 1U);
      ++checked;
    }
  }
  EXPECT_GT(checked, 500);
}

TEST(Borders, WideLinesReachFurtherTriangles) {
  const Sheet sheet = make_sheet(30, 0);
  std::vector<int> domain;
  for (const Triangle& t : sheet.triangles) domain.push_back(t[0] % 30 < 15 ? 0 : 1);
  const DisplayMesh mesh = build_display_mesh(frame_of(sheet), 0);
  const std::size_t thin = find_borders(mesh, domain, 0.001F).triangles.size();
  const std::size_t wide = find_borders(mesh, domain, 0.2F).triangles.size();
  EXPECT_GT(thin, 4 * 29U - 10);
  EXPECT_GT(wide, 2 * thin);
}

TEST(Borders, OneDomainHasNone) {
  const Sheet sheet = make_sheet(8, 0);
  const std::vector<int> domain(sheet.triangles.size(), 0);
  const Borders borders = find_borders(build_display_mesh(frame_of(sheet), 0), domain, 0.01F);
  EXPECT_TRUE(borders.triangles.empty());
  EXPECT_TRUE(borders.edges.empty());
}

}  // namespace
}  // namespace piecework::render
