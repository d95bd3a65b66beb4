// Every bad file, garment and collider of the shared test data has a stated outcome here. Skipped
// where that folder is absent; the kinds of trouble themselves are in import_test.cpp.

#include <filesystem>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include <piecework/mesh/import.hpp>
#include <piecework/mesh/mesh_test_util.hpp>

namespace piecework::mesh {
namespace {

namespace fs = std::filesystem;

fs::path data(const char* folder) { return fs::path(PIECEWORK_SHARED_DATA) / folder; }

#define SKIP_WITHOUT(folder) \
  if (!fs::is_directory(folder)) GTEST_SKIP() << (folder).string() << " is absent"

ImportOptions with_repair() {
  ImportOptions options;
  options.repair = true;
  return options;
}

struct Outcome {
  std::string error;  ///< part of the message without repair; empty: imports
  bool repairable = false;
  int vertices = -1;  ///< after repair, if it was needed; -1: not stated
  int triangles = -1;
};

std::map<std::string, Outcome> bad_outcomes() {
  const char* const corrupt = "the file is probably corrupt";
  return {
      {"AllIndicesOutOfRange.gltf", {"has no faces"}},
      {"anim_nan_quat.glb", {"", false, 4, 2}},
      {"anim_single_key.glb", {"", false, 4, 2}},
      {"anim_times_not_increasing.glb", {"", false, 4, 2}},
      {"anim_zero_quat.glb", {"", false, 4, 2}},
      {"assimp_BoxWithInfinites.glb", {"is not finite"}},
      {"assimp_MissingBin.gltf", {"could not open referenced file"}},
      {"assimp_RecursiveNodes.gltf", {"recursive reference"}},
      {"assimp_box_nested_animation_4286.dae", {"unknown kind of mesh file '.dae'"}},
      {"assimp_crash-30d6d0f7.ply", {"crashes the reader"}},
      {"assimp_empty.obj", {"file is empty"}},
      {"assimp_empty.ply", {"file is empty"}},
      {"assimp_malformed.obj", {":28: vertex index 0"}},
      {"assimp_testmixed.obj", {"", false, 8, 12}},
      {"bad_json.gltf", {corrupt}},
      {"count_lie.stl", {corrupt}},
      {"degenerate_faces.obj", {"line 123 (face 72): zero area", true, 49, 72}},
      {"duplicate_faces.obj", {"line 122 (face 72): duplicate", true, 49, 72}},
      {"far_from_origin_1e7.obj", {"", false, 49, 72}},
      {"flipped_winding_random.obj", {"inconsistent orientation", true, 49, 72}},
      {"huge_1e30.obj", {"more than 1e+12 m from the origin"}},
      {"index_negative_out_of_range.obj", {":4: vertex index -9 is out of range"}},
      {"index_out_of_range.ply", {"face 0: vertex index 77 is out of range"}},
      {"index_overflow_int.obj", {":4: vertex index 99999999999 is out of range"}},
      {"index_zero.obj", {":4: vertex index 0"}},
      {"isolated_vertices.obj", {"line 50 (vertex 49): isolated", true, 49, 72}},
      {"nan_inf_coords.obj", {":8: 'nan' is not a finite number"}},
      {"nm_bowtie_vertex.obj", {"line 1 (vertex 0): bow-tie", true, 6, 2}},
      {"nm_edge_3faces.obj", {"more than two triangles on it", true, 4, 2}},
      {"nonplanar_concave_ngon.obj", {"", false, 6, 4}},
      {"single_triangle.obj", {"", false, 3, 1}},
      {"skin_missing_skin_ref.glb", {"", false, 4, 2}},
      {"skin_ok_reference.glb", {"", false, 4, 2}},
      {"skin_singular_bind.glb", {"", false, 4, 2}},
      {"skin_weights_sum_3.glb", {"", false, 4, 2}},
      {"skin_zero_weights.glb", {"", false, 4, 2}},
      {"slivers_1e7.obj", {"", false, 49, 72}},
      {"soup_unwelded_10x10.obj", {"", false, 121, 200}},
      {"tet_index_out_of_range.mesh", {"unknown kind of mesh file '.mesh'"}},
      {"tet_inverted.mesh", {"unknown kind"}},
      {"tet_nonmanifold_face.mesh", {"unknown kind"}},
      {"tet_truncated.msh", {"unknown kind of mesh file '.msh'"}},
      {"tet_zero_volume.mesh", {"unknown kind"}},
      {"trimesh_notenoughindices.obj", {":9: face with 2 corners"}},
      {"truncated.glb", {corrupt}},
      {"truncated.obj", {":121: face with 0 corners"}},
      {"truncated_binary.ply", {"is out of range, there are 49 vertices"}},
      {"words_for_numbers.obj", {":1: 'a' is not a number"}},
  };
}

void expect_outcome(const fs::path& path, const Outcome& outcome) {
  SCOPED_TRACE(path.filename().string());
  const std::string error = import_error(path);
  EXPECT_EQ(error.empty(), outcome.error.empty()) << error;
  EXPECT_TRUE(contains(error, outcome.error));
  if (!error.empty()) {
    EXPECT_TRUE(contains(error, path.filename().string()));
    EXPECT_TRUE(contains(error, "; ")) << "no remedy";
    EXPECT_EQ(contains(error, "`repair: true`"), outcome.repairable) << error;
    EXPECT_EQ(import_error(path, with_repair()).empty(), outcome.repairable);
  }
  if (!error.empty() && !outcome.repairable) return;
  const MeshDocument document = import_mesh(path, error.empty() ? ImportOptions() : with_repair());
  const auto stated = [](int expected, int value) { return expected < 0 || expected == value; };
  EXPECT_TRUE(stated(outcome.vertices, document.mesh.num_vertices()))
      << document.mesh.num_vertices();
  EXPECT_TRUE(stated(outcome.triangles, document.mesh.num_triangles()))
      << document.mesh.num_triangles();
  EXPECT_EQ(error.empty(), !has_note(document, "repair: "));
  EXPECT_NO_THROW(validate(document.mesh, "imported"));
}

TEST(SharedData, EveryBadFileHasItsOutcome) {
  const fs::path folder = data("bad");
  SKIP_WITHOUT(folder);
  const std::map<std::string, Outcome> outcomes = bad_outcomes();
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() == ".bin") continue;  // part of a glTF
    ASSERT_TRUE(outcomes.contains(name)) << name << " has no stated outcome";
    expect_outcome(entry.path(), outcomes.at(name));
  }
}

/// Imports every mesh of a folder; `special` lists those that need repair.
void expect_all_import(const fs::path& folder, const std::map<std::string, Outcome>& special) {
  int imported = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension != ".obj" && extension != ".ply" && extension != ".glb") continue;
    const auto outcome = special.find(entry.path().filename().string());
    expect_outcome(entry.path(), outcome == special.end() ? Outcome{} : outcome->second);
    ++imported;
  }
  EXPECT_GT(imported, 0);
}

TEST(SharedData, GarmentsImport) {
  const fs::path folder = data("garments");
  SKIP_WITHOUT(folder);
  expect_all_import(
      folder,
      {{"mhf_female_elegantsuit01.obj", {"inconsistent orientation", true, 2205, 4192}},
       {"mhf_female_elegantsuit01_clean.obj", {"inconsistent orientation", true, 2205, 4192}}});
}

TEST(SharedData, CollidersImport) {
  const fs::path folder = data("colliders");
  SKIP_WITHOUT(folder);
  expect_all_import(folder, {{"stanford-bunny.obj", {"(and 1112 more)", true, 34834, 69451}},
                             {"teapot.obj", {"bow-tie", true, 3242, 6320}},
                             {"kaykit_stairs.obj", {"bow-tie", true, 286, 358}}});
  expect_all_import(folder / "erleben", {{"hole.obj", {"bow-tie", true, 52, 88}}});
}

// Panels share positions at the centre line and must stay apart; the vertex order is the file's.
TEST(SharedData, SewingPatternsKeepPanelsOrderAndRestShape) {
  const fs::path file = data("garments") / "gc_shirt_8panel.obj";
  if (!fs::exists(file)) GTEST_SKIP() << file.string() << " is absent";
  const MeshDocument document = import_mesh(file, {});
  EXPECT_EQ(document.mesh.num_vertices(), 2537);
  EXPECT_EQ(document.layout.groups.size(), 8U);
  EXPECT_TRUE(document.vertex_map.empty());
  ASSERT_EQ(document.corner_uv.size(), 3U * 4529U);
  // The panels were laid out flat without distortion: lengths in uv are lengths in space.
  const Triangle& t = document.mesh.triangles[0];
  const Positions& x = document.mesh.positions;
  EXPECT_NEAR((document.corner_uv[1] - document.corner_uv[0]).norm(),
              (x.row(t[1]) - x.row(t[0])).norm(), 1e-5);
}

TEST(SharedData, SkinnedAvatarsWeldAcrossSeams) {
  const fs::path folder = data("avatars");
  SKIP_WITHOUT(folder);
  expect_outcome(folder / "CesiumMan.glb", {"", false, 2338, 4672});
  expect_outcome(folder / "RiggedFigure.glb", {"", false, 130, 256});
  expect_outcome(folder / "mh_male.glb", {"", false, 13380, 26756});
}

}  // namespace
}  // namespace piecework::mesh
