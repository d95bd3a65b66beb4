#include <renderer/lighting.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <renderer/depth_map.hpp>

#include <piecework/core/parallel.hpp>

namespace piecework::render {
namespace {

// Numbers of directions, map sizes and angles are chosen by eye: fewer leave visible bands.
constexpr int kKeyDirections = 18;
constexpr int kKeyDirectionsFast = 8;  // without ambient occlusion: the fast path
constexpr int kSkyDirections = 56;
constexpr int kKeyMapSize = 512;
constexpr int kSkyMapSize = 352;
constexpr float kKeyRadius = 0.085F;  // radians: a soft box rather than the sun
constexpr std::size_t kBatch = 8;     // depth maps in memory at a time
constexpr float kGoldenAngle = 2.39996323F;

struct Direction {
  Vec3f towards;
  bool is_key;
};

void add_key_directions(const Vec3f& key, int count, std::vector<Direction>& directions) {
  Eigen::Index smallest = 0;
  key.cwiseAbs().minCoeff(&smallest);
  const Vec3f u = key.cross(Vec3f::Unit(smallest)).normalized();
  const Vec3f v = key.cross(u);
  for (int k = 0; k < count; ++k) {  // Vogel's spiral over a disc
    const float radius =
        kKeyRadius * std::sqrt((static_cast<float>(k) + 0.5F) / static_cast<float>(count));
    const float angle = kGoldenAngle * static_cast<float>(k);
    const Vec3f offset = radius * (std::cos(angle) * u + std::sin(angle) * v);
    directions.push_back({(key + offset).normalized(), true});
  }
}

void add_sky_directions(std::vector<Direction>& directions) {
  for (int k = 0; k < kSkyDirections; ++k) {  // Fibonacci points on the upper half sphere
    const float y = (static_cast<float>(k) + 0.5F) / static_cast<float>(kSkyDirections);
    const float radius = std::sqrt(1.0F - y * y);
    const float angle = kGoldenAngle * static_cast<float>(k);
    directions.push_back({{radius * std::cos(angle), y, radius * std::sin(angle)}, false});
  }
}

/// Sums over directions; each vertex is written by one task at a time.
struct VertexSum {
  float key = 0;
  std::array<float, 4> ambient{};
  float weight = 0;
};

void add_key(const DepthMap& map, const Vec3f& p, const Vec3f& normal, VertexSum& sum) {
  const float side = normal.dot(map.direction()) < 0 ? -1.0F : 1.0F;
  const Vec3f lifted = p + (1.3F * side * map.texel()) * normal;
  sum.key += map.visible_from_front(lifted, 0.9F * map.texel());
}

void add_sky(const DepthMap& map, const Vec3f& p, const Vec3f& normal, VertexSum& sum) {
  const float cosine = normal.dot(map.direction());
  const float side = cosine < 0 ? -1.0F : 1.0F;
  const float weight = std::abs(cosine);
  const Vec3f lift = (1.1F * side * map.texel()) * normal;
  const float bias = 0.7F * map.texel();
  // The direction lights the side that faces it with sky, and the other side from below.
  const std::size_t facing = cosine < 0 ? 2 : 0;
  sum.ambient[facing] += weight * map.visible_from_front(p + lift, bias);
  sum.ambient[2 - facing + 1] += weight * map.visible_from_back(p - lift, bias);
  sum.weight += weight;
}

std::uint8_t to_byte(float x) {
  return static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(x, 0.0F, 1.0F)));
}

std::array<std::uint8_t, 4> open_ambient(const Vec3f& normal) {
  const std::uint8_t sky = to_byte(0.5F + 0.5F * normal.y());
  const auto ground = static_cast<std::uint8_t>(255 - sky);
  return {sky, ground, ground, sky};
}

struct GroundSum {
  float key = 0, sky = 0;
};

/// The rectangle that shadows can reach: below the mesh and where the key light throws it.
void fit_ground(const DisplayMesh& mesh, const LightOptions& options, GroundLight& ground) {
  const float height = *options.ground_height;
  const float rise = std::max(mesh.high.y() - height, 0.0F);
  const Vec3f& key = options.key_direction;
  const Eigen::Vector2f slope = Eigen::Vector2f(key.x(), key.z()) / std::max(key.y(), 0.2F);
  const Eigen::Vector2f low(mesh.low.x(), mesh.low.z());
  const Eigen::Vector2f high(mesh.high.x(), mesh.high.z());
  const float rim = 0.3F + 0.45F * std::min(rise, 3.0F);
  const Eigen::Vector2f thrown = -slope * std::min(rise, 6.0F);
  ground.low = low.cwiseMin(low + thrown).array() - rim;
  ground.high = high.cwiseMax(high + thrown).array() + rim;
}

Vec3f ground_point(const GroundLight& ground, float height, std::size_t index) {
  const std::size_t row = index / GroundLight::kSize;
  const std::size_t column = index % GroundLight::kSize;
  const Eigen::Vector2f cell(static_cast<float>(column) + 0.5F, static_cast<float>(row) + 0.5F);
  const Eigen::Vector2f p =
      ground.low +
      (cell / static_cast<float>(GroundLight::kSize)).cwiseProduct(ground.high - ground.low);
  return {p.x(), height, p.y()};
}

/// Box blur of one channel along one axis; the rim repeats.
void blur_axis(std::vector<float>& values, int radius, std::size_t step, std::size_t line_step) {
  constexpr int kSize = GroundLight::kSize;
  parallel_for(
      kSize,
      [&](std::size_t line) {
        std::array<float, kSize> copy{};
        float* start = values.data() + line * line_step;
        for (int i = 0; i < kSize; ++i) copy[i] = start[static_cast<std::size_t>(i) * step];
        const auto at = [&](int i) { return copy[std::clamp(i, 0, kSize - 1)]; };
        float sum = 0;
        for (int i = -radius; i <= radius; ++i) sum += at(i);
        for (int i = 0; i < kSize; ++i) {
          start[static_cast<std::size_t>(i) * step] = sum / static_cast<float>(2 * radius + 1);
          sum += at(i + radius + 1) - at(i - radius);
        }
      },
      16);
}

void blur(std::vector<float>& values, int radius) {
  for (int pass = 0; pass < 2; ++pass) {  // two boxes make a tent: no visible edges
    blur_axis(values, radius, 1, GroundLight::kSize);
    blur_axis(values, radius, GroundLight::kSize, 1);
  }
}

/// 1 inside, 0 along the rim, so that the rectangle's edge cannot be seen.
float rim_window(std::size_t index) {
  const auto fade = [](std::size_t i) {
    const float x = (static_cast<float>(i) + 0.5F) / static_cast<float>(GroundLight::kSize);
    const float t = std::clamp(std::min(x, 1.0F - x) / 0.12F, 0.0F, 1.0F);
    return t * t * (3.0F - 2.0F * t);
  };
  return fade(index % GroundLight::kSize) * fade(index / GroundLight::kSize);
}

/// The sums of all directions while they are gone through batch by batch.
class LightGatherer {
 public:
  LightGatherer(const DisplayMesh& mesh, const LightOptions& options)
      : mesh_(mesh), options_(options) {
    if (options.shadows) {
      num_key_ = options.ambient_occlusion ? kKeyDirections : kKeyDirectionsFast;
      add_key_directions(options.key_direction, num_key_, directions_);
    }
    if (options.ambient_occlusion) add_sky_directions(directions_);
    vertices_.resize(mesh.positions.size());
    if (options.ground_height) {
      constexpr auto kSize = static_cast<std::size_t>(GroundLight::kSize);
      fit_ground(mesh, options, result_.ground);
      ground_.resize(kSize * kSize);
    }
  }

  Lighting run() {
    std::vector<DepthMap> maps(kBatch);
    for (std::size_t start = 0; start < directions_.size(); start += kBatch) {
      const std::size_t count = std::min(kBatch, directions_.size() - start);
      parallel_for(
          count,
          [&](std::size_t i) {
            const Direction& direction = directions_[start + i];
            maps[i].draw(mesh_, direction.towards, direction.is_key ? kKeyMapSize : kSkyMapSize);
          },
          1);
      for (std::size_t i = 0; i < count; ++i) {
        gather(maps[i], directions_[start + i].is_key);
      }
    }
    finish_vertices();
    if (!ground_.empty()) finish_ground();
    return std::move(result_);
  }

 private:
  void gather(const DepthMap& map, bool is_key) {
    parallel_for(vertices_.size(), [&](std::size_t v) {
      const auto add = is_key ? add_key : add_sky;
      add(map, mesh_.positions[v], mesh_.normals[v], vertices_[v]);
    });
    parallel_for(ground_.size(), [&](std::size_t i) {
      const Vec3f p = ground_point(result_.ground, *options_.ground_height, i);
      const float lit = map.visible_from_front(p, 1.5F * map.texel());
      if (is_key) {
        ground_[i].key += lit;
      } else {
        ground_[i].sky += lit * map.direction().y();
      }
    });
    if (!is_key) sky_weight_ += map.direction().y();
  }

  void finish_vertices() {
    result_.vertices.resize(vertices_.size());
    parallel_for(vertices_.size(), [&](std::size_t v) {
      const VertexSum& sum = vertices_[v];
      VertexLight& light = result_.vertices[v];
      light.key = num_key_ > 0 ? to_byte(sum.key / static_cast<float>(num_key_)) : 255;
      if (sum.weight > 0) {
        for (std::size_t i = 0; i < 4; ++i) light.ambient[i] = to_byte(sum.ambient[i] / sum.weight);
      } else {
        light.ambient = open_ambient(mesh_.normals[v]);
      }
    });
  }

  void finish_ground() {
    std::vector<float> key(ground_.size(), 1.0F);
    std::vector<float> sky(ground_.size(), 1.0F);
    for (std::size_t i = 0; i < ground_.size(); ++i) {
      if (num_key_ > 0) key[i] = ground_[i].key / static_cast<float>(num_key_);
      if (sky_weight_ > 0) sky[i] = ground_[i].sky / sky_weight_;
    }
    blur(key, options_.ambient_occlusion ? 2 : 3);
    blur(sky, 9);
    result_.ground.texels.resize(2 * ground_.size());
    for (std::size_t i = 0; i < ground_.size(); ++i) {
      const float window = rim_window(i);
      result_.ground.texels[2 * i] = to_byte(1.0F - window * (1.0F - key[i]));
      result_.ground.texels[2 * i + 1] = to_byte(1.0F - window * (1.0F - sky[i]));
    }
  }

  const DisplayMesh& mesh_;
  const LightOptions& options_;
  int num_key_ = 0;
  float sky_weight_ = 0;
  std::vector<Direction> directions_;
  std::vector<VertexSum> vertices_;
  std::vector<GroundSum> ground_;
  Lighting result_;
};

}  // namespace

Lighting compute_lighting(const DisplayMesh& mesh, const LightOptions& options) {
  return LightGatherer(mesh, options).run();
}

}  // namespace piecework::render
