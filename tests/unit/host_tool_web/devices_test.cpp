// Codes that pair devices, and the devices.
#include "host_tool/web/devices.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <sstream>

#include "tests/support/pictures.h"

namespace nodal::host::web {
namespace {

std::int64_t now_s = 0;

class PairedDevices : public testing::Test {
 protected:
  PairedDevices() { now_s = 1'800'000'000; }
  std::string file() const {
    std::ifstream in(folder_.path() / "devices.json");
    return (std::ostringstream() << in.rdbuf()).str();
  }
  std::string code(Rights rights = Rights::kOperate) { return devices_.make_code(rights).value(); }

  test::TemporaryFolder folder_;
  Devices devices_{folder_.path(), [] { return now_s; }};
};

TEST_F(PairedDevices, ACode_PairsOnceWithItsRights_AndNoSecretIsOnTheDisk) {
  const std::string watch = code(Rights::kWatch), operate = code();
  ASSERT_EQ(watch.size(), 32u);
  ASSERT_NE(watch, operate);
  const auto anna = devices_.pair(watch, "Anna's phone");
  ASSERT_TRUE(anna) << anna.error().text();
  EXPECT_EQ(anna->device.rights, Rights::kWatch);
  EXPECT_EQ(anna->secret.size(), 64u);
  EXPECT_EQ(devices_.pair(watch, "another").error().code, Errc::kNotFound) << "a code is good once";
  ASSERT_TRUE(devices_.pair(operate, "Ben"));
  EXPECT_EQ(devices_.find(anna->secret)->name, "Anna's phone");
  EXPECT_EQ(devices_.find(anna->secret)->number, anna->device.number);
  EXPECT_FALSE(devices_.find(std::string(64, '0')));
  EXPECT_EQ(file().find(anna->secret), std::string::npos);
  EXPECT_EQ(file().find(watch), std::string::npos);
  struct stat state {};
  ASSERT_EQ(::stat((folder_.path() / "devices.json").c_str(), &state), 0);
  EXPECT_EQ(state.st_mode & 0777, 0600u);
}

TEST_F(PairedDevices, FiveWrongCodes_EndTheRightOne_AndFourDoNot) {
  for (const int wrong : {4, 5}) {
    const std::string right = code();
    for (int k = 0; k < wrong; ++k) EXPECT_FALSE(devices_.pair(std::string(32, 'f'), "guess"));
    EXPECT_EQ(devices_.pair(right, "phone").has_value(), wrong == 4);
  }
}

TEST_F(PairedDevices, ACodeAfterTenMinutes_AndADeviceAfterThirtyDays_AreOver) {
  const std::string early = code();
  now_s += 599;
  const auto paired = devices_.pair(early, "phone");
  ASSERT_TRUE(paired);
  const std::string late = code();
  now_s += 600;
  EXPECT_FALSE(devices_.pair(late, "phone"));
  now_s += 29 * 86'400;
  EXPECT_TRUE(devices_.find(paired->secret)) << "which counts from now on";
  now_s += 29 * 86'400;
  EXPECT_TRUE(devices_.find(paired->secret));
  now_s += 30 * 86'400 + 1;
  EXPECT_FALSE(devices_.find(paired->secret));
}

TEST_F(PairedDevices, RevokedByAnotherProcess_IsRefusedAtOnce) {
  const auto phone = devices_.pair(code(), "phone"), tablet = devices_.pair(code(), "tablet");
  ASSERT_TRUE(phone && tablet);
  ASSERT_TRUE(devices_.find(phone->secret));
  Devices other(folder_.path(), [] { return now_s; });
  EXPECT_EQ(other.list()->size(), 2u);
  EXPECT_TRUE(other.revoke(phone->device.number));
  EXPECT_EQ(other.revoke(phone->device.number).error().code, Errc::kNotFound);
  EXPECT_FALSE(devices_.find(phone->secret));
  EXPECT_TRUE(devices_.find(tablet->secret));
}

TEST_F(PairedDevices, Names_AreShortAndPrintable) {
  for (const std::string& name : {std::string(), std::string(41, 'a'), std::string("a\nb"), std::string("a\"b"),
                                  std::string("a\xE2\x80\xAE"
                                              "b")}) {
    EXPECT_EQ(devices_.pair(code(), name).error().code, Errc::kBadValue) << name;
  }
  EXPECT_TRUE(devices_.pair(code(), "Jürgens Händi"));
}

TEST_F(PairedDevices, MoreThanAreKept_TheOneNotSeenForLongestIsForgotten) {
  std::vector<std::string> secrets;
  for (std::size_t k = 0; k <= Devices::kMaxDevices; ++k, ++now_s)
    secrets.push_back(devices_.pair(code(), "phone")->secret);
  EXPECT_FALSE(devices_.find(secrets.front()));
  EXPECT_TRUE(devices_.find(secrets[1]));
  EXPECT_EQ(devices_.list()->size(), Devices::kMaxDevices);
  EXPECT_LE(file().size(), Devices::kMaxFile);
  const std::string oldest = code();
  for (std::size_t k = 0; k < Devices::kMaxCodes; ++k) code();
  EXPECT_FALSE(devices_.pair(oldest, "phone"));
}

TEST_F(PairedDevices, ADamagedFile_PairsNobodyAndSaysSo) {
  std::ofstream(folder_.path() / "devices.json") << R"({"newest": -1, "devices": {}, "codes": []})";
  EXPECT_FALSE(devices_.find(std::string(64, '0')));
  const auto made = devices_.make_code(Rights::kWatch);
  ASSERT_FALSE(made);
  EXPECT_NE(made.error().message.find("devices.json"), std::string::npos) << made.error().message;
}

}  // namespace
}  // namespace nodal::host::web
