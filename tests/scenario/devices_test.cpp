// What is plugged in: hosts that ask while the scan takes seconds.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

/// A scan that ends when the test says so.
class SlowScan final : public firmware::DeviceScan {
 public:
  void begin() override {
    if (!running) ++begun;
    running = true;
  }
  std::optional<Result<firmware::DeviceList>> take() override {
    if (!running || !result) return std::nullopt;
    running = false;
    return std::exchange(result, std::nullopt);
  }
  int begun = 0;
  bool running = false;
  std::optional<Result<firmware::DeviceList>> result;
};

wire::Request devices() {
  wire::Request request;
  request.mutable_devices();
  return request;
}

class Devices : public testing::Test {
 protected:
  Devices()
      : stand_([this] {
          StandOptions options;
          options.scan = &scan_;
          return options;
        }()) {}
  SlowScan scan_;
  Stand stand_;
};

TEST_F(Devices, TwoHostsAsk_OneScanAnswersBoth) {
  TestHost& first = stand_.connect();
  TestHost& second = stand_.connect();
  stand_.settle();
  const auto& features = first.session().peer_hello()->features();
  EXPECT_NE(std::find(features.begin(), features.end(), "devices"), features.end());
  const std::uint64_t asked = first.post(devices());
  const std::uint64_t also_asked = second.post(devices());
  stand_.run(Duration::seconds(5));
  EXPECT_EQ(first.reply(asked), nullptr);
  EXPECT_EQ(first.status().state(), "no-calibration") << "other requests are answered meanwhile";
  scan_.result = firmware::DeviceList{"# a camera\n\n[rig]", "{}"};
  ASSERT_TRUE(stand_.run_until([&] { return first.reply(asked) != nullptr && second.reply(also_asked) != nullptr; }));
  EXPECT_EQ(scan_.begun, 1);
  ASSERT_EQ(first.reply(asked)->devices().lines_size(), 3);
  EXPECT_EQ(first.reply(asked)->devices().lines(0), "# a camera");
  EXPECT_EQ(first.reply(asked)->devices().lines(1), "");
  EXPECT_EQ(first.reply(asked)->devices().lines(2), "[rig]");
  EXPECT_EQ(second.reply(also_asked)->devices().json(), "{}");

  const std::uint64_t again = second.post(devices());
  stand_.run(Duration::milliseconds(10));
  EXPECT_EQ(scan_.begun, 2) << "a later request is a scan of its own";
  scan_.result = firmware::DeviceList{"", "{}"};
  EXPECT_TRUE(stand_.run_until([&] { return second.reply(again) != nullptr; }));
}

TEST_F(Devices, TheHostLeaves_TheScanAnswersTheOthersOnly) {
  TestHost& first = stand_.connect();
  TestHost& second = stand_.connect();
  stand_.settle();
  first.post(devices());
  const std::uint64_t asked = second.post(devices());
  stand_.settle();
  first.link().reset();
  stand_.run(Duration::milliseconds(100));
  scan_.result = firmware::DeviceList{"# a camera\n", "{}"};
  EXPECT_TRUE(stand_.run_until([&] { return second.reply(asked) != nullptr; }));
}

TEST_F(Devices, AHostAsksMoreOftenThanItMay_TheRestWaitsAndAllAreAnswered) {
  TestHost& host = stand_.connect();
  stand_.settle();
  std::vector<std::uint64_t> asked;
  for (std::size_t i = 0; i < 3 * firmware::Control::kMaxRequests; ++i) asked.push_back(host.post(devices()));
  const auto all_answered = [&] {
    if (scan_.running && !scan_.result) scan_.result = firmware::DeviceList{"", "{}"};
    return std::all_of(asked.begin(), asked.end(), [&](std::uint64_t id) { return host.reply(id) != nullptr; });
  };
  EXPECT_TRUE(stand_.run_until(all_answered));
  EXPECT_LE(scan_.begun, 4);
}

TEST_F(Devices, AHostHasAsManyUnansweredRequestsAsItMay_ItsNextOneWaitsAndNoneOfAnother) {
  TestHost& host = stand_.connect();
  TestHost& other = stand_.connect();
  stand_.settle();
  wire::Request status;
  status.mutable_status();
  for (std::size_t i = 1; i < firmware::Control::kMaxRequests; ++i) host.post(devices());
  const std::uint64_t before_last = host.post(status);
  host.post(devices());
  const std::uint64_t waits = host.post(status);
  stand_.run(Duration::seconds(1));
  EXPECT_NE(host.reply(before_last), nullptr) << "one request fewer than it may have is unanswered";
  EXPECT_EQ(host.reply(waits), nullptr);
  EXPECT_EQ(other.status().state(), "no-calibration");
  scan_.result = firmware::DeviceList{"", "{}"};
  EXPECT_TRUE(stand_.run_until([&] { return host.reply(waits) != nullptr; }));
}

TEST_F(Devices, ALongerListThanAReplyTakes_IsAnErrorThatSaysWhereToLook) {
  TestHost& host = stand_.connect();
  stand_.settle();
  for (const bool text : {true, false}) {
    const std::string large(firmware::kMaxDeviceListBytes + 1, '#');
    const std::uint64_t asked = host.post(devices());
    stand_.settle();
    scan_.result = firmware::DeviceList{text ? large : "", text ? "" : large};
    ASSERT_TRUE(stand_.run_until([&] { return host.reply(asked) != nullptr; }));
    EXPECT_EQ(host.reply(asked)->error().code(), static_cast<std::uint32_t>(Errc::kTooLarge));
    EXPECT_NE(host.reply(asked)->error().message().find("nodald --scan"), std::string::npos);
  }
}

TEST_F(Devices, AListAsLongAsAReplyTakes_IsGivenWhole) {
  TestHost& host = stand_.connect();
  stand_.settle();
  const std::uint64_t asked = host.post(devices());
  stand_.settle();
  const std::string longest(firmware::kMaxDeviceListBytes, '#');
  scan_.result = firmware::DeviceList{longest, longest};
  ASSERT_TRUE(stand_.run_until([&] { return host.reply(asked) != nullptr; }));
  ASSERT_FALSE(host.reply(asked)->has_error()) << host.reply(asked)->error().message();
  EXPECT_EQ(host.reply(asked)->devices().json(), longest);
}

TEST_F(Devices, TheScanFails_TheHostHearsWhy) {
  TestHost& host = stand_.connect();
  stand_.settle();
  const std::uint64_t asked = host.post(devices());
  stand_.settle();
  scan_.result = fail(Errc::kOverload, "the system refuses a thread");
  ASSERT_TRUE(stand_.run_until([&] { return host.reply(asked) != nullptr; }));
  EXPECT_EQ(host.reply(asked)->error().message(), "the system refuses a thread");
}

TEST(DevicesOfARigWithoutAny, TheRequest_IsUnsupported) {
  Stand stand;
  TestHost& host = stand.connect();
  stand.settle();
  EXPECT_EQ(host.ask(devices()).error().code(), static_cast<std::uint32_t>(Errc::kUnsupported));
}

}  // namespace
}  // namespace nodal::scenario
