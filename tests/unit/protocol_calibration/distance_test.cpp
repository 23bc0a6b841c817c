// Positions and the distance in the calibration document: parsing, writing, limits.
#include <gtest/gtest.h>

#include <limits>

#include "examples.h"
#include "protocol/calibration.h"

namespace nodal {
namespace {

Calibration at_distance(double distance, double forward) {
  Calibration rig = two_heads();
  rig.heads[1].position = {0, 0.05, forward};
  rig.distance = distance;
  return rig;
}

void expect_refused(const Calibration& rig, const std::string& says) {
  const Status checked = check_calibration(rig);
  ASSERT_FALSE(checked) << says;
  EXPECT_EQ(checked.error().code, Errc::kBadValue);
  EXPECT_NE(checked.error().message.find(says), std::string::npos) << checked.error().message;
}

TEST(CalibrationDistance, WrittenAndRead_IsTheSameInVersion3) {
  for (const double distance : {0.0, 0.26, 1.0 / 3, 1e6}) {
    const Calibration rig = at_distance(distance, 0.2);
    for (const std::string& text : {to_json(rig), canonical_json(rig)}) {
      const auto read = parse_calibration(text);
      ASSERT_TRUE(read) << read.error().text();
      EXPECT_EQ(*read, rig);
      EXPECT_EQ(calibration_id(*read), calibration_id(rig));
    }
    EXPECT_NE(canonical_json(rig).find("\"nodal_calibration\":3"), std::string::npos);
  }
  EXPECT_NE(calibration_id(at_distance(2, 0.2)), calibration_id(at_distance(3, 0.2)));
}

TEST(CalibrationDistance, WithoutPositions_LeavesVersionAndIdAsTheyWere) {
  EXPECT_NE(canonical_json(two_heads()).find("\"nodal_calibration\":1"), std::string::npos);
  EXPECT_EQ(canonical_json(two_heads()).find("position"), std::string::npos);
  EXPECT_EQ(canonical_json(two_heads()).find("distance"), std::string::npos);
}

TEST(CalibrationDistance, ThatCannotBe_IsRefusedWithWhatItMayBe) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double endless = std::numeric_limits<double>::infinity();
  Calibration nowhere = at_distance(2, 0.2);
  nowhere.heads[1].position = {};
  expect_refused(nowhere, "no head has a position");
  expect_refused(at_distance(0.2, 0.2), "farthest head");
  for (const double bad : {nan, endless, -1.0, 1.0000001e6}) expect_refused(at_distance(bad, 0.2), "distance is");
  for (const double bad : {nan, endless, -endless, 100.1}) expect_refused(at_distance(2, bad), "position[2] is");
}

TEST(CalibrationDistance, OfZeroOrLessInADocument_IsRefused) {
  const std::string text = to_json(at_distance(2, 0.2));
  for (const char* bad : {"0", "-2", "1e-400"}) {
    const auto read = parse_calibration(replaced(text, "\"distance\": 2", std::string("\"distance\": ") + bad));
    ASSERT_FALSE(read) << bad;
    EXPECT_NE(read.error().message.find("above 0"), std::string::npos) << read.error().message;
  }
  EXPECT_FALSE(parse_calibration(replaced(text, "\"distance\": 2", "\"distance\": \"near\"")));
  EXPECT_FALSE(parse_calibration(replaced(text, "[0, 0.05, 0.2]", "[0, 0.05]")));
}

}  // namespace
}  // namespace nodal
