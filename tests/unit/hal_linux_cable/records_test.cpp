#include "hal/linux/cable/records.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <vector>

#include "bytes.h"
#include "hal/linux/cable/function_fs.h"
#include "hal/linux/cable/receive_ring.h"

namespace nodal::hal::cable {
namespace {

Bytes record(std::uint16_t session, std::span<const std::uint8_t> payload) {
  Bytes bytes(kTransferBytes);
  const WrittenRecord written =
      write_record(session, payload, std::span<std::uint8_t, kTransferBytes>(bytes.data(), kTransferBytes));
  bytes.resize(written.transfer);
  return bytes;
}

/// Everything the reader makes of `stream`, given to it in pieces of `piece` bytes.
Result<Bytes> read_all(RecordReader& reader, std::span<const std::uint8_t> stream, std::size_t piece) {
  Bytes all;
  while (!stream.empty()) {
    auto part = stream.first(std::min(piece, stream.size()));
    stream = stream.subspan(part.size());
    while (!part.empty()) {
      const auto got = reader.next(part);
      if (!got) return fail(got.error());
      all.insert(all.end(), got->begin(), got->end());
    }
  }
  return all;
}

// USB ends a transfer at a packet that is shorter than the others, or when the receiver's buffer is full.
TEST(Records, OfEverySize_EndWithAShortPacketOrFillTheBuffer) {
  const Bytes bytes = numbered(kMaxPayload + 100);
  for (std::size_t n = 0; n <= bytes.size(); ++n) {
    Bytes into(kTransferBytes);
    const WrittenRecord written = write_record(1, std::span(bytes).first(n),
                                               std::span<std::uint8_t, kTransferBytes>(into.data(), kTransferBytes));
    ASSERT_EQ(written.payload, std::min(n, kMaxPayload));
    ASSERT_LE(written.transfer, kTransferBytes);
    ASSERT_TRUE(written.transfer == kTransferBytes || written.transfer % 64 != 0) << n;
    ASSERT_LE(written.transfer, written.payload + kHeaderBytes + 1);
  }
}

RC_GTEST_PROP(Records, AnySizesCutAnywhere_GiveTheStreamBack, ()) {
  const auto sizes = *rc::gen::container<std::vector<std::size_t>>(
      rc::gen::element<std::size_t>(1, 55, 56, 57, 120, 503, 504, 505, 1016, kMaxPayload - 1, kMaxPayload));
  const auto piece = *rc::gen::inRange<std::size_t>(1, 2000);
  const auto session = *rc::gen::arbitrary<std::uint16_t>();
  Bytes sent, stream;
  for (const std::size_t size : sizes) {
    const Bytes payload = numbered(size);
    sent.insert(sent.end(), payload.begin(), payload.end());
    const Bytes one = record(session, payload);
    stream.insert(stream.end(), one.begin(), one.end());
  }
  RecordReader reader(session);
  const auto got = read_all(reader, stream, piece);
  RC_ASSERT(got.has_value());
  RC_ASSERT(*got == sent);
  RC_ASSERT(!reader.ended());
  const Bytes last = record(session, {});
  RC_ASSERT(read_all(reader, last, piece)->empty());
  RC_ASSERT(reader.ended());
  RC_ASSERT(read_all(reader, numbered(500), piece)->empty());
}

TEST(Records, OfAnotherSession_AreRefusedWithBothNumbers) {
  for (const auto& [ours, theirs] : {std::pair<std::uint16_t, std::uint16_t>{0, 65535}, {65535, 0}, {7, 6}}) {
    RecordReader reader(ours);
    const auto got = read_all(reader, record(theirs, numbered(3)), 64);
    ASSERT_FALSE(got);
    EXPECT_EQ(got.error().code, Errc::kProtocol);
    EXPECT_NE(got.error().message.find("session " + std::to_string(theirs)), std::string::npos) << got.error().text();
  }
}

TEST(Records, WithAHeaderOutsideItsRange_AreRefused) {
  const Bytes good = record(5, numbered(10));
  for (const auto& [at, value] : {std::pair<std::size_t, std::uint8_t>{0, 0}, {1, 0xff}, {5, 0x40}, {6, 2}, {7, 1}}) {
    Bytes bad = good;
    bad[at] = value;  // 5: a length of 0x400a, above 16376
    RecordReader reader(5);
    const auto got = read_all(reader, bad, 3);
    ASSERT_FALSE(got) << at;
    EXPECT_EQ(got.error().code, Errc::kProtocol);
  }
}

RC_GTEST_PROP(Records, AnyBytes_AreReadOrRefused, (const Bytes& noise)) {
  RecordReader reader(3);
  const auto got = read_all(reader, noise, 17);
  RC_ASSERT(!got || got->size() <= noise.size());
}

TEST(OpenAnswer, GoesThereAndBack_AndNothingElseIsTakenForOne) {
  for (const OpenAnswer answer : {OpenAnswer{0, 0}, OpenAnswer{1, 65535}, OpenAnswer{65535, 1}}) {
    EXPECT_EQ(read_answer(write_answer(answer)), answer);
  }
  const auto bytes = write_answer({1, 2});
  EXPECT_FALSE(read_answer(std::span(bytes).first(7)));
  EXPECT_FALSE(read_answer({}));
  EXPECT_FALSE(read_answer(numbered(8)));
}

/// A ring whose queue is a list of slots.
struct Ring {
  std::vector<std::size_t> queued;
  ReceiveRing ring{[this](std::size_t slot) {
    queued.push_back(slot);
    return true;
  }};
  void arrive(const Bytes& bytes) {
    const std::size_t slot = queued.front();
    queued.erase(queued.begin());
    ring.received(slot, bytes);
  }
};

TEST(ReceiveRing, PeerIsNotRead_NothingMoreIsQueued) {
  Ring it;
  it.ring.begin(1);
  ASSERT_EQ(it.queued.size(), kTransfers);
  const Bytes one = record(1, numbered(10));
  for (std::size_t i = 0; i < kTransfers; ++i) it.arrive(one);
  EXPECT_EQ(it.ring.queued(), 0u);
  EXPECT_EQ(it.ring.next_bytes(4).size(), 4u);
  EXPECT_EQ(it.ring.queued(), 0u) << "the slot still has bytes";
  EXPECT_EQ(it.ring.next_bytes(100).size(), 6u);
  EXPECT_EQ(it.ring.next_bytes(100).size(), 10u);
  EXPECT_EQ(it.ring.queued(), 1u);
}

TEST(ReceiveRing, EmptyTransfers_AreQueuedAgain) {
  Ring it;
  it.ring.begin(1);
  for (int round = 0; round < 3; ++round) {
    for (std::size_t i = 0; i < kTransfers; ++i) it.arrive({});
    EXPECT_TRUE(it.ring.next_bytes(100).empty());
    EXPECT_EQ(it.ring.queued(), kTransfers);
  }
}

TEST(ReceiveRing, Stopped_GivesWhatHadArrivedAndQueuesNothing) {
  Ring it;
  it.ring.begin(1);
  const Bytes one = record(1, numbered(10));
  it.arrive({});
  it.arrive(one);
  it.ring.stop();
  while (!it.queued.empty()) it.arrive({});
  EXPECT_EQ(it.ring.next_bytes(100).size(), 10u);
  EXPECT_TRUE(it.ring.next_bytes(100).empty());
  EXPECT_TRUE(it.queued.empty());
}

// The layout that include/uapi/linux/usb/functionfs.h and USB 3.2, 9.6, specify.
TEST(Descriptors, HaveTheLengthsTheyState) {
  const Bytes bytes = function_descriptors();
  ASSERT_EQ(bytes.size(), 12u + 12u + 2 * (9 + 7 + 7) + (9 + 7 + 6 + 7 + 6));
  EXPECT_EQ(bytes[4] | bytes[5] << 8, static_cast<int>(bytes.size()));
  int interfaces = 0, packets = 0;
  for (std::size_t at = 24; at < bytes.size(); at += bytes[at]) {
    ASSERT_GT(bytes[at], 1);
    if (bytes[at + 1] == 4) ++interfaces;
    if (bytes[at + 1] == 5) packets += bytes[at + 4] | bytes[at + 5] << 8;
  }
  EXPECT_EQ(interfaces, 3);
  EXPECT_EQ(packets, 2 * (64 + 512 + 1024));
  EXPECT_EQ(function_strings("abc").size(), 16u + 2 + 4);
}

}  // namespace
}  // namespace nodal::hal::cable
