// What hosts set comes back after a restart without a host.
#include <gtest/gtest.h>

#include "firmware/settings.h"
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

/// Sets some, locks, and loses power a moment later; the disk as it is then.
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

TEST(Settings, ATornFile_IsNotBelievedAndTheRigStarts) {
  const StandOptions options;
  auto disk = set_and_lose_power(options);
  auto file = disk->read(firmware::kSettingsFile, firmware::kMaxSettingsBytes).value();
  file.back() ^= 1;
  const auto handle = disk->create(firmware::kSettingsFile).value();
  ASSERT_TRUE(disk->write(handle, file));
  ASSERT_TRUE(disk->sync(handle));
  disk->close(handle);
  Stand stand(options, std::move(disk));
  ASSERT_TRUE(stand.run_until([&] { return stand.state() == "running"; }));
  stand.run(Duration::seconds(1));
  EXPECT_EQ(stand.capture().genlock.state, firmware::GenlockState::kOff);
  EXPECT_NE(stand.capture().heads[0].in_effect.gain, Gain::millidecibels(3000));
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

TEST(Settings, AnyFile_IsReadOrRefused) {
  firmware::Settings settings;
  EXPECT_TRUE(settings.remember(exposure_of({0}, 5), 6));
  const Sha256 rig{};
  const std::string good = settings.encode(rig);
  const std::vector<std::uint8_t> bytes(good.begin(), good.end());
  EXPECT_EQ(firmware::Settings::decode(bytes, rig)->requests().size(), 1u);
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
