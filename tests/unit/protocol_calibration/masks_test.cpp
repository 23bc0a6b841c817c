// Masks in the calibration document: parsing, writing, limits.
#include <gtest/gtest.h>

#include <limits>

#include "examples.h"
#include "protocol/calibration.h"

namespace nodal {
namespace {

using Polygon = std::vector<Region::Point>;

Calibration masked(std::vector<Polygon> masks) {
  Calibration rig = two_heads();
  rig.heads[0].region.masks = std::move(masks);
  return rig;
}

const Polygon kTriangle{{10, 20}, {200.5, 20}, {100, 300}};

void expect_masks_refused(const Calibration& rig, const std::string& says) {
  const Status checked = check_calibration(rig);
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().code, Errc::kBadValue);
  EXPECT_NE(checked.error().message.find(says), std::string::npos) << checked.error().message;
  EXPECT_NE(checked.error().message.find(rig.heads[0].name), std::string::npos) << checked.error().message;
}

TEST(CalibrationMasks, WrittenAndRead_AreTheSameInVersion2) {
  const Calibration rig = masked({kTriangle, {{-50, -50}, {900, -50}, {900, 3}, {-50, 3}}});
  for (const std::string& text : {to_json(rig), canonical_json(rig)}) {
    const auto read = parse_calibration(text);
    ASSERT_TRUE(read) << read.error().text();
    EXPECT_EQ(*read, rig);
    EXPECT_EQ(calibration_id(*read), calibration_id(rig));
  }
  EXPECT_NE(canonical_json(rig).find("\"nodal_calibration\":2"), std::string::npos);
  EXPECT_NE(calibration_id(rig), calibration_id(two_heads()));
}

TEST(CalibrationMasks, OfNoHead_LeaveVersionAndIdAsTheyWere) {
  EXPECT_NE(canonical_json(two_heads()).find("\"nodal_calibration\":1"), std::string::npos);
  EXPECT_EQ(canonical_json(two_heads()).find("masks"), std::string::npos);
  const auto empty =
      parse_calibration(replaced(to_json(two_heads()), "\"bottom\": 480", "\"bottom\": 480, \"masks\": []"));
  ASSERT_TRUE(empty) << empty.error().text();
  EXPECT_EQ(calibration_id(*empty), calibration_id(two_heads()));
}

TEST(CalibrationMasks, ThatCannotBe_AreRefusedByHeadAndMask) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double endless = std::numeric_limits<double>::infinity();
  expect_masks_refused(masked({kTriangle, {{1, 1}, {5, 5}}}), "region.masks[1] has 2 corners");
  expect_masks_refused(masked({{}}), "region.masks[0] has 0 corners");
  expect_masks_refused(masked({{{1, 1}, {5, 5}, {9, 9}, {3, 3}}}), "region.masks[0] has no area");
  expect_masks_refused(masked({{{7, 7}, {7, 7}, {7, 7}}}), "no area");
  expect_masks_refused(masked({{{800, 10}, {900, 10}, {900, 90}}}), "outside the picture");
  expect_masks_refused(masked({{{10, -90}, {90, -10}, {10, -10}}}), "outside the picture");
  for (const double bad : {nan, endless, -endless, 1.1e6, -1.1e6}) {
    expect_masks_refused(masked({{{10, 10}, {90, bad}, {50, 90}}}), "region.masks[0][1][1]");
    expect_masks_refused(masked({{{10, 10}, {90, 10}, {bad, 90}}}), "region.masks[0][2][0]");
  }
  // A bow tie and a star hide what they enclose: crossings are allowed.
  EXPECT_TRUE(check_calibration(masked({{{10, 10}, {90, 90}, {90, 10}, {10, 90}}})));
}

TEST(CalibrationMasks, MoreThanThereMayBe_AreRefusedWhateverTheirSize) {
  expect_masks_refused(masked(std::vector<Polygon>(kMaxMasks + 1, kTriangle)), "more than 16 polygons");
  EXPECT_TRUE(check_calibration(masked(std::vector<Polygon>(kMaxMasks, kTriangle))));
  Polygon comb;
  while (comb.size() < kMaxMaskPoints)
    comb.push_back({10.0 + static_cast<double>(comb.size()), comb.size() % 2 == 0 ? 0.0 : 50.0});
  EXPECT_TRUE(check_calibration(masked({comb})));
  comb.push_back({5, 5});
  expect_masks_refused(masked({comb}), "more than 256 corners");
  std::string many = "[[[1,1]";  // as many as a document can hold
  while (many.size() + 3000 < kMaxCalibrationBytes) many += ",[1,2]";
  for (const std::string& masks : {many + "]]", "[" + many.substr(0, 500'000) + "]],[[1,2]]]", std::string("7"),
                                   std::string("[7]"), std::string("[[7]]"), std::string("[[[7]]]"),
                                   std::string("[[[1,\"2\"],[1,2],[2,2]]]"), std::string("[[[[1,2]]]]")}) {
    const std::string text = replaced(to_json(two_heads()), "\"bottom\": 480", "\"bottom\": 480, \"masks\": " + masks);
    const auto read = parse_calibration(text);
    ASSERT_FALSE(read) << masks.substr(0, 50);
    EXPECT_LT(read.error().message.size(), 400U);
  }
}

}  // namespace
}  // namespace nodal
