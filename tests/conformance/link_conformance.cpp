#include "link_conformance.h"

#include <array>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "hal/linux/link/wait.h"

namespace nodal::hal {
namespace {

constexpr int kPatience = 20'000;  // calls without result before a test gives up

/// Whether its wake-ups end a sleep.
bool wakes(const WakeUps& wake_ups, Duration at_most) {
  const Instant now = Instant() + Duration::seconds(1);  // what can go on at once says so by a time that has passed
  return wait_for(wake_ups, now, at_most) || (wake_ups.at() && *wake_ups.at() <= now);
}

bool wait_for_link(const LinkPort& link, bool to_read, bool to_write, Duration at_most = Duration::seconds(2)) {
  WakeUps wake_ups;
  link.add_wake_ups(wake_ups, to_read, to_write);
  return wakes(wake_ups, at_most);
}

bool wait_for_peer(const LinkListenerPort& listener, Duration at_most = Duration::seconds(2)) {
  WakeUps wake_ups;
  listener.add_wake_ups(wake_ups);
  return wakes(wake_ups, at_most);
}

struct Pair {
  std::unique_ptr<LinkWorld> world;
  std::unique_ptr<LinkPort> host;
  std::unique_ptr<LinkPort> rig;
};

Pair make_pair(const LinkWorldKind& kind) {
  Pair pair;
  pair.world = kind.make();
  pair.host = pair.world->connect();
  for (int i = 0; i < kPatience && !pair.rig; ++i) {
    wait_for_peer(pair.world->listener());
    auto link = pair.world->listener().accept();
    EXPECT_TRUE(link) << link.error().text();
    if (!link) break;
    pair.rig = std::move(*link);
  }
  return pair;
}

std::vector<std::uint8_t> numbered_bytes(std::size_t n) {
  std::vector<std::uint8_t> bytes(n);
  for (std::size_t i = 0; i < n; ++i) bytes[i] = static_cast<std::uint8_t>(i * 7 + i / 251);
  return bytes;
}

void write_all(LinkPort& link, std::span<const std::uint8_t> bytes) {
  for (int i = 0; i < kPatience && !bytes.empty(); ++i) {
    const auto n = link.write(bytes);
    ASSERT_TRUE(n) << n.error().text();
    ASSERT_LE(*n, bytes.size());
    bytes = bytes.subspan(*n);
    if (*n == 0) wait_for_link(link, false, true);
  }
  ASSERT_TRUE(bytes.empty());
}

/// Reads until `n` bytes have arrived or the link fails.
std::vector<std::uint8_t> read_bytes(LinkPort& link, std::size_t n) {
  std::vector<std::uint8_t> all;
  std::array<std::uint8_t, 5000> part;
  for (int i = 0; i < kPatience && all.size() < n; ++i) {
    const auto got = link.read(std::span(part).first(std::min(part.size(), n - all.size())));
    if (!got) break;
    all.insert(all.end(), part.begin(), part.begin() + static_cast<std::ptrdiff_t>(*got));
    if (*got == 0) wait_for_link(link, true, false);
  }
  return all;
}

/// Reads to the end; returns the final error and appends the bytes before it to `rest`.
Errc read_to_end(LinkPort& link, std::vector<std::uint8_t>& rest) {
  std::array<std::uint8_t, 4096> part;
  for (int i = 0; i < kPatience; ++i) {
    const auto got = link.read(part);
    if (!got) return got.error().code;
    rest.insert(rest.end(), part.begin(), part.begin() + static_cast<std::ptrdiff_t>(*got));
    if (*got == 0) wait_for_link(link, true, false);
  }
  ADD_FAILURE() << "the link never ended";
  return Errc::kTimeout;
}

Errc write_until_it_fails(LinkPort& link) {
  const std::vector<std::uint8_t> bytes(4096);
  for (int i = 0; i < kPatience; ++i) {
    const auto n = link.write(bytes);
    if (!n) return n.error().code;
  }
  ADD_FAILURE() << "writing to nobody never failed";
  return Errc::kTimeout;
}

TEST_P(LinkConformance, NothingWritten_ReadGivesZeroAtOnce) {
  Pair pair = make_pair(GetParam());
  std::array<std::uint8_t, 16> into;
  const auto n = pair.rig->read(into);
  ASSERT_TRUE(n) << n.error().text();
  EXPECT_EQ(*n, 0u);
}

TEST_P(LinkConformance, EmptySpans_MoveNothingAndEndNothing) {
  Pair pair = make_pair(GetParam());
  EXPECT_EQ(pair.rig->read({}).value(), 0u);
  EXPECT_EQ(pair.rig->write({}).value(), 0u);
  const auto bytes = numbered_bytes(3);
  write_all(*pair.host, bytes);
  EXPECT_EQ(read_bytes(*pair.rig, 3), bytes);
}

TEST_P(LinkConformance, BytesBothWaysInPiecesOfAnySize_ArriveInOrder) {
  Pair pair = make_pair(GetParam());
  const auto bytes = numbered_bytes(300'000);
  std::minstd_rand random(7);
  for (auto [from, to] : {std::pair{pair.host.get(), pair.rig.get()}, std::pair{pair.rig.get(), pair.host.get()}}) {
    std::vector<std::uint8_t> got;
    for (std::size_t at = 0; at < bytes.size();) {
      const std::size_t n = std::min<std::size_t>(1 + random() % 9000, bytes.size() - at);
      ASSERT_NO_FATAL_FAILURE(write_all(*from, std::span(bytes).subspan(at, n)));
      const auto part = read_bytes(*to, n);
      got.insert(got.end(), part.begin(), part.end());
      at += n;
    }
    EXPECT_EQ(got, bytes);
  }
}

TEST_P(LinkConformance, PeerDoesNotRead_WriteGivesZeroAndNothingIsLost) {
  Pair pair = make_pair(GetParam());
  const auto bytes = numbered_bytes(64U << 20);
  std::size_t written = 0;
  for (int zeros = 0; zeros < 3;) {
    const auto n = pair.host->write(std::span(bytes).subspan(written));
    ASSERT_TRUE(n) << n.error().text();
    written += *n;
    zeros = *n == 0 ? zeros + 1 : 0;
    ASSERT_LT(written, bytes.size()) << "nothing bounds what a peer that does not read costs";
  }
  EXPECT_TRUE(read_bytes(*pair.rig, written) ==
              std::vector<std::uint8_t>(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(written)));
  write_all(*pair.host, std::span(bytes).first(10));
}

TEST_P(LinkConformance, WakeUps_EndASleepWhenTheCallCanGoOnAndNotBefore) {
  constexpr Duration kShort = Duration::milliseconds(20);
  Pair pair = make_pair(GetParam());
  EXPECT_FALSE(wait_for_link(*pair.rig, true, false, kShort)) << "there is nothing to read";
  EXPECT_TRUE(wait_for_link(*pair.rig, false, true, kShort)) << "there is room to write";
  EXPECT_FALSE(wait_for_link(*pair.rig, false, false, kShort)) << "it wants nothing";
  EXPECT_FALSE(wait_for_peer(pair.world->listener(), kShort)) << "no peer waits";

  const std::vector<std::uint8_t> one{1};
  write_all(*pair.host, one);
  EXPECT_TRUE(wait_for_link(*pair.rig, true, false));
  EXPECT_EQ(read_bytes(*pair.rig, 1), one);
  EXPECT_FALSE(wait_for_link(*pair.rig, true, false, kShort)) << "what was to read is read";

  const auto bytes = numbered_bytes(1U << 20);
  std::size_t written = 0;
  while (const auto n = pair.host->write(bytes)) {
    if (*n == 0) break;
    written += *n;
  }
  EXPECT_FALSE(wait_for_link(*pair.host, false, true, kShort)) << "there is no room to write";
  EXPECT_TRUE(wait_for_link(*pair.rig, true, false));

  std::unique_ptr<LinkPort> second;
  if (pair.world->carries_several_hosts()) {
    second = pair.world->connect();
    EXPECT_TRUE(wait_for_peer(pair.world->listener()));
  } else {
    read_bytes(*pair.rig, written);  // a cable keeps nothing for a host that has closed it
  }
  pair.host.reset();
  std::vector<std::uint8_t> rest;
  EXPECT_EQ(read_to_end(*pair.rig, rest), Errc::kLinkClosed);
  EXPECT_TRUE(wait_for_link(*pair.rig, true, false)) << "the end is something to read";
}

TEST_P(LinkConformance, PeerClosed_EveryByteIsReadBeforeLinkClosed) {
  Pair pair = make_pair(GetParam());
  const auto bytes = numbered_bytes(10'000);
  write_all(*pair.rig, bytes);
  pair.rig.reset();
  std::vector<std::uint8_t> rest;
  EXPECT_EQ(read_to_end(*pair.host, rest), Errc::kLinkClosed);
  EXPECT_EQ(rest, bytes);
  std::array<std::uint8_t, 4> into;
  EXPECT_EQ(pair.host->read(into).error().code, Errc::kLinkClosed) << "closed is final";
}

TEST_P(LinkConformance, PeerClosed_WriteReportsLinkClosedAndNoSignalEndsTheProgram) {
  Pair pair = make_pair(GetParam());
  pair.rig.reset();
  EXPECT_EQ(write_until_it_fails(*pair.host), Errc::kLinkClosed);
  EXPECT_EQ(write_until_it_fails(*pair.host), Errc::kLinkClosed);
}

TEST_P(LinkConformance, PeerClosedWithBytesItNeverRead_BothCallsReportLinkClosed) {
  Pair pair = make_pair(GetParam());
  write_all(*pair.host, numbered_bytes(100));
  pair.rig.reset();
  std::vector<std::uint8_t> rest;
  EXPECT_EQ(read_to_end(*pair.host, rest), Errc::kLinkClosed);
  EXPECT_TRUE(rest.empty());
  EXPECT_EQ(write_until_it_fails(*pair.host), Errc::kLinkClosed);
}

TEST_P(LinkConformance, Links_SayWhoIsThere) {
  Pair pair = make_pair(GetParam());
  EXPECT_FALSE(pair.host->peer().empty());
  EXPECT_FALSE(pair.rig->peer().empty());
}

TEST_P(LinkConformance, TheRigsEnd_TellsWhichProcessConnected) {
  Pair pair = make_pair(GetParam());
  EXPECT_EQ(pair.rig->identity(), pair.world->host_identity());
}

TEST_P(LinkConformance, NobodyKnocks_AcceptGivesNullAtOnce) {
  const auto world = GetParam().make();
  const auto link = world->listener().accept();
  ASSERT_TRUE(link) << link.error().text();
  EXPECT_EQ(*link, nullptr);
}

TEST_P(LinkConformance, TwoHosts_HaveLinksOfTheirOwn) {
  Pair a = make_pair(GetParam());
  if (!a.world->carries_several_hosts()) GTEST_SKIP() << "this kind of link carries one host";
  auto second = a.world->connect();
  std::unique_ptr<LinkPort> rig_of_second;
  for (int i = 0; i < kPatience && !rig_of_second; ++i) {
    wait_for_peer(a.world->listener());
    rig_of_second = a.world->listener().accept().value();
  }
  ASSERT_NE(rig_of_second, nullptr);
  const std::vector<std::uint8_t> one{1}, two{2};
  write_all(*second, two);
  write_all(*a.host, one);
  EXPECT_EQ(read_bytes(*a.rig, 1), one);
  EXPECT_EQ(read_bytes(*rig_of_second, 1), two);
}

TEST_P(LinkConformance, HostLeavesBeforeItIsAccepted_ListenerGoesOn) {
  const auto world = GetParam().make();
  world->connect().reset();
  auto host = world->connect();
  const std::vector<std::uint8_t> one{1};
  write_all(*host, one);
  // The first may be accepted and closed, or never appear; the second must be accepted.
  bool heard = false;
  for (int i = 0; i < kPatience && !heard; ++i) {
    wait_for_peer(world->listener());
    auto link = world->listener().accept();
    ASSERT_TRUE(link) << link.error().text();
    if (*link) heard = read_bytes(**link, 1) == one;
  }
  EXPECT_TRUE(heard);
}

TEST_P(LinkConformance, ListenerGone_LinksLiveOn) {
  Pair pair = make_pair(GetParam());
  pair.world->drop_listener();
  const auto bytes = numbered_bytes(1000);
  write_all(*pair.rig, bytes);
  EXPECT_EQ(read_bytes(*pair.host, bytes.size()), bytes);
}

}  // namespace
}  // namespace nodal::hal
