// The commands that make calibrations from files, run as by a user: input and output files, answers, exit codes.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "host_tool/console/files.h"
#include "protocol/calibration.h"
#include "run_nodal.h"
#include "stitch/media/image_file.h"
#include "stitch/media/png_writer.h"
#include "tests/support/photographer.h"
#include "tests/support/rendered_rig.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;
namespace ph = nodal::photographer;
using Document = nlohmann::json;

/// A folder for one test's files.
class CalibrationCommands : public testing::Test {
 protected:
  CalibrationCommands() {
    std::string name = fs::temp_directory_path() / "nodal-commands-XXXXXX";
    folder_ = ::mkdtemp(name.data());
  }
  ~CalibrationCommands() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  Calibration read(const std::string& name) const {
    const auto text = read_file(path(name), kMaxCalibrationBytes);
    EXPECT_TRUE(text) << (text ? "" : text.error().text());
    const auto calibration = text ? parse_calibration(*text) : Result<Calibration>(fail(Errc::kNotFound, name));
    EXPECT_TRUE(calibration) << (calibration ? "" : calibration.error().text());
    return calibration.value_or(Calibration{});
  }

  std::string write_rig(const std::string& name, const Calibration& rig) const {
    EXPECT_TRUE(write_file(path(name), to_json(rig)));
    return path(name);
  }

 private:
  fs::path folder_;
};

Document document(const Outcome& run) { return Document::parse(run.out, nullptr, false); }

TEST_F(CalibrationCommands, EveryFormat_ExportedImportedAndComparedIsTheSameRig) {
  const std::string rig = write_rig("rig.json", test::six_fisheyes(400, 110));
  for (const std::string format : {"pto", "pts", "ptv", "surround360", "kalibr"}) {
    const Outcome exported({"export", rig, "--format", format, "-o", path("there." + format), "--json"});
    ASSERT_EQ(exported.code, ExitCode::kOk) << exported.err;
    ASSERT_EQ(document(exported)["heads"].size(), 6u) << format;
    EXPECT_LT(document(exported)["heads"][0]["max_px"], 1e-3) << format;
    const Outcome imported({"import", path("there." + format), "-o", path("back.json")});
    ASSERT_EQ(imported.code, ExitCode::kOk) << imported.err;
    const Outcome compared({"calibration", "diff", rig, path("back.json"), "--json"});
    ASSERT_EQ(compared.code, ExitCode::kOk) << compared.err;
    const Document differences = document(compared);
    for (const Document& head : differences["heads"]) {
      EXPECT_LT(head["turned_deg"], 1e-5) << format;
      EXPECT_LT(head["max_px"], 1e-2) << format;
    }
  }
}

TEST_F(CalibrationCommands, ControlPointsFarFromEachOther_AreWarnedOfAndOthersAreNot) {
  const std::string rig = write_rig("rig.json", test::six_fisheyes(400, 110));
  ASSERT_EQ(Outcome({"export", rig, "--format", "pto", "-o", path("rig.pto")}).code, ExitCode::kOk);
  const Outcome without({"import", path("rig.pto"), "-o", path("a.json")});
  ASSERT_EQ(without.code, ExitCode::kOk) << without.err;
  EXPECT_EQ(without.err.find("control points"), std::string::npos) << without.err;
  // The middles of two heads that look in different directions.
  std::ofstream(path("rig.pto"), std::ios::app) << "c n0 N1 x200 y200 X200 Y200 t0\n";
  const Outcome with({"import", path("rig.pto"), "-o", path("b.json")});
  ASSERT_EQ(with.code, ExitCode::kOk) << with.err;
  EXPECT_NE(with.err.find("do not fit to the project's lenses and directions"), std::string::npos) << with.err;
}

TEST_F(CalibrationCommands, FormatOfOneCameraAFile_WritesOneForEveryHead) {
  const std::string rig = write_rig("rig.json", test::six_fisheyes(400, 110));
  const Outcome exported({"export", rig, "--format", "opencv", "-o", path("cam.yaml")});
  ASSERT_EQ(exported.code, ExitCode::kOk) << exported.err;
  for (int h = 0; h < 6; ++h) {
    const Outcome imported({"import", path("cam-cam" + std::to_string(h) + ".yaml"), "-o", path("one.json")});
    EXPECT_EQ(imported.code, ExitCode::kOk) << imported.err;
  }
}

TEST_F(CalibrationCommands, CamerasInTheFolderInWhichNodalRuns_AreImported) {
  // They name no pictures, and their path has no folder.
  const std::string rig = write_rig("rig.json", test::six_fisheyes(400, 110));
  ASSERT_EQ(Outcome({"export", rig, "--format", "opencv", "-o", path("cam.yaml")}).code, ExitCode::kOk);
  ASSERT_EQ(Outcome({"export", rig, "--format", "kalibr", "-o", path("chain.yaml")}).code, ExitCode::kOk);
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(std::filesystem::path(rig).parent_path());
  for (const std::string file : {"cam-cam0.yaml", "chain.yaml"}) {
    const Outcome imported({"import", file, "-o", "here.json"});
    EXPECT_EQ(imported.code, ExitCode::kOk) << file << imported.err;
    EXPECT_EQ(imported.err.find("is outside"), std::string::npos) << imported.err;
  }
  std::filesystem::current_path(before);
}

TEST_F(CalibrationCommands, WhatCannotBe_IsRefusedWithItsExitCode) {
  const std::string rig = write_rig("rig.json", test::six_fisheyes(100, 110));
  EXPECT_EQ(Outcome({"export", rig, "--format", "bmp"}).code, ExitCode::kUsage);
  EXPECT_EQ(Outcome({"export", path("none.json"), "--format", "pto"}).code, ExitCode::kStorage);
  const Outcome again({"import", rig, "-o", path("x.json")});
  EXPECT_EQ(again.code, ExitCode::kBadInput);
  EXPECT_NE(again.err.find("already"), std::string::npos) << again.err;
  Calibration two = test::six_fisheyes(100, 110);
  two.heads.resize(2);
  two.heads[0].name = "left";
  two.heads[1].name = "right";
  const Outcome unlike({"calibration", "diff", rig, write_rig("two.json", two)});
  EXPECT_EQ(unlike.code, ExitCode::kBadInput);
  EXPECT_NE(unlike.err.find("cannot be paired"), std::string::npos) << unlike.err;
  EXPECT_EQ(Outcome({"pattern", "-o", path("p.bmp")}).code, ExitCode::kUsage);
  EXPECT_EQ(Outcome({"pattern", "-o", path("p.png"), "--size", "letter"}).code, ExitCode::kUsage);
}

/// A small head with the paper's lens.
ph::Lens small_lens() {
  ph::Lens lens;
  lens.width = 360;
  lens.height = 240;
  lens.f = 245;
  lens.cx = 181.2;
  lens.cy = 116.9;
  lens.k = {2.29e-6 * 4, 1.65e-11 * 16};
  return lens;
}

TEST_F(CalibrationCommands, PatternPhotographedAndCalibrated_GivesTheLensAndAPageToLookAt) {
  const Outcome drawn({"pattern", "-o", path("pattern.png"), "--size", "1200x848", "--seed", "5"});
  ASSERT_EQ(drawn.code, ExitCode::kOk) << drawn.err;
  const auto raster = media::read_image(path("pattern.png"), PixelFormat::kGrey8);
  ASSERT_TRUE(raster);
  const ph::Scene print = ph::print_of(raster->width, raster->height, raster->bytes);
  const auto photograph = [&](const std::string& name, const ph::Scene& scene, double tilt, double about) {
    ph::Shot shot;
    shot.tilt_deg = tilt;
    shot.tilt_about_deg = about;
    shot.distance = 0.3;
    shot.noise = 1;
    const ph::Photo photo = ph::take(scene, small_lens(), shot);
    const auto png = media::png_file({photo.width, photo.height, 1, 8, photo.grey}, {});
    EXPECT_TRUE(png && write_file(path(name), *png));
    return path(name);
  };
  const std::string a = photograph("a.png", print, 25, 30), b = photograph("b.png", print, 28, 200);
  const Outcome found({"calibrate", "lens", a, b, "--pattern", path("pattern.png"), "--name", "cam5", "-o",
                       path("cam5.json"), "--report", path("cam5.html"), "--json"});
  ASSERT_EQ(found.code, ExitCode::kOk) << found.err;
  EXPECT_NEAR(document(found)["focal_px"]["value"], 245, 0.5);
  EXPECT_EQ(document(found)["views"].size(), 2u);
  const Calibration lens = read("cam5.json");
  ASSERT_EQ(lens.heads.size(), 1u);
  EXPECT_EQ(lens.heads[0].name, "cam5");
  EXPECT_NEAR(lens.heads[0].center_x, 181.2, 0.3);
  const auto page = read_file(path("cam5.html"), 64 << 20);
  ASSERT_TRUE(page);
  EXPECT_NE(page->find("data:image/png;base64,"), std::string::npos);
  EXPECT_EQ(page->find("src=\"http"), std::string::npos);

  const std::string board = photograph("board.png", ph::chessboard(9, 6), 25, 30);
  const Outcome refused({"calibrate", "lens", a, board, "--pattern", path("pattern.png"), "-o", path("no.json")});
  EXPECT_EQ(refused.code, ExitCode::kBadInput);
  EXPECT_NE(refused.err.find("board.png: the pattern is not in this photograph"), std::string::npos) << refused.err;
  EXPECT_FALSE(fs::exists(path("no.json")));
}

TEST_F(CalibrationCommands, Join_HasTheHeadsOfAllFilesInTheirOrder) {
  const Calibration truth = test::six_fisheyes(160);
  const auto alone = [&](std::size_t head, const std::string& name) {
    Calibration one = truth;
    one.heads = {truth.heads[head]};
    one.heads[0].name = name;
    one.heads[0].R_head_rig = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    return one;
  };
  const std::string a = write_rig("a.json", alone(0, "a")), b = write_rig("b.json", alone(1, "b"));
  const std::string same = write_rig("same.json", alone(2, "a"));
  const Outcome joined({"calibration", "join", b, a, "-o", path("rig.json")});
  ASSERT_EQ(joined.code, ExitCode::kOk) << joined.err;
  EXPECT_NE(joined.out.find("nodal register " + path("rig.json")), std::string::npos) << joined.out;
  const Calibration rig = read("rig.json");
  ASSERT_EQ(rig.heads.size(), 2U);
  EXPECT_EQ(rig.heads[0], alone(1, "b").heads[0]);
  EXPECT_EQ(rig.heads[1], alone(0, "a").heads[0]);
  // Directions of two rigs have nothing to do with each other, also if each file has some.
  Calibration turned = alone(0, "a"), far = alone(2, "c");
  turned.heads[0].R_head_rig = {0, 0, 1, 0, 1, 0, -1, 0, 0};
  const Outcome mixed({"calibration", "join", write_rig("turned.json", turned), b, "-o", path("mixed.json"), "--json"});
  EXPECT_NE(mixed.out.find("\"directions\":false"), std::string::npos) << mixed.out;
  far.distance = 3;
  far.heads[0].position = {0.1, 0, 0};
  const Outcome apart({"calibration", "join", a, write_rig("far.json", far), "-o", path("apart.json")});
  EXPECT_NE(apart.code, ExitCode::kOk);
  EXPECT_NE(apart.err.find("give them one distance"), std::string::npos) << apart.err;
  const Outcome refused({"calibration", "join", a, same, "-o", path("no.json")});
  EXPECT_NE(refused.code, ExitCode::kOk);
  EXPECT_NE(refused.err.find("both have a head 'a'"), std::string::npos) << refused.err;
  EXPECT_FALSE(fs::exists(path("no.json")));
}

TEST_F(CalibrationCommands, CornersOfABoard_GiveTheLensOfAPinhole) {
  constexpr double kFocal = 800;
  constexpr int kWidth = 1024, kHeight = 768;
  std::string rows = "# found by another program\npicture,x,y,board_x,board_y\n";
  for (int v = 0; v < 3; ++v) {
    const std::string name = "board" + std::to_string(v) + ".png";
    const std::vector<std::uint8_t> black(std::size_t{kWidth} * kHeight);
    const auto png = media::png_file({kWidth, kHeight, 1, 8, black}, {});
    EXPECT_TRUE(png && write_file(path(name), *png));
    const double a = v == 0 ? 0.6 : v == 1 ? -0.5 : 0, b = v == 2 ? 0.6 : 0.1;
    for (int k = 0; k < 63; ++k) {  // 9 x 7 corners, turned by a about x, then by b about y
      const double X = k % 9 - 4, Y = k / 9 - 3;
      const double y = Y * std::cos(a), z = Y * std::sin(a);
      const double x = X * std::cos(b) + z * std::sin(b), depth = 11 - X * std::sin(b) + z * std::cos(b);
      rows += name + "," + std::to_string(kWidth / 2.0 + kFocal * x / depth) + "," +
              std::to_string(kHeight / 2.0 + kFocal * y / depth) + "," + std::to_string(k % 9) + "," +
              std::to_string(k / 9) + "\n";
    }
  }
  EXPECT_TRUE(write_file(path("corners.csv"), rows));
  const Outcome found({"calibrate", "lens", path("corners.csv"), "-o", path("head.json")});
  ASSERT_EQ(found.code, ExitCode::kOk) << found.err;
  EXPECT_NE(found.out.find("board2.png"), std::string::npos) << found.out;
  const HeadCalibration head = read("head.json").heads.at(0);
  EXPECT_EQ(head.width, kWidth);
  EXPECT_NEAR(std::get<TsaiLens>(head.lens).focal, kFocal, 1);
  EXPECT_NEAR(head.center_x, kWidth / 2.0, 1);
  const auto refused = [&](const std::string& text, const std::string& says) {
    EXPECT_TRUE(write_file(path("bad.csv"), text));
    const Outcome run({"calibrate", "lens", path("bad.csv"), "-o", path("no.json")});
    EXPECT_NE(run.code, ExitCode::kOk) << says;
    EXPECT_NE(run.err.find(says), std::string::npos) << run.err;
  };
  refused("board0.png,1,2,3\n", "line 1: 4 fields");
  refused("board0.png,1,2,3,4\nboard0.png,1,x,3,4\n", "line 2: 'x' is no number");
  refused("board0.png,1,2,3,4,0\nboard0.png,1,2,3,4,5\n", "line 2: board_z differs");
  refused("board0.png,5000,2,3,4\n", "a corner at 5000.0");
  refused("gone.png,1,2,3,4\n", "gone.png");
  refused("picture,x,y,board_x,board_y\n", "it has no corners");
}

}  // namespace
}  // namespace nodal::host
