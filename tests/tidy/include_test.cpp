#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "include_rules.h"
#include "tree.h"

namespace nodal::tidy {
namespace {

Include quoted(std::string header) { return {std::move(header), true}; }
Include angled(std::string header) { return {std::move(header), false}; }

TEST(IncludeRules, EveryIncludeOfEveryFile_IsAllowedByTheTable) {
  int seen = 0;
  for (const TextFile& file : project_files()) {
    if (!is_source(file.path)) continue;
    for (const std::string& line : file.lines) {
      const std::optional<Include> include = parse_include(line);
      if (!include) continue;
      ++seen;
      if (const auto wrong = violation(file.path, *include)) ADD_FAILURE() << *wrong;
    }
  }
  EXPECT_GT(seen, 50);
}

/// Whether a test's include without a folder is a header of any suite: suites share their fixtures.
bool is_header_of_a_suite(const std::string& header) {
  return std::ranges::any_of(project_files(), [&](const TextFile& file) {
    return file.path.starts_with("tests/") && file.path.ends_with("/" + header);
  });
}

TEST(IncludeRules, EveryQuotedHeader_ExistsFromTheRootOrInATestSuite) {
  namespace fs = std::filesystem;
  const fs::path root = NODAL_SOURCE_DIR;
  for (const TextFile& file : project_files()) {
    if (!is_source(file.path)) continue;
    for (const std::string& line : file.lines) {
      const std::optional<Include> include = parse_include(line);
      if (!include || !include->quoted || include->header.ends_with(".pb.h")) continue;
      EXPECT_TRUE(fs::exists(root / include->header) ||
                  fs::exists(root / fs::path(file.path).parent_path() / include->header) ||
                  (file.path.starts_with("tests/") && is_header_of_a_suite(include->header)))
          << file.path << " includes " << include->header << ", which is not there";
    }
  }
}

TEST(IncludeTable, EveryModuleFolder_HasALineAndEveryLineAFolder) {
  const std::vector<std::string> folders = module_folders();
  for (const std::string& folder : folders) {
    EXPECT_TRUE(include_table().contains(folder)) << folder << " has no line in .cmake/includes.txt";
  }
  for (const auto& [folder, seen] : include_table()) {
    EXPECT_TRUE(std::ranges::find(folders, folder) != folders.end()) << folder << " has a line and no sources";
    for (const std::string& name : seen) {
      EXPECT_TRUE(std::filesystem::exists(std::filesystem::path(NODAL_SOURCE_DIR) / name))
          << folder << " sees " << name << ", which is not there";
    }
  }
}

TEST(IncludeTable, WhoSeesWhom_HasNoCircle) {
  std::string circle;
  for (const std::string& folder : cycle_in(include_table())) circle += folder + " ";
  EXPECT_TRUE(circle.empty()) << circle;
}

TEST(IncludeTable, LinesThatGoOnAndHeadersSeenAlone_AreRead) {
  const IncludeTable table = parse_include_table({"# a: remark", "", "a: b c/d", "  e/f.h", "b:"});
  ASSERT_EQ(table.size(), 2u);
  EXPECT_EQ(table.at("a"), (std::vector<std::string>{"b", "c/d", "e/f.h"}));
  EXPECT_TRUE(table.at("b").empty());
}

TEST(IncludeTable, PlantedCircles_AreFound) {
  EXPECT_EQ(cycle_in(parse_include_table({"a: b", "b: c/one.h", "c: b"})), (std::vector<std::string>{"b", "c", "b"}));
  EXPECT_TRUE(cycle_in(parse_include_table({"a: b c", "b: c", "c:"})).empty());
}

TEST(IncludeRules, PlantedOffences_AreAllFound) {
  EXPECT_TRUE(violation("protocol/base/units.h", quoted("protocol/calibration.h")));
  EXPECT_TRUE(violation("protocol/session.h", quoted("hal/link.h")));
  EXPECT_TRUE(violation("hal/head.h", quoted("hal/sim/sim_head.h")));
  EXPECT_TRUE(violation("hal/sim/render.cpp", quoted("stitch/geometry/lens/lens.h")));
  EXPECT_TRUE(violation("hal/sim/render.cpp", quoted("hal/linux/files.h")));
  EXPECT_TRUE(violation("stitch/blend/blend_scalar.cpp", quoted("stitch/geometry/lens/lens.h")));
  EXPECT_TRUE(violation("stitch/blend/blend_scalar.cpp", angled("Eigen/Dense")));
  EXPECT_TRUE(violation("stitch/blend/blend_scalar.cpp", angled("cmath")));
  EXPECT_TRUE(violation("stitch/geometry/lens/lens.cpp", quoted("stitch/blend/blend.h")));
  EXPECT_TRUE(violation("stitch/geometry/lens/lens.cpp", quoted("stitch/geometry/head.h")));
  EXPECT_TRUE(violation("stitch/geometry/head.cpp", quoted("stitch/geometry/raymap/layout.h")));
  EXPECT_TRUE(violation("stitch/geometry/head.cpp", quoted("protocol/session.h")));
  EXPECT_TRUE(violation("firmware/capture/capture.cpp", quoted("hal/sim/sim_head.h")));
  EXPECT_TRUE(violation("firmware/capture/capture.cpp", quoted("stitch/calibration/pts.h")));
  EXPECT_TRUE(violation("firmware/daemon/main.cpp", quoted("stitch/registration/solve.h")));
  EXPECT_TRUE(violation("firmware/capture/capture.cpp", angled("thread")));
  EXPECT_TRUE(violation("firmware/capture/capture.cpp", angled("Eigen/Dense")));
  EXPECT_TRUE(violation("firmware/daemon/main.cpp", angled("linux/videodev2.h")));
  EXPECT_TRUE(violation("host_tool/commands/status.cpp", quoted("hal/head.h")));
  EXPECT_TRUE(violation("host_tool/commands/status.cpp", quoted("firmware/config/config.h")));
  EXPECT_TRUE(violation("host_tool/commands/status.cpp", quoted("link.h")));
  EXPECT_TRUE(violation("new_folder/file.cpp", quoted("protocol/base/units.h")));
}

TEST(IncludeRules, WhatTheTableAllows_IsNotAnOffence) {
  EXPECT_FALSE(violation("firmware/daemon/main.cpp", quoted("hal/linux/files.h")));
  EXPECT_FALSE(violation("firmware/daemon/main.cpp", angled("thread")));
  EXPECT_FALSE(violation("firmware/daemon/main.cpp", angled("fstream")));
  EXPECT_FALSE(violation("firmware/capture/capture.cpp", quoted("hal/head.h")));
  EXPECT_FALSE(violation("stitch/geometry/lens/lens.cpp", angled("Eigen/Dense")));
  EXPECT_FALSE(violation("stitch/geometry/lens/lens.cpp", angled("cmath")));
  EXPECT_FALSE(violation("stitch/geometry/head.cpp", quoted("protocol/calibration.h")));
  EXPECT_FALSE(violation("stitch/table/compile.cpp", quoted("stitch/geometry/lens/lens.h")));
  EXPECT_FALSE(violation("host_tool/commands/status.cpp", quoted("hal/link.h")));
  EXPECT_FALSE(violation("tests/unit/hal/head_test.cpp", quoted("fixture.h")));
}

TEST(ParseInclude, SpacingAndBothForms_AreUnderstood) {
  EXPECT_EQ(parse_include("#include \"a/b.h\"")->header, "a/b.h");
  EXPECT_TRUE(parse_include("  #  include \"a/b.h\"  // why")->quoted);
  EXPECT_EQ(parse_include("#include <Eigen/Dense>")->header, "Eigen/Dense");
  EXPECT_FALSE(parse_include("#include <Eigen/Dense>")->quoted);
  EXPECT_FALSE(parse_include("// #include \"a/b.h\""));
  EXPECT_FALSE(parse_include("#define include"));
  EXPECT_FALSE(parse_include("#include"));
}

}  // namespace
}  // namespace nodal::tidy
