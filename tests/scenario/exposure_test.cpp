// Exposure programs in a closed loop: simulated heads with changing light, metered with the calibration in force.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

constexpr Stops kTenth = 141;  ///< log2(1.1): 10 % of light

/// A sky whose light decreases to a third from the zenith down, and a sun of 8 degrees.
class SunAndSky final : public hal::sim::Scene {
 public:
  hal::sim::Light light(const hal::sim::Direction& from, double /*footprint_rad*/) const override {
    const double sky = 0.3 * (1 - 0.5 * from.y);
    const double beside = std::acos(std::clamp(from.x * 0.8 - from.y * 0.6, -1.0, 1.0));
    const auto light = static_cast<float>(beside < 0.07 ? 400.0 : sky);
    return {light, light, light};
  }
};

/// A room that is four stops brighter to the right.
class BrightToTheRight final : public hal::sim::Scene {
 public:
  hal::sim::Light light(const hal::sim::Direction& from, double /*footprint_rad*/) const override {
    const float light = from.x > 0.5 ? 3.2F : 0.2F;
    return {light, light, light};
  }
};

StandOptions exposed(firmware::ExposureProgram program, int latency = 2) {
  StandOptions options;
  options.config.exposure.program = program;
  options.world.scene = std::make_shared<SunAndSky>();
  options.world.head.limits.control_latency_frames = latency;
  return options;
}

/// Exposures in effect, by set number.
using History = std::map<std::uint64_t, std::array<Stops, kHeads>>;

History watch(Stand& stand, int sets) {
  History history;
  const std::uint64_t until = stand.capture().sets + static_cast<std::uint64_t>(sets);
  while (stand.capture().sets < until) {
    stand.run(Duration::milliseconds(5));
    const blend::SphereLight& seen = stand.capture().exposure.seen;
    if (stand.capture().exposure.sets == 0) continue;
    for (std::size_t h = 0; h < kHeads; ++h) history[seen.set][h] = seen.heads[h].exposure;
  }
  return history;
}

struct Settling {
  int sets = 0;          ///< sets until every head stays within 10 %
  Stops overshoot = 0;   ///< the largest overshoot of the final exposure, over all heads
  Stops most_a_set = 0;  ///< largest change between two sets
};

Settling settling(const History& history) {
  const auto& start = history.begin()->second;
  const auto& end = history.rbegin()->second;
  Settling result;
  const std::array<Stops, kHeads>* before = &start;
  for (const auto& [set, exposures] : history) {
    for (std::size_t h = 0; h < kHeads; ++h) {
      const Stops past = end[h] < start[h] ? end[h] - exposures[h] : exposures[h] - end[h];
      result.overshoot = std::max(result.overshoot, past);
      result.most_a_set = std::max(result.most_a_set, std::abs(exposures[h] - (*before)[h]));
      if (std::abs(exposures[h] - end[h]) > kTenth) result.sets = static_cast<int>(set - history.begin()->first);
    }
    before = &exposures;
  }
  return result;
}

void set_light(Stand& stand, double factor) {
  for (int h = 0; h < kHeads; ++h) stand.world.head(h).set_light(factor);
}

struct Change {
  const char* name;
  double before, after;
  double stops;  ///< the necessary change of the exposures
};
class LightChanges : public testing::TestWithParam<std::tuple<Change, firmware::ExposureProgram>> {};

TEST_P(LightChanges, SettlesWithinTenFramesAndNeverATenthTooFar) {
  const auto& [change, program] = GetParam();
  Stand stand(exposed(program));
  stand.bring_up();
  set_light(stand, change.before);
  watch(stand, 60);
  ASSERT_TRUE(stand.capture().exposure.settled);
  set_light(stand, change.after);
  const History history = watch(stand, 60);
  const Settling result = settling(history);
  RecordProperty("sets", result.sets);
  RecordProperty("overshoot_1024ths", result.overshoot);
  std::printf("%s: settled in %d frames, overshoot %.1f %%\n", change.name, result.sets,
              100 * (std::exp2(result.overshoot / 1024.0) - 1));
  EXPECT_LE(result.sets, 10);
  EXPECT_LE(result.overshoot, kTenth);
  EXPECT_TRUE(stand.capture().exposure.settled);
  for (std::size_t h = 0; h < kHeads; ++h) {
    const double moved = (history.rbegin()->second[h] - history.begin()->second[h]) / 1024.0;
    EXPECT_NEAR(moved, change.stops, 0.3) << "head " << h;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Changes, LightChanges,
    testing::Combine(testing::Values(Change{"a lamp goes on, four stops", 1, 16, -4}, Change{"it goes off", 16, 1, 4},
                                     Change{"into the sun, five stops", 1, 32, -5},
                                     Change{"into the dark, five stops", 2, 1.0 / 16, 5},
                                     Change{"a cloud, half a stop", 1, 0.7071, 0.5}),
                     testing::Values(firmware::ExposureProgram::kJoint, firmware::ExposureProgram::kEach)));

class AnyLatency : public testing::TestWithParam<int> {};

TEST_P(AnyLatency, TheGoalIsNeverPassedHoweverLateHeadsFollow) {
  Stand stand(exposed(firmware::ExposureProgram::kJoint, GetParam()));
  stand.bring_up();
  watch(stand, 60);
  for (const double factor : {16.0, 1.0}) {
    set_light(stand, factor);
    EXPECT_LE(settling(watch(stand, 60)).overshoot, kTenth);
    EXPECT_TRUE(stand.capture().exposure.settled);
  }
}

INSTANTIATE_TEST_SUITE_P(Latencies, AnyLatency, testing::Values(0, 1, 2, 3, 4));

TEST(Exposure, Joint_NoNeighboursAreFurtherApartThanAllowedAndTheAnchorSeesWhatItWouldAlone) {
  StandOptions options = exposed(firmware::ExposureProgram::kJoint);
  options.config.exposure.difference = kStop / 2;
  options.config.exposure.anchor = HeadIndex{2};
  options.world.scene = std::make_shared<BrightToTheRight>();
  Stand stand(std::move(options));
  stand.bring_up();
  const History history = watch(stand, 90);
  const auto& end = history.rbegin()->second;
  const blend::SphereLight& seen = stand.capture().exposure.seen;
  for (std::size_t i = 0; i < kHeads; ++i) {
    for (std::size_t j = 0; j < kHeads; ++j) {
      if ((seen.heads[i].overlaps >> j & 1) == 0) continue;
      EXPECT_LE(std::abs(end[i] - end[j]), kStop / 2 + 40);
    }
  }
  EXPECT_LT(end[1], end[2] - kStop / 3) << "the bright one is held back as far as it may be";
  EXPECT_NEAR(seen.heads[2].light + end[2], -5 * kStop / 2, 70);
}

TEST(Exposure, Ramp_NoSetIsExposedFurtherFromTheOneBefore) {
  StandOptions options = exposed(firmware::ExposureProgram::kJoint);
  options.config.exposure.ramp = kStop / 50;
  Stand stand(std::move(options));
  stand.bring_up();
  watch(stand, 150);
  set_light(stand, 4);
  const History history = watch(stand, 150);
  // Two sets may close within one exposure of a free-running head; gain compensates the rounding to a microsecond.
  EXPECT_LE(settling(history).most_a_set, 2 * kStop / 50 + 6);
  EXPECT_NEAR(history.rbegin()->second[0] - history.begin()->second[0], -2 * kStop, 200);
}

TEST(Exposure, LockedOrManual_ExposuresStayWhateverTheLightDoes) {
  Stand stand(exposed(firmware::ExposureProgram::kJoint));
  TestHost& host = stand.bring_up();
  watch(stand, 60);
  wire::Request request;
  request.mutable_exposure()->set_locked(true);
  wire::Reply reply = host.ask(request);
  ASSERT_TRUE(reply.has_exposure()) << reply.error().message();
  EXPECT_TRUE(reply.exposure().settings().locked());
  EXPECT_EQ(reply.exposure().settings().program(), "joint");
  watch(stand, 6);
  set_light(stand, 8);
  const Settling locked = settling(watch(stand, 30));
  EXPECT_EQ(locked.most_a_set, 0);

  request.mutable_exposure()->set_locked(false);
  host.ask(request);
  EXPECT_GT(settling(watch(stand, 30)).most_a_set, kStop / 4);
}

TEST(Exposure, AProgramRuns_SettingAShutterByHandIsRefusedAndSaysWhatToDo) {
  Stand stand(exposed(firmware::ExposureProgram::kEach));
  TestHost& host = stand.bring_up();
  wire::Request set;
  set.mutable_head_set()->set_exposure_ns(4'000'000);
  wire::Reply reply = host.ask(set);
  ASSERT_TRUE(reply.has_error());
  EXPECT_NE(reply.error().message().find("nodal exposure set manual"), std::string::npos);
  wire::Request manual;
  manual.mutable_exposure()->set_program("manual");
  ASSERT_TRUE(host.ask(manual).has_exposure());
  EXPECT_TRUE(host.ask(set).has_done());
  wire::Request wrong;
  wrong.mutable_exposure()->set_program("automagic");
  EXPECT_EQ(host.ask(wrong).error().code(), static_cast<std::uint32_t>(Errc::kBadValue));
}

TEST(Exposure, OneHeadIsStuck_TheOthersSettleAllTheSame) {
  Stand stand(exposed(firmware::ExposureProgram::kEach));
  TestHost& host = stand.bring_up();
  watch(stand, 60);
  stand.world.head(3).set_stuck(true);
  set_light(stand, 8);
  const History history = watch(stand, 60);
  for (std::size_t h = 0; h < kHeads; ++h) {
    const Stops moved = history.rbegin()->second[h] - history.begin()->second[h];
    EXPECT_NEAR(moved, h == 3 ? 0 : -3 * kStop, 200) << "head " << h;
  }
  EXPECT_NE(host.heads().heads(3).problem(), "");
}

/// Compares every pixel of a raymap with the light of its ray at the exposure that all heads are equalized to: the
/// renderer's scene computed directly, without the stitcher's code.
struct Against {
  double worst = 0;      ///< levels of 255
  double mean = 0;       ///< mean absolute error
  double worst_row = 0;  ///< largest signed mean of a row or column block: where a seam would appear
};

Against against_light(const Pulled& raymap, const hal::sim::Scene& scene, const Response& response, double lift) {
  Against result;
  double sum = 0;
  int count = 0;
  for (int by = 0; by < 8; ++by) {
    for (int bx = 0; bx < 16; ++bx) {
      double block = 0;
      for (int y = 8 * by; y < 8 * by + 8; ++y) {
        for (int x = 8 * bx; x < 8 * bx + 8; ++x) {
          const double theta = 2 * M_PI * ((x + 0.5) / 128 - 0.5);
          const double phi = M_PI * ((y + 0.5) / 64 - 0.5);
          const hal::sim::Direction ray{std::sin(theta) * std::cos(phi), std::sin(phi),
                                        std::cos(theta) * std::cos(phi)};
          const double light = std::min(1.0, scene.light(ray, 0).r * lift);
          const double expected = 255 * (response.curve == Response::Curve::kGamma ? std::pow(light, 1 / response.gamma)
                                         : light <= 0.0031308                      ? 12.92 * light
                                                              : 1.055 * std::pow(light, 1 / 2.4) - 0.055);
          const double off = raymap.body[static_cast<std::size_t>(3 * (128 * y + x) + 1)] - expected;
          result.worst = std::max(result.worst, std::abs(off));
          sum += std::abs(off);
          block += off / 64;
          ++count;
        }
      }
      result.worst_row = std::max(result.worst_row, std::abs(block));
    }
  }
  result.mean = sum / count;
  return result;
}

/// Light that decreases smoothly from the zenith down, so that every step is the stitcher's error.
class Gradient final : public hal::sim::Scene {
 public:
  hal::sim::Light light(const hal::sim::Direction& from, double /*footprint_rad*/) const override {
    const auto light = static_cast<float>(0.12 * (1 - 0.6 * from.y));
    return {light, light, light};
  }
};

class FourStopsApart : public testing::TestWithParam<Response::Curve> {};

TEST_P(FourStopsApart, HeadsMeetWithoutASeamAndThePictureIsTheLight) {
  StandOptions options;
  options.world.scene = std::make_shared<Gradient>();
  for (auto& head : options.truth.heads) {
    head.response.curve = GetParam();
    head.response.gamma = 2.2;
  }
  const Response response = options.truth.heads[0].response;
  const auto scene = options.world.scene;
  Stand stand(std::move(options));
  TestHost& host = stand.connect();
  ASSERT_TRUE(host.upload(to_json(stand.world.truth())).has_done());
  const auto pull = [&] {
    stand.run(Duration::milliseconds(400));
    const StreamId stream = host.pull(false, 1);
    EXPECT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }));
    return host.pulled[stream].at(0);
  };
  const Against alike = against_light(pull(), *scene, response, 1);
  // Two stops less and two stops more than 5 ms, alternately by shutter and gain: 1.25 ms and 20 ms.
  for (std::uint32_t h = 0; h < kHeads; ++h) {
    wire::Request request;
    request.mutable_head_set()->add_heads(h);
    request.mutable_head_set()->set_exposure_ns(h % 2 == 0 ? 1'250'000 : h == 1 ? 20'000'000 : 10'000'000);
    request.mutable_head_set()->set_gain_mdb(h % 2 == 0 || h == 1 ? 0 : 6021);
    ASSERT_TRUE(host.ask(request).has_done());
  }
  const Pulled raymap = pull();
  ASSERT_EQ(raymap.header.exposure_ns_size(), kHeads);
  EXPECT_EQ(raymap.header.exposure_ns(0), 1'250'000U) << "a raymap tells what was in effect for it";
  EXPECT_EQ(raymap.header.exposure_ns(1), 20'000'000U);
  EXPECT_EQ(raymap.header.gain_mdb(1), 0);
  EXPECT_NEAR(raymap.header.gain_mdb(3), 6021, 1);
  const Against apart = against_light(raymap, *scene, response, 0.5);
  std::printf("alike: worst %.2f, mean %.2f, worst block %.2f; four stops apart: worst %.2f, mean %.2f, block %.2f\n",
              alike.worst, alike.mean, alike.worst_row, apart.worst, apart.mean, apart.worst_row);
  EXPECT_LT(alike.worst_row, 0.6);
  EXPECT_LT(apart.worst_row, 0.5) << "two blocks are then never more than a level apart";
  EXPECT_LT(apart.worst, 2.5);
}

INSTANTIATE_TEST_SUITE_P(Responses, FourStopsApart, testing::Values(Response::Curve::kGamma, Response::Curve::kSrgb));

}  // namespace
}  // namespace nodal::scenario
