#pragma once

// What the tests of mesh/ share: a folder for files, and texts of errors.

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include <piecework/core/error.hpp>
#include <piecework/mesh/import.hpp>

namespace piecework::mesh {

/// A fixture with an empty folder that goes away after the test.
class FolderTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              (std::string("piecework_") + info->test_suite_name() + "_" + info->name() + "_" +
               std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path write(const std::string& name, std::string_view content) const {
    std::filesystem::path path = folder_ / name;
    std::ofstream(path, std::ios::binary) << content;
    return path;
  }

  std::filesystem::path folder_;
};

/// Text of the InputError that importing throws; empty if it throws none.
inline std::string import_error(const std::filesystem::path& path,
                                const ImportOptions& options = {}) {
  try {
    import_mesh(path, options);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

inline testing::AssertionResult contains(const std::string& text, std::string_view part) {
  if (text.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << text << "' does not contain '" << part << "'";
}

/// True if some note contains `part`.
inline bool has_note(const MeshDocument& document, std::string_view part) {
  for (const std::string& note : document.notes) {
    if (note.find(part) != std::string::npos) return true;
  }
  return false;
}

}  // namespace piecework::mesh
