// Each rule by which the page's server refuses a request.
#include "host_tool/look/request_rules.h"

#include <gtest/gtest.h>

#include <optional>

namespace nodal::host::look {
namespace {

const Rules kRules{4567, "0123456789abcdef0123456789abcdef"};

Asked good() { return {"GET", "/" + kRules.token + "/scene.json", "HTTP/1.1", {{"Host", "127.0.0.1:4567"}}}; }

Asked with(const std::string& name, const std::string& value) {
  Asked asked = good();
  asked.headers.emplace_back(name, value);
  return asked;
}

/// 200: not refused.
unsigned status_of(const Asked& asked) {
  const std::optional<Refusal> refusal = kRules.check(asked);
  return refusal ? refusal->status : 200;
}

TEST(RequestRules, ARequestOfThePage_IsAnswered) {
  EXPECT_EQ(status_of(good()), 200u);
  EXPECT_EQ(kRules.name(good()), "scene.json");
  EXPECT_EQ(kRules.link(), "http://127.0.0.1:4567/0123456789abcdef0123456789abcdef/");
  Asked head = good();
  head.method = "HEAD";
  EXPECT_EQ(status_of(head), 200u);
  EXPECT_EQ(status_of(with("Origin", "http://127.0.0.1:4567")), 200u);
  EXPECT_EQ(status_of(with("Content-Length", "0")), 200u);
}

TEST(RequestRules, HostsOfThisComputerWithThePort_AreAccepted_AndNoOthers) {
  for (const std::string host : {"127.0.0.1:4567", "localhost:4567", "LOCALHOST:4567", "[::1]:4567"}) {
    Asked asked = good();
    asked.headers = {{"hOsT", host}};
    EXPECT_EQ(status_of(asked), 200u) << host;
  }
  for (const std::string host : {"evil.example", "evil.example:4567", "127.0.0.1", "127.0.0.1:4568", "localhost",
                                 "127.0.0.1:4567.evil.example", "127.0.0.2:4567", ""}) {
    Asked asked = good();
    asked.headers = {{"Host", host}};
    EXPECT_EQ(status_of(asked), 421u) << host;
  }
}

TEST(RequestRules, NoHostOrTwo_Is421) {
  Asked none = good();
  none.headers.clear();
  EXPECT_EQ(status_of(none), 421u);
  EXPECT_EQ(status_of(with("Host", "127.0.0.1:4567")), 421u) << "the same one twice";
  EXPECT_EQ(status_of(with("host", "evil.example")), 421u);
}

TEST(RequestRules, WithoutTheToken_ThereIsNoAnswer) {
  for (const std::string path :
       {"/", "/scene.json", "//scene.json", "/0123456789abcdef0123456789abcdef", "/0123456789abcdef0123456789abcdee/",
        "/0123456789ABCDEF0123456789ABCDEF/", "/favicon.ico", "/x/0123456789abcdef0123456789abcdef/"}) {
    Asked asked = good();
    asked.path = path;
    EXPECT_EQ(status_of(asked), 0u) << path;
  }
  const Rules unset{4567, ""};
  Asked asked = good();
  asked.path = "//";
  EXPECT_TRUE(unset.check(asked)) << "a program without a token answers nobody";
}

TEST(RequestRules, BodiesAndAmbiguousFraming_Are400) {
  EXPECT_EQ(status_of(with("Transfer-Encoding", "chunked")), 400u);
  EXPECT_EQ(status_of(with("transfer-encoding", "identity")), 400u);
  EXPECT_EQ(status_of(with("Content-Length", "5")), 400u);
  EXPECT_EQ(status_of(with("Content-Length", "+0")), 400u);
  EXPECT_EQ(status_of(with("Content-Length ", "5")), 400u) << "a blank before the colon";
  EXPECT_EQ(status_of(with("X-\x01", "a")), 400u);
  EXPECT_EQ(status_of(with("X-A", std::string("a\0b", 3))), 400u);
  Asked old = good();
  old.version = "HTTP/0.9";
  EXPECT_EQ(status_of(old), 400u);
}

TEST(RequestRules, PagesOfOtherSites_Are403) {
  for (const std::string origin : {"https://evil.example", "null", "http://127.0.0.1:80", "https://127.0.0.1:4567", ""})
    EXPECT_EQ(status_of(with("Origin", origin)), 403u) << origin;
}

TEST(RequestRules, WhatChangesThings_Is405) {
  for (const std::string method : {"POST", "PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT", "get"}) {
    Asked asked = good();
    asked.method = method;
    EXPECT_EQ(status_of(asked), 405u) << method;
  }
}

/// A change that the page asks for.
Asked change() {
  Asked asked = good();
  asked.method = "POST";
  asked.headers.insert(
      asked.headers.end(),
      {{"Origin", "http://127.0.0.1:4567"}, {"Content-Type", "application/json"}, {"Content-Length", "20"}});
  return asked;
}

Asked change_with(const std::string& name, const std::optional<std::string>& value) {
  Asked asked = change();
  std::erase_if(asked.headers, [&](const auto& header) { return header.first == name; });
  if (value) asked.headers.emplace_back(name, *value);
  return asked;
}

TEST(RequestRules, AChange_NeedsJsonOfKnownLengthFromTheOwnPage) {
  Rules rules = kRules;
  rules.changes = true;
  const auto status = [&](const Asked& asked) {
    const std::optional<Refusal> refusal = rules.check(asked);
    return refusal ? refusal->status : 200;
  };
  EXPECT_EQ(status(change()), 200u);
  EXPECT_EQ(status(good()), 200u);
  EXPECT_EQ(status_of(change()), 400u) << "a page that changes nothing";
  EXPECT_EQ(status(change_with("Origin", std::nullopt)), 403u);
  EXPECT_EQ(status(change_with("Origin", "https://evil.example")), 403u);
  EXPECT_EQ(status(change_with("Origin", "null")), 403u);
  for (const std::string type : {"application/x-www-form-urlencoded", "text/plain", "multipart/form-data; boundary=x",
                                 "application/json; charset=utf-8", ""})
    EXPECT_EQ(status(change_with("Content-Type", type)), 415u) << type;
  EXPECT_EQ(status(change_with("Content-Type", std::nullopt)), 415u);
  for (const std::string length : {"0", "-1", "+5", "5 ", "65537", "99999999999999999999", "0x5", ""})
    EXPECT_EQ(status(change_with("Content-Length", length)), 400u) << length;
  EXPECT_EQ(status(change_with("Content-Length", std::nullopt)), 400u);
  EXPECT_EQ(status(change_with("Content-Length", "65536")), 200u);
  Asked twice = change();
  twice.headers.emplace_back("Content-Length", "20");
  EXPECT_EQ(status(twice), 400u);
  Asked types = change();
  types.headers.emplace_back("content-type", "text/plain");
  EXPECT_EQ(status(types), 415u);
  Asked chunked = change();
  chunked.headers.emplace_back("Transfer-Encoding", "chunked");
  EXPECT_EQ(status(chunked), 400u);
  for (const std::string method : {"PUT", "DELETE", "PATCH", "OPTIONS"}) {
    Asked other = good();
    other.method = method;
    EXPECT_EQ(status(other), 405u) << method;
  }
}

}  // namespace
}  // namespace nodal::host::look
