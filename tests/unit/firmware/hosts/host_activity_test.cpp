#include "firmware/hosts/host_activity.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

namespace nodal::firmware {
namespace {

Instant at(Duration time) { return Instant() + time; }

/// The rig's end of a connection that began at 0, and its host.
class HostActivityTest : public testing::Test {
 protected:
  /// The rig reads so many bytes of what the host has to say; all if there are fewer.
  void read(Instant now, std::size_t most = SIZE_MAX) {
    const auto bytes = host_.output().first(std::min(most, host_.output().size()));
    activity_.on_read(bytes.size(), rig_, now);
    ASSERT_TRUE(rig_.receive(bytes));
    activity_.on_received(rig_, now);
    host_.sent(bytes.size());
  }
  void greet() {
    read(Instant());
    ASSERT_TRUE(host_.receive(rig_.output()));
    rig_.sent(rig_.output().size());
    while (rig_.next_event() || host_.next_event()) continue;
  }
  void request() {
    wire::Request request;
    request.mutable_status();
    ASSERT_TRUE(host_.send(request));
  }

  Session host_{Role::kHost, make_hello("a host")};
  Session rig_{Role::kRig, make_hello("a rig")};
  HostActivity activity_{Instant()};
};

TEST_F(HostActivityTest, NoHello_IsOverdueAfterTwoSeconds) {
  EXPECT_FALSE(activity_.overdue(rig_, at(Duration::seconds(2))));
  const auto why = activity_.overdue(rig_, at(Duration::milliseconds(2001)));
  ASSERT_TRUE(why);
  EXPECT_EQ(why->code, Errc::kTimeout);
  greet();
  EXPECT_FALSE(activity_.overdue(rig_, at(Duration::milliseconds(2001))));
}

TEST_F(HostActivityTest, AFrameThatStays_IsOverdueTenSecondsAfterItsFirstByte) {
  greet();
  request();
  read(at(Duration::seconds(60)), 1);
  read(at(Duration::seconds(65)), 1);
  EXPECT_FALSE(activity_.overdue(rig_, at(Duration::seconds(70))));
  EXPECT_TRUE(activity_.overdue(rig_, at(Duration::milliseconds(70'001))));
  read(at(Duration::seconds(71)));
  request();
  read(at(Duration::seconds(72)), 1);
  EXPECT_FALSE(activity_.overdue(rig_, at(Duration::seconds(82)))) << "another frame has its own ten seconds";
}

TEST_F(HostActivityTest, ASilentHost_IsPingedEveryThirtySecondsAndOverdueAfterThreeHundred) {
  greet();
  EXPECT_FALSE(activity_.ping_due(false, at(Duration::seconds(30))));
  EXPECT_TRUE(activity_.ping_due(false, at(Duration::milliseconds(30'001))));
  EXPECT_FALSE(activity_.ping_due(false, at(Duration::seconds(60)))) << "the next one comes later";
  EXPECT_TRUE(activity_.ping_due(false, at(Duration::seconds(61))));
  EXPECT_FALSE(activity_.overdue(rig_, at(Duration::seconds(300))));
  EXPECT_TRUE(activity_.overdue(rig_, at(Duration::milliseconds(300'001))));
}

TEST_F(HostActivityTest, WithTemporarySettings_PingsComeEveryTwoAndAHalfSeconds) {
  greet();
  EXPECT_FALSE(activity_.ping_due(true, at(Duration::milliseconds(2500))));
  EXPECT_TRUE(activity_.ping_due(true, at(Duration::milliseconds(2501))));
}

TEST_F(HostActivityTest, OnlyBytesOfStreams_KeepAHostFromStalling) {
  greet();
  const StreamId stream = host_.open_stream(StreamPolicy::kLossless).value();
  read(at(Duration::seconds(1)));
  ASSERT_TRUE(rig_.next_event());
  EXPECT_TRUE(activity_.stalled(at(Duration::seconds(10)))) << "ten seconds since it connected";
  // The rig's credit, then the host's bytes.
  ASSERT_TRUE(host_.receive(rig_.output()));
  rig_.sent(rig_.output().size());
  const auto body = std::make_shared<const std::vector<std::uint8_t>>(100);
  ASSERT_TRUE(host_.offer(stream, BulkItem{"", SharedBytes(body), 0}));
  while (!host_.output().empty()) read(at(Duration::seconds(20)));
  EXPECT_FALSE(activity_.stalled(at(Duration::milliseconds(29'999))));
  EXPECT_TRUE(activity_.stalled(at(Duration::seconds(30))));
  EXPECT_EQ(activity_.idle_since(), at(Duration::seconds(20)));
}

TEST_F(HostActivityTest, ARequest_EndsIdlenessAndNotStalling) {
  greet();
  EXPECT_FALSE(activity_.has_requested());
  activity_.on_request(at(Duration::seconds(15)));
  EXPECT_TRUE(activity_.has_requested());
  EXPECT_EQ(activity_.idle_since(), at(Duration::seconds(15)));
  EXPECT_TRUE(activity_.stalled(at(Duration::seconds(15))));
}

TEST_F(HostActivityTest, BytesBothWays_AreCounted) {
  const std::size_t hello = host_.output().size();
  greet();
  activity_.on_written(7);
  activity_.on_written(5);
  EXPECT_EQ(activity_.bytes_in(), hello);
  EXPECT_EQ(activity_.bytes_out(), 12u);
  EXPECT_EQ(activity_.silence(at(Duration::seconds(9))), Duration::seconds(9));
}

}  // namespace
}  // namespace nodal::firmware
