#pragma once

// Small animated figures as glTF files, for tests.

#include <cstring>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace piecework::mesh {

/// Binary data of a glTF file with what describes it.
class GltfBuffer {
 public:
  /// Returns the number of the accessor. \param type  "SCALAR", "VEC3", "VEC4", "MAT4"
  template <class T>
  int add(const std::vector<T>& values, const std::string& type, int components) {
    const std::size_t bytes = values.size() * sizeof(T);
    views_.push_back(
        fmt::format(R"({{"buffer": 0, "byteOffset": {}, "byteLength": {}}})", data_.size(), bytes));
    accessors_.push_back(
        fmt::format(R"({{"bufferView": {}, "componentType": {}, "count": {}, "type": "{}"}})",
                    views_.size() - 1,
                    sizeof(T) == 1   ? 5121
                    : sizeof(T) == 2 ? 5123
                                     : 5126,
                    values.size() / components, type));
    data_.append(reinterpret_cast<const char*>(values.data()), bytes);
    data_.resize((data_.size() + 3) / 4 * 4);
    return static_cast<int>(accessors_.size()) - 1;
  }

  [[nodiscard]] const std::string& data() const { return data_; }
  [[nodiscard]] std::string json(const std::string& file) const {
    return fmt::format(
        R"("buffers": [{{"uri": "{}", "byteLength": {}}}], "bufferViews": [{}], "accessors": [{}])",
        file, data_.size(), fmt::join(views_, ", "), fmt::join(accessors_, ", "));
  }

 private:
  std::string data_;
  std::vector<std::string> views_, accessors_;
};

/// A strip of two triangles a floor, two floors high, on two joints: `hip` in the origin and `knee`
/// 1 above it. The clip "bend" moves hip and turns knee; another triangle hangs rigidly on `knee`
/// through the node `badge`.
struct StripFigure {
  std::vector<float> positions{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0, 1, 2, 0, 1, 2, 0};
  std::vector<unsigned short> triangles{0, 1, 3, 0, 3, 2, 2, 3, 5, 2, 6, 4};  // 5 and 6 coincide
  std::vector<unsigned char> joints{0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1,
                                    0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0};
  std::vector<float> weights{1, 0, 0, 0, 1, 0, 0, 0, 0.5, 0.5, 0, 0, 0.25, 0.75,
                             0, 0, 0, 1, 0, 0, 0, 1, 0,   0,   0, 1, 0,    0};
  std::vector<float> inverse_binds{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0,  0, 1,
                                   1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1};
  std::vector<float> move_times{0, 2};
  std::vector<float> moves{0, 0, 0, 0, 0, 3};
  std::vector<float> turn_times{0.5F, 1.5F};
  std::vector<float> turns{0, 0, 0, 1, 0, 0, 1, 0};  // x, y, z, w: half a turn about z
  std::string body = "body", hip = "hip";            ///< names of nodes
  std::string second_clip;                           ///< name of an empty clip beside "bend"
  bool figure = true;                                ///< false: motion only
  bool clips = true;

  /// The text of the .gltf; `buffer` gets its binary data, to be written as figure.bin.
  std::string json(GltfBuffer& buffer) const {
    const int p = buffer.add(positions, "VEC3", 3), t = buffer.add(triangles, "SCALAR", 1);
    const int j = buffer.add(joints, "VEC4", 4), w = buffer.add(weights, "VEC4", 4);
    const int b = buffer.add(inverse_binds, "MAT4", 16);
    const int mt = buffer.add(move_times, "SCALAR", 1), m = buffer.add(moves, "VEC3", 3);
    const int tt = buffer.add(turn_times, "SCALAR", 1), q = buffer.add(turns, "VEC4", 4);
    const std::vector<float> badge{0, 0, 0, 1, 0, 0, 0, 1, 0};
    const int g = buffer.add(badge, "VEC3", 3);
    const std::string skin = figure ? R"("mesh": 0, "skin": 0, )" : "";
    const std::string rigid = figure ? R"("mesh": 1, )" : "";
    const std::string meshes = fmt::format(
        R"("meshes": [{{"primitives": [{{"attributes": {{"POSITION": {}, "JOINTS_0": {}, "WEIGHTS_0": {}}},
             "indices": {}}}]}}, {{"primitives": [{{"attributes": {{"POSITION": {}}}}}]}}],
           "skins": [{{"joints": [1, 2], "inverseBindMatrices": {}}}], )",
        p, j, w, t, g, b);
    std::string animations = fmt::format(
        R"({{"name": "bend", "channels": [
              {{"sampler": 0, "target": {{"node": 1, "path": "translation"}}}},
              {{"sampler": 1, "target": {{"node": 2, "path": "rotation"}}}}],
            "samplers": [{{"input": {}, "output": {}}}, {{"input": {}, "output": {}}}]}})",
        mt, m, tt, q);
    if (!second_clip.empty())
      animations += fmt::format(
          R"(, {{"name": "{}", "channels": [{{"sampler": 0, "target": {{"node": 1, "path":
               "translation"}}}}], "samplers": [{{"input": {}, "output": {}}}]}})",
          second_clip, mt, m);
    return fmt::format(
        R"({{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0, 1]}}],
            "nodes": [{{{}"name": "{}"}}, {{"name": "{}", "children": [2]}},
              {{"name": "knee", "translation": [0, 1, 0], "children": [3]}},
              {{{}"name": "badge", "translation": [0, 0.5, 0]}}],
            {}{}{}}})",
        skin, body, hip, rigid, figure ? meshes : "",
        clips ? fmt::format(R"("animations": [{}], )", animations) : "", buffer.json("figure.bin"));
  }
};

}  // namespace piecework::mesh
