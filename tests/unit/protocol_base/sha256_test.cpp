#include "protocol/base/sha256.h"

#include <gtest/gtest.h>

#include <string_view>

namespace nodal {
namespace {

std::span<const std::uint8_t> hashed_bytes(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

// FIPS 180-4, appendix B.1 of its predecessor, and the empty message.
TEST(Sha256, Standard_KnownAnswers) {
  EXPECT_EQ(to_hex(sha256(hashed_bytes("abc"))), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(to_hex(sha256({})), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(Sha256, InPieces_SameAsWhole) {
  Sha256Stream stream;
  stream.update(hashed_bytes("a"));
  stream.update(hashed_bytes("bc"));
  EXPECT_EQ(stream.finish(), sha256(hashed_bytes("abc")));
}

}  // namespace
}  // namespace nodal
