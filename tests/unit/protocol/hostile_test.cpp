// A short conversation with every kind of frame, cut at every byte and with every bit flipped: no end ever crashes,
// hangs, accepts a wrong byte, or gives an unclear error.
#include <gtest/gtest.h>

#include <set>

#include "conversation.h"

namespace nodal {
namespace {

struct Recording {
  std::vector<std::uint8_t> from_host, from_rig;
};

/// Both directions of a conversation; the host also uploads.
Recording record() {
  Conversation talk;
  Recording log;
  const auto flow = [&] {
    for (int i = 0; i < 5; ++i) {
      for (const bool up : {true, false}) {
        const auto bytes = take_output(up ? *talk.host : *talk.rig);
        auto& direction = up ? log.from_host : log.from_rig;
        direction.insert(direction.end(), bytes.begin(), bytes.end());
        if (bytes.empty()) continue;
        const Status status = (up ? *talk.rig : *talk.host).receive(bytes);
        EXPECT_TRUE(status || status.error().code == Errc::kCancelled) << status.error().text();
        take_events(*talk.host);
        take_events(*talk.rig);
      }
    }
  };
  wire::Request request;
  request.set_id(1);
  request.mutable_genlock()->set_action(wire::GenlockRequest::START);
  EXPECT_TRUE(talk.host->send(request));
  const StreamId up = talk.host->open_stream(StreamPolicy::kLossless).value();
  flow();
  talk.host->ping();
  talk.rig->ping();
  EXPECT_TRUE(talk.host->offer(up, BulkItem{"part", shared_bytes(60), 0}));
  EXPECT_TRUE(talk.host->offer(up, BulkItem{"", {}, 0}));
  wire::Reply reply;
  reply.set_id(1);
  reply.mutable_done();
  EXPECT_TRUE(talk.rig->send(reply));
  const StreamId live = talk.rig->open_stream(StreamPolicy::kLatest).value();
  for (std::uint32_t i = 0; i < 3; ++i) EXPECT_TRUE(talk.rig->offer(live, BulkItem{"raymap", shared_bytes(50, i), 0}));
  flow();
  talk.host->close_stream(up);
  talk.host->stop_stream(live, Error{Errc::kCancelled, "enough"});
  flow();
  talk.host->close(Error{Errc::kCancelled, "done"});
  flow();
  return log;
}

/// The events and the end of one session, in a form that can be compared.
struct Seen {
  std::vector<std::string> events;
  std::string error;
};

std::string describe(const Event& event) {
  struct Visitor {
    std::string operator()(const wire::Hello& m) { return "hello " + m.SerializeAsString(); }
    std::string operator()(const wire::Request& m) { return "request " + m.SerializeAsString(); }
    std::string operator()(const wire::Reply& m) { return "reply " + m.SerializeAsString(); }
    std::string operator()(const StreamOpened& e) { return "opened " + std::to_string(e.stream); }
    std::string operator()(const BulkPiece& p) {
      return "piece " + std::to_string(p.item) + "@" + std::to_string(p.offset) + "/" + std::to_string(p.total) + " " +
             std::to_string(p.dropped) + " " + p.meta + " " + std::string(p.data.begin(), p.data.end());
    }
    std::string operator()(const StreamClosed& e) {
      return "closed " + std::to_string(e.offered) + " " + std::to_string(e.dropped);
    }
    std::string operator()(const StreamStopped& e) { return "stopped " + e.why.text(); }
  };
  return std::visit(Visitor{}, event);
}

/// Plays one direction of the recording to a new end, `piece` bytes at a time. The end has opened the streams that the
/// recording uses.
Seen play(Role to, std::span<const std::uint8_t> bytes, std::size_t piece) {
  Session session(to, make_hello("test"));
  if (to == Role::kHost) (void)session.open_stream(StreamPolicy::kLossless);
  if (to == Role::kRig) (void)session.open_stream(StreamPolicy::kLatest);
  Seen seen;
  while (!bytes.empty() && session.error() == nullptr) {
    const auto part = bytes.first(std::min(piece, bytes.size()));
    bytes = bytes.subspan(part.size());
    (void)session.receive(part);
    take_output(session);  // sends the credits, as in a real conversation
    for (const Event& event : take_events(session)) seen.events.push_back(describe(event));
  }
  if (session.error() != nullptr) {
    seen.error = session.error()->text();
  } else if (const Status end = session.end_of_input(); !end) {
    seen.error = end.error().text();
  }
  return seen;
}

struct Direction {
  Role to;
  std::vector<std::uint8_t> bytes;
};

std::vector<Direction> directions() {
  Recording log = record();
  return {{Role::kRig, std::move(log.from_host)}, {Role::kHost, std::move(log.from_rig)}};
}

bool is_beginning_of(const std::vector<std::string>& part, const std::vector<std::string>& whole) {
  return part.size() <= whole.size() && std::equal(part.begin(), part.end(), whole.begin());
}

TEST(HostileStream, Recording_HoldsEveryKindOfFrame) {
  std::set<FrameType> types;
  for (const Direction& direction : directions()) {
    FrameDecoder decoder;
    std::span<const std::uint8_t> bytes = direction.bytes;
    while (const auto frame = decoder.next(bytes).value()) types.insert(frame->header.type);
  }
  EXPECT_EQ(types.size(), 11u);
}

TEST(HostileStream, InPiecesOfEverySize_SameEvents) {
  for (const auto& [to, bytes] : directions()) {
    const Seen whole = play(to, bytes, bytes.size());
    ASSERT_GE(whole.events.size(), 4u);
    for (std::size_t piece = 1; piece < bytes.size(); ++piece) {
      const Seen pieces = play(to, bytes, piece);
      ASSERT_EQ(pieces.events, whole.events) << piece;
      ASSERT_EQ(pieces.error, whole.error) << piece;
    }
  }
}

TEST(HostileStream, TornAtEveryByte_WhatCameBeforeIsRightAndTheEndIsKnown) {
  for (const auto& [to, bytes] : directions()) {
    const Seen whole = play(to, bytes, bytes.size());
    for (std::size_t n = 0; n < bytes.size(); ++n) {
      const Seen torn = play(to, std::span(bytes).first(n), 17);
      ASSERT_TRUE(is_beginning_of(torn.events, whole.events)) << n;
      ASSERT_TRUE(torn.error.empty() || torn.error.starts_with("link-closed (302): ") ||
                  torn.error.starts_with("cancelled"))
          << torn.error;
    }
  }
}

TEST(HostileStream, EveryBitFlipped_WhatCameBeforeIsRightAndTheErrorIsClear) {
  for (const auto& [to, bytes] : directions()) {
    const Seen whole = play(to, bytes, bytes.size());
    std::vector<std::uint8_t> flipped = bytes;
    for (std::size_t bit = 0; bit < bytes.size() * 8; ++bit) {
      const auto mask = static_cast<std::uint8_t>(1U << (bit % 8));
      flipped[bit / 8] ^= mask;
      const Seen seen = play(to, flipped, flipped.size());
      flipped[bit / 8] ^= mask;
      ASSERT_TRUE(is_beginning_of(seen.events, whole.events)) << bit;
      ASSERT_FALSE(seen.error.empty()) << bit;
      const bool clear = seen.error.starts_with("checksum (102)") || seen.error.starts_with("protocol (300)") ||
                         seen.error.starts_with("version-mismatch (301)");
      ASSERT_TRUE(clear) << bit << ": " << seen.error;
    }
  }
}

TEST(HostileStream, EveryByteLost_NeverAWrongEvent) {
  for (const auto& [to, bytes] : directions()) {
    const Seen whole = play(to, bytes, bytes.size());
    for (std::size_t lost = 0; lost < bytes.size(); ++lost) {
      std::vector<std::uint8_t> rest = bytes;
      rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(lost));
      const Seen seen = play(to, rest, rest.size());
      ASSERT_TRUE(is_beginning_of(seen.events, whole.events)) << lost;
      ASSERT_FALSE(seen.error.empty()) << lost;
    }
  }
}

}  // namespace
}  // namespace nodal
