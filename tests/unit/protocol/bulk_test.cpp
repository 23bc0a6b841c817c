#include "protocol/bulk.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>

#include "conversation.h"

namespace nodal {
namespace {

/// Assembles a stream's items and checks every piece against what was offered.
class Collector {
 public:
  void take(const BulkPiece& piece, const std::map<std::uint64_t, BulkItem>& offered) {
    const auto found = offered.find(piece.item);
    RC_ASSERT(found != offered.end());
    const std::span<const std::uint8_t> body = *std::get<SharedBytes>(found->second.body);
    RC_ASSERT(piece.first == (piece.offset == 0 && !inside_));
    if (piece.first) {
      RC_ASSERT(!inside_);
      RC_ASSERT(piece.item >= next_item_);
      RC_ASSERT(piece.meta == found->second.meta);
      RC_ASSERT(piece.dropped == piece.item - whole);
      item_ = piece.item;
    }
    RC_ASSERT(piece.item == item_);
    RC_ASSERT(piece.offset == at_);
    RC_ASSERT(piece.total == body.size());
    RC_ASSERT(std::equal(piece.data.begin(), piece.data.end(), body.begin() + static_cast<std::ptrdiff_t>(at_)));
    at_ += piece.data.size();
    inside_ = !piece.last;
    if (!piece.last) return;
    RC_ASSERT(at_ == body.size());
    at_ = 0;
    next_item_ = piece.item + 1;
    ++whole;
  }

  std::uint64_t whole = 0;

 private:
  bool inside_ = false;
  std::uint64_t item_ = 0;
  std::uint64_t next_item_ = 0;
  std::uint64_t at_ = 0;
};

/// A rig that offers items on one stream, a host that reads at chosen times, bytes split in any way.
struct BulkWorld {
  explicit BulkWorld(StreamPolicy with) : policy(with), stream(talk.rig->open_stream(with).value()) { talk.run(); }

  void offer(std::size_t body, std::size_t meta) {
    BulkItem item{std::string(meta, 'm'), shared_bytes(body, static_cast<std::uint32_t>(number)), 0};
    const Status status = talk.rig->offer(stream, item);
    if (status) {
      offered[number++] = std::move(item);
    } else {
      RC_ASSERT(policy == StreamPolicy::kLossless);
      RC_ASSERT(status.error().code == Errc::kOverload);
    }
  }

  /// At most `most` bytes from one end to the other.
  static void move(Session& from, Session& to, std::size_t most) {
    while (most > 0 && to.wants_input()) {
      const auto out = from.output();
      if (out.empty()) return;
      const auto part = out.first(std::min(most, out.size()));
      const Status status = to.receive(part);
      RC_ASSERT(status.has_value());
      from.sent(part.size());
      most -= part.size();
    }
  }

  void consume(std::size_t events) {
    for (; events > 0; --events) {
      auto event = talk.host->next_event();
      if (!event) return;
      if (const auto* piece = std::get_if<BulkPiece>(&*event)) collector.take(*piece, offered);
    }
  }

  void check_counts() {
    const StreamCounts counts = talk.rig->counts(stream).value();
    RC_ASSERT(counts.offered == number);
    RC_ASSERT(counts.offered == counts.delivered + counts.dropped + counts.pending);
    RC_ASSERT(counts.pending <= (policy == StreamPolicy::kLatest ? 2 : kLosslessQueueItems));
    if (policy == StreamPolicy::kLossless) RC_ASSERT(counts.dropped == 0u);
    RC_ASSERT(counts.bytes == talk.host->bulk_received(stream));  // pieces that have arrived in part count, too
    RC_ASSERT(counts.bytes == talk.rig->bulk_taken());
    RC_ASSERT(collector.whole <= counts.delivered);
  }

  void settle() {
    for (std::uint64_t before = ~0ULL; before != collector.whole || talk.rig->counts(stream)->pending > 0;) {
      before = collector.whole;
      move(*talk.rig, *talk.host, SIZE_MAX);
      consume(SIZE_MAX);
      move(*talk.host, *talk.rig, SIZE_MAX);
    }
  }

  Conversation talk;
  StreamPolicy policy;
  StreamId stream;
  std::uint64_t number = 0;
  std::map<std::uint64_t, BulkItem> offered;
  Collector collector;
};

void any_script(StreamPolicy policy) {
  BulkWorld world(policy);
  const auto steps = *rc::gen::inRange(1, 60);
  for (int i = 0; i < steps; ++i) {
    switch (*rc::gen::inRange(0, 4)) {
      case 0:
        world.offer(*rc::gen::element<std::size_t>(0, 1, 1000, kMaxPieceBytes - 7, kMaxPieceBytes, 300'000, 3'000'000),
                    *rc::gen::element<std::size_t>(0, 7, kMaxMetaBytes));
        break;
      case 1:
        BulkWorld::move(*world.talk.rig, *world.talk.host,
                        *rc::gen::element<std::size_t>(1, 27, 1000, 70'000, 1'000'000, 8'000'000));
        break;
      case 2: BulkWorld::move(*world.talk.host, *world.talk.rig, *rc::gen::inRange<std::size_t>(1, 200)); break;
      default: world.consume(*rc::gen::inRange<std::size_t>(1, 40));
    }
    world.check_counts();
  }
  world.settle();
  world.check_counts();
  const StreamCounts counts = world.talk.rig->counts(world.stream).value();
  RC_ASSERT(counts.pending == 0u);
  RC_ASSERT(world.collector.whole == counts.delivered);

  world.talk.rig->close_stream(world.stream);
  world.talk.run();
  const auto closed = only<StreamClosed>(world.talk.at_host);
  RC_ASSERT(closed.size() == 1u);
  RC_ASSERT(closed[0].offered == world.number);
  RC_ASSERT(closed[0].dropped == counts.dropped);
  RC_ASSERT(!closed[0].error);
}

RC_GTEST_PROP(Bulk, LosslessWithAnyCutsAndCredits_EveryItemArrivesInOrder, ()) { any_script(StreamPolicy::kLossless); }

RC_GTEST_PROP(Bulk, LatestWithAnyCutsAndCredits_NothingTornAndEveryDropCounted, ()) {
  any_script(StreamPolicy::kLatest);
}

TEST(Bulk, LatestWhileThePeerIsSlow_TheNewestReplacesAndTheGapTellsHowMany) {
  BulkWorld world(StreamPolicy::kLatest);
  for (int i = 0; i < 10; ++i) world.offer(100, 0);  // sending has begun for none: nine are replaced
  EXPECT_EQ(world.talk.rig->counts(world.stream)->dropped, 9u);
  world.talk.run();
  const auto pieces = only<BulkPiece>(world.talk.at_host);
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_EQ(pieces[0].item, 9u);
  EXPECT_EQ(pieces[0].dropped, 9u);
  EXPECT_EQ(pieces[0].data, *shared_bytes(100, 9));
}

TEST(Bulk, LatestItemThatHasBegun_IsFinishedBeforeTheNewest) {
  BulkWorld world(StreamPolicy::kLatest);
  world.offer(200'000, 0);
  BulkWorld::move(*world.talk.rig, *world.talk.host, 50'000);
  for (int i = 0; i < 3; ++i) world.offer(100, 0);
  world.talk.run();
  std::vector<std::uint64_t> whole;
  for (const BulkPiece& piece : only<BulkPiece>(world.talk.at_host)) {
    if (piece.last) whole.push_back(piece.item);
  }
  EXPECT_EQ(whole, (std::vector<std::uint64_t>{0, 3}));
}

TEST(Bulk, PiecesNotTaken_SenderStopsAtTheWindow) {
  for (const auto& [policy, window] : {std::pair{StreamPolicy::kLossless, kHostLosslessWindowBytes},
                                       std::pair{StreamPolicy::kLatest, kStreamWindowBytes}}) {
    BulkWorld world(policy);
    world.offer(20'000'000, 5);
    BulkWorld::move(*world.talk.host, *world.talk.rig, SIZE_MAX);
    BulkWorld::move(*world.talk.rig, *world.talk.host, SIZE_MAX);
    BulkWorld::move(*world.talk.host, *world.talk.rig, SIZE_MAX);
    EXPECT_TRUE(world.talk.rig->output().empty());
    std::uint64_t held = 0;
    while (auto event = world.talk.host->next_event()) {
      if (const auto* piece = std::get_if<BulkPiece>(&*event)) held += piece->data.size() + piece->meta.size();
    }
    EXPECT_EQ(held, window);
  }
}

// A sender that ignores its credit, and a receiver whose program consumes nothing.
TEST(Bulk, MoreBytesThanCredit_ProtocolAndNoMoreThanTheWindowIsHeld) {
  BulkReceiver receiver(1);
  ASSERT_TRUE(receiver.open(1, static_cast<std::uint32_t>(StreamPolicy::kLossless)));
  BulkSender sender(1);
  const StreamId stream = sender.open(StreamPolicy::kLossless).value();
  ASSERT_TRUE(sender.credit(stream, UINT64_MAX));
  ASSERT_TRUE(sender.offer(stream, BulkItem{"", shared_bytes(3'000'000), 0}));
  std::uint64_t held = 0;
  std::optional<Error> error;
  while (!error) {
    const auto piece = sender.next_piece();
    ASSERT_TRUE(piece) << "all of it was taken";
    std::vector<std::uint8_t> payload = piece->head;
    payload.insert(payload.end(), (*piece->slice).begin(), (*piece->slice).end());
    const auto taken = receiver.piece(stream, payload);
    sender.taken(payload.size() - kPieceHeaderBytes, true);
    if (taken) held += (*taken)->data.size();
    if (!taken) error = taken.error();
  }
  EXPECT_EQ(error->code, Errc::kProtocol);
  EXPECT_NE(error->message.find("than there was credit for"), std::string::npos) << error->message;
  EXPECT_LE(held, kStreamWindowBytes);
  EXPECT_GT(held, kStreamWindowBytes - kMaxPieceBytes);
}

TEST(Bulk, Saturated_ControlWaitsForOnePieceAtMost) {
  constexpr std::size_t kOnePiece = kFrameHeaderBytes + kMaxBulkBytes;
  for (const std::size_t written_before : {1UL, 100UL, 30'000UL, 65'000UL, 65'564UL, 200'001UL}) {
    Conversation talk;
    std::vector<StreamId> streams;
    for (int i = 0; i < 3; ++i) streams.push_back(talk.rig->open_stream(StreamPolicy::kLossless).value());
    talk.run();
    const auto body = shared_bytes(2'000'000);
    for (const StreamId stream : streams) ASSERT_TRUE(talk.rig->offer(stream, BulkItem{"", body, 0}));
    BulkWorld::move(*talk.rig, *talk.host, written_before);
    take_events(*talk.host);
    wire::Reply reply;
    reply.set_id(1);
    ASSERT_TRUE(talk.rig->send(reply));
    std::size_t waited = 0;
    bool came = false;
    while (!came) {
      const auto out = talk.rig->output();
      ASSERT_FALSE(out.empty());
      ASSERT_TRUE(talk.host->receive(out.first(1)));
      talk.rig->sent(1);
      ++waited;
      came = !only<wire::Reply>(take_events(*talk.host)).empty();
    }
    EXPECT_LE(waited, kOnePiece + kFrameHeaderBytes + reply.ByteSizeLong());
  }
}

TEST(Bulk, SeveralStreams_TakeTurnsPieceByPiece) {
  Conversation talk;
  const StreamId a = talk.rig->open_stream(StreamPolicy::kLossless).value();
  const StreamId b = talk.rig->open_stream(StreamPolicy::kLossless).value();
  talk.run();
  ASSERT_TRUE(talk.rig->offer(a, BulkItem{"", shared_bytes(10 * kMaxPieceBytes), 0}));
  ASSERT_TRUE(talk.rig->offer(b, BulkItem{"", shared_bytes(3 * kMaxPieceBytes), 0}));
  talk.run();
  const auto pieces = only<BulkPiece>(talk.at_host);
  ASSERT_EQ(pieces.size(), 13u);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(pieces[i].stream, i % 2 == 0 ? a : b);
}

TEST(Bulk, OneRaymapToThreeClients_IsNeverCopiedAndLetGo) {
  const auto body = shared_bytes(500'000);
  const std::uint8_t* begin = body->data();
  std::vector<Conversation> talks(3);
  for (Conversation& talk : talks) {
    const StreamId stream = talk.rig->open_stream(StreamPolicy::kLatest).value();
    talk.run();
    ASSERT_TRUE(talk.rig->offer(stream, BulkItem{"header", body, 0}));
  }
  EXPECT_EQ(body.use_count(), 4);
  for (Conversation& talk : talks) {
    std::size_t straight = 0;
    for (auto out = talk.rig->output(); !out.empty(); out = talk.rig->output()) {
      if (out.data() >= begin && out.data() < begin + body->size()) straight += out.size();
      ASSERT_TRUE(talk.host->receive(out));
      talk.rig->sent(out.size());
    }
    EXPECT_EQ(straight, body->size()) << "bytes go from the raymap's own memory to the link";
  }
  EXPECT_EQ(body.use_count(), 1);
}

TEST(Bulk, StreamClosedWithAnError_PendingIsDroppedAndTheReceiverKnows) {
  BulkWorld world(StreamPolicy::kLossless);
  for (int i = 0; i < 3; ++i) world.offer(200'000, 0);
  BulkWorld::move(*world.talk.rig, *world.talk.host, 300'000);  // sending of the second has begun
  world.talk.rig->close_stream(world.stream, Error{Errc::kDiskFull, "the card is full"});
  world.talk.run();
  EXPECT_EQ(world.talk.host->error(), nullptr);
  const auto closed = only<StreamClosed>(world.talk.at_host);
  ASSERT_EQ(closed.size(), 1u);
  EXPECT_EQ(closed[0].offered, 3u);
  EXPECT_EQ(closed[0].dropped, 2u);
  ASSERT_TRUE(closed[0].error);
  EXPECT_EQ(closed[0].error->code, Errc::kDiskFull);
  EXPECT_EQ(closed[0].error->message, "the card is full");
  EXPECT_EQ(world.talk.rig->offer(world.stream, BulkItem{}).error().code, Errc::kWrongState);
}

TEST(Bulk, ReceiverStops_SenderIsToldDropsAllAndTheSessionGoesOn) {
  BulkWorld world(StreamPolicy::kLossless);
  for (int i = 0; i < 5; ++i) world.offer(2'000'000, 0);
  BulkWorld::move(*world.talk.rig, *world.talk.host, 3'000'000);
  world.talk.host->stop_stream(world.stream, Error{Errc::kCancelled, "enough"});
  EXPECT_TRUE(only<BulkPiece>(take_events(*world.talk.host)).empty()) << "what waits is thrown away";
  world.talk.run();
  const auto stopped = only<StreamStopped>(world.talk.at_rig);
  ASSERT_EQ(stopped.size(), 1u);
  EXPECT_EQ(stopped[0].stream, world.stream);
  EXPECT_EQ(stopped[0].why.message, "enough");
  EXPECT_TRUE(only<BulkPiece>(world.talk.at_host).empty());
  EXPECT_FALSE(world.talk.rig->counts(world.stream));

  const StreamId next = world.talk.rig->open_stream(StreamPolicy::kLossless).value();
  ASSERT_TRUE(world.talk.rig->offer(next, BulkItem{"", shared_bytes(10), 0}));
  world.talk.run();
  EXPECT_EQ(only<BulkPiece>(world.talk.at_host).size(), 1u);
  EXPECT_EQ(world.talk.host->error(), nullptr);
  EXPECT_EQ(world.talk.rig->error(), nullptr);
}

TEST(Bulk, CloseAndStopCross_NeitherEndMinds) {
  BulkWorld world(StreamPolicy::kLatest);
  world.offer(10, 0);
  world.talk.rig->close_stream(world.stream);
  const auto from_rig = take_output(*world.talk.rig);  // the close is in transit
  world.talk.host->stop_stream(world.stream, Error{Errc::kCancelled, "enough"});
  ASSERT_TRUE(world.talk.rig->receive(take_output(*world.talk.host)));
  ASSERT_TRUE(world.talk.host->receive(from_rig));
  EXPECT_TRUE(take_events(*world.talk.rig).empty());
  EXPECT_TRUE(take_events(*world.talk.host).empty());
}

TEST(Bulk, TooManyStreams_OverloadUntilOneIsClosed) {
  Conversation talk;
  std::vector<StreamId> streams;
  for (std::size_t i = 0; i < kMaxStreams; ++i) streams.push_back(talk.rig->open_stream(StreamPolicy::kLatest).value());
  EXPECT_EQ(talk.rig->open_stream(StreamPolicy::kLatest).error().code, Errc::kOverload);
  talk.rig->close_stream(streams[3]);
  talk.run();
  EXPECT_TRUE(talk.rig->open_stream(StreamPolicy::kLatest));
  talk.run();
  EXPECT_EQ(talk.host->error(), nullptr);
}

TEST(Bulk, ItemsThatCannotBe_AreRefusedAndTheStreamGoesOn) {
  BulkWorld world(StreamPolicy::kLossless);
  Session& rig = *world.talk.rig;
  EXPECT_EQ(rig.offer(world.stream, BulkItem{std::string(kMaxMetaBytes + 1, 'm'), {}, 0}).error().code,
            Errc::kTooLarge);
  EXPECT_EQ(rig.offer(world.stream, BulkItem{"", shared_bytes(5), 6}).error().code, Errc::kBadValue);
  EXPECT_EQ(rig.offer(world.stream, BulkItem{"", {}, 1}).error().code, Errc::kBadValue);
  EXPECT_EQ(rig.offer(world.stream + 2, BulkItem{}).error().code, Errc::kWrongState);
  EXPECT_TRUE(rig.offer(world.stream, BulkItem{"", shared_bytes(5), 5}));
}

}  // namespace
}  // namespace nodal
