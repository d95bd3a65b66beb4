#include <map>
#include <string_view>
#include <utility>

#include <assimp/anim.h>
#include <assimp/scene.h>
#include <fmt/format.h>
#include <assimp/Importer.hpp>

#include <piecework/core/error.hpp>
#include <piecework/mesh/assimp_guard.hpp>
#include <piecework/mesh/avatar_file.hpp>
#include <piecework/mesh/packing.hpp>
#include <piecework/mesh/raw_mesh.hpp>

namespace piecework::mesh {
namespace {

namespace fs = std::filesystem;
using Vec4 = Eigen::Matrix<double, 4, 1>;

/// Clips without a rate count in so many ticks per second, as assimp's own viewer does.
constexpr double kDefaultTicks = 25;

void add_matrix(const aiMatrix4x4& m, std::vector<double>& out) {
  for (unsigned i = 0; i < 4; ++i)
    for (unsigned j = 0; j < 4; ++j) out.push_back(static_cast<double>(m[i][j]));
}

std::string seconds(const aiAnimation& clip) {
  const double ticks = clip.mTicksPerSecond > 0 ? clip.mTicksPerSecond : kDefaultTicks;
  return fmt::format("\"{}\" ({:.3g} s)", clip.mName.C_Str(), clip.mDuration / ticks);
}

std::string clip_list(const aiScene& scene) {
  std::string list;
  for (unsigned i = 0; i < scene.mNumAnimations; ++i)
    list += (i > 0 ? ", " : "") + seconds(*scene.mAnimations[i]);
  return list;
}

/// Fills an AvatarFile from a scene; what assimp says of indices is not trusted.
class AvatarCollector {
 public:
  AvatarCollector(std::string file, const aiScene& scene, std::size_t max_triangles)
      : scene_(scene), guard_(file, max_triangles) {
    out_.file = std::move(file);
    out_.polygon_begin.push_back(0);
  }

  AvatarFile run(const std::string& clip) {
    if (scene_.mRootNode != nullptr) add_node(*scene_.mRootNode, -1);
    if (scene_.mNumMeshes == 0 || out_.polygon_begin.size() == 1)
      fail(scene_.mNumAnimations > 0
               ? fmt::format("no triangles, only motion: {}", clip_list(scene_))
               : "no triangles",
           "name a file that holds the figure as well");
    for (const Placed& placed : placed_) add_joints(placed);
    if (const aiAnimation* chosen = choose(clip)) add_clip(*chosen);
    return std::move(out_);
  }

 private:
  struct Named {
    int number;
    bool has_mesh;
  };
  struct Placed {
    const aiMesh* mesh;
    int number, first_vertex;
  };

  [[noreturn]] void fail(const std::string& problem, const std::string& remedy) const {
    throw InputError(fmt::format("{}: {}; {}", out_.file, problem, remedy));
  }

  void add_node(const aiNode& node, int parent) {
    const int number = static_cast<int>(out_.node_parent.size());
    std::string name = node.mName.C_Str();
    for (char& c : name)
      if (c == '\n') c = ' ';
    nodes_[node.mName.C_Str()].push_back({number, node.mNumMeshes > 0});
    out_.node_names += name + '\n';
    out_.node_parent.push_back(parent);
    add_matrix(node.mTransformation, out_.node_local);
    for (unsigned i = 0; i < node.mNumMeshes; ++i) {
      if (node.mMeshes[i] >= scene_.mNumMeshes)
        fail(fmt::format("node '{}' names mesh {} of {}", name, node.mMeshes[i], scene_.mNumMeshes),
             kExportAgain);
      add_mesh(*scene_.mMeshes[node.mMeshes[i]], number);
    }
    for (unsigned i = 0; i < node.mNumChildren; ++i) add_node(*node.mChildren[i], number);
  }

  void add_mesh(const aiMesh& mesh, int node) {
    const int first = static_cast<int>(out_.positions.size());
    placed_.push_back({&mesh, static_cast<int>(placed_.size()), first});
    guard_.check_vertices(out_.positions.size() + mesh.mNumVertices);
    for (unsigned v = 0; v < mesh.mNumVertices; ++v) {
      const aiVector3D& p = mesh.mVertices[v];
      out_.positions.emplace_back(static_cast<double>(p.x), static_cast<double>(p.y),
                                  static_cast<double>(p.z));
      out_.vertex_node.push_back(node);
      out_.vertex_mesh.push_back(placed_.back().number);
    }
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices < 3) continue;  // lines and points are no surface
      const int number = static_cast<int>(out_.polygon_begin.size()) - 1;
      guard_.add_polygon(face.mNumIndices, "face", number);
      for (unsigned k = 0; k < face.mNumIndices; ++k) {
        if (face.mIndices[k] >= mesh.mNumVertices)
          fail(fmt::format("face {}: vertex index {} is out of range, there are {} vertices",
                           number, face.mIndices[k], mesh.mNumVertices),
               kExportAgain);
        out_.polygon_vertex.push_back(first + static_cast<int>(face.mIndices[k]));
      }
      out_.polygon_begin.push_back(static_cast<int>(out_.polygon_vertex.size()));
    }
  }

  /// assimp knows joints and animated nodes by name only, though names need not be unique: a joint
  /// and the part on it are often called alike. Then the joint is meant, which carries no mesh.
  [[nodiscard]] int node_named(const char* name, const char* who) const {
    const auto found = nodes_.find(name);
    if (found == nodes_.end())
      fail(fmt::format("{} names '{}', which is no node", who, name), kExportAgain);
    std::vector<Named> bare;
    for (const Named& node : found->second)
      if (!node.has_mesh) bare.push_back(node);
    const std::vector<Named>& candidates = bare.empty() ? found->second : bare;
    if (candidates.size() > 1)
      fail(fmt::format("{} names '{}', but {} nodes have that name", who, name, candidates.size()),
           "give each its own");
    return candidates.front().number;
  }

  void add_joints(const Placed& placed) {
    for (unsigned b = 0; b < placed.mesh->mNumBones; ++b) {
      const aiBone& bone = *placed.mesh->mBones[b];
      const int joint = static_cast<int>(out_.joint_node.size());
      out_.joint_node.push_back(node_named(bone.mName.C_Str(), "a joint"));
      out_.joint_mesh.push_back(placed.number);
      add_matrix(bone.mOffsetMatrix, out_.joint_offset);
      for (unsigned w = 0; w < bone.mNumWeights; ++w) {
        const aiVertexWeight& weight = bone.mWeights[w];
        if (weight.mVertexId >= placed.mesh->mNumVertices)
          fail(fmt::format("joint '{}': vertex {} is out of range, there are {}",
                           bone.mName.C_Str(), weight.mVertexId, placed.mesh->mNumVertices),
               kExportAgain);
        out_.weight_vertex.push_back(placed.first_vertex + static_cast<int>(weight.mVertexId));
        out_.weight_joint.push_back(joint);
        out_.weight.push_back(static_cast<double>(weight.mWeight));
      }
    }
  }

  [[nodiscard]] const aiAnimation* choose(const std::string& name) const {
    const unsigned count = scene_.mNumAnimations;
    if (name.empty() && count <= 1) return count == 1 ? scene_.mAnimations[0] : nullptr;
    for (unsigned i = 0; i < count; ++i)
      if (name == scene_.mAnimations[i]->mName.C_Str()) return scene_.mAnimations[i];
    if (count == 0) fail(fmt::format("no clip \"{}\", and no other", name), "leave out the clip");
    fail(name.empty() ? fmt::format("{} clips, and none is chosen", count)
                      : fmt::format("no clip \"{}\"", name),
         fmt::format("name one of {}", clip_list(scene_)));
  }

  void add_clip(const aiAnimation& clip) {
    const double ticks = clip.mTicksPerSecond > 0 ? clip.mTicksPerSecond : kDefaultTicks;
    out_.duration.push_back(clip.mDuration / ticks);
    out_.clip = clip.mName.C_Str();
    for (AvatarKeys* keys : {&out_.moves, &out_.turns, &out_.scales}) keys->begin.push_back(0);
    for (unsigned c = 0; c < clip.mNumChannels; ++c) {
      const aiNodeAnim& channel = *clip.mChannels[c];
      out_.track_node.push_back(node_named(channel.mNodeName.C_Str(), "the clip"));
      add_keys(channel.mPositionKeys, channel.mNumPositionKeys, ticks, out_.moves);
      add_keys(channel.mRotationKeys, channel.mNumRotationKeys, ticks, out_.turns);
      add_keys(channel.mScalingKeys, channel.mNumScalingKeys, ticks, out_.scales);
    }
    if (clip.mNumMorphMeshChannels > 0 || clip.mNumMeshChannels > 0)
      out_.notes += "morph targets of the clip are left out\n";
  }

  static Vec4 value_of(const aiVector3D& v) {
    return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z), 0.0};
  }
  static Vec4 value_of(const aiQuaternion& q) {
    return {static_cast<double>(q.w), static_cast<double>(q.x), static_cast<double>(q.y),
            static_cast<double>(q.z)};
  }

  template <class Key>
  static void add_keys(const Key* keys, unsigned count, double ticks, AvatarKeys& out) {
    for (unsigned k = 0; k < count; ++k) {
      out.time.push_back(keys[k].mTime / ticks);
      out.value.push_back(value_of(keys[k].mValue));
    }
    out.begin.push_back(static_cast<int>(out.time.size()));
  }

  const aiScene& scene_;
  SizeGuard guard_;
  AvatarFile out_;
  std::map<std::string, std::vector<Named>> nodes_;
  std::vector<Placed> placed_;
};

/// Every member, in one order for packing and unpacking.
template <class File, class Each>
void visit(File& f, const Each& each) {
  each(f.node_names), each(f.node_parent), each(f.node_local);
  each(f.positions), each(f.vertex_node), each(f.vertex_mesh);
  each(f.polygon_begin), each(f.polygon_vertex);
  each(f.joint_node), each(f.joint_mesh), each(f.joint_offset);
  each(f.weight_vertex), each(f.weight_joint), each(f.weight);
  each(f.duration), each(f.clip), each(f.track_node);
  for (auto* keys : {&f.moves, &f.turns, &f.scales})
    each(keys->begin), each(keys->time), each(keys->value);
  each(f.notes);
}

}  // namespace

AvatarFile read_avatar_file(const fs::path& path, const std::string& extension,
                            const std::string& clip, std::size_t max_triangles) {
  const auto work = [&] {
    Assimp::Importer importer;
    const aiScene& scene = read_guarded(importer, path, extension);
    const AvatarFile file = AvatarCollector(path.string(), scene, max_triangles).run(clip);
    Packer packer;
    visit(file, [&](const auto& member) { packer.add(member); });
    return packer.take();
  };
  AvatarFile file;
  file.file = path.string();
  const std::string bytes =
      run_in_child(path.string(), work, limits_for(path, extension == ".gltf"));
  Unpacker unpacker(file.file, bytes);
  visit(file, [&](auto& member) { unpacker.get(member); });
  return file;
}

}  // namespace piecework::mesh
