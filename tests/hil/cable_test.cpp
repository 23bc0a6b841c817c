// nodal against nodald over a USB cable: the kernel's FunctionFS and usbfs, with dummy_hcd between them. nodald runs as
// an ordinary user, as with its systemd unit.
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <sstream>
#include <thread>

#include "cable_rig.h"
#include "hal/linux/cable/host/cable_link.h"

namespace nodal::hil {
namespace {

using Json = nlohmann::json;
using test::Finished;
using test::Process;

class CableRig : public testing::Test {
 protected:
  CableRig() { std::filesystem::create_directories(kScratch); }

  static std::string pull(const std::string& rig, int count = 1) {
    const std::string file = kScratch + "/pulled.raw";
    std::filesystem::remove(file);
    const Finished done = nodal(rig, {"raymap", "pull", "--complete", "-n", std::to_string(count), "--out", file});
    EXPECT_EQ(done.code, 0) << done.err;
    return content(file);
  }
  static void upload(const std::string& rig, const std::string& calibration) {
    const Finished done = nodal(rig, {"--timeout", "2min", "calibration", "upload", calibration});
    EXPECT_EQ(done.code, 0) << done.err;
  }
  /// A host that pulls until it is killed; returns when it has pulled several.
  static std::unique_ptr<Process> puller(const std::string& rig) {
    const std::string file = kScratch + "/live.raw";
    std::filesystem::remove(file);
    auto host =
        std::make_unique<Process>(std::vector<std::string>{NODAL_BIN_DIR "/nodal", "--rig", rig, "--json", "raymap",
                                                           "pull", "--continuous", "--format", "raw", "--out", file});
    EXPECT_TRUE(test::wait_until([&] {
      const std::string said = host->said();
      return std::count(said.begin(), said.end(), '\n') >= 3;
    })) << host->complained();
    return host;
  }
};

TEST_F(CableRig, CalibrationGoesInAndRaymapsComeOut_AsOverTheSocketToTheByte) {
  const CableGadget gadget("RIG7", 0, "nobody");
  CableNodald rig(gadget);
  const Finished status = nodal("usb:", {"status"});
  ASSERT_EQ(status.code, 0) << status.err;
  EXPECT_EQ(Json::parse(status.out)["rig"], "rig-RIG7");
  upload(rig.by_cable(), rig.calibration());
  const std::string expected = pull(rig.by_socket());
  ASSERT_GT(expected.size(), 10'000u);
  ASSERT_EQ(pull(rig.by_socket()), expected) << "the scene moves, so this test shows nothing";
  EXPECT_TRUE(pull(rig.by_cable()) == expected);
  EXPECT_TRUE(pull(rig.by_cable(), 20) == expected);
}

TEST_F(CableRig, HostsKilledInTheMiddleOfAPull_TheNextGetsNoByteMeantForThem) {
  const CableGadget gadget("RIG7", 0, "nobody");
  CableNodald rig(gadget);
  upload(rig.by_cable(), rig.calibration());
  const std::string expected = pull(rig.by_socket());
  for (int i = 0; i < 8; ++i) {
    const auto host = puller(rig.by_cable());
    std::this_thread::sleep_for(std::chrono::microseconds(4300 * i));  // each time in the middle of another record
    host->signal(SIGKILL);
    host->wait();
    // Every second time, the next raymap fills the rig's transfers before the next host comes.
    if (i % 2 == 1) std::this_thread::sleep_for(std::chrono::milliseconds(120));
    ASSERT_TRUE(pull(rig.by_cable()) == expected) << i;
  }
  EXPECT_EQ(rig.nodald().complained().find("cable record"), std::string::npos) << rig.nodald().complained();
}

TEST_F(CableRig, UnpluggedDuringAPull_TheHostSaysSoAndTheRigGoesOn) {
  const CableGadget gadget("RIG7", 0, "nobody");
  CableNodald rig(gadget);
  upload(rig.by_cable(), rig.calibration());
  const std::string expected = pull(rig.by_socket());
  for (int i = 0; i < 3; ++i) {
    const auto host = puller(rig.by_cable());
    gadget.unplug();
    const Finished ended = host->wait();
    EXPECT_EQ(ended.code, 3) << ended.err;
    EXPECT_NE(ended.err.find("unplugged"), std::string::npos) << ended.err;
    EXPECT_TRUE(pull(rig.by_socket()) == expected);
    gadget.plug();
    EXPECT_TRUE(pull(rig.by_cable()) == expected);
  }
}

TEST_F(CableRig, SecondHost_IsRefusedAndServedWhenTheFirstHasLeft) {
  const CableGadget gadget("RIG7", 0, "nobody");
  CableNodald rig(gadget);
  upload(rig.by_cable(), rig.calibration());
  const auto first = puller(rig.by_cable());
  const Finished refused = nodal(rig.by_cable(), {"status"});
  EXPECT_EQ(refused.code, 7);
  EXPECT_NE(refused.err.find("another program of this machine uses the cable"), std::string::npos) << refused.err;
  first->signal(SIGINT);
  first->wait();
  for (int i = 0; i < 5; ++i) EXPECT_EQ(nodal(rig.by_cable(), {"status"}).code, 0);
}

TEST_F(CableRig, TwoHundredConnections_EachIsAnsweredAndNothingStays) {
  const CableGadget gadget("RIG7", 0, "nobody");
  CableNodald rig(gadget);
  const auto descriptors = [&] {
    const std::filesystem::directory_iterator all("/proc/" + std::to_string(rig.nodald().pid()) + "/fd");
    return std::distance(begin(all), end(all));
  };
  std::ptrdiff_t before = 0;
  for (int i = 0; i < 200; ++i) {
    auto link = hal::cable::connect_cable("RIG7");
    ASSERT_TRUE(link) << i << link.error().text();
    // The rig says hello first.
    std::array<std::uint8_t, 4096> bytes;
    EXPECT_TRUE(test::wait_until([&] { return (*link)->read(bytes).value_or(0) > 0; }, std::chrono::seconds(5))) << i;
    if (i == 10) before = descriptors();
  }
  EXPECT_EQ(descriptors(), before);
  EXPECT_EQ(nodal(rig.by_cable(), {"status"}).code, 0);
}

TEST_F(CableRig, NoRigOrTheWrongOneOrSeveral_OneErrorThatListsThem) {
  const auto complaint = [](const std::string& address) {
    const Finished done = nodal(address, {"status"});
    EXPECT_EQ(done.code, 3) << done.out;
    return done.err;
  };
  EXPECT_NE(complaint("usb:").find("no rig is plugged in"), std::string::npos);
  const CableGadget gadget("RIG7", 0, "nobody");
  const CableGadget other("RIG8", 1, "nobody");
  CableNodald rig(gadget);
  EXPECT_NE(complaint("usb:RIG8").find("plugged in: usb:RIG7 ('rig-RIG7' at "), std::string::npos);
  CableNodald second(other);
  const std::string several = complaint("usb:");
  EXPECT_NE(several.find("2 rigs are plugged in"), std::string::npos) << several;
  EXPECT_NE(several.find("usb:RIG7"), std::string::npos) << several;
  EXPECT_NE(several.find("usb:RIG8"), std::string::npos) << several;
  EXPECT_EQ(Json::parse(nodal("usb:RIG8", {"status"}).out)["rig"], "rig-RIG8");

  const Finished denied =
      Process(as_nobody({for_everybody(NODAL_BIN_DIR "/nodal"), "--rig", "usb:RIG7", "status"})).wait();
  EXPECT_EQ(denied.code, 3);
  EXPECT_NE(denied.err.find("60-nodal-host.rules"), std::string::npos) << denied.err;

  rig.nodald().signal(SIGSTOP);
  EXPECT_NE(complaint("usb:RIG7").find("did not answer within 3 s"), std::string::npos);
  rig.nodald().signal(SIGCONT);
  // nodald answers a host that is gone: the kernel keeps the answer's writer until another request, and only that.
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_EQ(nodal(rig.by_socket(), {"status"}).code, 0);
  EXPECT_EQ(nodal("usb:RIG7", {"status"}).code, 0);
  rig.nodald().signal(SIGTERM);
  EXPECT_EQ(rig.nodald().wait().code, 0);
  EXPECT_TRUE(test::wait_until([] { return hal::cable::plugged_rigs()->size() == 1; })) << "unplugged with its end";
}

TEST_F(CableRig, NoGadgetOrATakenOne_NodaldSaysWhatToDo) {
  const auto start = [](const std::string& folder) {
    std::filesystem::remove(kScratch + "/other.sock.lock");
    std::ofstream(kScratch + "/rig.toml")
        << "[rig]\nname = \"r\"\n[links]\nunix = \"other.sock\"\nusb = \"" << folder
        << "\"\n[store]\nfolder = \"store\"\n[sim]\ncalibration = \"" NODAL_SOURCE_DIR
           "/host_tool/example/ten_heads.json\"\nscene = \"constant\"\n[[heads]]\nname = \"cam0\"\nport = "
           "\"sim:cam0\"\n";
    return Process({NODAL_BIN_DIR "/nodald", "--config", kScratch + "/rig.toml"}).wait();
  };
  const Finished missing = start("/run/nowhere");
  EXPECT_EQ(missing.code, 3);
  EXPECT_NE(missing.err.find("systemctl enable --now nodal-cable"), std::string::npos) << missing.err;
  const CableGadget gadget("RIG7", 0, "nobody");
  const CableNodald rig(gadget);
  const Finished taken = start(gadget.folder());
  EXPECT_EQ(taken.code, 3);
  EXPECT_NE(taken.err.find("another program serves the cable"), std::string::npos) << taken.err;
}

}  // namespace
}  // namespace nodal::hil
