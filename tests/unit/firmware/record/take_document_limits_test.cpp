// Every field of take.json at its limits, as TAKE.md states them; what goes beyond them is refused with the field's
// name.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "hal/sim/disk.h"
#include "protocol/take/documents.h"
#include "protocol/take/limits.h"
#include "tests/support/take_stage.h"

namespace nodal::take {
namespace {

using Fields = std::vector<std::pair<std::string, std::string>>;

Fields fields() {
  return {{"take", "7"},
          {"version", std::to_string(kTakeVersion)},
          {"rig", "\"stadium\""},
          {"software", "\"nodald 0.2\""},
          {"started_utc_ns", "1"},
          {"rate", "[30000, 1001]"},
          {"mode", "\"jpeg\""},
          {"calibration", "\"\""},
          {"layout", "\"equirectangular\""},
          {"raymap", "[2048, 1024]"},
          {"heads", "[\"left\", \"right\"]"}};
}

std::string text_of(const Fields& all) {
  std::string text;
  for (const auto& [key, value] : all) text += (text.empty() ? "{\"" : ", \"") + key + "\": " + value;
  return text + "}";
}

/// The document with another value of one field.
Result<TakeDocument> parsed_with(const std::string& key, const std::string& value) {
  Fields all = fields();
  for (auto& [name, old] : all) {
    if (name == key) old = value;
  }
  return parse_take_json(text_of(all), "take.json");
}

TEST(TakeDocumentLimits, AsWritten_EveryFieldIsRead) {
  const auto take = parse_take_json(text_of(fields()), "take.json");
  ASSERT_TRUE(take) << take.error().text();
  EXPECT_EQ(take->number, 7u);
  EXPECT_EQ(take->rig, "stadium");
  EXPECT_EQ(take->software, "nodald 0.2");
  EXPECT_EQ(take->started_utc_ns, 1);
  EXPECT_EQ(take->rate, (FrameRate{30000, 1001}));
  EXPECT_EQ(take->mode, "jpeg");
  EXPECT_EQ(take->layout, "equirectangular");
  EXPECT_EQ(take->raymap_width, 2048);
  EXPECT_EQ(take->raymap_height, 1024);
  EXPECT_EQ(take->heads, (std::vector<std::string>{"left", "right"}));
}

TEST(TakeDocumentLimits, AFieldIsMissing_IsRefusedByItsName) {
  for (std::size_t i = 0; i < fields().size(); ++i) {
    Fields all = fields();
    all.erase(all.begin() + static_cast<std::ptrdiff_t>(i));
    const auto refused = parse_take_json(text_of(all), "take.json");
    ASSERT_FALSE(refused) << fields()[i].first;
    EXPECT_EQ(refused.error().code, Errc::kMissingField) << refused.error().text();
    EXPECT_EQ(refused.error().message, "take.json: " + fields()[i].first + " is missing");
  }
}

TEST(TakeDocumentLimits, ValuesAtTheirLimits_AreRead) {
  const std::string most(256, 'x');
  for (const auto& [key, value] : Fields{{"take", "1099511627776"},
                                         {"started_utc_ns", "4611686018427387903"},
                                         {"rig", '"' + most + '"'},
                                         {"rate", "[1000, 1]"},
                                         {"raymap", "[65536, 65536]"},
                                         {"heads", "[\"" + most + "\"]"}}) {
    EXPECT_TRUE(parsed_with(key, value)) << key << " " << value;
  }
}

TEST(TakeDocumentLimits, ValuesBeyondTheirLimits_AreRefused) {
  const std::string more(257, 'x');
  for (const auto& [key, value] : Fields{{"take", "1099511627777"},
                                         {"take", "-1"},
                                         {"take", "\"7\""},
                                         {"started_utc_ns", "4611686018427387904"},
                                         {"rig", '"' + more + '"'},
                                         {"rig", "7"},
                                         {"rate", "[30000]"},
                                         {"rate", "[0, 1]"},
                                         {"rate", "[30000, 0]"},
                                         {"rate", "[30000, -1001]"},
                                         {"rate", "[\"30000\", 1001]"},
                                         {"rate", "[30000, \"1001\"]"},
                                         {"rate", "[1001, 1]"},
                                         {"rate", "30"},
                                         {"mode", '"' + more + '"'},
                                         {"raymap", "[2048]"},
                                         {"raymap", "[65537, 1024]"},
                                         {"raymap", "[2048, 65537]"},
                                         {"raymap", "[-1, 1024]"},
                                         {"raymap", "[2048, \"1024\"]"},
                                         {"heads", "[7]"},
                                         {"heads", "[\"" + more + "\"]"},
                                         {"heads", "[\"a\\nb\"]"},
                                         {"heads", "\"left\""}}) {
    const auto take = parsed_with(key, value);
    EXPECT_FALSE(take) << key << " " << value;
    if (take) continue;
    EXPECT_NE(take.error().message.find(key), std::string::npos) << take.error().message;
  }
}

TEST(TakeDocumentLimits, AnotherVersion_IsTheFuture) {
  const auto take = parsed_with("version", std::to_string(kTakeVersion + 1));
  ASSERT_FALSE(take);
  EXPECT_EQ(take.error().code, Errc::kFutureVersion);
}

}  // namespace
}  // namespace nodal::take

namespace nodal::firmware {
namespace {

TEST(TakeDocumentLimits, PicturesAboveWhatAReaderTakes_StartNoTake) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  TakeStage stage(disk, clock, {});
  const auto start_with = [&](int height) {
    TakeRequest::Start start;
    start.heads.push_back(HeadShape{PixelFormat::kGrey8, 8192, height});
    return stage.ask(std::move(start)).result.error();
  };
  static_assert(8192 * 8192 == take::kMaxTakePictureBytes);
  EXPECT_EQ(start_with(8192).code, Errc::kBadValue) << "only this rig's buffer is too small";
  EXPECT_EQ(start_with(8193).code, Errc::kTooLarge);
}

}  // namespace
}  // namespace nodal::firmware
