// A rig that sends or takes a byte now and then does not hold a command for ever. All times are virtual.
#include "host_tool/rig/progress_floor.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "fake_rig.h"
#include "hal/sim/link.h"
#include "host_tool/console/console.h"
#include "host_tool/input/live_frames.h"
#include "host_tool/rig/rig_connection.h"
#include "host_tool/rig/stream_wait.h"

namespace nodal::host {
namespace {

constexpr Duration kPatience = Duration::seconds(10);
constexpr Duration kAnHour = Duration::seconds(3600);

/// A link that moves so many bytes a second of the clock in each direction, once it trickles.
class TricklingLink final : public hal::LinkPort {
 public:
  TricklingLink(std::unique_ptr<hal::LinkPort> link, const bool& trickles, const std::size_t& bytes,
                const Duration& now)
      : link_(std::move(link)), trickles_(trickles), bytes_(bytes), now_(now) {}

  Result<std::size_t> read(std::span<std::uint8_t> into) override {
    return counted(link_->read(into.first(std::min(into.size(), allowed(read_)))), read_);
  }
  Result<std::size_t> write(std::span<const std::uint8_t> from) override {
    return counted(link_->write(from.first(std::min(from.size(), allowed(written_)))), written_);
  }
  void add_wake_ups(hal::WakeUps& to, bool to_read, bool to_write) const override {
    link_->add_wake_ups(to, to_read, to_write);
  }
  const std::string& peer() const override { return link_->peer(); }
  std::optional<hal::PeerIdentity> identity() const override { return link_->identity(); }

 private:
  /// What one direction may move: what time has allowed since `at`, and what was not used before.
  struct Allowance {
    Duration at;
    std::size_t left = 0;
  };
  std::size_t allowed(Allowance& allowance) const {
    const auto since = static_cast<std::size_t>((now_ - allowance.at).ns());
    allowance.left = trickles_ ? allowance.left + bytes_ * since / 1'000'000'000U : std::size_t{1} << 30;
    allowance.at = now_;
    return allowance.left;
  }
  Result<std::size_t> counted(Result<std::size_t> moved, Allowance& allowance) const {
    if (moved) allowance.left = trickles_ ? allowance.left - *moved : 0;
    return moved;
  }

  std::unique_ptr<hal::LinkPort> link_;
  const bool& trickles_;
  const std::size_t& bytes_;
  const Duration& now_;
  Allowance read_, written_;
};

/// A connection whose clock advances only where it waits.
class Trickles : public testing::Test {
 protected:
  void connect() {
    auto link = std::make_unique<TricklingLink>(std::move(rig_.host_end), trickles_, trickle_, now_);
    auto connection = RigConnection::over(
        std::move(link), "sim:rig", kPatience,
        [this](hal::LinkPort&, bool, Duration at_most) {
          now_ = now_ + std::clamp(at_most, Duration::milliseconds(1), step_);
          rig_.step();
          if (now_ < kAnHour * 3) return;
          ADD_FAILURE() << "the wait has no end";
          rig_.hang_up();
        },
        [this] { return now_; });
    ASSERT_TRUE(connection) << connection.error().text();
    connection_ = std::move(*connection);
  }

  static wire::Request a_pull() {
    wire::Request request;
    request.mutable_frame_set();
    return request;
  }

  /// The rig answers questions after its status, and opens a stream for the pull that is asked for.
  StreamId begin_a_stream() {
    rig_.answer = [this](const wire::Request& request) {
      wire::Reply reply;
      if (request.has_status()) reply.mutable_status();
      else reply.mutable_pull()->set_stream(*rig_.session().open_stream(StreamPolicy::kLossless));
      return reply;
    };
    const auto started = connection_->ask(a_pull());
    EXPECT_TRUE(started) << started.error().text();
    return started ? started->pull().stream() : 0;
  }

  FakeRig rig_;
  bool trickles_ = false;
  std::size_t trickle_ = 1;
  Duration now_ = Duration::seconds(1);
  Duration step_ = Duration::seconds(1);
  std::unique_ptr<RigConnection> connection_;
};

TEST_F(Trickles, AByteASecond_WhileEventsAreWaitedFor_IsATimeoutAfterThePatience) {
  connect();
  rig_.answer = [this](const wire::Request&) {
    trickles_ = true;
    wire::Reply reply;
    reply.mutable_status()->set_problem(std::string(50'000, 'x'));
    return reply;
  };
  const Duration begun = now_;
  const auto event = connection_->next_event(kAnHour);
  ASSERT_FALSE(event);
  EXPECT_EQ(event.error().code, Errc::kTimeout);
  EXPECT_NE(event.error().message.find("too few"), std::string::npos) << event.error().message;
  EXPECT_LT(now_ - begun, kPatience * 3);
}

TEST_F(Trickles, ARigThatTakesAByteASecondOfAnUpload_IsATimeout) {
  connect();
  trickles_ = true;
  const auto body = std::make_shared<const std::vector<std::uint8_t>>(100'000);
  const Duration begun = now_;
  const Status sent = connection_->send_item({"meta", body, 0});
  ASSERT_FALSE(sent);
  EXPECT_EQ(sent.error().code, Errc::kTimeout);
  EXPECT_LT(now_ - begun, kPatience * 3);
}

TEST_F(Trickles, ARigThatAnswersAndSendsAByteOfAFrameSetASecond_IsATimeoutThatNamesTheFrameSet) {
  connect();
  const StreamId stream = begin_a_stream();
  StreamWait wait(*connection_, stream, kPatience, "a frame set");
  const Duration begun = now_;
  Status last;
  while (last) {
    // Items of one byte: the rig is alive and never finishes.
    EXPECT_TRUE(rig_.session().offer(stream, {"m", std::make_shared<const std::vector<std::uint8_t>>(1), 0}));
    const Result<Event> event = wait.next();
    if (!event) last = fail(event.error());
    now_ = now_ + step_;
  }
  EXPECT_EQ(last.error().code, Errc::kTimeout);
  EXPECT_NE(last.error().message.find("a frame set"), std::string::npos) << last.error().message;
  EXPECT_LT(now_ - begun, kPatience * 3);
}

/// At 2 kB/s a bulk piece of 64 KiB takes 32 s: more than three times the patience.
TEST_F(Trickles, ARigThatSendsAFrameSetSlowlyAndAboveTheFloor_IsWaitedFor) {
  connect();
  const StreamId stream = begin_a_stream();
  trickles_ = true;
  trickle_ = 2000;
  constexpr std::size_t kBytes = 150'000;
  ASSERT_TRUE(rig_.session().offer(stream, {"m", std::make_shared<const std::vector<std::uint8_t>>(kBytes), 0}));
  StreamWait wait(*connection_, stream, kPatience, "a frame set");
  const Duration begun = now_;
  std::size_t got = 0;
  while (got < kBytes) {
    const Result<Event> event = wait.next();
    ASSERT_TRUE(event) << event.error().text() << " after " << got << " bytes";
    if (const auto* piece = std::get_if<BulkPiece>(&*event)) got += piece->data.size();
  }
  EXPECT_GT(now_ - begun, Duration::seconds(70));
}

TEST_F(Trickles, ARigThatTakesAnUploadSlowlyAndAboveTheFloor_IsWaitedFor) {
  connect();
  trickles_ = true;
  trickle_ = 2000;
  const Duration begun = now_;
  const Status sent = connection_->send_item({"meta", std::make_shared<const std::vector<std::uint8_t>>(100'000), 0});
  ASSERT_TRUE(sent) << sent.error().text();
  EXPECT_GE(now_ - begun, Duration::seconds(50)) << "until the link has taken all of it, not all but a piece";
}

TEST_F(Trickles, ASlowRigAboveTheFloor_IsWaitedFor) {
  connect();
  ProgressFloor floor(kPatience, now_);
  for (int i = 0; i < 1000; ++i) {
    now_ = now_ + Duration::seconds(1);
    floor.moved(kMinBytesAWindow / 4, now_);
    EXPECT_FALSE(floor.stalled(now_)) << i;
  }
}

TEST_F(Trickles, AProgramThatWasStoppedForAWhile_LooksOnceMoreBeforeItGivesUp) {
  ProgressFloor floor(kPatience, now_);
  now_ = now_ + kAnHour;
  EXPECT_FALSE(floor.stalled(now_));
  floor.moved(kMinBytesAWindow, now_);
  now_ = now_ + kPatience / 2;
  EXPECT_FALSE(floor.stalled(now_));
  now_ = now_ + kPatience / 2;
  EXPECT_TRUE(floor.stalled(now_));
}

TEST_F(Trickles, ARequestWhoseActivityStaysTheSame_IsGivenUp) {
  connect();
  rig_.answer = [](const wire::Request& request) -> std::optional<wire::Reply> {
    if (!request.has_status()) return std::nullopt;
    wire::Reply reply;
    reply.mutable_status()->set_activity("compiling: 40 %");
    return reply;
  };
  wire::Request commit;
  commit.mutable_upload_commit();
  const auto reply = connection_->ask_long(commit, [](const wire::RigStatus&) {});
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error().code, Errc::kTimeout);
  EXPECT_LT(now_, ActivityFloor::kSameActivity * 2);
}

TEST_F(Trickles, ARequestThatAlwaysSaysSomethingNew_IsGivenUpAfterAnHour) {
  connect();
  int looks = 0;
  rig_.answer = [&](const wire::Request& request) -> std::optional<wire::Reply> {
    if (!request.has_status()) return std::nullopt;
    wire::Reply reply;
    reply.mutable_status()->set_activity("compiling: " + std::to_string(++looks));
    return reply;
  };
  wire::Request commit;
  commit.mutable_upload_commit();
  const auto reply = connection_->ask_long(commit, [](const wire::RigStatus&) {});
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error().code, Errc::kTimeout);
  EXPECT_LT(now_, ActivityFloor::kLongestRequest * 2);
}

}  // namespace
}  // namespace nodal::host
