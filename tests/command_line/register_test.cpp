// `nodal register` run as by a user, on pictures of a rendered rig.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "protocol/calibration.h"
#include "stitch/geometry/head.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"
#include "tests/support/rendered_rig.h"

namespace nodal::command_line {
namespace {

using nlohmann::json;
using test::Finished;
using test::Process;

constexpr int kSide = 160;
constexpr double kPixelDeg = 130.0 / kSide;

class RegisterCommand : public testing::Test {
 protected:
  static const test::RenderedRig& town() {
    static const test::RenderedRig rig =
        test::render_rig(test::six_fisheyes(kSide), hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, 5, 3});
    return rig;
  }

  // Pictures named after the heads, and a calibration that is some degrees off.
  void write(const test::RenderedRig& rig, double least_deg = 1, double most_deg = 3) {
    std::filesystem::create_directories(folder_ / "frames");
    for (std::size_t h = 0; h < rig.bytes.size(); ++h) {
      test::write_bytes(folder_ / ("frames/" + rig.truth.heads[h].name + ".png"),
                        test::png_of(rig.bytes[h], kSide, kSide, 1));
    }
    prior_ = test::turned(rig.truth, least_deg, most_deg, 3);
    std::ofstream(folder_ / "prior.json") << to_json(prior_);
  }

  Finished run(std::vector<std::string> more) const {
    std::vector<std::string> command{NODAL_BIN_DIR "/nodal", "register"};
    command.insert(command.end(), more.begin(), more.end());
    return Process(command).wait();
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  static std::string text_of(const std::string& file) {
    std::ifstream in(file);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  test::TemporaryFolder folder_;
  Calibration prior_;
};

TEST_F(RegisterCommand, FolderOfPictures_WritesACalibrationThatIsRightAndSaysWhatItDid) {
  write(town());
  const Finished done = run({path("prior.json"), path("frames"), "-o", path("found.json"), "--json"});
  ASSERT_EQ(done.code, 0) << done.err;
  const Calibration found = parse_calibration(text_of(path("found.json"))).value();
  EXPECT_LT(test::rotation_error(town().truth, found).rms_deg, 0.01 * kPixelDeg);
  const json answer = json::parse(done.out);
  EXPECT_LT(answer["objective_after"].get<double>(), 0.05 * answer["objective_before"].get<double>());
  ASSERT_EQ(answer["heads"].size(), 6u);
  for (const json& head : answer["heads"]) EXPECT_TRUE(head["placed"].get<bool>());
  EXPECT_FALSE(answer["pairs"].empty());
  EXPECT_TRUE(answer["warnings"].empty()) << answer["warnings"];
  EXPECT_EQ(answer["out"], path("found.json"));
  EXPECT_EQ(answer["verdict"], "good") << answer["seams"];
  EXPECT_EQ(answer["seams"].size(), 12u) << "the edges of a cube";
}

TEST_F(RegisterCommand, AHeadThatSeesNothing_IsNamedAndKeptAndTheRestIsWritten) {
  test::RenderedRig rig = town();
  std::ranges::fill(rig.bytes[4], std::uint8_t{140});
  write(rig);
  const Finished done = run({path("prior.json"), path("frames"), "-o", path("found.json")});
  ASSERT_EQ(done.code, 0) << done.err;
  EXPECT_NE(done.err.find("head 'cam4' is not placed"), std::string::npos) << done.err;
  EXPECT_NE(done.out.find("not placed, not changed"), std::string::npos) << done.out;
  const Calibration found = parse_calibration(text_of(path("found.json"))).value();
  for (std::size_t k = 0; k < 9; ++k) {
    EXPECT_NEAR(found.heads[4].R_head_rig[k], prior_.heads[4].R_head_rig[k], 1e-9);
  }
}

TEST_F(RegisterCommand, FreeDistanceInARoom_IsToldWrittenAndTakenByStitch) {
  const Calibration spread = test::spread_out(test::six_fisheyes(kSide), 0.1);
  const auto scene = hal::sim::town_square_scene(3);
  write(test::render_rig_in({test::Room::Shape::kBall, 2, {}}, spread, scene, {PixelFormat::kGrey8, 1.0, 5, 3}));
  const Finished done =
      run({path("prior.json"), path("frames"), "--free", "distance", "-o", path("found.json"), "--gauge", "mean"});
  ASSERT_EQ(done.code, 0) << done.err;
  EXPECT_NE(done.out.find("the pictures meet at 2.0"), std::string::npos) << done.out;
  EXPECT_NEAR(parse_calibration(text_of(path("found.json"))).value().distance, 2, 0.02);
  // Without it the command says so.
  const Finished far = run({path("prior.json"), path("frames"), "-o", path("far.json")});
  ASSERT_EQ(far.code, 0) << far.err;
  EXPECT_NE(far.err.find("run again with --free distance"), std::string::npos) << far.err;

  const auto stitch = [&](const std::string& distance) {
    return Process({NODAL_BIN_DIR "/nodal", "stitch", path("far.json"), path("frames"), "-o", path("s.png"), "--width",
                    "256", "--distance", distance})
        .wait();
  };
  EXPECT_EQ(stitch("2").code, 0);
  const Finished inside = stitch("0.11");
  EXPECT_NE(inside.code, 0);
  EXPECT_NE(inside.err.find("the farthest head is 0.1 m from the rig's nodal point"), std::string::npos) << inside.err;
  for (const char* bad : {"0", "-1", "nan", "1e9", "two"}) EXPECT_NE(stitch(bad).code, 0) << bad;
}

TEST_F(RegisterCommand, FreeDistanceWithoutPositions_IsRefusedWithWhatToDo) {
  write(town());
  const Finished done = run({path("prior.json"), path("frames"), "--free", "distance", "-o", path("found.json")});
  EXPECT_NE(done.code, 0);
  EXPECT_NE(done.err.find("no head of the calibration has a position"), std::string::npos) << done.err;
  EXPECT_FALSE(std::filesystem::exists(path("found.json")));
}

TEST_F(RegisterCommand, FramesThatCannotBeRegistered_OneSentenceAndNoFile) {
  struct Trouble {
    const char* says;
    void (*spoil)(test::RenderedRig&);
  };
  for (const Trouble& trouble :
       {Trouble{"head 'cam2' is black",
                [](test::RenderedRig& rig) { std::ranges::fill(rig.bytes[2], std::uint8_t{1}); }},
        Trouble{"have the same picture", [](test::RenderedRig& rig) { rig.bytes[1] = rig.bytes[0]; }},
        Trouble{"head 'cam3' is upside down", [](test::RenderedRig& rig) { std::ranges::reverse(rig.bytes[3]); }}}) {
    test::RenderedRig rig = town();
    trouble.spoil(rig);
    write(rig);
    const Finished done = run({path("prior.json"), path("frames"), "-o", path("found.json")});
    EXPECT_EQ(done.code, 4) << trouble.says;
    EXPECT_NE(done.err.find(trouble.says), std::string::npos) << done.err;
    EXPECT_FALSE(std::filesystem::exists(path("found.json"))) << trouble.says;
  }
}

TEST_F(RegisterCommand, Report_IsOneFileWithEveryHeadAndPicturesAndNothingFromANetwork) {
  test::RenderedRig rig = town();
  std::ranges::fill(rig.bytes[4], std::uint8_t{140});
  write(rig);
  const Finished done =
      run({path("prior.json"), path("frames"), "-o", path("found.json"), "--report", path("page.html")});
  ASSERT_EQ(done.code, 0) << done.err;
  const std::string page = text_of(path("page.html"));
  for (const char* says : {"<html", "cam0", "cam5", "not changed", "is not placed", "Seams, before and after",
                           "Differences of the heads", "Overlaps of the heads", "5 of 6 heads are placed", "<svg",
                           "cam0 and cam1:", "data:image/png;base64,", "</html>"}) {
    EXPECT_NE(page.find(says), std::string::npos) << says;
  }
  for (const char* remote : {"src=\"http", "href=\"http", "url(http", "@import"}) {
    EXPECT_EQ(page.find(remote), std::string::npos) << remote;
  }
}

TEST_F(RegisterCommand, HeadsAnywhereAndPointPairs_AreRegisteredFromThere) {
  write(town(), 60, 170);
  const Finished alone = run({path("prior.json"), path("frames"), "-o", path("found.json")});
  EXPECT_EQ(alone.code, 4) << alone.out;
  // Points as set by hand, to half a pixel: the corners of a cube around the rig, each seen by three heads.
  std::string csv = "head_a,x_a,y_a,head_b,x_b,y_b\n";
  const std::vector<geometry::Head> heads = geometry::make_heads(town().truth).value();
  for (int corner = 0; corner < 8; ++corner) {
    const auto ray = geometry::Ray::towards(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
    for (std::size_t a = 0; a < heads.size(); ++a) {
      for (std::size_t b = a + 1; b < heads.size(); ++b) {
        const auto pa = heads[a].project(ray), pb = heads[b].project(ray);
        if (!pa || !pb || !heads[a].contains(*pa) || !heads[b].contains(*pb)) continue;
        csv += heads[a].name() + "," + std::to_string(std::round(pa->x)) + "," + std::to_string(std::round(pa->y)) +
               "," + heads[b].name() + "," + std::to_string(std::round(pb->x)) + "," +
               std::to_string(std::round(pb->y)) + "\n";
      }
    }
  }
  std::ofstream(path("points.csv")) << csv;
  const Finished done =
      run({path("prior.json"), path("frames"), "--pairs", path("points.csv"), "-o", path("found.json")});
  ASSERT_EQ(done.code, 0) << done.err;
  const Calibration found = parse_calibration(text_of(path("found.json"))).value();
  EXPECT_LT(test::rotation_error(town().truth, found).rms_deg, 0.01 * kPixelDeg);
  const Finished rough =
      Process({NODAL_BIN_DIR "/nodal", "pairs", path("prior.json"), path("points.csv"), "-o", path("rough.json")})
          .wait();
  ASSERT_EQ(rough.code, 0) << rough.err;
  EXPECT_LT(test::rotation_error(town().truth, parse_calibration(text_of(path("rough.json"))).value()).rms_deg,
            2 * kPixelDeg);
  EXPECT_NE(rough.out.find("the point pairs agree within"), std::string::npos) << rough.out;
}

TEST_F(RegisterCommand, PicturesThatDoNotFitTheCalibration_AreCountedAndNamed) {
  write(town());
  const Finished few = run({path("prior.json"), path("frames/cam0.png"), path("frames/cam1.png")});
  EXPECT_EQ(few.code, 4);
  EXPECT_NE(few.err.find("2 pictures for 6 heads"), std::string::npos) << few.err;
  std::filesystem::remove(path("frames/cam5.png"));
  const Finished missing = run({path("prior.json"), path("frames")});
  EXPECT_NE(missing.err.find("no picture of head 'cam5'"), std::string::npos) << missing.err;
  const Finished none = run({path("prior.json")});
  EXPECT_EQ(none.code, 4);
  EXPECT_NE(none.err.find("no pictures"), std::string::npos) << none.err;
}

TEST_F(RegisterCommand, NominalRig_IsAsTheDataSheetHasItAndNeedsNoCalibration) {
  // Three fisheyes around the horizon; their truth differs slightly from the data sheet.
  Calibration truth = test::six_fisheyes(kSide, 190);
  truth.heads = {truth.heads[0], truth.heads[1], truth.heads[3]};
  for (HeadCalibration& head : truth.heads) head.region.circle = Region::Circle{80, 80, 80};
  const double turns[] = {0, 120, -120};
  for (std::size_t h = 0; h < 3; ++h) {
    const double a = turns[h] * 3.14159265358979323846 / 180, c = std::cos(a), s = std::sin(a);
    truth.heads[h].R_head_rig = {c, 0, -s, 0, 1, 0, s, 0, c};
    truth.heads[h].name = "cam" + std::to_string(h);
  }
  truth = test::turned(truth, 0.5, 2, 9);
  write(test::render_rig(truth, hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, 5, 3}));
  const auto error_with = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"--nominal", "3x190", "--free", "focals", path("frames"), "-o", path("found.json")};
    words.insert(words.end(), more.begin(), more.end());
    const Finished done = run(words);
    EXPECT_EQ(done.code, 0) << done.err;
    return test::rotation_error(truth, parse_calibration(text_of(path("found.json"))).value()).rms_deg;
  };
  constexpr double kPixel = 190.0 / kSide;
  EXPECT_LT(error_with({"--circle", "80,80,80"}), 0.03 * kPixel);
  EXPECT_LT(error_with({}), 0.15 * kPixel) << "circles found in the pictures: their edges are read to half a pixel";
  EXPECT_EQ(run({"--nominal", "3by190", path("frames")}).code, 2);
}

TEST_F(RegisterCommand, NominalHeadsThatLookAnywhere_AreRegistered) {
  // Six fisheyes along the axes, each up to two degrees off; the fifth looks down and is mounted upside down.
  const test::RenderedRig rig = test::render_rig(test::turned(test::six_fisheyes(kSide), 0.5, 2, 9),
                                                 hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, 5, 3});
  write(rig);
  std::vector<std::string> words{"--nominal", "6x130", path("frames"), "-o", path("found.json")};
  for (const char* place : {"0,0", "90,0", "180,0", "-90,0", "0,-90,180", "0,90"}) {
    words.insert(words.end(), {"--at", place});
  }
  const Finished done = run(words);
  ASSERT_EQ(done.code, 0) << done.err;
  EXPECT_LT(test::rotation_error(rig.truth, parse_calibration(text_of(path("found.json"))).value()).rms_deg,
            0.2 * kPixelDeg);

  const auto refused = [&](const std::vector<std::string>& more, const std::string& says) {
    std::vector<std::string> bad{"--nominal", "6x130", path("frames"), "-o", path("no.json")};
    bad.insert(bad.end(), more.begin(), more.end());
    const Finished ended = run(bad);
    EXPECT_NE(ended.code, 0) << says;
    EXPECT_NE(ended.err.find(says), std::string::npos) << ended.err;
  };
  refused({"--at", "0,0"}, "--at: 1 place for 6 heads");
  refused({"--at", "0,95"}, "yaw to the right and pitch up");
  refused({"--lens", "rectilinear", "--circle", "80,80,80"}, "a rectilinear lens has none");
}

TEST(ImportCommand, OpenCvCamerasAFileEach_MakeOneRigAndABadOneIsNamed) {
  const test::TemporaryFolder folder;
  const auto camera = [&](const std::string& name, int width) {
    std::ofstream(folder / name) << "%YAML:1.0\n---\nimage_width: " << width << "\nimage_height: 480\n"
                                 << "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
                                 << "   data: [ 500., 0., 320., 0., 500., 240., 0., 0., 1. ]\n"
                                 << "distortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n"
                                 << "   data: [ -0.1, 0.02, 0., 0. ]\n";
    return (folder / name).string();
  };
  const std::string left = camera("left.yaml", 640), right = camera("right.yaml", 648), bad = camera("bad.yaml", 0);
  const std::string out = (folder / "rig.json").string();
  const Finished done = Process({NODAL_BIN_DIR "/nodal", "import", left, right, "-o", out}).wait();
  ASSERT_EQ(done.code, 0) << done.err;
  std::ifstream file(out);
  const Result<Calibration> rig = parse_calibration(std::string{std::istreambuf_iterator<char>(file), {}});
  ASSERT_TRUE(rig) << rig.error().text();
  ASSERT_EQ(rig->heads.size(), 2u);
  EXPECT_EQ(rig->heads[0].name, "left");
  EXPECT_EQ(rig->heads[1].width, 648);
  const Finished refused = Process({NODAL_BIN_DIR "/nodal", "import", left, bad, "-o", out}).wait();
  EXPECT_NE(refused.code, 0);
  EXPECT_NE(refused.err.find("bad.yaml: "), std::string::npos) << refused.err;
}

}  // namespace
}  // namespace nodal::command_line
