#include "protocol/outgoing_frames.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "conversation.h"
#include "protocol/bulk_receiver.h"
#include "protocol/nodal.pb.h"

namespace nodal {
namespace {

/// What one end sends. Its streams have the numbers 1, 3, ...; the peer's 2, 4, ...
struct Sending {
  OutgoingFrames frames{1};
  BulkReceiver received{2};
  FrameDecoder decoder;

  /// The headers of all that goes out now, by `link` bytes at a time.
  std::vector<FrameHeader> take(std::size_t link = SIZE_MAX) {
    std::vector<FrameHeader> all;
    for (auto out = frames.output(received); !out.empty(); out = frames.output(received)) {
      std::span<const std::uint8_t> bytes = out.first(std::min(link, out.size()));
      const std::size_t taken = bytes.size();
      while (auto frame = decoder.next(bytes).value()) {
        all.push_back(frame->header);
        kept.emplace_back(frame->payload.begin(), frame->payload.end());
      }
      frames.sent(taken);
    }
    return all;
  }
  std::vector<FrameType> types(std::size_t link = SIZE_MAX) {
    std::vector<FrameType> found;
    for (const FrameHeader& header : take(link)) found.push_back(header.type);
    return found;
  }

  /// A stream of this end with credit for `allowed` bytes, and one item on it.
  StreamId stream_with_item(std::size_t bytes, std::uint64_t allowed) {
    const StreamId stream = frames.streams().open(StreamPolicy::kLossless).value();
    EXPECT_TRUE(frames.streams().credit(stream, allowed));
    EXPECT_TRUE(frames.streams().offer(stream, BulkItem{"meta", shared_bytes(bytes), 0}));
    return stream;
  }

  std::vector<std::vector<std::uint8_t>> kept;  ///< payloads of all frames so far
};

using Types = std::vector<FrameType>;

TEST(OutgoingFrames, ControlPingCreditClosePiece_GoOutInThisOrder) {
  Sending end;
  const StreamId closed = end.stream_with_item(0, 100);
  EXPECT_EQ(end.types(), Types{FrameType::kBulk});
  end.stream_with_item(10, 100);
  end.frames.streams().close(closed, std::nullopt);
  ASSERT_TRUE(end.received.open(2, static_cast<std::uint32_t>(StreamPolicy::kLossless)));
  end.frames.answer_ping();
  end.frames.answer_ping();
  end.frames.ping();
  end.frames.push(FrameType::kRequest, 0, "x");
  EXPECT_EQ(end.types(), (Types{FrameType::kRequest, FrameType::kPing, FrameType::kPong, FrameType::kCredit,
                                FrameType::kStreamClose, FrameType::kBulk}));
  EXPECT_EQ(end.types(), Types{});
}

TEST(OutgoingFrames, TheEndOfAStream_GoesBeforeThePiecesOfOthers) {
  Sending end;
  const StreamId closed = end.stream_with_item(0, 100);
  EXPECT_EQ(end.types(), Types{FrameType::kBulk});
  end.stream_with_item(10, 100);
  end.frames.streams().close(closed, std::nullopt);
  EXPECT_EQ(end.types(), (Types{FrameType::kStreamClose, FrameType::kBulk}));
}

TEST(OutgoingFrames, SequenceNumbers_CountAllFramesOfTheDirection) {
  Sending end;
  end.frames.push(FrameType::kRequest, 0, "x");
  end.stream_with_item(3 * kMaxPieceBytes, kStreamWindowBytes);
  end.frames.ping();
  std::uint32_t expected = 0;
  for (const FrameHeader& header : end.take()) EXPECT_EQ(header.sequence, expected++);
  EXPECT_EQ(expected, 1u + 1u + 4u);  // the meta takes a part of the first piece
}

TEST(OutgoingFrames, QueuedBytes_AreThoseOfWholeFramesUntilTheyAreWritten) {
  Sending end;
  end.frames.push(FrameType::kRequest, 0, "four");
  end.frames.push(FrameType::kRequest, 0, "");
  EXPECT_EQ(end.frames.queued_bytes(), 4 + 2 * kFrameHeaderBytes);
  EXPECT_EQ(end.types(1), (Types{FrameType::kRequest, FrameType::kRequest}));
  EXPECT_EQ(end.frames.queued_bytes(), 0u);
}

TEST(OutgoingFrames, ControlThatComesWhileAPieceIsWritten_WaitsForThatPieceOnly) {
  Sending end;
  end.stream_with_item(3 * kMaxPieceBytes, kStreamWindowBytes);
  const std::size_t written = end.frames.output(end.received).size();
  std::span<const std::uint8_t> bytes = end.frames.output(end.received);
  ASSERT_FALSE(end.decoder.next(bytes).value());  // the header and the meta; the body is a part of its own
  end.frames.sent(written);
  end.frames.push(FrameType::kRequest, 0, "x");
  const Types types = end.types();
  ASSERT_EQ(types.size(), 5u);
  EXPECT_EQ(types[0], FrameType::kBulk);
  EXPECT_EQ(types[1], FrameType::kRequest);
}

TEST(OutgoingFrames, TakenBytes_AreThoseOfItemsThatTheLinkTook) {
  Sending end;
  end.stream_with_item(10, 100);
  const std::size_t head = end.frames.output(end.received).size();
  ASSERT_EQ(head, kFrameHeaderBytes + kPieceHeaderBytes + 4);  // "meta"
  end.frames.sent(kFrameHeaderBytes + kPieceHeaderBytes);
  EXPECT_EQ(end.frames.streams().taken_bytes(), 0u);
  end.frames.sent(1);
  EXPECT_EQ(end.frames.streams().taken_bytes(), 1u);
  end.frames.sent(3);
  end.frames.sent(10);
  EXPECT_EQ(end.frames.streams().taken_bytes(), 14u);
  EXPECT_TRUE(end.frames.output(end.received).empty());
}

TEST(OutgoingFrames, EndOfStreams_ReleasesBodiesAndLeavesOnlyControl) {
  Sending end;
  const auto body = shared_bytes(3 * kMaxPieceBytes);
  const StreamId stream = end.frames.streams().open(StreamPolicy::kLossless).value();
  ASSERT_TRUE(end.frames.streams().credit(stream, kStreamWindowBytes));
  ASSERT_TRUE(end.frames.streams().offer(stream, BulkItem{"meta", body, 0}));
  end.frames.sent(end.frames.output(end.received).size());
  end.frames.end_streams();
  end.frames.ping();
  end.frames.push(FrameType::kBye, 0, "");
  // The piece that is being written is finished: the peer would not find the next frame without its rest.
  const std::size_t rest = end.frames.output(end.received).size();
  EXPECT_EQ(rest, kMaxPieceBytes - 4);
  end.frames.sent(rest);
  const std::span<const std::uint8_t> bye = end.frames.output(end.received);
  ASSERT_EQ(bye.size(), kFrameHeaderBytes);
  EXPECT_EQ(bye[5], static_cast<std::uint8_t>(FrameType::kBye));
  end.frames.sent(bye.size());
  EXPECT_TRUE(end.frames.output(end.received).empty()) << "a ping after the end";
  EXPECT_EQ(body.use_count(), 1) << "the body is still held";
  EXPECT_EQ(end.frames.streams().taken_bytes(), 0u) << "bytes of a stream that is gone are counted";
}

/// A file that became unreadable.
struct Unreadable final : BodySource {
  std::uint64_t size() const override { return 10; }
  Status read(std::uint64_t, std::span<std::uint8_t>) override { return fail(Errc::kIo, "cannot be read"); }
};

TEST(OutgoingFrames, BodyThatCannotBeRead_ClosesItsStreamWithTheError) {
  Sending end;
  const StreamId stream = end.frames.streams().open(StreamPolicy::kLossless).value();
  ASSERT_TRUE(end.frames.streams().credit(stream, 100));
  ASSERT_TRUE(end.frames.streams().offer(stream, BulkItem{"", std::make_shared<Unreadable>(), 0}));
  EXPECT_EQ(end.types(), Types{FrameType::kStreamClose});
  wire::StreamClose close;
  ASSERT_TRUE(close.ParseFromArray(end.kept.back().data(), static_cast<int>(end.kept.back().size())));
  EXPECT_EQ(close.error().message(), "cannot be read");
}

}  // namespace
}  // namespace nodal
