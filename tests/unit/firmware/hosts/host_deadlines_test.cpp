// A host's connection in virtual time: how long its protocol frames and its farewell may take, when it counts as
// active, and which of too many hosts is closed.
#include <gtest/gtest.h>

#include <array>
#include <utility>
#include <vector>

#include "firmware/hosts/admission.h"
#include "firmware/hosts/client.h"
#include "hal/sim/link.h"

namespace nodal::firmware {
namespace {

constexpr Duration kTick = Duration::nanoseconds(1);

Instant after_start(Duration time) { return Instant() + time; }

/// A client of the rig, and the host at the other end of its link.
class ConnectedHost {
 public:
  explicit ConnectedHost(Instant now = Instant()) : ConnectedHost(hal::sim::make_link_pair(), now) {}

  /// The host writes all it has to say, and the rig reads it.
  void host_says(Instant now) {
    for (auto bytes = host.output(); !bytes.empty(); bytes = host.output()) host_writes(bytes.size());
    rig().pump_in(now);
    while (rig().session().next_event()) continue;
  }
  /// The next bytes of what the host has to say reach the link.
  void host_writes(std::size_t bytes) {
    ASSERT_EQ(host_link->write(host.output().first(bytes)).value_or(0), bytes);
    host.sent(bytes);
  }
  Client& rig() { return *client; }

  std::unique_ptr<hal::sim::SimLink> host_link;
  std::unique_ptr<Client> client;
  Session host{Role::kHost, make_hello("a host")};

 private:
  ConnectedHost(std::pair<std::unique_ptr<hal::sim::SimLink>, std::unique_ptr<hal::sim::SimLink>> ends, Instant now)
      : host_link(std::move(ends.second)),
        client(std::make_unique<Client>(1, std::move(ends.first), Access::kControl, make_hello("a rig"), now)) {}
};

TEST(HostDeadlines, AFrameThatComesByteByByte_HasTenSecondsFromItsFirstByte) {
  ConnectedHost connected;
  connected.host_says(Instant());
  wire::Request request;
  request.set_id(1);
  request.mutable_status();
  ASSERT_TRUE(connected.host.send(request));
  const Instant begun = after_start(Duration::seconds(5));
  for (int k = 0; k <= 4; ++k) {
    connected.host_writes(1);
    connected.rig().pump_in(begun + HostActivity::kFrameWithin / 4 * k);
    ASSERT_FALSE(connected.rig().ending()) << "after byte " << k;
  }
  connected.host_writes(1);
  connected.rig().pump_in(begun + HostActivity::kFrameWithin + kTick);
  ASSERT_TRUE(connected.rig().ending());
  EXPECT_EQ(connected.rig().session().error()->code, Errc::kTimeout);
}

TEST(HostDeadlines, AFrameAfterOthers_HasItsOwnTenSeconds) {
  ConnectedHost connected;
  connected.host_says(Instant());
  Instant now = after_start(Duration::seconds(5));
  for (int k = 0; k < 5; ++k) {  // each read ends one frame and begins the next
    wire::Request request;
    request.set_id(1);
    request.mutable_status();
    ASSERT_TRUE(connected.host.send(request));
    connected.host_writes(connected.host.output().size() - 1);
    connected.rig().pump_in(now);
    now = now + HostActivity::kFrameWithin / 4 * 3;
    connected.host_writes(1);
    ASSERT_FALSE(connected.rig().ending()) << "frame " << k;
  }
}

TEST(HostDeadlines, AFarewellThatTheHostDoesNotRead_IsGivenUpAfterASecond) {
  ConnectedHost connected;
  connected.host_says(Instant());
  connected.host_link->in().capacity = 0;
  const Instant now = after_start(Duration::seconds(1));
  EXPECT_FALSE(connected.rig().pump_out(now + Duration::seconds(3))) << "nothing ends without an error";
  EXPECT_FALSE(connected.rig().finished());
  connected.rig().end({Errc::kLinkClosed, "the rig stops"}, now);
  connected.rig().end({Errc::kLinkClosed, "again"}, now + Duration::milliseconds(500));
  connected.rig().pump_out(now);
  EXPECT_FALSE(connected.rig().finished());
  connected.rig().pump_out(now + Duration::seconds(1));
  EXPECT_FALSE(connected.rig().finished());
  connected.rig().pump_out(now + Duration::seconds(1) + kTick);
  EXPECT_TRUE(connected.rig().finished()) << "a second after the first reason, not the second";
  EXPECT_EQ(connected.rig().why().message, "the rig stops");
}

TEST(HostDeadlines, AFarewellThatTheHostReads_EndsTheConnectionAtOnce) {
  ConnectedHost connected;
  connected.host_says(Instant());
  connected.rig().end({Errc::kLinkClosed, "the rig stops"}, Instant());
  EXPECT_TRUE(connected.rig().pump_out(Instant()));
  EXPECT_TRUE(connected.rig().finished());
}

/// Or control would never sleep while it has a host that only leaves.
TEST(HostDeadlines, OfAHostThatIsBeingClosed_NothingIsReadAndNothingIsToDo) {
  ConnectedHost silent;
  silent.rig().end({Errc::kLinkClosed, "the rig stops"}, Instant());
  EXPECT_FALSE(silent.rig().pump_in(after_start(HostActivity::kHelloWithin + kTick)));
  ConnectedHost gone;
  gone.host_link.reset();
  EXPECT_TRUE(gone.rig().pump_in(Instant())) << "it finds the link closed";
  EXPECT_TRUE(gone.rig().finished());
  EXPECT_FALSE(gone.rig().pump_in(Instant()));
}

TEST(ActiveHosts, AreThoseThatWaitForAnAnswer) {
  ConnectedHost connected;
  connected.host_says(Instant());
  EXPECT_FALSE(connected.rig().active(Instant()));
  connected.rig().requests_open = 1;
  EXPECT_TRUE(connected.rig().active(Instant()));
  connected.rig().requests_open = 0;
  connected.rig().held.emplace();
  EXPECT_TRUE(connected.rig().active(Instant()));
}

TEST(ActiveHosts, AreThoseWhoseFrameSetOrFileMovesOrHasNothingToSend) {
  for (const bool set : {true, false}) {
    ConnectedHost connected;
    connected.host_says(Instant());
    Session& session = connected.rig().session();
    const auto stream = session.open_stream(StreamPolicy::kLossless);
    ASSERT_TRUE(stream);
    (set ? connected.rig().frame_set : connected.rig().take_file) = *stream;
    const Instant stalled = after_start(HostActivity::kStalledAfter);
    EXPECT_TRUE(connected.rig().active(stalled)) << "nothing waits for its link";
    ASSERT_TRUE(session.offer(*stream, BulkItem{"a picture", {}, 0}));
    EXPECT_FALSE(connected.rig().active(stalled));
    EXPECT_TRUE(connected.rig().active(Instant::from_ns(stalled.ns() - 1)));
  }
}

/// A rig's client that sends a file of 1 MiB, over a link that takes `capacity` bytes until the host reads.
class SlowReader {
 public:
  explicit SlowReader(std::size_t capacity) {
    connected.host_says(Instant());
    stream = *connected.rig().session().open_stream(StreamPolicy::kLossless);
    connected.rig().take_file = stream;
    const auto file = std::make_shared<const std::vector<std::uint8_t>>(std::size_t{1} << 20);
    EXPECT_TRUE(connected.rig().session().offer(stream, BulkItem{"a file", file, 0}));
    connected.host_link->in().capacity = capacity;
  }
  /// The host reads what its link holds, and answers; the rig goes on.
  void host_reads(Instant now) {
    std::array<std::uint8_t, 4096> bytes;
    const auto read = connected.host_link->read(bytes);
    ASSERT_TRUE(read && connected.host.receive(std::span(bytes).first(*read)));
    while (connected.host.next_event()) continue;
    for (auto out = connected.host.output(); !out.empty(); out = connected.host.output())
      connected.host_writes(out.size());
    rig_steps(now);
  }
  void rig_steps(Instant now) {
    connected.rig().pump_in(now);
    connected.rig().pump_out(now);
  }

  ConnectedHost connected;
  StreamId stream = 0;
};

TEST(ActiveHosts, AreThoseThatReadAKilobyteASecond) {
  SlowReader slow(1000);
  Instant now;
  for (int k = 0; k < 40; ++k) {  // a bulk piece takes 65 s
    now = after_start(Duration::seconds(k));
    slow.host_reads(now);
    ASSERT_TRUE(slow.connected.rig().active(now)) << k;
    ASSERT_EQ(slow.connected.rig().activity().idle_since(), now) << k;
  }
  EXPECT_TRUE(slow.connected.rig().active(now + HostActivity::kStalledAfter - kTick));
  EXPECT_FALSE(slow.connected.rig().active(now + HostActivity::kStalledAfter));
}

TEST(ActiveHosts, AreNotThoseThatReadOnlyAnswersAndGiveTheirFileNoCredit) {
  SlowReader picky(1U << 20);
  ConnectedHost& connected = picky.connected;
  std::uint64_t taken = 0;
  for (int k = 0; k < 20; ++k) {  // it reads all that comes, and never sends what it has to say: credits
    const Instant now = after_start(Duration::seconds(k));
    ASSERT_TRUE(connected.rig().session().send(wire::Reply()));
    picky.rig_steps(now);
    taken = connected.rig().activity().bytes_out();
    std::vector<std::uint8_t> bytes(1U << 20);
    const auto read = connected.host_link->read(bytes);
    ASSERT_TRUE(read && connected.host.receive(std::span(bytes).first(*read)));
  }
  const Instant now = after_start(Duration::seconds(19));
  EXPECT_EQ(connected.rig().session().counts(picky.stream)->bytes, 0U);
  EXPECT_GT(taken, 0U);
  EXPECT_FALSE(connected.rig().active(now));
}

TEST(HostDeadlines, AHostWhoseFileMovesAndWhosePongWaitsBehindIt_IsNotSilent) {
  SlowReader slow(1000);
  const int long_ago = static_cast<int>(HostActivity::kSilentFor.ms() / 1000);
  slow.host_reads(Instant());
  slow.host_reads(Instant());  // it has given credit
  for (int k = 0; k < long_ago + 100; ++k) {
    std::array<std::uint8_t, 1000> bytes;
    ASSERT_TRUE(slow.connected.host_link->read(bytes));  // and it says nothing
    slow.rig_steps(after_start(Duration::seconds(k)));
    ASSERT_FALSE(slow.connected.rig().ending()) << k;
  }
  slow.rig_steps(after_start(Duration::seconds(2 * long_ago + 100)));
  EXPECT_TRUE(slow.connected.rig().ending()) << "now it reads nothing, either";
}

TEST(HostDeadlines, AnUploadOfAKilobyteASecond_IsNotEnded) {
  ConnectedHost connected;
  connected.host_says(Instant());
  const StreamId stream = *connected.host.open_stream(StreamPolicy::kLossless);
  connected.rig().on_upload(stream, Instant());
  const auto file = std::make_shared<const std::vector<std::uint8_t>>(200'000);
  ASSERT_TRUE(connected.host.offer(stream, BulkItem{"", file, 0}));
  std::size_t sent = 0;
  for (int k = 0; k < 100; ++k) {
    const Instant now = after_start(Duration::seconds(k));
    const auto out = connected.host.output();
    const std::size_t bytes = std::min<std::size_t>(out.size(), 1000);
    connected.host_writes(bytes);
    sent += bytes;
    connected.rig().pump_in(now);
    connected.rig().pump_out(now);
    while (connected.rig().session().next_event()) continue;
    std::array<std::uint8_t, 4096> answer;
    const auto read = connected.host_link->read(answer);
    ASSERT_TRUE(read && connected.host.receive(std::span(answer).first(*read)));
    ASSERT_FALSE(connected.rig().ending()) << k << ": " << connected.rig().session().error()->message;
    ASSERT_TRUE(connected.rig().active(now)) << k;
  }
  EXPECT_GT(sent, 64U << 10) << "more than a frame";
}

TEST(TooManyHosts, OneIdleForLong_IsClosedBeforeOnesThatHaveJustCome) {
  const Instant now = after_start(Duration::seconds(11));
  std::vector<std::unique_ptr<ConnectedHost>> hosts;
  Clients clients;
  for (std::size_t k = 0; k <= Admission::kMaxClients; ++k) {
    const Instant came = k == 3 ? Instant() : now;
    hosts.push_back(std::make_unique<ConnectedHost>(came));
    hosts.back()->host_says(came);
    clients.push_back(std::move(hosts.back()->client));
  }
  Admission({}).close_excess(clients, now);
  for (std::size_t k = 0; k < clients.size(); ++k) EXPECT_EQ(clients[k]->ending(), k == 3) << "host " << k;
}

}  // namespace
}  // namespace nodal::firmware
