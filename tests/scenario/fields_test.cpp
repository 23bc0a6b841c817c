// Interlaced heads that see a moving or a still bar: the positions of its edges in the raymaps are compared with the
// exact positions at the time in the raymap's header. With NODAL_PICTURES=FOLDER the raymaps are saved there.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "protocol/base/angles.h"
#include "tests/reference/png_file.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

constexpr int kWidth = 1024;
constexpr int kHeight = 512;
constexpr Duration kHalfPeriod = Duration::nanoseconds(16'683'333);
constexpr Duration kTurn = Duration::seconds(2);  ///< 8.5 px of the raymap between fields
constexpr double kHalfBar = 0.1;
constexpr double kLevel = (0.2 + 0.8) / 2 * 255;  ///< half way between the room's and the bar's level

/// Four heads of 100 degrees around the horizon.
Calibration ring() {
  Calibration calibration = small_calibration("ring");
  calibration.heads.resize(4);
  for (HeadCalibration& head : calibration.heads) {
    head.width = 240;
    head.height = 160;
    head.center_x = 120;
    head.center_y = 80;
    head.lens = RectilinearLens{{100.7}};
    head.region = {0, 0, 240, 160, std::nullopt};
    head.vignetting = {120, 80, 120, {}};
  }
  return calibration;
}

StandOptions before(hal::sim::ScenePtr scene, FieldUse use, Fields fields = Fields::kBottomFirst) {
  StandOptions options;
  options.truth = ring();
  options.config.heads.resize(4);
  for (firmware::HeadConfig& head : options.config.heads) head.fields = fields;
  options.config.raymap.width = kWidth;
  options.config.raymap.height = kHeight;
  options.config.raymap.fields = use;
  options.world.scene = std::move(scene);
  options.world.head.fields = fields;
  return options;
}

/// An upright bar that rotates to the right.
hal::sim::ScenePtr turning_bar() { return hal::sim::bar_scene({0, 1, 0}, kTurn, kHalfBar); }

std::vector<Pulled> pull(Stand& stand, std::uint64_t count) {
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const StreamId stream = host.pull(false, count, true);
  EXPECT_NE(stream, 0u) << host.refusal.message();
  EXPECT_TRUE(stand.run_until([&] { return host.closed.count(stream) != 0; }));
  return host.pulled[stream];
}

/// The column of the rotating bar's edge; `side` is 1 for the leading edge, -1 for the other.
double edge_at(std::uint64_t time_ns, int side) {
  const double turned = static_cast<double>(time_ns) / static_cast<double>(kTurn.ns());
  return (turned - std::floor(turned) + side * kHalfBar / (2 * kPi) + 0.5) * kWidth;
}

int level(const Pulled& raymap, int x, int y) {
  const int column = (x % kWidth + kWidth) % kWidth;
  return raymap.body[static_cast<std::size_t>((y * kWidth + column) * 3 + 1)];
}

/// Distance of `expected` from the nearest position on a row or column where the level crosses the bar's edge; `at`
/// gives the level of sample i, whose centre is at i + 1/2.
template <class At>
double off(At at, double expected, bool falls) {
  constexpr int kReach = 20;
  double nearest = kReach;
  for (int i = static_cast<int>(std::floor(expected)) - kReach; i < expected + kReach; ++i) {
    const double a = at(i);
    const double b = at(i + 1);
    if (falls ? a < kLevel || b >= kLevel : a >= kLevel || b < kLevel) continue;
    const double here = i + 0.5 + (kLevel - a) / (b - a) - expected;
    if (std::abs(here) < std::abs(nearest)) nearest = here;
  }
  return nearest;
}

double off_on_row(const Pulled& raymap, int y, double expected, bool falls) {
  return off([&](int x) { return level(raymap, x, y); }, expected, falls);
}

/// Rows that every head's picture covers completely: 25 degrees up and down.
constexpr int kFirstRow = kHeight / 2 - 71;
constexpr int kLastRow = kHeight / 2 + 71;

void leave_picture(const Pulled& raymap, const std::string& name) {
  const char* folder = std::getenv("NODAL_PICTURES");
  if (!folder) return;
  test::Picture picture(PixelFormat::kRgb24, kWidth, kHeight);
  picture.bytes = raymap.body;
  ASSERT_TRUE(test::write_png(std::filesystem::path(folder) / name, picture));
}

TEST(Fields, SeparateBeforeAMovingBar_EachRaymapHasItsEdgesWhereTheyWereAtItsFieldsTime) {
  for (const Fields fields : {Fields::kBottomFirst, Fields::kTopFirst}) {
    Stand stand(before(turning_bar(), FieldUse::kSeparate, fields));
    const std::vector<Pulled> raymaps = pull(stand, 32);
    ASSERT_EQ(raymaps.size(), 32u);
    double worst = 0;
    for (std::size_t i = 0; i < raymaps.size(); ++i) {
      const wire::RaymapHeader& header = raymaps[i].header;
      const bool second = i % 2 == 1;
      ASSERT_EQ(header.field(), second ? 1u : 0u);
      ASSERT_EQ(header.parity(), (fields == Fields::kTopFirst) == second ? "bottom" : "top");
      ASSERT_EQ(header.heads_mask(), 15u);
      if (second) {
        ASSERT_EQ(header.set(), raymaps[i - 1].header.set());
        ASSERT_EQ(header.calibration_id(), raymaps[i - 1].header.calibration_id());
        ASSERT_EQ(header.mid_exposure_ns() - raymaps[i - 1].header.mid_exposure_ns(),
                  static_cast<std::uint64_t>(kHalfPeriod.ns()));
      } else if (i > 0) {
        ASSERT_EQ(header.set(), raymaps[i - 1].header.set() + 1);
      }
      for (const int side : {1, -1}) {
        const double expected = edge_at(header.mid_exposure_ns(), side);
        for (int y = kFirstRow; y <= kLastRow; ++y) {
          worst = std::max(worst, std::abs(off_on_row(raymaps[i], y, expected, side == 1)));
        }
      }
    }
    EXPECT_LE(worst, 0.25);
    RecordProperty("worst_px", std::to_string(worst));
    leave_picture(raymaps[10], "field-first.png");
    leave_picture(raymaps[11], "field-second.png");
  }
}

TEST(Fields, WovenBeforeAMovingBar_RowsShowTheEdgeOfEitherFieldInTurns) {
  Stand stand(before(turning_bar(), FieldUse::kWeave));
  const std::vector<Pulled> raymaps = pull(stand, 8);
  ASSERT_EQ(raymaps.size(), 8u);
  int rows = 0, of_first = 0, of_second = 0, jumps = 0;
  for (const Pulled& raymap : raymaps) {
    EXPECT_FALSE(raymap.header.has_field());
    const double first = edge_at(raymap.header.mid_exposure_ns(), 1);
    const double second = edge_at(raymap.header.mid_exposure_ns() + static_cast<std::uint64_t>(kHalfPeriod.ns()), 1);
    double before = 0;
    for (int y = kFirstRow; y <= kLastRow; ++y, ++rows) {
      const double from_first = off_on_row(raymap, y, first, true);
      const double from_second = off_on_row(raymap, y, second, true);
      if (std::abs(from_first) <= 1) ++of_first;
      if (std::abs(from_second) <= 1) ++of_second;
      const bool is_first = std::abs(from_first) < std::abs(from_second);
      if (y > kFirstRow && is_first != (before != 0)) ++jumps;
      before = is_first ? 1 : 0;
    }
  }
  // A frame's line is 1.6 rows here: the interlacing comb has teeth of that width, 8.5 px long.
  EXPECT_GT(of_first, rows / 3);
  EXPECT_GT(of_second, rows / 3);
  EXPECT_GT(jumps, rows / 3);
  leave_picture(raymaps[5], "weave.png");
}

/// A horizontal bar: about an axis through the heads' sides, tilted by 3 degrees, not moving.
TEST(Fields, SeparateBeforeAStillEdge_BothFieldsHaveItWhereItIs) {
  const double tilt = 3 * kPi / 180;
  const hal::sim::Direction axis{std::cos(tilt), std::sin(tilt), 0};
  Stand stand(before(hal::sim::bar_scene(axis, Duration::seconds(1'000'000'000), kHalfBar), FieldUse::kSeparate));
  const std::vector<Pulled> raymaps = pull(stand, 2);
  ASSERT_EQ(raymaps.size(), 2u);
  for (const Pulled& raymap : raymaps) {
    for (const int side : {1, -1}) {  // the bar's middle, z, rotated by kHalfBar about the axis
      const double up = side * std::sin(kHalfBar);
      const double normal[3] = {-std::sin(tilt) * std::cos(kHalfBar), std::cos(tilt) * std::cos(kHalfBar), up};
      double sum = 0;
      int columns = 0;
      for (int x = kWidth / 2 - 71; x <= kWidth / 2 + 71; ++x, ++columns) {  // 25 degrees to both sides of forward
        const double theta = (x + 0.5 - kWidth / 2) * 2 * kPi / kWidth;
        const double phi = std::atan(-(normal[0] * std::sin(theta) + normal[2] * std::cos(theta)) / normal[1]);
        const double expected = (phi / kPi + 0.5) * kHeight;
        sum += off([&](int y) { return level(raymap, x, y); }, expected, side == -1);
      }
      // A field has one line per 3.2 rows: a single column's edge may be off by half of that, but not the mean of many.
      // The other field's lines are 1.6 rows away.
      EXPECT_NEAR(sum / columns, 0, 0.25) << raymap.header.parity() << " field, side " << side;
    }
  }
}

TEST(Fields, SeparateForAWhile_StatusTellsOfTwiceTheRaymapsAndNoSetIsLost) {
  Stand stand(before(turning_bar(), FieldUse::kSeparate));
  TestHost& host = stand.bring_up();
  stand.run(Duration::seconds(4));
  const wire::RigStatus status = host.status();
  EXPECT_EQ(status.state(), "running") << status.problem();
  EXPECT_EQ(status.raymaps_a_set(), 2u);
  EXPECT_EQ(status.rate_wanted_millihertz(), 59'940u);
  EXPECT_NEAR(status.rate_millihertz(), 59'940, 600);
  std::uint64_t lost = 0;
  for (const wire::Count& count : status.set_losses()) lost += count.frames();
  EXPECT_EQ(status.sets(), status.raymaps() / 2 + lost);
}

TEST(Fields, EvidenceOfSeparateFields_IsToldOnceASet) {
  Stand stand(before(turning_bar(), FieldUse::kSeparate));
  TestHost& host = stand.bring_up();
  wire::Request request;
  request.mutable_pull()->set_coding(wire::PullRequest::EVIDENCE);
  request.mutable_pull()->set_count(6);
  request.mutable_pull()->set_lossless(true);
  const StreamId stream = host.ask(request).pull().stream();
  ASSERT_TRUE(stand.run_until([&] { return host.closed.count(stream) != 0; }));
  const std::vector<Pulled>& received = host.pulled[stream];
  ASSERT_EQ(received.size(), 6u);
  for (std::size_t i = 1; i < received.size(); ++i)
    EXPECT_EQ(received[i].header.set(), received[i - 1].header.set() + 1);
}

TEST(Fields, ACalibrationComesWhileFieldsAreBlended_NoSetIsMadeByTwo) {
  Stand stand(before(turning_bar(), FieldUse::kSeparate));
  TestHost& host = stand.bring_up();
  const StreamId stream = host.pull(false, 0, true);
  Calibration other = ring();
  other.name = "another";
  stand.run(Duration::milliseconds(200));
  EXPECT_TRUE(host.upload(to_json(other)).has_done());
  stand.run(Duration::milliseconds(200));
  const std::vector<Pulled>& raymaps = host.pulled[stream];
  std::size_t swaps = 0;
  for (std::size_t i = 1; i < raymaps.size(); ++i) {
    const bool same = raymaps[i].header.calibration_id() == raymaps[i - 1].header.calibration_id();
    swaps += same ? 0 : 1;
    EXPECT_EQ(raymaps[i].header.set() != raymaps[i - 1].header.set(), raymaps[i].header.field() == 0);
    if (raymaps[i].header.field() == 1) {
      EXPECT_TRUE(same) << "set " << raymaps[i].header.set();
    }
  }
  EXPECT_EQ(swaps, 1u);
}

TEST(Fields, OneFieldOfAFrameIsLost_TheOtherHeadsMakeBothRaymapsOfItsSet) {
  Stand stand(before(turning_bar(), FieldUse::kSeparate));
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const StreamId stream = host.pull(false, 0, true);
  stand.run(Duration::milliseconds(200));
  stand.world.head(2).lose_next_field();
  stand.run(Duration::milliseconds(300));
  EXPECT_EQ(stand.losses(2, firmware::LossReason::kFieldParity), 1u);
  std::size_t without = 0;
  for (const Pulled& raymap : host.pulled[stream]) without += raymap.header.heads_mask() == 0b1011u;
  EXPECT_EQ(without, 2u);
}

}  // namespace
}  // namespace nodal::scenario
