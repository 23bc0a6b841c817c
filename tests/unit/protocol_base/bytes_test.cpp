#include "protocol/base/bytes.h"

#include <gtest/gtest.h>

#include <array>
#include <vector>

namespace nodal {
namespace {

TEST(ByteReader, EveryWidth_LowestByteComesFirst) {
  const std::array<std::uint8_t, 15> bytes{0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0xF8,
                                           0xF9, 0xFA, 0xFB, 0xFC, 0xFD, 0xFE, 0xFF};
  ByteReader in(bytes);
  EXPECT_EQ(in.u8(), 0x01);
  EXPECT_EQ(in.u16(), 0x0302);
  EXPECT_EQ(in.u32(), 0x07060504u);
  EXPECT_EQ(in.u64(), 0xFFFEFDFCFBFAF9F8u);
  EXPECT_TRUE(in.complete());
}

TEST(ByteReader, PastTheEnd_ZerosForEverAndNotOk) {
  const std::array<std::uint8_t, 3> bytes{1, 2, 3};
  ByteReader in(bytes);
  EXPECT_EQ(in.u32(), 0u);
  EXPECT_FALSE(in.ok());
  EXPECT_EQ(in.u8(), 0u) << "the three bytes are not read in another way after the failure";
  EXPECT_TRUE(in.bytes(0).empty());
  EXPECT_FALSE(in.complete());
}

TEST(ByteReader, BytesLeftOver_OkButNotComplete) {
  const std::array<std::uint8_t, 3> bytes{1, 2, 3};
  ByteReader in(bytes);
  in.u16();
  EXPECT_TRUE(in.ok());
  EXPECT_FALSE(in.complete());
  EXPECT_EQ(in.left(), 1u);
}

TEST(ByteReader, LengthNearTheLargestNumber_IsPastTheEnd) {
  const std::array<std::uint8_t, 3> bytes{1, 2, 3};
  ByteReader in(bytes);
  in.u8();
  EXPECT_TRUE(in.bytes(SIZE_MAX).empty());
  EXPECT_FALSE(in.ok());
}

TEST(ByteWriter, WhatWasWritten_ReadsBackAndLiesLittleEndian) {
  std::array<std::uint8_t, 15> bytes{};
  ByteWriter out(bytes);
  out.u8(0x11);
  out.u16(0x3322);
  out.u32(0x77665544);
  out.u64(0xFFEEDDCCBBAA9988);
  ASSERT_TRUE(out.ok());
  EXPECT_EQ(out.size(), 15u);
  for (std::size_t i = 0; i < bytes.size(); ++i) EXPECT_EQ(bytes[i], 0x11 * (i + 1));
}

TEST(ByteWriter, Full_WritesNothingMoreAndNothingOutside) {
  std::array<std::uint8_t, 4> bytes{9, 9, 9, 9};
  ByteWriter out{std::span(bytes).first(3)};
  out.u16(0);
  out.u16(0);
  EXPECT_FALSE(out.ok());
  EXPECT_EQ(out.size(), 2u);
  out.u8(0);
  EXPECT_EQ(bytes[2], 9) << "after the failure nothing is written, or fields would change places";
  EXPECT_EQ(bytes[3], 9);
}

}  // namespace
}  // namespace nodal
