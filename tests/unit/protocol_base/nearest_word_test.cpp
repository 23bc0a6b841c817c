#include "protocol/base/nearest_word.h"

#include <gtest/gtest.h>

#include <array>
#include <string>

namespace nodal {
namespace {

constexpr std::array<std::string_view, 4> kWords{"status", "heads", "raymap", "register"};

TEST(NearestWord, OneOrTwoLettersWrong_FindsIt) {
  EXPECT_EQ(nearest_word("statsu", kWords), "status");
  EXPECT_EQ(nearest_word("head", kWords), "heads");
  EXPECT_EQ(nearest_word("raymp", kWords), "raymap");
}

TEST(NearestWord, AThirdOfALongWordWrong_FindsIt) { EXPECT_EQ(nearest_word("rogistered", kWords), "register"); }

TEST(NearestWord, AnotherWordAltogether_FindsNone) {
  EXPECT_EQ(nearest_word("offload", kWords), "");
  EXPECT_EQ(nearest_word("status", {}), "");
}

TEST(NearestWord, AVeryLongWord_IsNotCompared) { EXPECT_EQ(nearest_word(std::string(100'000, 's'), kWords), ""); }

}  // namespace
}  // namespace nodal
