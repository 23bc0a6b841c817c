#include "protocol/framing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "protocol/base/bytes.h"
#include "protocol/base/crc32c.h"

namespace nodal {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes frame(FrameHeader header, const Bytes& payload) {
  const auto head = encode_frame_header(header, payload);
  Bytes bytes(head.size() + payload.size());
  std::copy(head.begin(), head.end(), bytes.begin());
  std::copy(payload.begin(), payload.end(), bytes.begin() + kFrameHeaderBytes);
  return bytes;
}

/// A frame with one header field overwritten and the header's CRC recomputed.
Bytes forged(Bytes bytes, std::size_t at, std::uint32_t value, std::size_t width) {
  for (std::size_t i = 0; i < width; ++i) bytes[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
  ByteWriter(std::span(bytes).subspan(24, 4)).u32(crc32c(std::span(bytes).first(24)));
  return bytes;
}

Error first_error(std::span<const std::uint8_t> bytes) {
  FrameDecoder decoder;
  while (true) {
    const auto got = decoder.next(bytes);
    if (!got) return got.error();
    if (!*got) return Error{Errc::kInternal, "no error"};
  }
}

const Bytes kHi{'h', 'i'};

// The layout of framing.h, written by hand; the CRCs computed bit by bit from the definition, in another language.
TEST(Framing, RequestFrame_LiesAsDocumented) {
  const Bytes expected{'N', 'O', 'D', 'L', 1, 2,    0xCD, 0xAB, 4,    3,    2,    1,    0,    0,   0,
                       0,   2,   0,   0,   0, 0xC2, 0xD9, 0x9D, 0xF5, 0xC5, 0x5B, 0x20, 0x97, 'h', 'i'};
  EXPECT_EQ(frame(FrameHeader{FrameType::kRequest, 0xABCD, 0x01020304, 0}, kHi), expected);
}

TEST(FrameDecoder, TwoFrames_ComeOutAsTheyWentIn) {
  Bytes bytes = frame({FrameType::kRequest, 1, 0, 0}, kHi);
  const Bytes second = frame({FrameType::kBulk, 0, 7, 1}, Bytes(kMaxBulkBytes, 5));
  bytes.insert(bytes.end(), second.begin(), second.end());
  FrameDecoder decoder;
  std::span<const std::uint8_t> rest = bytes;
  auto got = decoder.next(rest).value();
  ASSERT_TRUE(got);
  EXPECT_EQ(got->header, (FrameHeader{FrameType::kRequest, 1, 0, 0}));
  EXPECT_EQ(Bytes(got->payload.begin(), got->payload.end()), kHi);
  got = decoder.next(rest).value();
  ASSERT_TRUE(got);
  EXPECT_EQ(got->header, (FrameHeader{FrameType::kBulk, 0, 7, 1}));
  EXPECT_EQ(got->payload.size(), kMaxBulkBytes);
  EXPECT_TRUE(rest.empty());
  EXPECT_TRUE(decoder.at_border());
}

TEST(FrameDecoder, CutAnywhere_SameFrame) {
  const Bytes bytes = frame({FrameType::kReply, 0, 0, 0}, Bytes{1, 2, 3, 4, 5});
  for (std::size_t cut = 0; cut < bytes.size(); ++cut) {
    FrameDecoder decoder;
    auto first = std::span<const std::uint8_t>(bytes).first(cut);
    auto second = std::span<const std::uint8_t>(bytes).subspan(cut);
    ASSERT_FALSE(decoder.next(first).value()) << cut;
    EXPECT_TRUE(first.empty());
    EXPECT_EQ(decoder.at_border(), cut == 0);
    const auto got = decoder.next(second).value();
    ASSERT_TRUE(got) << cut;
    EXPECT_EQ(Bytes(got->payload.begin(), got->payload.end()), (Bytes{1, 2, 3, 4, 5}));
  }
}

TEST(FrameDecoder, EmptyPayload_IsAFrame) {
  FrameDecoder decoder;
  const Bytes bytes = frame({FrameType::kReply, 0, 0, 0}, {});
  std::span<const std::uint8_t> rest = bytes;
  const auto got = decoder.next(rest).value();
  ASSERT_TRUE(got);
  EXPECT_TRUE(got->payload.empty());
}

TEST(FrameDecoder, SomebodyWhoSpeaksSomethingElse_ProtocolSaysSo) {
  const std::string_view http = "GET / HTTP/1.1\r\nHost: rig\r\n\r\n";
  const Error error = first_error({reinterpret_cast<const std::uint8_t*>(http.data()), http.size()});
  EXPECT_EQ(error.code, Errc::kProtocol);
  EXPECT_NE(error.message.find("does not speak Nodal's protocol"), std::string::npos) << error.message;
}

TEST(FrameDecoder, NewerFraming_VersionMismatchNamesBoth) {
  Bytes bytes = frame({FrameType::kRequest, 0, 0, 0}, kHi);
  bytes[4] = 9;  // another version may compute its CRC in another way, so the CRC is unchanged
  const Error error = first_error(bytes);
  EXPECT_EQ(error.code, Errc::kVersionMismatch);
  EXPECT_NE(error.message.find("version 9"), std::string::npos);
}

TEST(FrameDecoder, LengthOverTheLimitOfItsType_TooLargeBeforeAnythingIsAllocated) {
  const std::pair<FrameType, std::size_t> limits[] = {{FrameType::kHello, kMaxMessageBytes},
                                                      {FrameType::kRequest, kMaxRequestBytes},
                                                      {FrameType::kReply, kMaxReplyBytes},
                                                      {FrameType::kBulk, kMaxBulkBytes}};
  for (const auto& [type, limit] : limits) {
    const Bytes honest = frame({type, 0, 0, 0}, {});
    EXPECT_EQ(first_error(forged(honest, 16, static_cast<std::uint32_t>(limit), 4)).code, Errc::kInternal);
    for (const std::uint32_t length : {static_cast<std::uint32_t>(limit + 1), 0x80000000U, 0xFFFFFFFFU}) {
      const Error error = first_error(forged(honest, 16, length, 4));
      EXPECT_EQ(error.code, Errc::kTooLarge);
      EXPECT_NE(error.message.find(std::to_string(limit)), std::string::npos) << error.message;
    }
  }
}

TEST(FrameDecoder, UnknownType_Protocol) {
  for (const std::uint32_t type : {0U, 7U, 15U, 21U, 255U}) {
    const Error error = first_error(forged(frame({FrameType::kHello, 0, 0, 0}, {}), 5, type, 1));
    EXPECT_EQ(error.code, Errc::kProtocol);
    EXPECT_NE(error.message.find("type " + std::to_string(type)), std::string::npos) << error.message;
  }
}

TEST(FrameDecoder, FrameLostRepeatedOrReplayed_ProtocolNamesBothNumbers) {
  const Bytes zero = frame({FrameType::kRequest, 0, 0, 0}, kHi);
  const Bytes two = frame({FrameType::kRequest, 0, 0, 2}, kHi);
  for (const Bytes& second : {zero, two}) {
    Bytes bytes = zero;
    bytes.insert(bytes.end(), second.begin(), second.end());
    const Error error = first_error(bytes);
    EXPECT_EQ(error.code, Errc::kProtocol);
    EXPECT_NE(error.message.find("where frame 1 was due"), std::string::npos) << error.message;
  }
}

TEST(FrameDecoder, AnyBitFlipped_AnErrorAndNeverAFrame) {
  const Bytes honest = frame({FrameType::kRequest, 0, 3, 0}, kHi);
  for (std::size_t bit = 0; bit < honest.size() * 8; ++bit) {
    Bytes bytes = honest;
    bytes[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    const Error error = first_error(bytes);
    EXPECT_TRUE(error.code == Errc::kChecksum || error.code == Errc::kProtocol || error.code == Errc::kVersionMismatch)
        << "bit " << bit << ": " << error.text();
  }
}

TEST(FrameDecoder, AfterAnError_GoodFramesChangeNothing) {
  Bytes bytes = frame({FrameType::kRequest, 0, 0, 0}, kHi);
  bytes.back() ^= 1;
  FrameDecoder decoder;
  std::span<const std::uint8_t> rest = bytes;
  const auto first = decoder.next(rest);
  ASSERT_FALSE(first);
  const Error error = first.error();
  EXPECT_EQ(error.code, Errc::kChecksum);
  const Bytes good = frame({FrameType::kRequest, 0, 0, 0}, kHi);
  rest = good;
  const auto again = decoder.next(rest);
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().message, error.message);
  EXPECT_FALSE(decoder.at_border());
}

}  // namespace
}  // namespace nodal
