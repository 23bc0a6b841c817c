#include "protocol/strict_json.h"

#include <gtest/gtest.h>

#include <string>

namespace nodal {
namespace {

constexpr JsonLimits kLimits{1000, 4};

TEST(StrictJson, GoodText_BecomesTheTree) {
  const auto tree = parse_strict_json(R"({"a": [1, -2.5, {"b": null}], "c": {"d": true}, "e": "x"})", kLimits);
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
  const auto tree = parse_strict_json(GetParam().text, kLimits);
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
                    BadJson{"DuplicateKeyInside", "[{\"b\": {\"a\": 1, \"a\": 1}}]", Errc::kBadFormat,
                            "'a' is given twice"},
                    BadJson{"Deep", "[[[[[1]]]]]", Errc::kTooLarge, "more than 4 deep"},
                    BadJson{"Long", std::string(1001, ' '), Errc::kTooLarge, "1001 bytes"},
                    BadJson{"ZeroByte", std::string("[1]\0", 4), Errc::kBadFormat, "zero byte"},
                    BadJson{"BadUtf8", "[\"\xff\xfe\"]", Errc::kBadFormat, "not valid JSON"},
                    BadJson{"Comment", "[1] // no", Errc::kBadFormat, "line 1, column 5"}),
    kFieldName);

}  // namespace
}  // namespace nodal
