// Bodies that are read in pieces while they are sent.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>

#include "conversation.h"

namespace nodal {
namespace {

std::uint8_t byte_at(std::uint64_t offset) { return static_cast<std::uint8_t>((offset * 0x9E3779B97F4A7C15U) >> 56); }

/// A body of any size that needs no memory. Counts the bytes that were read.
class Generated final : public BodySource {
 public:
  explicit Generated(std::uint64_t size) : size_(size) {}
  std::uint64_t size() const override { return size_; }
  Status read(std::uint64_t offset, std::span<std::uint8_t> bytes) override {
    ++reads;
    longest = std::max(longest, bytes.size());
    EXPECT_LE(offset + bytes.size(), size_);
    if (offset + bytes.size() > fails_at) return fail(Errc::kIo, "file 'take.mkv': the disk reports an error");
    for (std::uint8_t& byte : bytes) byte = byte_at(offset++);
    return {};
  }

  std::uint64_t fails_at = std::numeric_limits<std::uint64_t>::max();
  int reads = 0;
  std::size_t longest = 0;

 private:
  const std::uint64_t size_;
};

/// The part of one stream that arrived at the host.
struct Received {
  std::string meta;
  std::uint64_t bytes = 0;
  std::uint64_t total = 0;
  std::uint64_t wrong = 0;  ///< bytes that differ from byte_at() of their offset
  bool whole = false;
  std::optional<Error> closed;
};

/// Takes the host's events of `stream`; `offset` is the body's first byte that is sent.
void take(Conversation& talk, StreamId stream, std::uint64_t offset, Received& into) {
  for (const Event& event : talk.at_host) {
    if (const auto* piece = std::get_if<BulkPiece>(&event); piece != nullptr && piece->stream == stream) {
      if (piece->first) into.meta = piece->meta;
      EXPECT_EQ(piece->offset, into.bytes);
      for (const std::uint8_t byte : piece->data) into.wrong += byte != byte_at(offset + into.bytes++);
      into.total = piece->total;
      into.whole = piece->last;
    } else if (const auto* closed = std::get_if<StreamClosed>(&event); closed != nullptr && closed->stream == stream) {
      into.closed = closed->error;
    }
  }
  talk.at_host.clear();
}

TEST(BodySource, AnySizeFromAnyOffset_ArrivesAsTheSourceHasIt) {
  for (const std::uint64_t size : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{kMaxPieceBytes - 5},
                                   std::uint64_t{kMaxPieceBytes}, std::uint64_t{3 * kMaxPieceBytes + 1}}) {
    for (const std::uint64_t offset : {std::uint64_t{0}, size / 2, size}) {
      Conversation talk;
      talk.run();
      const auto source = std::make_shared<Generated>(size);
      const StreamId stream = talk.rig->open_stream(StreamPolicy::kLossless).value();
      ASSERT_TRUE(talk.rig->offer(stream, BulkItem{"about", source, offset}));
      talk.run();
      Received received;
      take(talk, stream, offset, received);
      EXPECT_TRUE(received.whole) << size << " from " << offset;
      EXPECT_EQ(received.meta, "about");
      EXPECT_EQ(received.bytes, size - offset);
      EXPECT_EQ(received.wrong, 0U);
      EXPECT_LE(source->longest, kMaxPieceBytes);
      EXPECT_EQ(source.use_count(), 1) << "the stream gives it back";
    }
  }
}

TEST(BodySource, AcrossFourGigabytes_PlacesAreCountedIn64Bits) {
  constexpr std::uint64_t kFourGiB = std::uint64_t{1} << 32;
  constexpr std::uint64_t kAround = 300'000;
  Conversation talk;
  talk.run();
  const auto source = std::make_shared<Generated>(kFourGiB + kAround);
  const StreamId stream = talk.rig->open_stream(StreamPolicy::kLossless).value();
  ASSERT_TRUE(talk.rig->offer(stream, BulkItem{"", source, kFourGiB - kAround}));
  talk.run();
  Received received;
  take(talk, stream, kFourGiB - kAround, received);
  EXPECT_TRUE(received.whole);
  EXPECT_EQ(received.bytes, 2 * kAround);
  EXPECT_EQ(received.wrong, 0U);
}

TEST(BodySource, NoCredit_NothingIsReadBeforeItCanGo) {
  Conversation talk;
  talk.run();
  const auto source = std::make_shared<Generated>(kMaxItemBytes);
  const StreamId stream = talk.rig->open_stream(StreamPolicy::kLossless).value();
  ASSERT_TRUE(talk.rig->offer(stream, BulkItem{"", source, 0}));
  (void)take_output(*talk.rig);
  EXPECT_EQ(source->reads, 0);
  Conversation with_credit;
  with_credit.run();
  const StreamId other = with_credit.rig->open_stream(StreamPolicy::kLossless).value();
  ASSERT_TRUE(with_credit.rig->offer(other, BulkItem{"", source, 0}));
  Conversation::move(*with_credit.rig, *with_credit.host, with_credit.at_host);
  Conversation::move(*with_credit.host, *with_credit.rig, with_credit.at_rig);  // the first credit
  for (int i = 0; i < 3; ++i) (void)with_credit.rig->output();
  EXPECT_EQ(source->reads, 1) << "one piece is in memory at a time";
}

TEST(BodySource, SizesThatCannotBe_AreRefused) {
  Conversation talk;
  talk.run();
  const StreamId stream = talk.rig->open_stream(StreamPolicy::kLossless).value();
  constexpr std::uint64_t kMax = std::numeric_limits<std::uint64_t>::max();
  const auto offer = [&](std::uint64_t size, std::uint64_t offset) {
    return talk.rig->offer(stream, BulkItem{"meta", std::make_shared<Generated>(size), offset});
  };
  for (const std::uint64_t size : {kMax, kMax - 3, kMaxItemBytes + 1, kMaxItemBytes, kMaxItemBytes - 3}) {
    const Status refused = offer(size, 0);
    ASSERT_FALSE(refused) << size;
    EXPECT_EQ(refused.error().code, Errc::kTooLarge);
  }
  EXPECT_EQ(offer(5, 6).error().code, Errc::kBadValue);
  EXPECT_EQ(offer(5, kMax).error().code, Errc::kBadValue);
  EXPECT_TRUE(offer(kMaxItemBytes - 4, 0));
}

TEST(BodySource, ReadingFails_TheStreamEndsWithTheReasonAndOthersGoOn) {
  Conversation talk;
  talk.run();
  const auto broken = std::make_shared<Generated>(10 * kMaxPieceBytes);
  broken->fails_at = 2 * kMaxPieceBytes;
  const auto good = std::make_shared<Generated>(10 * kMaxPieceBytes);
  const StreamId first = talk.rig->open_stream(StreamPolicy::kLossless).value();
  const StreamId second = talk.rig->open_stream(StreamPolicy::kLossless).value();
  ASSERT_TRUE(talk.rig->offer(first, BulkItem{"", broken, 0}));
  ASSERT_TRUE(talk.rig->offer(first, BulkItem{"", broken, 0}));
  ASSERT_TRUE(talk.rig->offer(second, BulkItem{"", good, 0}));
  talk.run();
  Received torn;
  Received whole;
  auto events = talk.at_host;
  take(talk, first, 0, torn);
  talk.at_host = std::move(events);
  take(talk, second, 0, whole);
  EXPECT_FALSE(torn.whole);
  EXPECT_EQ(torn.bytes, 2 * kMaxPieceBytes);
  EXPECT_EQ(torn.wrong, 0U);
  ASSERT_TRUE(torn.closed);
  EXPECT_EQ(torn.closed->code, Errc::kIo);
  EXPECT_NE(torn.closed->message.find("take.mkv"), std::string::npos) << torn.closed->message;
  EXPECT_TRUE(whole.whole);
  EXPECT_EQ(whole.wrong, 0U);
  EXPECT_FALSE(talk.rig->counts(first)) << "it is closed";
  EXPECT_EQ(broken.use_count(), 1);
}

TEST(BodySource, TheOnlyStreamFails_ItsCloseGoesOutAtOnce) {
  Conversation talk;
  talk.run();
  const auto broken = std::make_shared<Generated>(100);
  broken->fails_at = 0;
  const StreamId stream = talk.rig->open_stream(StreamPolicy::kLossless).value();
  ASSERT_TRUE(talk.rig->offer(stream, BulkItem{"", broken, 0}));
  talk.run();
  const auto closes = only<StreamClosed>(talk.at_host);
  ASSERT_EQ(closes.size(), 1U);
  EXPECT_EQ(closes.front().dropped, 1U);
  ASSERT_TRUE(closes.front().error);
}

}  // namespace
}  // namespace nodal
