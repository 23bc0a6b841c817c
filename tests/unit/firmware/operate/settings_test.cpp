#include "firmware/operate/settings.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>

#include "firmware/operate/settings_writer.h"
#include "firmware/storage/settings_store.h"
#include "hal/sim/clock.h"
#include "protocol/base/units.h"

namespace nodal::firmware {
namespace {

Result<Settings> read_back(const std::string& file, const Sha256& rig_toml = {}) {
  return Settings::decode({reinterpret_cast<const std::uint8_t*>(file.data()), file.size()}, rig_toml);
}

/// The longest value of every setting, for every head that a rig can have.
std::vector<CaptureCommand> longest_changes() {
  constexpr auto k64 = std::numeric_limits<std::int64_t>::max();
  constexpr auto k32 = -std::numeric_limits<std::int32_t>::max();
  HeadChange heads{head_bit(kMaxHeads) - 1, {}};
  heads.change.exposure = Exposure::of(Duration::nanoseconds(k64));
  heads.change.gain = Gain::millidecibels(k32);
  heads.change.white_balance = WhiteBalance{65535, 65535};
  heads.change.gamma = hal::Gamma::thousandths(k32);
  ExposureChange exposure;
  exposure.program = ExposureProgram::kManual;  // the longest name
  exposure.anchor = kMaxHeads - 1;
  exposure.target = exposure.difference = exposure.ramp = k32;
  exposure.longest = Exposure::of(Duration::nanoseconds(k64));
  exposure.highest = Gain::millidecibels(k32);
  exposure.locked = false;
  return {heads, exposure, GenlockStart{FrameRate{999'999, 1'000'000}, Duration::nanoseconds(k64)}};
}

TEST(SettingsSize, EveryFieldAtItsLargest_IsFarBelowTheLimit) {
  Settings settings;
  for (const CaptureCommand& change : longest_changes()) settings.remember(change);
  const std::string file = settings.encode(Sha256{});
  // A line is a name of at most 16 letters, " = ", a number of at most 20 characters and an end of line.
  constexpr std::size_t kLine = 16 + 3 + 20 + 1;
  EXPECT_LE(file.size(), kLine * (kMaxHeads * 7 + 9 + 5) + 200);
  EXPECT_LE(file.size(), kMaxSettingsBytes / 8);
  const auto again = read_back(file);
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->encode(Sha256{}), file);
}

TEST(SettingsFile, AChangeThatNamesNoProgram_IsReadBackWithoutOne) {
  Settings settings;
  ExposureChange lock;
  lock.locked = true;
  settings.remember(lock);
  const auto again = read_back(settings.encode(Sha256{}));
  ASSERT_TRUE(again);
  const std::vector<CaptureCommand> commands = again->commands();
  EXPECT_FALSE(std::get<ExposureChange>(commands.back()).program);
  EXPECT_EQ(std::get<ExposureChange>(commands.back()).locked, true);
  EXPECT_EQ(std::get<ExposureChange>(commands.front()).program, ExposureProgram::kManual)
      << "under which heads are set first";
}

TEST(SettingsFile, NewerValues_GoOverOlderOnesAndTheOthersStay) {
  Settings settings;
  HeadChange first{head_bit(0) | head_bit(2), {}};
  first.change.gain = Gain::millidecibels(1000);
  first.change.exposure = Exposure::microseconds(500);
  HeadChange second{head_bit(2), {}};
  second.change.gain = Gain::millidecibels(2000);
  settings.remember(first);
  settings.remember(second);
  settings.remember(GenlockStart{});
  settings.remember(GenlockStop{});
  const auto again = read_back(settings.encode(Sha256{}));
  ASSERT_TRUE(again);
  const std::vector<CaptureCommand> commands = again->commands();
  ASSERT_EQ(commands.size(), 3u) << "two heads and the genlock";
  const auto& head0 = std::get<HeadChange>(commands[0]);
  const auto& head2 = std::get<HeadChange>(commands[1]);
  EXPECT_EQ(head0.heads, head_bit(0));
  EXPECT_EQ(head0.change.gain, Gain::millidecibels(1000));
  EXPECT_EQ(head2.heads, head_bit(2));
  EXPECT_EQ(head2.change.gain, Gain::millidecibels(2000));
  EXPECT_EQ(head2.change.exposure, Exposure::microseconds(500));
  EXPECT_TRUE(std::holds_alternative<GenlockStop>(commands[2]));
}

/// The error for a settings file with this text after the line of its rig.toml.
std::string refusal(const std::string& text) {
  const auto settings = read_back(Settings::with_checksum("rig_toml = \"" + to_hex(Sha256{}) + "\"\n" + text));
  return settings ? "" : settings.error().message;
}

TEST(SettingsFile, TextThatIsNoSettings_IsRefusedWithTheFieldAndLine) {
  EXPECT_EQ(refusal(""), "");
  EXPECT_NE(refusal("[genlock]\nrunning = true\nrate_numerator = 299700300\nrate_denominator = 10000000\n")
                .find("299700300/10000000"),
            std::string::npos);
  EXPECT_NE(refusal("[[heads]]\nindex = 16\n").find(":4:9"), std::string::npos) << refusal("[[heads]]\nindex = 16\n");
  EXPECT_NE(refusal("[[heads]]\nindex = 0\ngian_mdb = 3\n").find("did you mean 'gain_mdb'"), std::string::npos);
  EXPECT_NE(refusal("[exposure]\nprogram = \"none\"\n").find("program"), std::string::npos);
  EXPECT_NE(refusal("heads = [1, 2]\n").find("heads"), std::string::npos);
  EXPECT_NE(refusal("[exposure]\nlocked = 3\n").find("locked"), std::string::npos);
  EXPECT_NE(refusal("[").find("not TOML"), std::string::npos);
}

class SettingsWriterTest : public testing::Test {
 protected:
  hal::sim::SimClock clock;
  SettingsWriter writer;
  Status full = fail(Errc::kDiskFull, "no space");
  /// One write that ends with `end`.
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
