#include "protocol/strict_json.h"

#include <gtest/gtest.h>

#include <string>

namespace nodal {
namespace {

constexpr JsonLimits kLimits{1000, 4};

/// {"a": [numbers or {"b": ...}], "c": {"d": ...}, "e": text of 5, "gain": number}
JsonShape shape() {
  const JsonShape value = JsonShape::value(5);
  return JsonShape::object({{"a", JsonShape::list(3, JsonShape::object({{"b", value}}))},
                            {"c", JsonShape::object({{"d", value}})},
                            {"e", value},
                            {"gain", value}});
}

nlohmann::json kept(const std::string& text) {
  const auto tree = parse_strict_json(text, kLimits, shape());
  EXPECT_TRUE(tree) << tree.error().text();
  return tree.value_or(nlohmann::json());
}

TEST(StrictJson, GoodText_BecomesTheTree) {
  const auto tree = parse_strict_json(R"({"a": [1, -2.5, {"b": null}], "c": {"d": true}, "e": "x"})", kLimits, shape());
  ASSERT_TRUE(tree) << tree.error().text();
  EXPECT_EQ(*tree, nlohmann::json::parse(R"({"a": [1, -2.5, {"b": null}], "c": {"d": true}, "e": "x"})"));
}

struct BadJson {
  const char* name;
  std::string text;
  Errc code;
  const char* says;
  friend void PrintTo(const BadJson& bad, std::ostream* out) { *out << bad.name; }
};

const auto kFieldName = [](const auto& bad) { return std::string(bad.param.name); };

class StrictJsonRefuses : public testing::TestWithParam<BadJson> {};

TEST_P(StrictJsonRefuses, WithTheRightErrorAndPlace) {
  const auto tree = parse_strict_json(GetParam().text, kLimits, shape());
  ASSERT_FALSE(tree);
  EXPECT_EQ(tree.error().code, GetParam().code) << tree.error().text();
  EXPECT_NE(tree.error().message.find(GetParam().says), std::string::npos) << tree.error().text();
}

INSTANTIATE_TEST_SUITE_P(
    Texts, StrictJsonRefuses,
    testing::Values(BadJson{"Empty", "", Errc::kTruncated, "ends too early"},
                    BadJson{"CutInAnObject", "{\"a\": 1", Errc::kTruncated, "line 1"},
                    BadJson{"CutInAString", "{\"a", Errc::kTruncated, "ends too early"},
                    BadJson{"CutInANumber", "[1, 2e", Errc::kTruncated, "ends too early"},
                    BadJson{"CutInAWord", "[tru", Errc::kTruncated, "ends too early"},
                    BadJson{"Comma", "{\"a\": 1,\n \"b\": ,}", Errc::kBadFormat, "line 2, column 7"},
                    BadJson{"Trailing", "{} x", Errc::kBadFormat, "line 1, column 4"},
                    BadJson{"NaN", "[NaN]", Errc::kBadFormat, "NaN and Infinity are not numbers"},
                    BadJson{"Infinity", "[Infinity]", Errc::kBadFormat, "NaN and Infinity are not numbers"},
                    BadJson{"MinusInfinity", "[-Infinity]", Errc::kBadFormat, "NaN and Infinity are not numbers"},
                    BadJson{"Overflow", "[1e999]", Errc::kBadFormat, "too large to represent"},
                    BadJson{"DuplicateKey", "{\"gain\": 1, \"gain\": 2}", Errc::kBadFormat, "'gain' is given twice"},
                    BadJson{"DuplicateKeyInside", "{\"c\": {\"d\": 1, \"d\": 1}}", Errc::kBadFormat,
                            "'d' is given twice"},
                    BadJson{"Deep", "[[[[[1]]]]]", Errc::kTooLarge, "more than 4 deep"},
                    BadJson{"Long", std::string(1001, ' '), Errc::kTooLarge, "1001 bytes"},
                    BadJson{"ZeroByte", std::string("[1]\0", 4), Errc::kBadFormat, "zero byte"},
                    BadJson{"BadUtf8", "[\"\xff\xfe\"]", Errc::kBadFormat, "not valid JSON"},
                    BadJson{"Comment", "[1] // no", Errc::kBadFormat, "line 1, column 5"}),
    kFieldName);

TEST(StrictJson, WhatIsNotInTheShape_IsLeftOutButForWhatItsReaderRefuses) {
  EXPECT_EQ(kept(R"({"e": "x", "later": {"a": [1, 2]}, "other": 2})"),
            nlohmann::json::parse(R"({"e": "x", "later": null})"));
  EXPECT_EQ(kept(R"({"e": {"a": [1, 2]}, "a": {"b": 1}, "c": [1, [2]]})"),
            nlohmann::json::parse(R"({"e": {}, "a": {}, "c": []})"));
  EXPECT_EQ(kept(R"({"a": [{"b": 1}, {"b": 2}, {"b": 3}, {"b": 4}, {"b": 5}]})"),
            nlohmann::json::parse(R"({"a": [{"b": 1}, {"b": 2}, {"b": 3}, {"b": 4}]})"));
  EXPECT_EQ(kept(R"({"e": "seven letters"})"), nlohmann::json::parse(R"({"e": "seven "})"));
  EXPECT_EQ(kept(R"([1, 2])"), nlohmann::json::array());
}

TEST(StrictJson, StreamedList_GoesToItsReaderElementByElement) {
  std::vector<nlohmann::json> seen;
  const JsonShape shape =
      JsonShape::object({{"list", JsonShape::stream(JsonShape::object({{"b", JsonShape::value()}}),
                                                    [&](const nlohmann::json& element) { seen.push_back(element); })},
                         {"e", JsonShape::value()}});
  const auto tree =
      parse_strict_json(R"({"list": [{"b": 1, "c": [3]}, 2, [5, 6], {"b": {"d": 4}}], "e": 7})", kLimits, shape);
  ASSERT_TRUE(tree) << tree.error().text();
  EXPECT_EQ(*tree, nlohmann::json::parse(R"({"list": [], "e": 7})"));
  EXPECT_EQ(seen, (std::vector<nlohmann::json>{nlohmann::json::parse(R"({"b": 1, "c": null})"), 2,
                                               nlohmann::json::array(), nlohmann::json::parse(R"({"b": {}})")}));
}

TEST(StrictJson, TextInPiecesOfAnySize_IsReadAsOne) {
  const std::string text = " {\"e\" :\n  \"a \\\" b\" ,\t\"gain\": -1.5e3 } \n";
  const auto whole = parse_strict_json(text, kLimits, shape());
  ASSERT_TRUE(whole) << whole.error().text();
  for (std::size_t size = 1; size < text.size(); ++size) {
    std::size_t at = 0;
    const auto pieces = [&]() -> Result<std::string_view> {
      const std::string_view piece = std::string_view(text).substr(at, size);
      at += piece.size();
      return piece;
    };
    EXPECT_EQ(parse_strict_json(pieces, kLimits, shape()).value_or(nullptr), *whole) << size;
  }
}

TEST(StrictJson, PiecesThatFail_AreTheError) {
  const auto pieces = []() -> Result<std::string_view> { return fail(Errc::kIo, "file 'x': reading it failed"); };
  const auto tree = parse_strict_json(pieces, kLimits, shape());
  ASSERT_FALSE(tree);
  EXPECT_EQ(tree.error().code, Errc::kIo);
}

}  // namespace
}  // namespace nodal
