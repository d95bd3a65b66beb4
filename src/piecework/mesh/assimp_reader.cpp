#include <piecework/mesh/assimp_reader.hpp>

#include <span>
#include <string_view>
#include <vector>

#include <assimp/scene.h>
#include <fmt/format.h>
#include <assimp/Importer.hpp>

#include <piecework/core/error.hpp>
#include <piecework/mesh/assimp_guard.hpp>
#include <piecework/mesh/child_process.hpp>
#include <piecework/mesh/packing.hpp>

namespace piecework::mesh {
namespace {

namespace fs = std::filesystem;

/// Collects the meshes of a scene, node by node.
class SceneCollector {
 public:
  SceneCollector(const std::string& file, const aiScene& scene, bool lists_vertices,
                 std::size_t max_triangles)
      : scene_(scene), guard_(file, max_triangles) {
    raw_.file = file;
    raw_.lists_vertices = lists_vertices;
    raw_.layout.polygon_begin.push_back(0);
  }

  RawMesh run() {
    if (scene_.mRootNode != nullptr) add_node(*scene_.mRootNode, aiMatrix4x4());
    if (raw_.num_polygons() == 0) fail("no faces", "give a file with a mesh");
    if (!any_uv_) {
      raw_.layout.polygon_uv.clear();
      raw_.layout.uv.clear();
    }
    auto& groups = raw_.layout.groups;
    if (groups.size() == 1) groups.clear();
    if (num_skipped_ > 0)
      raw_.notes.push_back(fmt::format("skipped {} line and point elements", num_skipped_));
    return std::move(raw_);
  }

 private:
  [[noreturn]] void fail(const std::string& problem, const char* remedy) const {
    throw InputError(fmt::format("{}: {}; {}", raw_.file, problem, remedy));
  }

  void add_node(const aiNode& node, const aiMatrix4x4& parent) {
    const aiMatrix4x4 transform = parent * node.mTransformation;
    if (node.mNumMeshes > 0)
      raw_.layout.groups.push_back({node.mName.C_Str(), raw_.num_polygons()});
    for (unsigned i = 0; i < node.mNumMeshes; ++i) {
      if (node.mMeshes[i] >= scene_.mNumMeshes)
        fail(fmt::format("node '{}' names mesh {} of {}", node.mName.C_Str(), node.mMeshes[i],
                         scene_.mNumMeshes),
             kExportAgain);
      add_mesh(*scene_.mMeshes[node.mMeshes[i]], transform);
    }
    for (unsigned i = 0; i < node.mNumChildren; ++i) add_node(*node.mChildren[i], transform);
  }

  void add_mesh(const aiMesh& mesh, const aiMatrix4x4& transform) {
    const bool has_uv = mesh.mTextureCoords[0] != nullptr;
    any_uv_ = any_uv_ || has_uv;
    const std::size_t first = raw_.positions.size();
    guard_.check_vertices(first + mesh.mNumVertices);
    for (unsigned v = 0; v < mesh.mNumVertices; ++v) add_vertex(mesh, v, transform, has_uv);
    const bool mirrored = transform.Determinant() < 0;
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices < 3) {
        ++num_skipped_;
      } else {
        add_face({face.mIndices, face.mNumIndices}, first, mesh.mNumVertices, has_uv, mirrored);
      }
    }
  }

  void add_vertex(const aiMesh& mesh, unsigned v, const aiMatrix4x4& m, bool has_uv) {
    const aiVector3D& p = mesh.mVertices[v];
    const double x = p.x;
    const double y = p.y;
    const double z = p.z;
    // In double: the identity of most files must not cost a bit, nor another transform more.
    raw_.positions.emplace_back(m.a1 * x + m.a2 * y + m.a3 * z + m.a4,
                                m.b1 * x + m.b2 * y + m.b3 * z + m.b4,
                                m.c1 * x + m.c2 * y + m.c3 * z + m.c4);
    const aiVector3D uv = has_uv ? mesh.mTextureCoords[0][v] : aiVector3D();
    raw_.layout.uv.emplace_back(static_cast<double>(uv.x), static_cast<double>(uv.y));
  }

  void add_face(std::span<const unsigned> indices, std::size_t first, unsigned num_vertices,
                bool has_uv, bool mirrored) {
    FileLayout& layout = raw_.layout;
    guard_.add_polygon(indices.size(), "face", raw_.num_polygons());
    for (std::size_t i = 0; i < indices.size(); ++i) {
      const unsigned index = indices[mirrored ? indices.size() - 1 - i : i];
      if (index >= num_vertices)
        fail(fmt::format("face {}: vertex index {} is out of range, there are {} vertices",
                         raw_.num_polygons(), index, num_vertices),
             kExportAgain);
      layout.polygon_vertex.push_back(static_cast<int>(first + index));
      layout.polygon_uv.push_back(has_uv ? static_cast<int>(first + index) : -1);
    }
    layout.polygon_begin.push_back(static_cast<int>(layout.polygon_vertex.size()));
  }

  const aiScene& scene_;
  RawMesh raw_;
  SizeGuard guard_;
  bool any_uv_ = false;
  std::size_t num_skipped_ = 0;
};

std::string pack(const RawMesh& raw) {
  Packer packer;
  packer.add(raw.positions);
  packer.add(raw.layout.polygon_begin);
  packer.add(raw.layout.polygon_vertex);
  packer.add(raw.layout.polygon_uv);
  packer.add(raw.layout.uv);
  std::string names;
  std::vector<int> first;
  for (const FileLayout::Group& group : raw.layout.groups) {
    names += group.name + '\n';
    first.push_back(group.first_polygon);
  }
  packer.add(names);
  packer.add(first);
  packer.add(raw.notes.empty() ? std::string() : raw.notes.front());
  return packer.take();
}

RawMesh unpack(const std::string& file, std::string_view bytes, bool lists_vertices) {
  RawMesh raw;
  raw.file = file;
  raw.lists_vertices = lists_vertices;
  Unpacker unpacker(file, bytes);
  unpacker.get(raw.positions);
  unpacker.get(raw.layout.polygon_begin);
  unpacker.get(raw.layout.polygon_vertex);
  unpacker.get(raw.layout.polygon_uv);
  unpacker.get(raw.layout.uv);
  std::string names;
  std::vector<int> first;
  std::string note;
  unpacker.get(names);
  unpacker.get(first);
  unpacker.get(note);
  std::string_view rest = names;
  for (int polygon : first) {
    const std::size_t end = rest.find('\n');
    raw.layout.groups.push_back({std::string(rest.substr(0, end)), polygon});
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
  }
  if (!note.empty()) raw.notes.push_back(note);
  return raw;
}

std::string read_and_pack(const fs::path& path, const std::string& extension,
                          std::size_t max_triangles) {
  Assimp::Importer importer;
  const aiScene& scene = read_guarded(importer, path, extension);
  return pack(SceneCollector(path.string(), scene, extension != ".stl", max_triangles).run());
}

}  // namespace

RawMesh read_with_assimp(const fs::path& path, const std::string& extension,
                         std::size_t max_triangles) {
  const std::string bytes = run_in_child(
      path.string(), [&] { return read_and_pack(path, extension, max_triangles); },
      limits_for(path, extension == ".gltf"));
  return unpack(path.string(), bytes, extension != ".stl");
}

}  // namespace piecework::mesh
