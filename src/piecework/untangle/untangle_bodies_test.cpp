#include <piecework/untangle/untangle.hpp>
#include <gtest/gtest.h>
#include <filesystem>
#include <iostream>
#include <piecework/core/clock.hpp>
#include <piecework/mesh/avatar.hpp>
#include <piecework/mesh/import.hpp>
#include "untangle_test_util.hpp"
namespace piecework::untangle {
namespace {
namespace fs = std::filesystem;
TEST(Garments, All) {
  const fs::path data = fs::path(PIECEWORK_SHARED_DATA);
  std::vector<fs::path> files;
  for (const auto& e : fs::directory_iterator(data / "garments")) {
    const std::string n = e.path().filename().string();
    if ((n.starts_with("mhf_") || n.starts_with("mhm_")) && n.ends_with(".obj")) files.push_back(e.path());
  }
  std::sort(files.begin(), files.end());
  for (const auto& f : files) {
    const std::string n = f.filename().string();
    if (const char* only = std::getenv("ONLY"); only && n.find(only) == std::string::npos) continue;
    const auto doc = [&]{ mesh::ImportOptions io; io.repair = true; return mesh::import_mesh(f, io); }();
    mesh::AvatarOptions ao; ao.clip = n[2]=='f' ? "walk_131_01" : (std::getenv("CLIP")?std::getenv("CLIP"):"walk_131_01");
    const auto avatar = mesh::import_avatar(data / "avatars" / (n[2] == 'f' ? "mh_female.glb" : "mh_male.glb"), ao);
    mesh::TriangleMesh body; body.triangles = avatar.triangles(); avatar.positions_at(0, body.positions);
    for (bool self : {false, true}) if (!std::getenv("SELF") || self == (std::atoi(std::getenv("SELF"))==1)) {
    TangledCloth c(doc.mesh);
    c.options.distance = std::min(1e-3, 0.25*c.model.mean_edge); c.options.self = self;
    if (const char* r = std::getenv("ROUNDS")) c.options.rounds = std::atoi(r);
    c.meshes.emplace_back(colliders::Traits{.name="body"}, body, Eigen::Affine3d::Identity(), colliders::RigidMotion{});
    const auto before = c.intersections();
    Stopwatch w;
    const auto r = c.untangle();
    const double ms = w.lap();
    const auto s = c.stretches();
    std::printf("%-32s V %6d edge %.1f mm self %d exact %5zu -> %4zu inside %5d -> %4d rounds %3d move %.2f mm stretch %.2f..%.2f  %.0f ms\n", n.c_str(), c.model.num_vertices(), 1e3*c.model.mean_edge, self, before, c.intersections(), r.before.inside, r.after.inside, r.rounds, 1e3*r.largest_move, s[0], s[1], ms);
    std::fflush(stdout);
    }
  }
}
}}
