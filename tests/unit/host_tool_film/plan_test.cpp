// The plan of a film as a document: it comes back as it was, every change is another plan, and a document that lies is
// refused.
#include <gtest/gtest.h>

#include <functional>

#include "host_tool/film/film_plan.h"
#include "tests/support/rigs.h"
#include "tests/support/within_memory.h"

namespace nodal::film {
namespace {

FilmPlan small_plan() {
  FilmPlan plan;
  plan.request = {{"films", {"a.mp4", "b.mp4"}}, {"quality", 20}};
  plan.calibration = test::ring(2, 64, 48);
  plan.raymap.width = 128;
  plan.raymap.height = 64;
  plan.coding.rate = {25, 1};
  plan.coding.width = 128;
  plan.coding.height = 64;
  plan.frames = 300;
  for (const HeadCalibration& head : plan.calibration.heads) {
    PlannedHead planned{head.name, {}, {}, 0.002};
    planned.film.path = "/films/" + head.name + ".mp4";
    planned.film.width = 64;
    planned.film.height = 48;
    planned.film.format = PixelFormat::kI420;
    planned.film.decoded_format = "yuv420p";
    planned.film.time_base = {1, 90000};
    planned.film.times = {-3600};
    for (int k = 0; k < 300; ++k) planned.times.push_back(3600 * k - 1800);
    plan.heads.push_back(std::move(planned));
  }
  plan.sound = PlannedSound{"/films/cam0.mp4", "aac", 0.25, 12};
  plan.light = {{0, 240}, {{10, -20}, {-10, 20}}};
  plan.seams.push_back({1, std::vector<std::uint8_t>(256 * 128, 1)});
  return plan;
}

FilmPlan take_plan() {
  FilmPlan plan = small_plan();
  plan.calibration = {};
  plan.light = {};
  plan.heads.clear();
  plan.sound.reset();
  plan.take = PlannedTake{"takes/000001", {"cam0", "cam1"}, {}, 0.001};
  for (int k = 0; k < 300; ++k) plan.take->raymaps.push_back(k < 7 ? 3 : k + 2);
  return plan;
}

std::string id_of(const FilmPlan& plan) { return plan_of(to_text(plan)).value().id; }

TEST(FilmPlanText, WrittenAndRead_IsTheSamePlan) {
  const FilmPlan plan = small_plan();
  const auto read = plan_of(to_text(plan));
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(to_text(*read), to_text(plan));
  EXPECT_EQ(read->calibration, plan.calibration);
  EXPECT_EQ(read->coding, plan.coding);
  EXPECT_EQ(read->frames, 300u);
  EXPECT_EQ(read->heads.at(1).times, plan.heads.at(1).times);
  EXPECT_EQ(read->seams.at(0).labels, plan.seams.at(0).labels);
  EXPECT_EQ(read->id.size(), 12u);
}

TEST(FilmPlanText, OfATake_IsTheSamePlanAndEveryFieldCounts) {
  const FilmPlan plan = take_plan();
  const auto read = plan_of(to_text(plan));
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(to_text(*read), to_text(plan));
  ASSERT_TRUE(read->take);
  EXPECT_EQ(read->take->raymaps, plan.take->raymaps);
  EXPECT_EQ(read->take->heads, plan.take->heads);
  EXPECT_TRUE(read->heads.empty());
  using Change = std::function<void(FilmPlan&)>;
  const std::vector<Change> changes{
      [](FilmPlan& p) { p.take->folder = "x"; },      [](FilmPlan& p) { p.take->heads[1] = "x"; },
      [](FilmPlan& p) { p.take->raymaps[299] += 1; }, [](FilmPlan& p) { p.take->farthest_s = 0; },
      [](FilmPlan& p) { p.raymap.soft = false; },     [](FilmPlan& p) { p.raymap.fields = FieldUse::kSeparate; }};
  for (const Change& change : changes) {
    FilmPlan other = plan;
    change(other);
    EXPECT_NE(id_of(other), read->id);
  }
  const Json whole = Json::parse(to_text(plan));
  for (const auto& [field, value] : std::vector<std::pair<std::string, std::string>>{{"/take", "1"},
                                                                                     {"/take/heads", "[]"},
                                                                                     {"/take/heads/0", "1"},
                                                                                     {"/take/raymaps", "[-1,300]"},
                                                                                     {"/take/raymaps", "[1,299]"},
                                                                                     {"/take/raymaps", "[9,1,-1,299]"},
                                                                                     {"/seams/0/labels", "[2,32768]"},
                                                                                     {"/raymap/soft", "1"}}) {
    Json json = whole;
    json[Json::json_pointer(field)] = Json::parse(value);
    EXPECT_FALSE(plan_of(json.dump())) << field << " " << value;
  }
}

TEST(FilmPlanText, AnyFieldChanges_IsAnotherPlan) {
  using Change = std::function<void(FilmPlan&)>;
  const std::vector<Change> changes{[](FilmPlan& p) { p.request["quality"] = 21; },
                                    [](FilmPlan& p) { p.calibration.heads[0].center_x += 1; },
                                    [](FilmPlan& p) { p.raymap.layout = "cubemap"; },
                                    [](FilmPlan& p) { p.raymap.width = 256; },
                                    [](FilmPlan& p) { p.raymap.height = 128; },
                                    [](FilmPlan& p) { p.raymap.format = PixelFormat::kRgb24; },
                                    [](FilmPlan& p) { p.raymap.transition = Transition::kFeather; },
                                    [](FilmPlan& p) { p.raymap.seam_width_deg = 2; },
                                    [](FilmPlan& p) { p.raymap.feather = 0.25; },
                                    [](FilmPlan& p) { p.raymap.seams = SeamPlacement::kPlaced; },
                                    [](FilmPlan& p) { p.coding.codec = Codec::kH265; },
                                    [](FilmPlan& p) {
                                      p.coding.rate = {30, 1};
                                    },
                                    [](FilmPlan& p) { p.coding.quality = 3; },
                                    [](FilmPlan& p) { p.coding.preset = "slow"; },
                                    [](FilmPlan& p) { p.coding.transfer = "bt709"; },
                                    [](FilmPlan& p) { p.container = Container::kMkv; },
                                    [](FilmPlan& p) { p.heads[1].film.path = "/films/c.mp4"; },
                                    [](FilmPlan& p) { p.heads[1].film.format = PixelFormat::kRgb24; },
                                    [](FilmPlan& p) { p.heads[1].film.decoded_format = "yuvj420p"; },
                                    [](FilmPlan& p) { p.heads[1].film.coding.video_range = true; },
                                    [](FilmPlan& p) { p.heads[1].film.coding.bt709 = true; },
                                    [](FilmPlan& p) { p.heads[1].film.file_starts_s = 1; },
                                    [](FilmPlan& p) { p.heads[1].film.time_base.den = 1000; },
                                    [](FilmPlan& p) { p.heads[1].film.times = {0}; },
                                    [](FilmPlan& p) { p.heads[1].times[299] += 1; },
                                    [](FilmPlan& p) { p.heads[1].farthest_s = 0; },
                                    [](FilmPlan& p) { p.heads[1].clock.offset_s = 1; },
                                    [](FilmPlan& p) { p.heads[1].clock.ppm = 1; },
                                    [](FilmPlan& p) { p.heads[1].film.track = 1; },
                                    [](FilmPlan& p) { p.heads[1].clock.sigma_s = 1; },
                                    [](FilmPlan& p) { p.heads[1].clock.ppm_sigma = 1; },
                                    [](FilmPlan& p) { p.heads[1].clock.by = "sound"; },
                                    [](FilmPlan& p) { p.times_residual_s = 1; },
                                    [](FilmPlan& p) { p.sound.reset(); },
                                    [](FilmPlan& p) { p.sound->path = "/a"; },
                                    [](FilmPlan& p) { p.sound->codec = "mp3"; },
                                    [](FilmPlan& p) { p.sound->from_s = 0.5; },
                                    [](FilmPlan& p) { p.sound->ppm = 0; },
                                    [](FilmPlan& p) { p.light = {}; },
                                    [](FilmPlan& p) { p.light.frames[1] += 1; },
                                    [](FilmPlan& p) { p.light.stops[1][0] += 1; },
                                    [](FilmPlan& p) { p.seams[0].segment = 0; },
                                    [](FilmPlan& p) { p.seams[0].labels[7] = 0; }};
  std::vector<std::string> ids{id_of(small_plan())};
  for (const Change& change : changes) {
    FilmPlan plan = small_plan();
    change(plan);
    ids.push_back(id_of(plan));
  }
  std::ranges::sort(ids);
  EXPECT_EQ(std::ranges::adjacent_find(ids), ids.end());
}

TEST(FilmPlanText, ValuesThatAreNone_AreOneErrorWithoutMemory) {
  const Json whole = Json::parse(to_text(small_plan()));
  const std::vector<std::pair<std::string, std::string>> lies{{"/raymap/width", "0"},
                                                              {"/raymap/width", "1.5"},
                                                              {"/raymap/width", "4294967424"},
                                                              {"/raymap/width", "true"},
                                                              {"/raymap/transition", "-1"},
                                                              {"/raymap/transition", "3"},
                                                              {"/raymap/feather", "\"1\""},
                                                              {"/raymap/format", "\"none\""},
                                                              {"/coding/codec", "\"none\""},
                                                              {"/coding/rate", "[25]"},
                                                              {"/coding/rate", "[25,-1]"},
                                                              {"/coding/quality", "1e300"},
                                                              {"/container", "-1"},
                                                              {"/container", "3"},
                                                              {"/frames", "0"},
                                                              {"/frames", "-1"},
                                                              {"/frames", "299"},
                                                              {"/frames", "18446744073709551615"},
                                                              {"/heads", "{}"},
                                                              {"/heads", "[]"},
                                                              {"/heads/0", "7"},
                                                              {"/heads/0/name", "\"other\""},
                                                              {"/heads/0/width", "65"},
                                                              {"/heads/0/height", "-48"},
                                                              {"/heads/0/time_base", "[0,1]"},
                                                              {"/heads/0/time_base", "[1,0]"},
                                                              {"/heads/0/time_base/1", "9223372036854775807"},
                                                              {"/heads/0/steps", "{}"},
                                                              {"/heads/0/steps", "[1,299]"},
                                                              {"/heads/0/steps", "[1,300,1]"},
                                                              {"/heads/0/steps", "[-1,300]"},
                                                              {"/heads/0/steps", "[1,301]"},
                                                              {"/heads/0/steps", "[1152921504606846976,300]"},
                                                              {"/heads/0/steps", "[1,-1]"},
                                                              {"/seams/0/segment", "2"},
                                                              {"/seams/0/segment", "-1"},
                                                              {"/seams/0/labels", "[2,32768]"},
                                                              {"/seams/0/labels", "[257,32768]"},
                                                              {"/seams/0/labels", "[1,32769]"},
                                                              {"/light", "1"},
                                                              {"/light/frames", "[]"},
                                                              {"/light/frames", "[240,0]"},
                                                              {"/light/frames", "[0,300]"},
                                                              {"/light/stops", "[[1,2]]"},
                                                              {"/light/stops/0", "[1]"},
                                                              {"/light/stops/0/0", "9000"},
                                                              {"/calibration", "null"},
                                                              {"/sound", "1"},
                                                              {"/file", "\"nodal film plan 3\""}};
  for (const auto& [field, value] : lies) {
    Json json = whole;
    json[Json::json_pointer(field)] = Json::parse(value);
    const std::string text = json.dump();
    const auto plan = plan_of(text);
    ASSERT_FALSE(plan) << field << " " << value;
    EXPECT_EQ(plan.error().message.find('\n'), std::string::npos) << plan.error().message;
    EXPECT_TRUE(test::within_memory(64, [&] { return !plan_of(text).has_value(); })) << field << " " << value;
  }
  Json bomb = whole;
  bomb["frames"] = 1'000'000'000;
  for (auto& head : bomb["heads"]) head["steps"] = {1, 1'000'000'000};
  EXPECT_TRUE(test::within_memory(64, [&] { return !plan_of(bomb.dump()).has_value(); }));
}

TEST(FilmPlanText, DeepOrWide_IsOneError) {
  const Json whole = Json::parse(to_text(small_plan()));
  std::string heads = R"({"file":"nodal film plan 2","calibration":)" + std::string(1'000'000, '[') + "1";
  heads += std::string(1'000'000, ']') + "}";
  EXPECT_FALSE(plan_of(heads));
  std::string fields = R"({"file":"nodal film plan 2")";
  for (int k = 0; k < 200'000; ++k) fields += ",\"" + std::to_string(k) + "\":1";
  EXPECT_FALSE(plan_of(fields + "}"));
  Json many = whole;
  many["heads"] = std::vector<Json>(1'000'000, Json::object());
  const auto plan = plan_of(many.dump());
  ASSERT_FALSE(plan);
  EXPECT_NE(plan.error().message.find("heads"), std::string::npos) << plan.error().message;
  for (const std::string text : {"", "[]", "{}", "{", "null", "\xff"}) EXPECT_FALSE(plan_of(text)) << text;
}

}  // namespace
}  // namespace nodal::film
