#include <piecework/mesh/export.hpp>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <span>
#include <string_view>

#include <fmt/format.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>

namespace piecework::mesh {
namespace {

static_assert(std::endian::native == std::endian::little, "the writers copy numbers as they are");

constexpr int kNoDomain = -1;

template <class T>
void append(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// The vertices and faces of one part as they go into a file.
class PartView {
 public:
  explicit PartView(const ExportPart& part) : part_(part), document_(*part.document) {
    PIECEWORK_ASSERT(part.positions.rows() == document_.mesh.num_vertices());
    PIECEWORK_ASSERT(!has_domains() || static_cast<int>(part.triangle_domain.size()) ==
                                           document_.mesh.num_triangles());
  }

  [[nodiscard]] const std::string& name() const { return part_.name; }
  [[nodiscard]] const FileLayout& layout() const { return document_.layout; }
  [[nodiscard]] int num_vertices() const { return document_.num_file_vertices(); }
  [[nodiscard]] bool has_domains() const { return !part_.triangle_domain.empty(); }
  [[nodiscard]] int domain(int triangle) const {
    return has_domains() ? part_.triangle_domain[triangle] : kNoDomain;
  }

  /// Calls visit(position) for each file vertex, in file order.
  template <class Visit>
  void for_each_vertex(const Visit& visit) const {
    Eigen::Index next_dropped = 0;
    for (int v = 0; v < num_vertices(); ++v) {
      const int vertex = document_.vertex_map.empty() ? v : document_.vertex_map[v];
      if (vertex >= 0) {
        visit(Vec3(part_.positions.row(vertex).transpose()));
      } else {
        visit(Vec3(document_.layout.positions.row(next_dropped++).transpose()));
      }
    }
  }

  [[nodiscard]] bool has_polygons() const { return !layout().polygon_begin.empty(); }

  /// True if the file's polygons are the mesh's triangles, one by one.
  [[nodiscard]] bool is_triangulated() const {
    if (!has_polygons()) return true;
    return layout().polygon_vertex.size() == 3 * document_.mesh.triangles.size() &&
           layout().polygon_begin.size() == document_.mesh.triangles.size() + 1;
  }

  /// Calls visit(file vertices of the face) for each polygon of the file, or for each triangle.
  template <class Visit>
  void for_each_polygon(const Visit& visit) const {
    if (!has_polygons()) {
      for_each_triangle(visit);
      return;
    }
    const FileLayout& file = layout();
    for (std::size_t p = 0; p + 1 < file.polygon_begin.size(); ++p) {
      visit(std::span<const int>(file.polygon_vertex)
                .subspan(
                    static_cast<std::size_t>(file.polygon_begin[p]),
                    static_cast<std::size_t>(file.polygon_begin[p + 1] - file.polygon_begin[p])));
    }
  }

  /// The same for the triangles of the mesh, on the first file vertex of each.
  template <class Visit>
  void for_each_triangle(const Visit& visit) const {
    std::vector<int> file_vertex(static_cast<std::size_t>(document_.mesh.num_vertices()));
    for (int v = num_vertices() - 1; v >= 0; --v) {
      const int vertex = document_.vertex_map.empty() ? v : document_.vertex_map[v];
      if (vertex >= 0) file_vertex[vertex] = v;
    }
    for (const Triangle& t : document_.mesh.triangles) {
      const Triangle corners{file_vertex[t[0]], file_vertex[t[1]], file_vertex[t[2]]};
      visit(std::span<const int>(corners));
    }
  }

 private:
  const ExportPart& part_;
  const MeshDocument& document_;
};

using PartViews = std::vector<PartView>;

int total_vertices(const PartViews& parts) {
  int count = 0;
  for (const PartView& part : parts) count += part.num_vertices();
  return count;
}

// --- PLY -----------------------------------------------------------------------------------------

/// Faces count their corners in a byte unless one has too many.
bool need_wide_counts(const PartViews& parts) {
  std::size_t most = 0;
  for (const PartView& part : parts) {
    part.for_each_polygon(
        [&](std::span<const int> corners) { most = std::max(most, corners.size()); });
  }
  return most > std::numeric_limits<std::uint8_t>::max();
}

std::string to_ply(const PartViews& parts) {
  const bool wide = need_wide_counts(parts);
  const bool domains = std::all_of(parts.begin(), parts.end(), [](const PartView& part) {
    return part.has_domains() && part.is_triangulated();
  });
  std::string vertices;
  std::string faces;
  std::size_t num_faces = 0;
  int first = 0;
  for (const PartView& part : parts) {
    part.for_each_vertex([&](const Vec3& p) {
      for (int k = 0; k < 3; ++k) append(vertices, p[k]);
    });
    int triangle = 0;
    part.for_each_polygon([&](std::span<const int> corners) {
      const auto count =
          static_cast<std::uint16_t>(corners.size());  // little endian: low byte first
      faces.append(reinterpret_cast<const char*>(&count), wide ? 2 : 1);
      for (int v : corners) append(faces, std::int32_t{first + v});
      if (domains) append(faces, std::int32_t{part.domain(triangle++)});
      ++num_faces;
    });
    first += part.num_vertices();
  }
  std::string ply = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\n"
      "property double y\nproperty double z\nelement face {}\n"
      "property list {} int vertex_indices\n{}end_header\n",
      first, num_faces, wide ? "ushort" : "uchar", domains ? "property int domain\n" : "");
  return ply + vertices + faces;
}

// --- OBJ -----------------------------------------------------------------------------------------

/// A name on one line.
std::string clean_name(std::string name) {
  for (char& c : name) {
    if (static_cast<unsigned char>(c) < 0x20) c = '_';
  }
  return name;
}

void append_obj_faces(const PartView& part, int first_vertex, int first_uv, std::string& obj) {
  const FileLayout& layout = part.layout();
  const bool has_uv = !layout.polygon_uv.empty();
  auto group = layout.groups.begin();
  int polygon = 0;
  std::size_t corner = 0;
  part.for_each_polygon([&](std::span<const int> corners) {
    for (; group != layout.groups.end() && group->first_polygon <= polygon; ++group)
      fmt::format_to(std::back_inserter(obj), "g {}\n", clean_name(group->name));
    obj += 'f';
    for (int v : corners) {
      fmt::format_to(std::back_inserter(obj), " {}", first_vertex + v);
      if (has_uv && layout.polygon_uv[corner] >= 0)
        fmt::format_to(std::back_inserter(obj), "/{}", first_uv + layout.polygon_uv[corner]);
      ++corner;
    }
    obj += '\n';
    ++polygon;
  });
}

std::string to_obj(const PartViews& parts) {
  std::string obj = "# Piecework\n";
  int first_vertex = 1;
  int first_uv = 1;
  for (const PartView& part : parts) {
    if (parts.size() > 1) obj += fmt::format("o {}\n", clean_name(part.name()));
    part.for_each_vertex([&](const Vec3& p) {
      fmt::format_to(std::back_inserter(obj), "v {:.17g} {:.17g} {:.17g}\n", p.x(), p.y(), p.z());
    });
    for (const Vec2& uv : part.layout().uv)
      fmt::format_to(std::back_inserter(obj), "vt {:.17g} {:.17g}\n", uv.x(), uv.y());
    append_obj_faces(part, first_vertex, first_uv, obj);
    first_vertex += part.num_vertices();
    first_uv += static_cast<int>(part.layout().uv.size());
  }
  return obj;
}

// --- VTP -----------------------------------------------------------------------------------------

/// Arrays behind the XML of a VTK file, each with its size in front.
class AppendedData {
 public:
  /// Appends `data` and returns its offset.
  template <class T>
  std::size_t add(const std::vector<T>& data) {
    const std::size_t offset = bytes_.size();
    append(bytes_, std::uint64_t{data.size() * sizeof(T)});
    bytes_.append(reinterpret_cast<const char*>(data.data()), data.size() * sizeof(T));
    return offset;
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

struct VtpFaces {
  std::vector<std::int64_t> connectivity;
  std::vector<std::int64_t> offsets;
  std::vector<std::int32_t> domain;
};

/// Polygons; triangles where domains divide a polygon.
VtpFaces vtp_faces(const PartViews& parts) {
  VtpFaces faces;
  int first = 0;
  for (const PartView& part : parts) {
    int face = 0;
    const bool triangles = part.has_domains() || part.is_triangulated();
    const auto add = [&](std::span<const int> corners) {
      for (int v : corners) faces.connectivity.push_back(first + v);
      faces.offsets.push_back(static_cast<std::int64_t>(faces.connectivity.size()));
      faces.domain.push_back(triangles ? part.domain(face) : kNoDomain);
      ++face;
    };
    if (part.has_domains() && !part.is_triangulated()) {
      part.for_each_triangle(add);
    } else {
      part.for_each_polygon(add);
    }
    first += part.num_vertices();
  }
  return faces;
}

std::string to_vtp(const PartViews& parts) {
  std::vector<double> points;
  points.reserve(3 * static_cast<std::size_t>(total_vertices(parts)));
  for (const PartView& part : parts) {
    part.for_each_vertex(
        [&](const Vec3& p) { points.insert(points.end(), p.data(), p.data() + 3); });
  }
  const VtpFaces faces = vtp_faces(parts);
  AppendedData data;
  const std::size_t points_at = data.add(points);
  const std::size_t connectivity_at = data.add(faces.connectivity);
  const std::size_t offsets_at = data.add(faces.offsets);
  std::string cell_data;
  if (std::any_of(parts.begin(), parts.end(), [](const PartView& p) { return p.has_domains(); }))
    cell_data = fmt::format(
        "      <CellData Scalars=\"domain\">\n"
        "        <DataArray type=\"Int32\" Name=\"domain\" format=\"appended\" offset=\"{}\"/>\n"
        "      </CellData>\n",
        data.add(faces.domain));
  std::string vtp = fmt::format(
      "<?xml version=\"1.0\"?>\n"
      "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n"
      "  <PolyData>\n"
      "    <Piece NumberOfPoints=\"{}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" "
      "NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n"
      "      <Points>\n"
      "        <DataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\" "
      "format=\"appended\" offset=\"{}\"/>\n"
      "      </Points>\n"
      "      <Polys>\n"
      "        <DataArray type=\"Int64\" Name=\"connectivity\" format=\"appended\" "
      "offset=\"{}\"/>\n"
      "        <DataArray type=\"Int64\" Name=\"offsets\" format=\"appended\" offset=\"{}\"/>\n"
      "      </Polys>\n"
      "{}"
      "    </Piece>\n"
      "  </PolyData>\n"
      "  <AppendedData encoding=\"raw\">\n_",
      points.size() / 3, faces.offsets.size(), points_at, connectivity_at, offsets_at, cell_data);
  vtp += data.bytes();
  vtp += "\n  </AppendedData>\n</VTKFile>\n";
  return vtp;
}

}  // namespace

void export_meshes(const std::filesystem::path& path, ExportFormat format,
                   std::span<const ExportPart> parts) {
  const PartViews views(parts.begin(), parts.end());
  switch (format) {
    case ExportFormat::Ply:
      return write_file_atomically(path, to_ply(views));
    case ExportFormat::Obj:
      return write_file_atomically(path, to_obj(views));
    case ExportFormat::Vtp:
      return write_file_atomically(path, to_vtp(views));
  }
}

const char* extension(ExportFormat format) {
  switch (format) {
    case ExportFormat::Ply:
      return "ply";
    case ExportFormat::Obj:
      return "obj";
    case ExportFormat::Vtp:
      break;
  }
  return "vtp";
}

}  // namespace piecework::mesh
