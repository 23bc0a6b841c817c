#include "firmware/storage/settings.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>

#include "firmware/storage/settings_writer.h"
#include "hal/sim/clock.h"
#include "protocol/base/units.h"

namespace nodal::firmware {
namespace {

/// Every known field at the value that takes the most bytes, for every head that a rig can have.
std::vector<wire::Request> largest_requests() {
  std::vector<wire::Request> all;
  wire::HeadSetRequest& heads = *all.emplace_back().mutable_head_set();
  heads.set_exposure_ns(std::numeric_limits<std::uint64_t>::max());
  heads.set_gain_mdb(std::numeric_limits<std::int32_t>::min());
  heads.set_red_q12(std::numeric_limits<std::uint32_t>::max());
  heads.set_blue_q12(std::numeric_limits<std::uint32_t>::max());
  heads.set_gamma(std::numeric_limits<std::uint32_t>::max());
  wire::ExposureRequest& exposure = *all.emplace_back().mutable_exposure();
  exposure.set_program("manual");  // the longest name
  exposure.set_anchor(std::numeric_limits<std::int32_t>::min());
  exposure.set_target_below(std::numeric_limits<std::uint32_t>::max());
  exposure.set_difference(std::numeric_limits<std::uint32_t>::max());
  exposure.set_ramp(std::numeric_limits<std::uint32_t>::max());
  exposure.set_longest_ns(std::numeric_limits<std::uint64_t>::max());
  exposure.set_highest_gain_mdb(std::numeric_limits<std::int32_t>::min());
  exposure.set_locked(true);
  wire::GenlockRequest& genlock = *all.emplace_back().mutable_genlock();
  genlock.set_action(wire::GenlockRequest::START);
  genlock.set_rate_numerator(std::numeric_limits<std::uint32_t>::max());
  genlock.set_rate_denominator(std::numeric_limits<std::uint32_t>::max());
  genlock.set_pulse_width_ns(std::numeric_limits<std::uint64_t>::max());
  return all;
}

TEST(SettingsSize, EveryFieldAtItsLargest_IsFarBelowTheLimit) {
  Settings settings;
  for (const wire::Request& request : largest_requests()) EXPECT_TRUE(settings.remember(request, kMaxHeads));
  const std::string file = settings.encode(Sha256{});
  // A varint of 32 bits takes 5 bytes, of 64 bits 10, and a tag 1; 16 more for what wraps a request.
  constexpr std::size_t kHead = 11 + 6 + 6 + 6 + 6 + 3 + 16;
  EXPECT_LE(file.size(), kMaxHeads * kHead + 200);
  EXPECT_LE(file.size(), kMaxSettingsBytes / 16);
  const auto again = Settings::decode({reinterpret_cast<const std::uint8_t*>(file.data()), file.size()}, Sha256{});
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->encode(Sha256{}), file);
}

TEST(SettingsSize, HeadsThatNoRigHas_AreNotKept) {
  Settings settings;
  const std::string before = settings.encode(Sha256{});
  wire::Request request;
  request.mutable_head_set()->set_gain_mdb(1);
  for (std::uint32_t head = kMaxHeads; head < 5000; ++head) request.mutable_head_set()->add_heads(head);
  settings.remember(request, 6);
  EXPECT_EQ(settings.encode(Sha256{}), before);
}

TEST(SettingsSize, AProgramThatDoesNotExist_IsNotKept) {
  Settings settings;
  wire::Request request;
  request.mutable_exposure()->set_program(std::string(50'000, 'x'));
  settings.remember(request, 6);
  EXPECT_LT(settings.encode(Sha256{}).size(), 200u);
}

TEST(SettingsFile, ARequestThatNamesNoProgram_IsReadBackWithoutOne) {
  Settings settings;
  wire::Request lock;
  lock.mutable_exposure()->set_locked(true);
  settings.remember(lock, 6);
  const std::string file = settings.encode(Sha256{});
  const auto again = Settings::decode({reinterpret_cast<const std::uint8_t*>(file.data()), file.size()}, Sha256{});
  ASSERT_TRUE(again);
  EXPECT_EQ(again->encode(Sha256{}), file);
  EXPECT_FALSE(again->requests().back().exposure().has_program());
  EXPECT_EQ(again->requests().front().exposure().program(), "manual") << "under which heads are set first";
}

class SettingsWriterTest : public testing::Test {
 protected:
  hal::sim::SimClock clock;
  SettingsWriter writer;
  Status full = fail(Errc::kDiskFull, "no space");
  /// One write, and how it ends.
  void write(const Status& end) {
    writer.begun(clock.now());
    writer.ended(end);
  }
};

TEST_F(SettingsWriterTest, NothingChanged_NothingIsWritten) { EXPECT_FALSE(writer.due(clock.now())); }

TEST_F(SettingsWriterTest, ManyChanges_AreOneWriteASecond) {
  int writes = 0;
  for (int ms = 0; ms < 3000; ++ms) {
    writer.changed();
    if (writer.due(clock.now())) {
      ++writes;
      write({});
    }
    clock.advance(Duration::milliseconds(1));
  }
  EXPECT_EQ(writes, 3);
}

TEST_F(SettingsWriterTest, AWriteThatFails_IsAProblemUntilOneSucceeds) {
  writer.changed();
  writer.begun(clock.now());
  EXPECT_TRUE(writer.ended(full));
  EXPECT_EQ(writer.problem(), "settings will not survive a restart: no space");
  EXPECT_FALSE(writer.due(clock.now()));
  clock.advance(SettingsWriter::kRetryEvery);
  ASSERT_TRUE(writer.due(clock.now())) << "without another change";
  writer.begun(clock.now());
  EXPECT_FALSE(writer.ended(full)) << "the same problem is not told again";
  clock.advance(SettingsWriter::kRetryEvery);
  writer.begun(clock.now());
  EXPECT_TRUE(writer.ended({}));
  EXPECT_EQ(writer.problem(), "");
  EXPECT_FALSE(writer.due(clock.now()));
}

TEST_F(SettingsWriterTest, AChangeDuringAWrite_IsWrittenAfterIt) {
  writer.changed();
  writer.begun(clock.now());
  writer.changed();
  EXPECT_FALSE(writer.due(clock.now() + Duration::seconds(5)));
  writer.ended({});
  EXPECT_TRUE(writer.due(clock.now() + SettingsWriter::kWriteEvery));
}

TEST_F(SettingsWriterTest, AReply_WaitsForTheWriteButNotForADiskThatHangs) {
  EXPECT_FALSE(writer.worth_waiting(clock.now()));
  writer.changed();
  writer.begun(clock.now());
  EXPECT_TRUE(writer.worth_waiting(clock.now()));
  clock.advance(SettingsWriter::kAnswerWithin);
  EXPECT_FALSE(writer.worth_waiting(clock.now()));
}

}  // namespace
}  // namespace nodal::firmware
