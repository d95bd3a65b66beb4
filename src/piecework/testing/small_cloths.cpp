#include <piecework/testing/small_cloths.hpp>

#include <map>
#include <utility>

#include <piecework/core/random.hpp>

namespace piecework::testing {

mesh::TriangleMesh grid_mesh(int columns, int rows, double size) {
  mesh::TriangleMesh mesh;
  mesh.positions.resize(static_cast<Eigen::Index>(columns) * rows, 3);
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i)
      mesh.positions.row(j * columns + i) << size * i / (columns - 1), 0.0, size * j / (rows - 1);
  for (int j = 0; j + 1 < rows; ++j)
    for (int i = 0; i + 1 < columns; ++i) {
      const int a = j * columns + i;
      const int b = a + 1;
      const int c = a + columns;
      const int d = c + 1;
      if ((i + j) % 2 == 0) {
        mesh.triangles.push_back({a, c, b});
        mesh.triangles.push_back({b, c, d});
      } else {
        mesh.triangles.push_back({a, c, d});
        mesh.triangles.push_back({a, d, b});
      }
    }
  return mesh;
}

mesh::TriangleMesh sphere_mesh(int level, double radius) {
  std::vector<Vec3> points{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  Triangles triangles{{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                      {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int l = 0; l < level; ++l) {
    std::map<std::pair<int, int>, int> middles;
    const auto middle = [&](int a, int b) {
      const auto [it, is_new] =
          middles.try_emplace(std::minmax(a, b), static_cast<int>(points.size()));
      if (is_new)
        points.push_back((points[static_cast<std::size_t>(a)] + points[static_cast<std::size_t>(b)])
                             .normalized());
      return it->second;
    };
    Triangles finer;
    for (const auto& [a, b, c] : triangles) {
      const int ab = middle(a, b);
      const int bc = middle(b, c);
      const int ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    triangles = std::move(finer);
  }
  mesh::TriangleMesh mesh;
  mesh.triangles = std::move(triangles);
  mesh.positions.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i)
    mesh.positions.row(static_cast<Eigen::Index>(i)) = radius * points[i].transpose();
  return mesh;
}

mesh::TriangleMesh disjoint_union(const mesh::TriangleMesh& a, const mesh::TriangleMesh& b) {
  mesh::TriangleMesh both;
  both.positions.resize(a.positions.rows() + b.positions.rows(), 3);
  both.positions << a.positions, b.positions;
  both.triangles = a.triangles;
  for (Triangle t : b.triangles) {
    for (int& v : t) v += a.num_vertices();
    both.triangles.push_back(t);
  }
  return both;
}

model::Material cotton(std::optional<double> bending) {
  return {.density = 0.5, .stretching = 0.821e6 * 0.318e-3, .bending = bending};
}

model::ClothModel cloth_model(const mesh::TriangleMesh& mesh, const model::Material& material) {
  return model::build_model(
      {{.name = "cloth",
        .triangles = mesh.triangles,
        .rest = model::rest_from_positions(mesh.positions, mesh.triangles, "cloth"),
        .start = mesh.positions,
        .material = material}});
}

Positions random_positions(int rows, double size, std::uint64_t seed) {
  Random random(seed);
  Positions x(rows, 3);
  for (Eigen::Index i = 0; i < x.size(); ++i) x.data()[i] = random.uniform(-size, size);
  return x;
}

}  // namespace piecework::testing
