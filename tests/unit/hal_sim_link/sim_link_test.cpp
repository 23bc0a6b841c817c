// The faults that a test can cause in a simulated link, and how a session over it reacts.
#include "hal/sim/link.h"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "protocol/session.h"

namespace nodal::hal::sim {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes read_now(SimLink& link) {
  Bytes all;
  std::array<std::uint8_t, 64> part;
  for (auto n = link.read(part); n && *n > 0; n = link.read(part))
    all.insert(all.end(), part.begin(), part.begin() + *n);
  return all;
}

TEST(SimLink, Split_EveryCallMovesAtMostThatAndTheSeedRepeatsIt) {
  std::vector<std::size_t> moves[2];
  for (auto& seen : moves) {
    auto [a, b] = make_link_pair();
    a->out().split = 5;
    const Bytes bytes(100, 1);
    for (std::size_t at = 0; at < bytes.size();) {
      const std::size_t n = a->write(std::span(bytes).subspan(at)).value();
      EXPECT_GE(n, 1u);
      EXPECT_LE(n, 5u);
      seen.push_back(n);
      at += n;
    }
  }
  EXPECT_EQ(moves[0], moves[1]);
}

TEST(SimLink, Reset_BytesOnTheirWayAreLostAndBothEndsAreClosed) {
  auto [a, b] = make_link_pair();
  ASSERT_TRUE(a->write(Bytes{1, 2, 3}));
  b->reset();
  std::array<std::uint8_t, 4> into;
  EXPECT_EQ(b->read(into).error().code, Errc::kLinkClosed);
  EXPECT_EQ(a->read(into).error().code, Errc::kLinkClosed);
  EXPECT_EQ(a->write(into).error().code, Errc::kLinkClosed);
}

TEST(SimLink, Stalled_ReaderGetsNothingUntilItGoesOn) {
  auto [a, b] = make_link_pair();
  ASSERT_TRUE(a->write(Bytes{1, 2, 3}));
  b->in().stalled = true;
  EXPECT_TRUE(read_now(*b).empty());
  b->in().stalled = false;
  EXPECT_EQ(read_now(*b), (Bytes{1, 2, 3}));
}

TEST(SimLink, FlipBit_ExactlyThatBitOfWhatIsYetToBeWritten) {
  for (std::uint64_t bit = 0; bit < 48; ++bit) {
    auto [a, b] = make_link_pair();
    ASSERT_TRUE(a->write(Bytes{0, 0}));
    a->out().flip_bit = bit;
    a->out().split = 3;
    const Bytes zeros(6, 0);
    for (std::size_t at = 0; at < zeros.size();) at += a->write(std::span(zeros).subspan(at)).value();
    Bytes expected(8, 0);
    expected[2 + bit / 8] = static_cast<std::uint8_t>(1U << (bit % 8));
    EXPECT_EQ(read_now(*b), expected) << bit;
  }
}

/// A session at the end of a link, stepped like a stage.
struct End {
  End(Role role, std::unique_ptr<SimLink> over) : session(role, make_hello("test")), link(std::move(over)) {}

  /// Returns whether any byte was moved.
  bool step() {
    bool moved = false;
    std::array<std::uint8_t, 8192> part;
    while (!down && session.wants_input()) {
      const auto n = link->read(part);
      if (!n) down = true;
      if (!n || *n == 0) break;
      moved = true;
      (void)session.receive(std::span(part).first(*n));
    }
    while (auto event = session.next_event()) {
      if (auto* piece = std::get_if<BulkPiece>(&*event)) got.insert(got.end(), piece->data.begin(), piece->data.end());
    }
    for (auto out = session.output(); !down && !out.empty(); out = session.output()) {
      const auto n = link->write(out);
      if (!n) down = true;
      if (!n || *n == 0) break;
      moved = true;
      session.sent(*n);
    }
    return moved;
  }

  Session session;
  std::unique_ptr<SimLink> link;
  bool down = false;
  Bytes got;
};

struct Talk {
  Talk() {
    auto [a, b] = make_link_pair();
    host.emplace(Role::kHost, std::move(a));
    rig.emplace(Role::kRig, std::move(b));
    const StreamId stream = rig->session.open_stream(StreamPolicy::kLossless).value();
    EXPECT_TRUE(rig->session.offer(stream, BulkItem{"", body, 0}));
  }
  void run() {
    while (static_cast<int>(host->step()) + static_cast<int>(rig->step()) > 0) {}
  }

  std::shared_ptr<const Bytes> body = std::make_shared<const Bytes>(400'000, std::uint8_t{0x5A});
  std::optional<End> host, rig;
};

TEST(SessionOverSimLink, TinyPiecesAndASmallPipe_EverythingArrives) {
  Talk talk;
  for (LinkPipe* pipe : {&talk.host->link->in(), &talk.host->link->out()}) {
    pipe->split = 700;
    pipe->capacity = 1000;
  }
  talk.run();
  EXPECT_EQ(talk.host->got, *talk.body);
  EXPECT_EQ(talk.host->session.error(), nullptr);
}

TEST(SessionOverSimLink, SlowReader_ThePipeFillsAndNothingIsLost) {
  Talk talk;
  talk.host->step();
  talk.rig->step();
  talk.host->step();  // the first credit is in transit
  talk.host->link->in().stalled = true;
  talk.run();
  EXPECT_EQ(talk.host->link->in().bytes.size(), talk.host->link->in().capacity);
  talk.host->link->in().stalled = false;
  talk.run();
  EXPECT_EQ(talk.host->got, *talk.body);
}

TEST(SessionOverSimLink, AnyBitFlippedOnTheWay_NoWrongByteIsEverTaken) {
  for (std::uint64_t bit = 3; bit < 8 * 400'000; bit += 99'991) {
    Talk talk;
    talk.rig->link->out().flip_bit = bit;
    talk.run();
    ASSERT_NE(talk.host->session.error(), nullptr) << bit;
    ASSERT_LE(talk.host->got.size(), bit / 8);
    ASSERT_TRUE(std::equal(talk.host->got.begin(), talk.host->got.end(), talk.body->begin())) << bit;
    // The rig gets the error, and ends too.
    ASSERT_NE(talk.rig->session.error(), nullptr) << bit;
    ASSERT_NE(talk.rig->session.error()->message.find("the host (test) ended the session"), std::string::npos);
  }
}

TEST(SessionOverSimLink, CablePulled_BothEndsSeeTheLinkGoDown) {
  Talk talk;
  talk.host->link->in().capacity = 100'000;
  for (int i = 0; i < 3; ++i) talk.rig->step(), talk.host->step();
  talk.host->link->reset();
  talk.run();
  EXPECT_TRUE(talk.host->down);
  EXPECT_TRUE(talk.rig->down);
  EXPECT_LT(talk.host->got.size(), talk.body->size());
  EXPECT_EQ(talk.host->session.end_of_input().error().code, Errc::kLinkClosed);
}

}  // namespace
}  // namespace nodal::hal::sim
