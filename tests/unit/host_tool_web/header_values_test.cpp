// Headers of browsers. Expected values are those of RFC 6265, 6750 and 9110.
#include "host_tool/web/header_values.h"

#include <gtest/gtest.h>

namespace nodal::host::web {
namespace {

const std::string kSecret(64, 'a');
const std::string kCookie = "__Host-nodal=" + kSecret;

std::optional<std::string> secret_of(const std::string& header) { return secret_of_cookie(header, "__Host-nodal"); }

TEST(Cookies, TheSecretIsFoundAmongOthers_AndNothingElseIsTakenForIt) {
  for (const std::string& header :
       {kCookie, "a=b; " + kCookie, kCookie + "; a=b", "a=b;" + kCookie + ";", "x; " + kCookie}) {
    EXPECT_EQ(secret_of(header), kSecret) << header;
  }
  for (const std::string& header :
       {std::string(), std::string("__Host-nodal="), "nodal=" + kSecret, "x__Host-nodal=" + kSecret,
        "__host-nodal=" + kSecret, kCookie + "a", "__Host-nodal=\"" + kSecret + "\"",
        "__Host-nodal=" + std::string(63, 'a'), "__Host-nodal=" + std::string(64, 'A'),
        "__Host-nodal=" + std::string(64, 'g'), kCookie + "; " + kCookie, "__Host-nodal=0; " + kCookie,
        std::string(kMaxCookieBytes, ' ') + kCookie}) {
    EXPECT_EQ(secret_of(header), std::nullopt) << header.substr(0, 200);
  }
}

TEST(Bearer, TheSchemeHasNoCaseAndTheSecretHas) {
  EXPECT_EQ(secret_of_bearer("Bearer " + kSecret), kSecret);
  EXPECT_EQ(secret_of_bearer("bEARER  " + kSecret + " "), kSecret);
  for (const std::string& header : {kSecret, "Basic " + kSecret, std::string("Bearer"), "Bearer " + kSecret + kSecret,
                                    "Bearer " + std::string(64, 'A'), "Bearer " + kSecret + ", " + kSecret}) {
    EXPECT_EQ(secret_of_bearer(header), std::nullopt) << header;
  }
}

void expect_part(const std::string& header, std::uint64_t begin, std::uint64_t length) {
  const ParsedRange parsed = parse_range(header, 1000);
  EXPECT_EQ(parsed.kind, RangeKind::kPart) << header;
  EXPECT_EQ(parsed.range, (ByteRange{begin, length})) << header;
}

TEST(Ranges, OfAFileOfAThousandBytes_AreThoseOfTheStandard) {
  expect_part("bytes=0-0", 0, 1);
  expect_part("bytes=0-999", 0, 1000);
  expect_part("bytes=0-1000", 0, 1000);
  expect_part("bytes=500-", 500, 500);
  expect_part("bytes=999-", 999, 1);
  expect_part("bytes=-1", 999, 1);
  expect_part("bytes=-5000", 0, 1000);
  expect_part("Bytes=7-9", 7, 3);
  expect_part("bytes=0-18446744073709551615", 0, 1000);
  expect_part("bytes=1-18446744073709551615", 1, 999);
  expect_part("bytes=0-99999999999999999999999", 0, 1000);
  for (const std::string header : {"bytes=1000-", "bytes=1000-1000", "bytes=-0", "bytes=18446744073709551615-",
                                   "bytes=99999999999999999999999-"}) {
    EXPECT_EQ(parse_range(header, 1000).kind, RangeKind::kOutside) << header;
  }
  for (const std::string header :
       {"", "bytes", "bytes=", "bytes=-", "bytes=5", "bytes=5-4", "bytes=0-1,5-6", "bytes=a-b", "bytes=+1-2",
        "bytes=1-+2", "bytes=0x1-2", "lines=1-2", "bytes =1-2", "bytes=1 - 2"}) {
    EXPECT_EQ(parse_range(header, 1000).kind, RangeKind::kWhole) << header;
  }
  EXPECT_EQ(parse_range("bytes=0-", 0).kind, RangeKind::kOutside) << "an empty file has no bytes";
}

}  // namespace
}  // namespace nodal::host::web
