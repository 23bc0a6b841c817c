// What exists is never written over: a rig's code and copies of takes create files exclusively (hal/disk.h,
// DiskPort::create; host_tool/offload/local_file.h), and delete no tree.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "tree.h"

namespace nodal::tidy {
namespace {

constexpr std::array<std::string_view, 4> kFolders{"firmware/", "hal/", "protocol/", "host_tool/offload/"};
constexpr std::array<std::string_view, 6> kWords{"O_TRUNC",    "ofstream", "std::fstream",
                                                 "remove_all", "creat(",   "\"wb\""};

TEST(House, ARigsFiles_AreCreatedExclusivelyAndNoTreeIsDeleted) {
  std::size_t read = 0;
  for (const TextFile& file : project_files()) {
    const bool source = file.path.ends_with(".cpp") || file.path.ends_with(".h");
    const bool ours =
        std::ranges::any_of(kFolders, [&](std::string_view folder) { return file.path.starts_with(folder); });
    if (!source || !ours) continue;
    ++read;
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      for (const std::string_view word : kWords) {
        EXPECT_EQ(file.lines[i].find(word), std::string::npos)
            << file.path << ":" << i + 1 << " says \"" << word << "\": create exclusively, or use a DiskPort";
      }
    }
  }
  EXPECT_GT(read, 300U);
}

/// Outputs of commands are written where console/overwriting.h is asked: by write_file(), and as films.
TEST(House, ACommandsFiles_AreWrittenInTwoPlacesThatAskForTheName) {
  constexpr std::array<std::string_view, 2> kMayWrite{"host_tool/console/files.cpp", "host_tool/output/film_file.cpp"};
  constexpr std::array<std::string_view, 5> kWays{"open_descriptor_to_write(", "O_TRUNC", "ofstream", "std::fstream",
                                                  "fopen("};
  for (const TextFile& file : project_files()) {
    if (!file.path.starts_with("host_tool/") || !file.path.ends_with(".cpp")) continue;
    const bool may = std::ranges::find(kMayWrite, file.path) != kMayWrite.end();
    const bool does = std::ranges::any_of(file.lines, [&](const std::string& line) {
      return std::ranges::any_of(kWays, [&](std::string_view way) { return line.find(way) != std::string::npos; });
    });
    EXPECT_EQ(does, may) << file.path << ": use write_file(), which asks check_free()";
  }
}

/// A name that exists is replaced in few places, each with a reason: settings and counters that have one newest value,
/// the manifest that a loop shortens, the calibration in force, the audit log after its entries have gone into the file
/// before.
TEST(House, WhatReplacesAFile_IsListedHere) {
  constexpr std::array<std::string_view, 8> kMayReplace{"firmware/calibration/calibration_store.cpp",
                                                        "firmware/record/take_manifest.cpp",
                                                        "firmware/record/take_numbers.cpp",
                                                        "firmware/record/take_recovery.cpp",
                                                        "firmware/record/take_shelf.cpp",
                                                        "firmware/storage/audit_store.cpp",
                                                        "firmware/storage/settings_store.cpp",
                                                        "firmware/storage/start_count.cpp"};
  for (const TextFile& file : project_files()) {
    if (!file.path.starts_with("firmware/") || !file.path.ends_with(".cpp")) continue;
    if (file.path == "firmware/storage/durable_file.cpp") continue;
    const bool may = std::ranges::find(kMayReplace, file.path) != kMayReplace.end();
    const bool does = std::ranges::any_of(
        file.lines, [](const std::string& line) { return line.find("write_durably(") != std::string::npos; });
    EXPECT_EQ(does, may) << file.path << ": create_durably() replaces nothing";
  }
}

}  // namespace
}  // namespace nodal::tidy
