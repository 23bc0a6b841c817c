// A host's connection in virtual time: how long its protocol frames and its farewell may take, when it counts as active,
// and which of too many hosts is closed.
#include <gtest/gtest.h>

#include <utility>

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

TEST(HostDeadlines, AFrameThatComesByteByByte_HasTwoSecondsFromItsFirstByte) {
  ConnectedHost connected;
  connected.host_says(Instant());
  wire::Request request;
  request.set_id(1);
  request.mutable_status();
  ASSERT_TRUE(connected.host.send(request));
  const Instant begun = after_start(Duration::seconds(5));
  for (int k = 0; k <= 4; ++k) {
    connected.host_writes(1);
    connected.rig().pump_in(begun + Client::kFrameWithin / 4 * k);
    ASSERT_FALSE(connected.rig().ending()) << "after byte " << k;
  }
  connected.host_writes(1);
  connected.rig().pump_in(begun + Client::kFrameWithin + kTick);
  ASSERT_TRUE(connected.rig().ending());
  EXPECT_EQ(connected.rig().session().error()->code, Errc::kTimeout);
}

TEST(HostDeadlines, AFrameAfterOthers_HasItsOwnTwoSeconds) {
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
    now = now + Duration::milliseconds(1500);
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
  EXPECT_FALSE(silent.rig().pump_in(after_start(Client::kHelloWithin + kTick)));
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
    const Instant stalled = after_start(Client::kStalledAfter);
    EXPECT_TRUE(connected.rig().active(stalled)) << "nothing waits for its link";
    ASSERT_TRUE(session.offer(*stream, BulkItem{"a picture", {}, 0}));
    EXPECT_FALSE(connected.rig().active(stalled));
    EXPECT_TRUE(connected.rig().active(Instant::from_ns(stalled.ns() - 1)));
  }
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
