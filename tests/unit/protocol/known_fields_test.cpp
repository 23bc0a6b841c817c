#include "protocol/known_fields.h"

#include <gtest/gtest.h>

#include "protocol/session.h"

namespace nodal {
namespace {

constexpr std::uint32_t kFarField = 9999;  // no message of ours has so many fields

std::string unknown_field(std::size_t bytes) {
  const auto varint = [](std::uint64_t value) {
    std::string text;
    for (; value >= 128; value >>= 7) text.push_back(static_cast<char>(value % 128 + 128));
    return text + static_cast<char>(value);
  };
  return varint(kFarField << 3 | 2) + varint(bytes) + std::string(bytes, 'x');
}

/// One request of each existing kind, by its field number.
std::vector<wire::Request> every_request() {
  std::vector<wire::Request> all;
  for (std::uint32_t number = 1; number < 200; ++number) {
    const std::string inner = unknown_field(2000);
    std::string bytes;
    for (std::uint32_t tag = number << 3 | 2; tag != 0; tag >>= 7) {
      bytes.push_back(static_cast<char>(tag >= 128 ? tag % 128 + 128 : tag));
    }
    bytes.push_back(static_cast<char>(inner.size() % 128 + 128));
    bytes.push_back(static_cast<char>(inner.size() / 128));
    wire::Request request;
    if (request.ParseFromString(bytes + inner + unknown_field(3000)) && request.what_case() != 0)
      all.push_back(request);
  }
  return all;
}

TEST(KnownFields, ARequestOfEveryKind_LosesTheFieldsThatNobodyKnows) {
  const std::vector<wire::Request> requests = every_request();
  ASSERT_GE(requests.size(), 15u);
  for (wire::Request request : requests) {
    ASSERT_GT(request.ByteSizeLong(), 5000u);
    drop_unknown_fields(request);
    EXPECT_LT(request.ByteSizeLong(), 16u) << "kind " << request.what_case();
  }
}

TEST(KnownFields, WhatIsKnown_Stays) {
  wire::Request request;
  request.set_id(7);
  request.mutable_head_set()->add_heads(3);
  request.mutable_head_set()->set_gain_mdb(-6000);
  const std::string known = request.SerializeAsString();
  ASSERT_TRUE(request.mutable_head_set()->MergeFromString(unknown_field(100)));
  drop_unknown_fields(request);
  EXPECT_EQ(request.SerializeAsString(), known);
}

TEST(KnownFields, ARigsSession_HandsOutRequestsWithoutThem) {
  Session host(Role::kHost, make_hello("host"));
  Session rig(Role::kRig, make_hello("rig"));
  wire::Request request;
  request.mutable_head_set()->set_gain_mdb(1);
  ASSERT_TRUE(request.mutable_head_set()->MergeFromString(unknown_field(60'000)));
  ASSERT_TRUE(host.send(request));
  for (auto bytes = host.output(); !bytes.empty(); bytes = host.output()) {
    ASSERT_TRUE(rig.receive(bytes));
    host.sent(bytes.size());
  }
  ASSERT_TRUE(rig.next_event());  // its hello
  const auto event = rig.next_event();
  ASSERT_TRUE(event && std::holds_alternative<wire::Request>(*event));
  EXPECT_LT(std::get<wire::Request>(*event).ByteSizeLong(), 16u);
}

}  // namespace
}  // namespace nodal
