// The effect of hostile hosts on the rig's log.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "protocol/base/text.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

TEST(Log, ACalibrationWithATerminalSequenceInAKeyAndAName_ForgesNoLine) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.rig->control().take_news();
  std::string document = to_json(small_calibration("named"));
  const std::size_t name = document.find("named");
  std::string forged_name = document;
  forged_name.replace(name, 5, "x\\n2026-01-01 nodald: all is well\\u001b[2J\\u202e");
  std::string forged_key = document;
  forged_key.replace(document.find("\"name\""), 6, "\"\\u001b[2J\\nforged\": 1, \"name\"");
  for (const std::string& forged : {forged_name, forged_key}) {
    const wire::Reply refused = host.upload(forged);
    ASSERT_TRUE(refused.has_error());
    EXPECT_TRUE(is_printable(refused.error().message())) << refused.error().message();
  }
  const std::vector<std::string> news = stand.rig->control().take_news();
  EXPECT_EQ(news.size(), 2U) << "one for each refusal";
  EXPECT_TRUE(std::all_of(news.begin(), news.end(), [](const std::string& sentence) {
    return sentence.find("upload_commit: ") != std::string::npos;
  }));
  for (const std::string& sentence : news) EXPECT_TRUE(is_printable(sentence)) << sentence;
}

TEST(Log, AHostThatStays_IsInIt_OneThatAsksAndLeavesIsNot) {
  Stand stand;
  stand.bring_up();
  const auto about_hosts = [&] {
    std::vector<std::string> found;
    for (const std::string& sentence : stand.rig->control().take_news()) {
      if (sentence.starts_with("host ")) found.push_back(sentence);
    }
    return found;
  };
  stand.run(Duration::seconds(8));
  EXPECT_TRUE(about_hosts().empty());
  stand.hosts.clear();
  stand.run(Duration::seconds(1));
  EXPECT_TRUE(about_hosts().empty()) << "it has asked, and left";

  stand.connect();
  stand.run(Duration::seconds(11));
  const std::vector<std::string> stays = about_hosts();
  ASSERT_EQ(stays.size(), 1U);
  EXPECT_NE(stays[0].find("is connected"), std::string::npos) << stays[0];
  stand.run(Duration::seconds(30));
  EXPECT_TRUE(about_hosts().empty()) << "once is enough";
  stand.hosts.clear();
  stand.run(Duration::seconds(1));
  const std::vector<std::string> leaves = about_hosts();
  ASSERT_EQ(leaves.size(), 1U);
  EXPECT_NE(leaves[0].find(" left"), std::string::npos) << leaves[0];
}

TEST(Log, ThousandsOfBadConnections_AFewLinesAndACountOfTheRest) {
  Stand stand;
  stand.settle();
  stand.rig->control().take_news();
  constexpr int kConnections = 5000;
  std::vector<std::string> news;
  const auto collect = [&] {
    const auto some = stand.rig->control().take_news();
    news.insert(news.end(), some.begin(), some.end());
  };
  for (int i = 0; i < kConnections; ++i) {
    const auto link = stand.listener.connect();
    const std::string junk = "GET / HTTP/1.1\r\n\r\n";
    ASSERT_TRUE(link->write(std::span(reinterpret_cast<const std::uint8_t*>(junk.data()), junk.size())));
    stand.settle();
    if (i % 100 == 0) stand.run(Duration::milliseconds(1));
    collect();
  }
  stand.run(Duration::seconds(21));
  collect();
  std::size_t bytes = 0;
  std::uint64_t left_out = 0;
  for (const std::string& sentence : news) {
    bytes += sentence.size();
    if (sentence.find("messages about hosts left out") != std::string::npos) {
      left_out += std::strtoull(sentence.c_str(), nullptr, 10);
    }
  }
  EXPECT_LT(bytes, 20'000u) << "bytes of log";
  const auto about_hosts = static_cast<std::uint64_t>(std::count_if(
      news.begin(), news.end(), [](const std::string& sentence) { return sentence.starts_with("host "); }));
  EXPECT_EQ(about_hosts + left_out, std::uint64_t{kConnections}) << "each is dropped; only who says hello has come";
}

}  // namespace
}  // namespace nodal::scenario
