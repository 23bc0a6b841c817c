// The page's words as requests.
#include "host_tool/web/operations.h"

#include <gtest/gtest.h>

namespace nodal::host::web {
namespace {

TEST(Operations, EachOfThem_IsItsRequest) {
  EXPECT_TRUE(operation("record", R"({"on": true})")->has_take_start());
  EXPECT_FALSE(operation("record", R"({"on": true})")->take_start().still());
  EXPECT_TRUE(operation("record", R"({"on": false})")->has_take_stop());
  EXPECT_TRUE(operation("still", "{}")->take_start().still());
  EXPECT_EQ(operation("mark", R"({"text": "the door opens"})")->take_mark().text(), "the door opens");
  const auto protect = operation("protect", R"({"take": 7, "on": true})");
  EXPECT_EQ(protect->take_protect().take(), 7u);
  EXPECT_TRUE(protect->take_protect().on());
  EXPECT_EQ(operation("genlock", R"({"on": true})")->genlock().action(), wire::GenlockRequest::START);
  EXPECT_EQ(operation("genlock", R"({"on": false})")->genlock().action(), wire::GenlockRequest::STOP);
  const auto exposure = operation("exposure", R"({"program": "joint", "locked": false, "anchor": -1})");
  EXPECT_EQ(exposure->exposure().program(), "joint");
  EXPECT_TRUE(exposure->exposure().has_locked());
  EXPECT_EQ(exposure->exposure().anchor(), -1);
  EXPECT_FALSE(exposure->exposure().has_ramp());
  const auto heads = operation("heads", R"({"heads": [0, 2], "exposure_ns": 4000000})");
  ASSERT_EQ(heads->head_set().heads_size(), 2);
  EXPECT_EQ(heads->head_set().heads(1), 2u);
  EXPECT_EQ(heads->head_set().exposure_ns(), 4'000'000u);
}

TEST(Operations, WhatIsNotExactlyOne_IsRefused) {
  const std::vector<std::pair<std::string, std::string>> wrong{{"record", "{}"},
                                                               {"record", R"({"on": 1})"},
                                                               {"record", R"({"on": "true"})"},
                                                               {"record", R"({"on": null})"},
                                                               {"record", "[]"},
                                                               {"record", "true"},
                                                               {"record", ""},
                                                               {"record", R"({"on": true)"},
                                                               {"record", R"({"on": true} x)"},
                                                               {"record", R"({"on": true, "on": false})"},
                                                               {"record", R"({"on": true, "still": true})"},
                                                               {"record", R"({"on": true, "take": 1})"},
                                                               {"protect", R"({"take": -1, "on": true})"},
                                                               {"protect", R"({"take": 1.5, "on": true})"},
                                                               {"protect", R"({"take": 1e30, "on": true})"},
                                                               {"heads", R"({"heads": [0]})"},
                                                               {"heads", "{}"},
                                                               {"exposure", "{}"},
                                                               {"heads", R"({"heads": ["0"], "gain_mdb": 1})"},
                                                               {"heads", R"({"heads": [4294967296], "gain_mdb": 1})"},
                                                               {"heads", R"({"gain_mdb": 2147483648})"},
                                                               {"mark", R"({"text": 5})"}};
  for (const auto& [name, json] : wrong) EXPECT_FALSE(operation(name, json)) << name << " " << json;
  for (const std::string name : {"take_delete", "upload_begin", "", "RECORD", "record/../record", "host_end"}) {
    const auto none = operation(name, R"({"on": true})");
    ASSERT_FALSE(none);
    EXPECT_EQ(none.error().code, Errc::kNotFound) << name;
  }
}

}  // namespace
}  // namespace nodal::host::web
