// Reading point pairs from files, and the errors.
#include "host_tool/input/pairs_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/pictures.h"
#include "tests/support/rigs.h"

namespace nodal::host {
namespace {

class PairsFile : public testing::Test {
 protected:
  Result<std::vector<registration::PointPair>> read(const std::string& name, const std::string& text) {
    const std::string file = (folder_ / name).string();
    std::ofstream(file) << text;
    return read_pairs(file, rig_);
  }
  test::TemporaryFolder folder_;
  Calibration rig_ = test::ring(3, 640, 480);
};

TEST_F(PairsFile, Csv_HeadsByNameAndPixelsAsTheyStand) {
  const auto pairs = read("p.csv", "head_a,x_a,y_a,head_b,x_b,y_b\n# by hand\ncam0,600.5,240,cam1, 40.25 ,239.5\r\n\n");
  ASSERT_TRUE(pairs) << pairs.error().text();
  ASSERT_EQ(pairs->size(), 1u);
  EXPECT_EQ(pairs->front().head_a, 0u);
  EXPECT_EQ(pairs->front().head_b, 1u);
  EXPECT_EQ(pairs->front().pixel_a, (geometry::Pixel{600.5, 240}));
  EXPECT_EQ(pairs->front().pixel_b, (geometry::Pixel{40.25, 239.5}));
}

TEST_F(PairsFile, MorePairsThanAreFitted_AreRefused) {
  std::string text;
  for (std::size_t i = 0; i <= kMaxPointPairs; ++i) text += "cam0,1,2,cam1,3,4\n";
  const auto pairs = read("p.csv", text);
  ASSERT_FALSE(pairs);
  EXPECT_EQ(pairs.error().code, Errc::kTooLarge) << pairs.error().text();
}

TEST_F(PairsFile, WhatPairsCsvWrites_ReadsBack) {
  const auto pairs = read("p.csv", "cam0,600.5,240,cam1,40.25,239.5\ncam2,1,2,cam0,3,4.125\n");
  ASSERT_TRUE(pairs);
  const auto again = read("q.csv", pairs_csv(*pairs, rig_));
  ASSERT_TRUE(again) << again.error().text();
  ASSERT_EQ(again->size(), 2u);
  EXPECT_EQ((*again)[1].head_a, 2u);
  EXPECT_EQ((*again)[1].pixel_b, (geometry::Pixel{3, 4.125}));
}

TEST_F(PairsFile, BrokenCsv_NamesTheFileTheLineAndWhatIsWrong) {
  struct Broken {
    const char* line;
    const char* says;
  };
  for (const Broken& broken :
       {Broken{"cam0,1,2,cam7,3,4", "no head 'cam7'"}, Broken{"cam0,1,2,cam1,3", "5 fields"},
        Broken{"cam0,1,two,cam1,3,4", "'two' is no number"}, Broken{"cam0,1,nan,cam1,3,4", "'nan' is no number"},
        Broken{"cam0,1,2,cam1,inf,4", "'inf' is no number"},
        Broken{"cam0,1,2,cam0,3,4", "both points are of head 'cam0'"}}) {
    const auto pairs = read("p.csv", "head_a,x_a,y_a,head_b,x_b,y_b\n" + std::string(broken.line) + "\n");
    ASSERT_FALSE(pairs) << broken.line;
    EXPECT_NE(pairs.error().message.find("p.csv: line 2"), std::string::npos) << pairs.error().text();
    EXPECT_NE(pairs.error().message.find(broken.says), std::string::npos) << pairs.error().text();
  }
  EXPECT_EQ(read("p.csv", "").error().code, Errc::kMissingField);
}

// In Hugin, pixel centres are at integers.
constexpr const char* kProject =
    "p f2 w2048 h1024 v360 n\"TIFF_m\"\n"
    "i w640 h480 f0 v90 a0 b0 c0 d0 e0 y0 p0 r0 n\"a.png\"\n"
    "i w640 h480 f0 v90 a0 b0 c0 d0 e0 y120 p0 r0 n\"b.png\"\n"
    "i w640 h480 f0 v90 a0 b0 c0 d0 e0 y-120 p0 r0 n\"c.png\"\n"
    "c n0 N1 x600 y240 X40 Y239.5 t0\nc n2 N2 x1 y1 X5 Y5 t2\n";

TEST_F(PairsFile, ControlPointsOfAProject_AreTakenInNodalsPixels) {
  const auto pairs = read("p.pto", kProject);
  ASSERT_TRUE(pairs) << pairs.error().text();
  ASSERT_EQ(pairs->size(), 1u);
  EXPECT_EQ(pairs->front().pixel_a, (geometry::Pixel{600.5, 240.5}));
  EXPECT_EQ(pairs->front().pixel_b, (geometry::Pixel{40.5, 240}));
}

TEST_F(PairsFile, ControlPointsOfVideoStitch_AreTakenToo) {
  std::string inputs;
  for (int i = 0; i < 3; ++i) {
    inputs += std::string(i == 0 ? "" : ", ") +
              R"({"reader_config": "a.jpg", "width": 640, "height": 480, "proj": "rectilinear", )" +
              R"("geometries": [0, 0, {"horizontalFocal": 320, "yaw": )" + std::to_string(120 * i) + "}]}";
  }
  const auto pairs = read("p.ptv", R"({"pano": {"inputs": [)" + inputs +
                                       R"(], "calibration_control_points": {"matched_control_points": [)" +
                                       R"({"frame_number": 0, "input_index0": 0, "x0": 600, "y0": 240, )" +
                                       R"("input_index1": 1, "x1": 40, "y1": 239.5, "score": 0.1}]}}})");
  ASSERT_TRUE(pairs) << pairs.error().text();
  ASSERT_EQ(pairs->size(), 1u);
  EXPECT_EQ(pairs->front().pixel_a, (geometry::Pixel{600.5, 240.5}));
  EXPECT_EQ(pairs->front().pixel_b, (geometry::Pixel{40.5, 240}));
}

TEST_F(PairsFile, AProjectOfAnotherRig_IsRefused) {
  rig_ = test::ring(4, 640, 480);
  const auto pairs = read("p.pto", kProject);
  ASSERT_FALSE(pairs);
  EXPECT_EQ(pairs.error().code, Errc::kHeadMismatch);
  EXPECT_NE(pairs.error().message.find("3 images, the calibration 4 heads"), std::string::npos) << pairs.error().text();
}

}  // namespace
}  // namespace nodal::host
