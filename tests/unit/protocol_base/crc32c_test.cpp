#include "protocol/base/crc32c.h"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <string_view>
#include <vector>

namespace nodal {
namespace {

std::span<const std::uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

struct Known {
  std::vector<std::uint8_t> bytes;
  std::uint32_t crc;
};

// RFC 3720, appendix B.4 (CRCs listed byte by byte, lowest first), and the catalogue's check value.
std::vector<Known> known_answers() {
  std::vector<std::uint8_t> rising(32), falling(32);
  for (std::size_t i = 0; i < 32; ++i) {
    rising[i] = static_cast<std::uint8_t>(i);
    falling[i] = static_cast<std::uint8_t>(31 - i);
  }
  const std::vector<std::uint8_t> iscsi_read{0x01, 0xc0, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
                                             0x00, 0x00, 0x00, 0x00, 0x14, 0x00, 0x00, 0x00, 0x00, 0x00, 0x04, 0x00,
                                             0x00, 0x00, 0x00, 0x14, 0x00, 0x00, 0x00, 0x18, 0x28, 0x00, 0x00, 0x00,
                                             0x00, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00};
  const auto digits = bytes_of("123456789");
  return {{std::vector<std::uint8_t>(32, 0x00), 0x8A9136AA},
          {std::vector<std::uint8_t>(32, 0xFF), 0x62A8AB43},
          {rising, 0x46DD794E},
          {falling, 0x113FDB5C},
          {iscsi_read, 0xD9963A56},
          {{digits.begin(), digits.end()}, 0xE3069283},
          {{}, 0}};
}

TEST(Crc32c, Rfc3720_KnownAnswers) {
  for (const Known& known : known_answers()) {
    EXPECT_EQ(crc32c_by_table(known.bytes), known.crc);
    EXPECT_EQ(crc32c(known.bytes), known.crc);
  }
}

TEST(Crc32c, ProcessorAndTable_AgreeOnEveryLengthAndAlignment) {
  std::mt19937 random(1);
  std::vector<std::uint8_t> bytes(300);
  for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
  for (std::size_t from = 0; from < 16; ++from) {
    for (std::size_t n = 0; from + n <= bytes.size(); n += 1 + n / 20) {
      const auto part = std::span(bytes).subspan(from, n);
      ASSERT_EQ(crc32c(part, 0x12345678), crc32c_by_table(part, 0x12345678)) << from << " " << n;
    }
  }
}

TEST(Crc32c, InTwoParts_SameAsWhole) {
  const auto digits = bytes_of("123456789");
  for (std::size_t cut = 0; cut <= digits.size(); ++cut) {
    EXPECT_EQ(crc32c(digits.subspan(cut), crc32c(digits.first(cut))), 0xE3069283u);
  }
}

}  // namespace
}  // namespace nodal
