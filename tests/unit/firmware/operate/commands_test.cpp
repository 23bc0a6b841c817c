// Commands: conversion of hosts' messages, accepted range of every type, states of a trial.
#include "firmware/operate/commands.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/calibration/trial.h"
#include "firmware/hosts/access.h"
#include "firmware/hosts/wire_commands.h"

namespace nodal::firmware {
namespace {

constexpr auto kMax64 = std::numeric_limits<std::uint64_t>::max();
constexpr auto kMax32 = std::numeric_limits<std::uint32_t>::max();
constexpr auto kMin32 = std::numeric_limits<std::int32_t>::min();

RigConfig two_heads() {
  RigConfig config;
  config.heads.resize(2);
  return config;
}

/// Whether a host may request it: as a command, and by check().
bool allowed(const wire::Request& request) {
  const RigConfig config = two_heads();
  const auto command = command_of(request, config, 7);
  return command && check(*command, config);
}

template <class Set>
bool head_set(Set set) {
  wire::Request request;
  set(*request.mutable_head_set());
  return allowed(request);
}

template <class Set>
bool exposure(Set set) {
  wire::Request request;
  set(*request.mutable_exposure());
  return allowed(request);
}

bool genlock(std::uint32_t numerator, std::uint32_t denominator, std::uint64_t pulse) {
  wire::Request request;
  request.mutable_genlock()->set_action(wire::GenlockRequest::START);
  request.mutable_genlock()->set_rate_numerator(numerator);
  request.mutable_genlock()->set_rate_denominator(denominator);
  request.mutable_genlock()->set_pulse_width_ns(pulse);
  return allowed(request);
}

TEST(Commands, OfHeads_AreAllowedToTheirLimitsAndNotBeyond) {
  for (const std::uint64_t ns : {std::uint64_t{1}, std::uint64_t{3'600'000'000'000}}) {
    EXPECT_TRUE(head_set([&](auto& set) { set.set_exposure_ns(ns); })) << ns;
  }
  for (const std::uint64_t ns :
       {std::uint64_t{0}, std::uint64_t{3'600'000'000'001}, kMax64 / 2, kMax64 / 2 + 1, kMax64}) {
    EXPECT_FALSE(head_set([&](auto& set) { set.set_exposure_ns(ns); })) << ns;
  }
  for (const std::int32_t mdb : {-60'000, 60'000}) EXPECT_TRUE(head_set([&](auto& set) { set.set_gain_mdb(mdb); }));
  for (const std::int32_t mdb : {-60'001, 60'001, kMin32}) {
    EXPECT_FALSE(head_set([&](auto& set) { set.set_gain_mdb(mdb); })) << mdb;
  }
  const auto balance = [](std::uint32_t red, std::uint32_t blue) {
    return head_set([&](auto& set) { set.set_red_q12(red), set.set_blue_q12(blue); });
  };
  EXPECT_TRUE(balance(256, 65535));
  for (const std::uint32_t bad : {0U, 255U, 65536U, 65536U + 4096U, kMax32}) {
    EXPECT_FALSE(balance(bad, 4096)) << bad;
    EXPECT_FALSE(balance(4096, bad)) << bad;
  }
  EXPECT_FALSE(head_set([](auto& set) { set.set_red_q12(4096); })) << "without blue";
  for (const std::uint32_t gamma : {0U, 100U, 8000U}) EXPECT_TRUE(head_set([&](auto& set) { set.set_gamma(gamma); }));
  for (const std::uint32_t gamma : {1U, 99U, 8001U, kMax32 / 2 + 1, kMax32}) {
    EXPECT_FALSE(head_set([&](auto& set) { set.set_gamma(gamma); })) << gamma;
  }
  EXPECT_TRUE(head_set([](auto& set) { set.add_heads(1), set.set_gain_mdb(0); }));
  for (const std::uint32_t head : {2U, 15U, 16U, 31U, 32U, kMax32}) {
    EXPECT_FALSE(head_set([&](auto& set) { set.add_heads(head), set.set_gain_mdb(0); })) << head;
  }
}

TEST(Commands, OfTheExposure_AreAllowedToTheirLimitsAndNotBeyond) {
  for (const std::uint32_t stops : {500U, 8000U})
    EXPECT_TRUE(exposure([&](auto& set) { set.set_target_below(stops); }));
  for (const std::uint32_t stops : {0U, 499U, 8001U, kMax32}) {
    EXPECT_FALSE(exposure([&](auto& set) { set.set_target_below(stops); })) << stops;
  }
  for (const std::uint32_t stops : {0U, 8000U}) EXPECT_TRUE(exposure([&](auto& set) { set.set_difference(stops); }));
  for (const std::uint32_t stops : {1U, 8000U}) EXPECT_TRUE(exposure([&](auto& set) { set.set_ramp(stops); }));
  EXPECT_FALSE(exposure([](auto& set) { set.set_ramp(0); }));
  for (const std::uint32_t stops : {8001U, kMax32 / 1024, kMax32 / 1024 + 1, kMax32}) {
    EXPECT_FALSE(exposure([&](auto& set) { set.set_difference(stops); })) << stops;
    EXPECT_FALSE(exposure([&](auto& set) { set.set_ramp(stops); })) << stops;
  }
  for (const std::uint64_t ns : {1000ULL, 10'000'000'000ULL}) {
    EXPECT_TRUE(exposure([&](auto& set) { set.set_longest_ns(ns); })) << ns;
  }
  for (const std::uint64_t ns : {0ULL, 999ULL, 10'000'000'001ULL, 1ULL << 63, ~0ULL}) {
    EXPECT_FALSE(exposure([&](auto& set) { set.set_longest_ns(ns); })) << ns;
  }
  EXPECT_FALSE(exposure([](auto& set) { set.set_highest_gain_mdb(kMin32); }));
  for (const std::int32_t head : {-1, 0, 1}) EXPECT_TRUE(exposure([&](auto& set) { set.set_anchor(head); }));
  for (const std::int32_t head : {-2, 2, 16, kMin32, -(kMin32 + 1)}) {
    EXPECT_FALSE(exposure([&](auto& set) { set.set_anchor(head); })) << head;
  }
  EXPECT_FALSE(exposure([](auto& set) { set.set_program("automatic"); }));
}

TEST(Commands, OfTheGenlock_ArePulsesShorterThanAFrameAtRatesThatAreAllowed) {
  EXPECT_TRUE(genlock(0, 0, 0)) << "as rig.toml says";
  EXPECT_TRUE(genlock(25, 1, 39'999'999));
  for (const std::uint64_t pulse : {std::uint64_t{40'000'000}, kMax64 / 2 + 1, kMax64}) {
    EXPECT_FALSE(genlock(25, 1, pulse)) << pulse;
  }
  EXPECT_FALSE(genlock(1, 0, 0));
  EXPECT_FALSE(genlock(0, 1, 0));
  EXPECT_FALSE(genlock(kMax32, kMax32 - 1, 0)) << "terms over a million";
  EXPECT_TRUE(genlock(kMax32, kMax32, 0)) << "it is 1/1";
}

TEST(Commands, OfTakes_AreRefusedByARigWithoutAFolderForThem_WithTheLinesThatAreMissing) {
  RigConfig config = two_heads();
  const Command start = TakeCommand(TakeRequest::Start{});
  const Status refused = check(start, config);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("[takes]"), std::string::npos) << refused.error().message;
  EXPECT_NE(refused.error().message.find("folder = \"takes\""), std::string::npos) << refused.error().message;
  config.takes.emplace();
  EXPECT_TRUE(check(start, config));
}

TEST(Commands, EveryRequestThatAStageCarriesOut_IsACommandOfThatStageUnderItsOwnName) {
  std::vector<wire::Request> all(16);
  all[0].mutable_head_set();
  all[1].mutable_exposure()->set_locked(true);
  all[2].mutable_genlock()->set_action(wire::GenlockRequest::STOP);
  all[3].mutable_calibration_list();
  all[4].mutable_calibration_get();
  all[5].mutable_calibration_use();
  all[6].mutable_trial_end();
  all[7].mutable_calibration_rollback();
  all[8].mutable_take_start();
  all[9].mutable_take_stop();
  all[10].mutable_take_mark();
  all[11].mutable_take_list();
  all[12].mutable_take_delete();
  all[13].mutable_take_protect();
  all[14].mutable_disk_test();
  all[15].mutable_disk_eject();
  std::set<std::string_view> tried{"upload_commit"};  // below, since its document is not in the request
  for (const wire::Request& request : all) tried.insert(kind_of(request).name);
  for (const RequestKind& kind : request_kinds()) {
    EXPECT_TRUE(!kind.command || tried.contains(kind.name)) << kind.name;
  }
  for (const wire::Request& request : all) {
    const auto command = command_of(request, two_heads(), 7);
    ASSERT_TRUE(command) << kind_of(request).name;
    ASSERT_NE(command_kind(request), nullptr) << kind_of(request).name;
    EXPECT_EQ(command_kind(request)->name, kind_of(request).name);
    EXPECT_EQ(kind_of(*command).name, kind_of(request).name);
    EXPECT_EQ(kind_of(*command).changes, changes_rig(request)) << kind_of(request).name;
    EXPECT_EQ(kind_of(*command).important, is_important(request)) << kind_of(request).name;
    EXPECT_EQ(kind_of(*command).stage, command_kind(request)->stage) << kind_of(request).name;
    EXPECT_EQ(command->index(), static_cast<std::size_t>(kind_of(*command).stage)) << kind_of(request).name;
  }
  const Command install(CalibrationCommand(CalibrationRequest::Install{"", Duration::seconds(1), ""}));
  EXPECT_EQ(kind_of(install).name, "upload_commit");
  EXPECT_TRUE(check(install, two_heads()));
  for (const Duration trial :
       {Duration::milliseconds(999), Duration::seconds(24 * 3600 + 1), Duration::milliseconds(-1)}) {
    EXPECT_FALSE(check(Command(CalibrationCommand(CalibrationRequest::Install{"", trial, ""})), two_heads()));
  }
}

class CalibrationTrialTest : public testing::Test {
 protected:
  void prepare() { trial.prepare(Calibration{}, std::nullopt, before, Duration::seconds(60)); }

  sets::BlendSetup before{std::make_shared<sets::BlendPlan>(), nullptr};
  Instant start = Instant::from_ns(1'000'000'000);
  CalibrationTrial trial;
};

TEST_F(CalibrationTrialTest, ItsTimeBeginsWhenItRuns) {
  prepare();
  EXPECT_FALSE(trial.overdue(start + Duration::seconds(1000))) << "its table is still compiled";
  trial.run(start);
  EXPECT_EQ(trial.report().until, start + Duration::seconds(60));
  EXPECT_FALSE(trial.overdue(start + Duration::seconds(60) - Duration::nanoseconds(1)));
  EXPECT_TRUE(trial.overdue(start + Duration::seconds(60)));
}

TEST_F(CalibrationTrialTest, GoingBack_GivesWhatWasInForceAndANewTrialMayBegin) {
  prepare();
  trial.run(start);
  EXPECT_EQ(trial.go_back().plan, before.plan);
  EXPECT_EQ(trial.state(), CalibrationTrial::State::kNone);
  prepare();
  trial.give_up();
  EXPECT_EQ(before.plan.use_count(), 1) << "nothing of an ended trial is kept in memory";
  prepare();
  trial.run(start);
  trial.keep();
  EXPECT_EQ(before.plan.use_count(), 1);
  EXPECT_FALSE(trial.overdue(start + Duration::seconds(1000)));
}

using CalibrationTrialDeathTest = CalibrationTrialTest;

TEST_F(CalibrationTrialDeathTest, ACallInAnotherState_IsAMistakeOfTheProgram) {
  EXPECT_DEATH(trial.run(start), "");
  EXPECT_DEATH((void)trial.go_back(), "");
  EXPECT_DEATH((void)trial.report(), "");
  prepare();
  EXPECT_DEATH(prepare(), "");
  EXPECT_DEATH(trial.keep(), "");
}

}  // namespace
}  // namespace nodal::firmware
