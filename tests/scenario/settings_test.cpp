// Hosts' settings are restored after a restart without a host.
#include <gtest/gtest.h>
#include <malloc.h>

#include "firmware/operate/settings.h"
#include "firmware/storage/settings_store.h"
#include "firmware/storage/start_count.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

wire::Request exposure_of(std::initializer_list<std::uint32_t> heads, std::uint64_t ns) {
  wire::Request request;
  for (const std::uint32_t head : heads) request.mutable_head_set()->add_heads(head);
  request.mutable_head_set()->set_exposure_ns(ns);
  return request;
}

wire::Request gain_of_all(std::int32_t mdb) {
  wire::Request request;
  request.mutable_head_set()->set_gain_mdb(mdb);
  return request;
}

/// Makes some settings, locks, and loses power a moment later; returns the disk after that.
std::unique_ptr<hal::sim::SimDisk> set_and_lose_power(const StandOptions& options) {
  Stand stand(options);
  TestHost& host = stand.bring_up();
  EXPECT_TRUE(host.ask(exposure_of({}, 4'000'000)).has_done());
  EXPECT_TRUE(host.ask(exposure_of({1, 4}, 2'000'000)).has_done());
  EXPECT_TRUE(host.ask(gain_of_all(3000)).has_done());
  stand.lock(host);
  stand.run(Duration::seconds(2));
  return stand.disk->after_power_loss(3);
}

void write_settings(hal::sim::SimDisk& disk, const std::vector<std::uint8_t>& bytes) {
  disk.put(firmware::kSettingsFile, bytes);
}

TEST(Settings, AfterPowerLossWithoutAHost_AreAsHostsLeftThem) {
  const StandOptions options;
  Stand stand(options, set_and_lose_power(options));
  ASSERT_TRUE(stand.run_until([&] { return stand.state() == "running"; }));
  ASSERT_TRUE(stand.run_until([&] { return stand.capture().genlock.state == firmware::GenlockState::kLocked; }));
  stand.run(Duration::seconds(1));
  const firmware::CaptureReport& capture = stand.capture();
  for (std::size_t i = 0; i < capture.heads.size(); ++i) {
    const bool both = i == 1 || i == 4;
    EXPECT_EQ(capture.heads[i].in_effect.exposure.duration(), Duration::milliseconds(both ? 2 : 4)) << i;
    EXPECT_EQ(capture.heads[i].in_effect.gain, Gain::millidecibels(3000)) << i;
  }
}

TEST(Settings, RigTomlChangedMeanwhile_HasTheNewestWord) {
  StandOptions options;
  auto disk = set_and_lose_power(options);
  options.config.text_id[0] ^= 1;
  Stand stand(options, std::move(disk));
  ASSERT_TRUE(stand.run_until([&] { return stand.state() == "running"; }));
  stand.run(Duration::seconds(1));
  EXPECT_EQ(stand.capture().genlock.state, firmware::GenlockState::kOff);
  EXPECT_NE(stand.capture().heads[0].in_effect.gain, Gain::millidecibels(3000));
}

TEST(Settings, TheDiskIsSlowerThanTheStart_TheyAreInEffectOnceTheyHaveBeenRead) {
  const StandOptions options;
  Stand stand(options, set_and_lose_power(options));
  for (int k = 0; k < 3; ++k) stand.rig->step_control();
  stand.run(Duration::seconds(2));
  EXPECT_EQ(stand.capture().heads[0].in_effect.gain, Gain::millidecibels(3000));
  EXPECT_NE(stand.capture().genlock.state, firmware::GenlockState::kOff);
}

TEST(Settings, ATornFile_IsNotBelievedAndTheRigStarts) {
  const StandOptions options;
  auto disk = set_and_lose_power(options);
  auto file = disk->read(firmware::kSettingsFile, firmware::kMaxSettingsBytes).value();
  file.back() ^= 1;
  write_settings(*disk, file);
  Stand stand(options, std::move(disk));
  ASSERT_TRUE(stand.run_until([&] { return stand.state() == "degraded"; })) << "it runs, and says what it lost";
  EXPECT_NE(stand.rig->control().health().problem.find("stored settings is damaged"), std::string::npos);
  stand.run(Duration::seconds(1));
  EXPECT_EQ(stand.capture().genlock.state, firmware::GenlockState::kOff);
  EXPECT_NE(stand.capture().heads[0].in_effect.gain, Gain::millidecibels(3000));
}

/// The exposure settings after a kill and a restart from the disk at that time.
firmware::ExposureSettings settings_after_restart(Stand& stand, const StandOptions& options) {
  stand.run(Duration::seconds(2));
  Stand again(options, stand.disk->after_kill());
  again.run(Duration::seconds(2));
  return again.capture().exposure.settings;
}

// A host may send the second request before the first has taken effect.
TEST(Settings, TwoExposureRequestsAtOnce_BothAreInEffectNowAndAfterARestart) {
  const StandOptions options;
  Stand stand(options);
  TestHost& host = stand.bring_up();
  wire::Request ramp, difference;
  ramp.mutable_exposure()->set_ramp(250);
  difference.mutable_exposure()->set_difference(500);
  host.post(ramp);
  host.post(difference);
  stand.run(Duration::milliseconds(100));
  firmware::ExposureSettings wanted = options.config.exposure;
  wanted.ramp = kStop / 4;
  wanted.difference = kStop / 2;
  EXPECT_EQ(stand.capture().exposure.settings, wanted);
  EXPECT_EQ(settings_after_restart(stand, options), wanted);
}

TEST(Settings, TheProgramIsOfRigTomlAndAHostLocksIt_ItIsTheSameAndLockedAfterARestart) {
  StandOptions options;
  options.config.exposure.program = firmware::ExposureProgram::kJoint;
  Stand stand(options);
  wire::Request lock;
  lock.mutable_exposure()->set_locked(true);
  ASSERT_TRUE(stand.bring_up().ask(lock).has_exposure());
  firmware::ExposureSettings wanted = options.config.exposure;
  wanted.locked = true;
  EXPECT_EQ(stand.capture().exposure.settings, wanted);
  EXPECT_EQ(settings_after_restart(stand, options), wanted);
}

/// The bytes of a settings file with this text after the line of the rig.toml.
std::vector<std::uint8_t> settings_of(const StandOptions& options, const std::string& text) {
  const std::string file =
      firmware::Settings::with_checksum("rig_toml = \"" + to_hex(options.config.text_id) + "\"\n" + text);
  return {file.begin(), file.end()};
}

// A nodald without the check for 64-bit overflow may have stored it.
TEST(Settings, AStoredRateThatIsNotAllowed_IsToldAndNotMade) {
  const StandOptions options;
  auto disk = set_and_lose_power(options);
  write_settings(*disk, settings_of(options,
                                    "[genlock]\nrunning = true\nrate_numerator = 299700300\n"
                                    "rate_denominator = 10000000\n"));
  Stand stand(options, std::move(disk));
  ASSERT_TRUE(stand.run_until([&] { return stand.state() == "degraded"; })) << "it runs, and says what it lost";
  EXPECT_NE(stand.rig->control().health().problem.find("a rate of 299700300/10000000, which is not allowed"),
            std::string::npos)
      << stand.rig->control().health().problem;
  stand.run(Duration::seconds(65));
  EXPECT_EQ(stand.state(), "degraded");
  EXPECT_EQ(stand.capture().genlock.state, firmware::GenlockState::kOff);
}

// Each value fits its type; the request is refused when it is restored, like any command.
TEST(Settings, AStoredExposureThatIsNotAllowed_IsToldAndTheOthersAreMade) {
  const StandOptions options;
  auto disk = set_and_lose_power(options);
  write_settings(*disk, settings_of(options,
                                    "[[heads]]\nindex = 0\nexposure_ns = 9223372036854775807\n"
                                    "[[heads]]\nindex = 1\nexposure_ns = 3000000\n"));
  Stand stand(options, std::move(disk));
  std::string news;
  ASSERT_TRUE(stand.run_until([&] {
    for (const std::string& sentence : stand.rig->control().take_news()) news += sentence + "\n";
    return stand.state() == "running";
  }));
  EXPECT_NE(news.find("could not restore a stored setting: an exposure of 9223372036854775807 ns"), std::string::npos)
      << news;
  stand.run(Duration::seconds(1));
  EXPECT_EQ(stand.capture().heads[1].in_effect.exposure.duration(), Duration::milliseconds(3));
}

/// Starts with the disk, runs and is killed; returns the disk after that.
std::unique_ptr<hal::sim::SimDisk> run_and_kill(const StandOptions& options, std::unique_ptr<hal::sim::SimDisk> disk,
                                                Duration runs) {
  Stand stand(options, std::move(disk));
  stand.run(runs);
  EXPECT_EQ(stand.capture().heads[0].in_effect.gain, Gain::millidecibels(3000));
  return stand.disk->after_kill();
}

TEST(Settings, TwoStartsWithThemFail_TheThirdPutsThemAsideAndSaysSo) {
  const StandOptions options;
  auto disk = set_and_lose_power(options);
  const auto settings = disk->read(firmware::kSettingsFile, firmware::kMaxSettingsBytes).value();
  for (int i = 0; i < 2; ++i) disk = run_and_kill(options, std::move(disk), Duration::seconds(3));
  Stand third(options, std::move(disk));
  third.run(Duration::seconds(3));
  EXPECT_EQ(third.capture().genlock.state, firmware::GenlockState::kOff);
  EXPECT_NE(third.capture().heads[0].in_effect.gain, Gain::millidecibels(3000));
  EXPECT_EQ(third.state(), "degraded");
  EXPECT_NE(third.rig->control().health().problem.find("failed 2 times with the stored settings"), std::string::npos)
      << third.rig->control().health().problem;
  EXPECT_EQ(third.disk->read(firmware::kSettingsAsideFile, firmware::kMaxSettingsBytes).value(), settings);
  Stand fourth(options, third.disk->after_kill());
  fourth.run(Duration::seconds(3));
  EXPECT_EQ(fourth.state(), "running");
  EXPECT_NE(fourth.capture().heads[0].in_effect.gain, Gain::millidecibels(3000));
}

TEST(Settings, AStartThatRanWellForTenSeconds_IsNoFailure) {
  const StandOptions options;
  auto disk = set_and_lose_power(options);
  for (const int seconds : {3, 12, 3, 12, 3, 3}) {
    disk = run_and_kill(options, std::move(disk), Duration::seconds(seconds));
  }
}

TEST(Settings, AStartThatIsEndedByARequest_IsNoFailure) {
  const StandOptions options;
  auto disk = set_and_lose_power(options);
  for (int i = 0; i < 4; ++i) {
    Stand stand(options, std::move(disk));
    stand.run(Duration::seconds(3));
    EXPECT_EQ(stand.capture().heads[0].in_effect.gain, Gain::millidecibels(3000)) << i;
    stand.rig->close();
    disk = stand.disk->after_kill();
  }
}

// A stage that hangs is a failure after any time, also when the watchdog ends it.
TEST(Settings, ACaptureThatHangs_IsAFailureHoweverLongItTakes) {
  const StandOptions options;
  auto disk = set_and_lose_power(options);
  for (int i = 0; i < 2; ++i) {
    Stand stand(options, std::move(disk));
    stand.run(Duration::seconds(1));
    for (int ms = 0; ms < 30'000; ++ms) {
      stand.world.clock().advance(Duration::milliseconds(1));
      stand.rig->step_control();
      stand.rig->step_keeper();
    }
    EXPECT_EQ(stand.state(), "hanging");
    disk = stand.disk->after_kill();
  }
  Stand third(options, std::move(disk));
  third.run(Duration::seconds(3));
  EXPECT_EQ(third.state(), "degraded");
}

TEST(Settings, AKnobIsTurned_TheDiskIsWrittenOnceASecond) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.run(Duration::seconds(2));
  std::uint64_t files = 0;
  std::vector<std::uint8_t> seen;
  for (std::uint64_t i = 0; i < 100; ++i) {
    ASSERT_TRUE(host.ask(exposure_of({0}, 1'000'000 + i)).has_done());
    stand.run(Duration::milliseconds(20));
    const auto file = stand.disk->read(firmware::kSettingsFile, firmware::kMaxSettingsBytes);
    if (file && *file != seen) {
      seen = *file;
      ++files;
    }
  }
  EXPECT_GE(files, 2u);
  EXPECT_LE(files, 4u);
}

TEST(Settings, TheDiskIsFull_TheyAreMadeAllTheSame) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.disk->set_capacity(0);
  EXPECT_TRUE(host.ask(exposure_of({2}, 3'000'000)).has_done());
  ASSERT_TRUE(stand.run_until(
      [&] { return stand.capture().heads[2].in_effect.exposure.duration() == Duration::milliseconds(3); }));
}

/// A protobuf field that no message has, number 1000, of 60 KB.
std::string unknown_field() { return "\xc2\x3e\xe0\xd4\x03" + std::string(60'000, 'x'); }

std::size_t settings_bytes(Stand& stand) {
  const auto size = stand.disk->size(firmware::kSettingsFile);
  return size ? *size : 0;
}

/// Includes mmapped blocks, which uordblks omits: a growing buffer becomes one.
std::int64_t heap_bytes() {
  const struct mallinfo2 now = mallinfo2();
  return static_cast<std::int64_t>(now.uordblks + now.hblkhd);
}

TEST(Settings, AThousandRequestsWithUnknownFields_LeaveMemoryAndFileAsTheyWere) {
  Stand stand;
  TestHost& host = stand.bring_up();
  wire::Request request = gain_of_all(1000);
  const auto ask_times = [&](int times) {
    for (int i = 0; i < times; ++i) {
      ASSERT_TRUE(host.ask(request).has_done());
      if (i % 10 == 0) stand.run(Duration::milliseconds(200));
    }
    stand.run(Duration::seconds(2));
  };
  ask_times(10);
  const std::size_t file = settings_bytes(stand);
  const std::int64_t heap = heap_bytes();
  ASSERT_TRUE(request.mutable_head_set()->MergeFromString(unknown_field()));
  ask_times(1000);
  EXPECT_GT(file, 0u);
  EXPECT_EQ(settings_bytes(stand), file);
  // Nothing of the 60 MB stays; this test's host keeps about 200 KB of replies.
  EXPECT_LT(heap_bytes() - heap, 1 << 20);
}

TEST(Settings, MoreHeadsThanARigCanHave_AreRefused) {
  Stand stand;
  TestHost& host = stand.connect();
  wire::Request request = gain_of_all(1000);
  for (int i = 0; i < 17; ++i) request.mutable_head_set()->add_heads(0);
  EXPECT_EQ(host.ask(request).error().code(), static_cast<unsigned>(Errc::kBadValue));
}

TEST(Settings, AFileOverTheLimit_IsAProblemUntilItIsReplaced) {
  const StandOptions options;
  auto disk = set_and_lose_power(options);
  write_settings(*disk, std::vector<std::uint8_t>(firmware::kMaxSettingsBytes + 1));
  Stand stand(options, std::move(disk));
  ASSERT_TRUE(stand.run_until([&] { return stand.state() == "degraded"; }));
  TestHost& host = stand.connect();
  EXPECT_NE(host.status().problem().find("over the limit"), std::string::npos) << host.status().problem();
  EXPECT_EQ(host.ask(gain_of_all(1000)).not_stored(), "");
  ASSERT_TRUE(stand.run_until([&] { return stand.state() == "running"; }));
}

TEST(Settings, TheyCannotBeStored_TheReplyAndTheStatusSaySoUntilTheyAre) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.disk->set_capacity(0);
  const wire::Reply reply = host.ask(exposure_of({2}, 3'000'000));
  EXPECT_TRUE(reply.has_done()) << reply.error().message();
  EXPECT_NE(reply.not_stored().find("will not survive a restart"), std::string::npos) << reply.not_stored();
  stand.run(Duration::milliseconds(100));
  EXPECT_EQ(stand.state(), "degraded");
  EXPECT_EQ(host.status().problem(), reply.not_stored());
  EXPECT_EQ(settings_bytes(stand), 0u);

  stand.disk->set_capacity(1 << 20);
  ASSERT_TRUE(stand.run_until([&] { return stand.state() == "running"; })) << "it tries again by itself";
  EXPECT_GT(settings_bytes(stand), 0u);
  EXPECT_EQ(host.ask(exposure_of({2}, 4'000'000)).not_stored(), "");
}

TEST(Settings, AnyFile_IsReadOrRefused) {
  firmware::Settings settings;
  firmware::HeadChange change{firmware::head_bit(0), {}};
  change.change.exposure = Exposure::of(Duration::nanoseconds(5));
  settings.remember(change);
  const Sha256 rig{};
  const std::string good = settings.encode(rig);
  const std::vector<std::uint8_t> bytes(good.begin(), good.end());
  EXPECT_EQ(firmware::Settings::decode(bytes, rig)->commands().size(), 1u);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    std::vector<std::uint8_t> torn(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(i));
    EXPECT_FALSE(firmware::Settings::decode(torn, rig)) << "cut at " << i;
    torn = bytes;
    torn[i] ^= 4;
    EXPECT_FALSE(firmware::Settings::decode(torn, rig)) << "flipped at " << i;
  }
}

}  // namespace
}  // namespace nodal::scenario
