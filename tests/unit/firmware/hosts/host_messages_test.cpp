// What hosts are told: the messages that reports and answers become.
#include <gtest/gtest.h>

#include <string>

#include "firmware/hosts/status.h"
#include "firmware/hosts/wire_commands.h"
#include "firmware/record/take_shelf.h"
#include "protocol/framing.h"
#include "protocol/take/limits.h"

namespace nodal::firmware {
namespace {

RigConfig two_named_heads() {
  RigConfig config;
  config.heads.resize(2);
  config.heads[0].name = "left";
  config.heads[1].name = "right";
  return config;
}

TEST(HostMessages, OfTheGenlock_NameLostPulsesByTheirReasonAndHeadsThatDoNotFollow) {
  GenlockReport report;
  report.losses_of_port.late = 3;
  report.losses_of_port.jumps = 1;
  report.wired[1].state = Following::kDrifts;
  wire::Genlock filled;
  fill_genlock(two_named_heads(), report, filled);
  ASSERT_EQ(filled.pulse_losses_size(), 2);
  EXPECT_EQ(filled.pulse_losses(0).reason(), "late");
  EXPECT_EQ(filled.pulse_losses(0).pulses(), 3U);
  EXPECT_EQ(filled.pulse_losses(1).reason(), "jumped");
  EXPECT_EQ(filled.pulse_losses(1).pulses(), 1U);
  ASSERT_EQ(filled.unaligned_size(), 1);
  EXPECT_EQ(filled.unaligned(0).find("head 'right' does not follow the trigger"), 0U) << filled.unaligned(0);
}

TEST(HostMessages, OfTheExposure_GiveSharesOfTheSphereInMillionths) {
  ExposureControl::Report report;
  report.seen.solid_angle = 1 << 23;  // half of the sphere
  report.settings.target = -kStop;
  wire::ExposureState filled;
  fill_exposure(report, 2, filled);
  EXPECT_EQ(filled.sphere_ppm(), 500'000U);
  EXPECT_EQ(filled.settings().target_below(), 1000U);
}

/// The longest texts and numbers that a card can have: a take that is not complete has no manifest.
TakeEntry longest_entry(TakeState state) {
  TakeEntry entry;
  entry.number = take::kMaxTakeNumber - 1;
  entry.state = state;
  entry.started_utc_ns = take::kMaxUtcNs;
  entry.rate = FrameRate{UINT32_MAX, UINT32_MAX};
  entry.rates = take::kMaxRates;
  entry.is_protected = true;
  entry.raymap_width = entry.raymap_height = INT32_MAX;
  if (state != TakeState::kComplete) {
    entry.problem = std::string(TakeShelf::kMaxProblemBytes, 'x');
    return entry;
  }
  entry.ended = std::string(take::kMaxTakeTextBytes, 'x');
  entry.sets = entry.lost_sets = entry.deleted_sets = take::kMaxSets;
  entry.gaps = {take::kMaxSets, take::kMaxSets, take::kMaxSets, take::kMaxSets,
                Duration::nanoseconds(take::kMaxTimeNs)};
  entry.heads.assign(kMaxHeads, {take::kMaxSets, take::kMaxSets, take::kMaxSets});
  entry.bytes = UINT64_MAX;
  entry.length = Duration::nanoseconds(take::kMaxTimeNs);
  return entry;
}

// Otherwise a card could keep hosts from seeing any take.
TEST(HostMessages, OfAsManyTakesAsThereMayBeWithTheLongestTexts_FitAReply) {
  for (const TakeState state : {TakeState::kComplete, TakeState::kSetAside}) {
    wire::Reply reply;
    fill_takes({std::vector<TakeEntry>(TakeShelf::kMaxTakes, longest_entry(state))}, *reply.mutable_takes());
    ASSERT_EQ(reply.takes().takes_size(), static_cast<int>(TakeShelf::kMaxTakes));
    EXPECT_LE(reply.ByteSizeLong(), kMaxListReplyBytes) << take_state_name(state);
  }
}

TEST(HostMessages, OfATake_GiveItsLengthAndHowLongAgoAllOfItWasDurable) {
  TakeReport report;
  report.recording = 7;
  report.since = Instant::from_ns(1'000);
  report.durable = Instant::from_ns(4'000);
  wire::Recording filled;
  fill_recording(report, Instant::from_ns(9'000), filled);
  EXPECT_EQ(filled.take(), 7U);
  EXPECT_EQ(filled.length_ns(), 8'000U);
  EXPECT_EQ(filled.durable_ns(), 5'000U);
  wire::Recording none;
  fill_recording(TakeReport(), Instant::from_ns(9'000), none);
  EXPECT_FALSE(none.has_take());
}

TEST(HostMessages, OfACommandThatIsDone_SayWhenAndWhatWillBeLost) {
  Answer answer{1, Outcome(CommandDone{Instant::from_ns(42)})};
  wire::Reply filled = reply_of(answer, two_named_heads());
  ASSERT_TRUE(filled.has_done());
  EXPECT_EQ(filled.done().at_ns(), 42U);
  EXPECT_EQ(filled.not_stored(), "");
  EXPECT_EQ(filled.not_recorded(), "");
  answer.not_stored = "no space";
  answer.not_recorded = "the disk is gone";
  filled = reply_of(answer, two_named_heads());
  EXPECT_EQ(filled.not_stored(), "no space");
  EXPECT_EQ(filled.not_recorded(), "the disk is gone");
  EXPECT_TRUE(reply_of({1, Outcome(CommandDone{})}, two_named_heads()).has_done()) << "of a change without a time";
  const wire::Reply refused = reply_of({1, fail(Errc::kBusy, "try again")}, two_named_heads());
  EXPECT_EQ(refused.error().message(), "try again");
  EXPECT_EQ(refused.error().code(), static_cast<std::uint32_t>(Errc::kBusy));
}

TEST(HostMessages, OfAGenlockActionThatIsNew_AreRefusedWithWhatToDo) {
  wire::Request request;
  request.mutable_genlock()->set_action(static_cast<wire::GenlockRequest::Action>(3));
  const auto command = command_of(request, two_named_heads(), 1);
  ASSERT_FALSE(command);
  EXPECT_EQ(command.error().code, Errc::kUnsupported);
  EXPECT_NE(command.error().message.find("update nodald"), std::string::npos) << command.error().message;
}

}  // namespace
}  // namespace nodal::firmware
