// The rig.toml that nodald proposes for what is plugged in.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <utility>

#include "firmware/config/config.h"
#include "firmware/daemon/rig_proposal.h"
#include "firmware/daemon/scan_report.h"

namespace nodal::daemon {
namespace {

using hal::v4l2::FoundDevice;
using hal::v4l2::FoundFormat;
using hal::v4l2::FoundSize;

FoundFormat format(PixelFormat pixels, std::vector<FoundSize> sizes) {
  return {std::string(pixel_format_name(pixels)), pixels, std::move(sizes), false};
}

/// A camera on USB 2.0. 30 frames a second of YUYV need: 1280x720 55.3 MB/s, 640x480 18.4, 320x240 4.6.
FoundDevice camera(int number, int bus, std::vector<FoundSize> sizes) {
  FoundDevice device;
  device.node = "/dev/video" + std::to_string(number);
  device.port = "v4l2:usb-" + std::to_string(number);
  device.model = "Camera";
  device.usb = hal::device::UsbPlace{bus, 480, 480, ""};
  device.formats = {format(PixelFormat::kYuyv, std::move(sizes))};
  return device;
}
const std::vector<FoundSize> kUsual{{1280, 720, {{30, 1}, {10, 1}}}, {640, 480, {{30, 1}}}, {320, 240, {{30, 1}}}};

firmware::RigConfig accepted(const std::vector<FoundDevice>& devices) {
  const auto config = firmware::parse_rig_config(scan_text(devices).value(), "rig.toml");
  if (!config) throw std::runtime_error(config.error().text() + "\n" + scan_text(devices).value());
  return *config;
}

TEST(RigProposal, TwoCamerasOnOneBus_HaveTheLargestSizesThatTheirConnectionsCarryAndARigTomlThatIsAccepted) {
  const firmware::RigConfig config = accepted({camera(0, 1, kUsual), camera(2, 1, kUsual)});
  EXPECT_EQ(config.rate, (FrameRate{30, 1}));
  EXPECT_EQ(config.trigger.source, firmware::SyncSource::kNone);
  ASSERT_EQ(config.heads.size(), 2U);
  for (const auto& head : config.heads) {
    EXPECT_EQ(head.device.width, 640) << "55.3 MB/s of 1280x720 are more than the 53.2 of USB 2.0";
    EXPECT_EQ(head.format, PixelFormat::kYuyv);
  }
  EXPECT_EQ(config.heads[1].port.text(), "v4l2:usb-2");
}

TEST(RigProposal, MoreThanABusCarries_SmallerSizesUntilTheSumFits) {
  std::vector<FoundDevice> devices;
  for (int i = 0; i < 4; ++i) devices.push_back(camera(i, 1, kUsual));
  devices.push_back(camera(4, 2, kUsual));
  const RigProposal proposal = propose_rig(devices);
  ASSERT_EQ(proposal.heads.size(), 5U);
  // 4 * 18.4 MB/s are too much; with two at 4.6 the bus carries 46.1.
  int large = 0;
  std::int64_t sum = 0;
  for (const ProposedHead& head : proposal.heads) {
    if (head.device == 4) continue;
    large += head.width == 640;
    sum += head.bytes_per_second;
  }
  EXPECT_EQ(large, 2);
  EXPECT_EQ(sum, 2 * (640 * 480 * 2 * 30 + 320 * 240 * 2 * 30));
  EXPECT_EQ(proposal.heads[4].width, 640) << "it has a bus of its own";
}

TEST(RigProposal, NoSmallerSize_TheHeadIsLeftOutWithTheReason) {
  std::vector<FoundDevice> devices;
  for (int i = 0; i < 4; ++i) devices.push_back(camera(i, 1, {{640, 480, {{30, 1}}}}));
  const RigProposal proposal = propose_rig(devices);
  EXPECT_EQ(proposal.heads.size(), 2U);
  ASSERT_EQ(proposal.left_out.size(), 2U);
  EXPECT_NE(proposal.left_out.begin()->second.find("USB bus 1 cannot carry it"), std::string::npos);
  EXPECT_NE(scan_text(devices).value().find("# USB bus 1 (480 Mbit/s): 36.9 MB/s of at most 53.2"), std::string::npos);
}

TEST(RigProposal, DifferentRates_TheOneThatMostCamerasHave) {
  const std::vector<FoundDevice> devices{
      camera(0, 1, {{640, 480, {{30, 1}, {15, 1}}}}), camera(1, 2, {{640, 480, {{25, 1}, {15, 1}}}}),
      camera(2, 3, {{640, 480, {{60, 1}, {5, 1}}, true}}), camera(3, 4, {{640, 480, {}}})};
  const RigProposal proposal = propose_rig(devices);
  EXPECT_EQ(proposal.rate, (FrameRate{15, 1})) << "of the rates that all have";
  EXPECT_EQ(proposal.heads.size(), 4U);
}

TEST(RigProposal, ColourAndGreyCameras_TheMoreNumerousMakeTheRig) {
  std::vector<FoundDevice> devices{camera(0, 1, kUsual), camera(1, 2, kUsual), camera(2, 3, kUsual)};
  for (std::size_t i : {0U, 2U}) devices[i].formats[0] = format(PixelFormat::kGrey8, kUsual);
  const firmware::RigConfig config = accepted(devices);
  EXPECT_EQ(config.raymap.format, PixelFormat::kGrey8);
  EXPECT_EQ(config.heads.size(), 2U);
  EXPECT_NE(scan_text(devices).value().find("not in this rig: it has no format"), std::string::npos);
}

TEST(RigProposal, AnAnalogueInput_HasTheFieldOrderOfItsStandard) {
  FoundDevice grabber = camera(0, 1, {{720, 480, {{30000, 1001}}}});
  grabber.usb.reset();
  grabber.standard = FrameRate{30000, 1001};
  grabber.fields = Fields::kBottomFirst;
  const firmware::RigConfig config = accepted({grabber});
  EXPECT_EQ(config.rate, (FrameRate{30000, 1001}));
  EXPECT_EQ(config.heads.at(0).fields, Fields::kBottomFirst);
}

TEST(RigProposal, MoreCamerasThanARigHasHeads_TheRestIsLeftOut) {
  std::vector<FoundDevice> devices;
  for (int i = 0; i < 20; ++i) devices.push_back(camera(i, i, kUsual));
  EXPECT_EQ(accepted(devices).heads.size(), static_cast<std::size_t>(kMaxHeads));
}

TEST(RigProposal, HostileTexts_ReachRigTomlAsTheyAreAndForgeNoKey) {
  FoundDevice device = camera(0, 1, kUsual);
  device.port = R"(v4l2:a" # \ "b)";
  device.model = "] [[heads]] \"\"\"";
  device.input = "'''";
  const firmware::RigConfig config = accepted({device});
  ASSERT_EQ(config.heads.size(), 1U);
  EXPECT_EQ(config.heads[0].port.name, R"(a" # \ "b)");
}

TEST(RigProposal, ATomlThatNodaldCouldNotRead_IsAnErrorAndNeitherTextNorJson) {
  FoundDevice device = camera(0, 1, kUsual);
  device.port = "usb-0";  // no kind of port
  for (const auto& report : {scan_text({device}), scan_json({device})}) {
    ASSERT_FALSE(report);
    EXPECT_NE(report.error().message.find("the proposed rig.toml:"), std::string::npos) << report.error().text();
  }
}

TEST(RigProposal, NothingUsable_SaysWhyForEveryDevice) {
  FoundDevice silent = camera(0, 1, {});
  silent.formats.clear();
  silent.problem = Error{Errc::kTimeout, "/dev/video0: the device does not answer"};
  const FoundDevice compressed = [] {
    FoundDevice device = camera(1, 1, {});
    device.formats = {{"MJPG", std::nullopt, {{1920, 1080, {{30, 1}}}}, false}};
    return device;
  }();
  const std::vector<FoundDevice> devices{silent, compressed};
  EXPECT_TRUE(propose_rig(devices).heads.empty());
  const auto json = nlohmann::json::parse(scan_json(devices).value());
  EXPECT_EQ(json["devices"][0]["left_out"], "/dev/video0: the device does not answer");
  EXPECT_EQ(json["devices"][1]["formats"][0]["format"], nullptr);
  EXPECT_EQ(json["devices"][1]["left_out"], "it has no format and size of a head at the rate of the others");
  EXPECT_NE(scan_text({}).value().find("There is none"), std::string::npos);
}

TEST(RigProposal, SizesAtTheEndsOfArithmetic_AreNotProposed) {
  FoundDevice device = camera(0, 1, {{16384, 16384, {{1000, 1}}}, {16, 16, {{1, 1000}}}});
  device.usb->device_mbit = device.usb->bus_mbit = 20'000;
  const RigProposal proposal = propose_rig({device});
  // 16384 * 16384 * 2 bytes * 1000 are 537 GB/s; the small one has another rate.
  ASSERT_EQ(proposal.heads.size(), 1U);
  EXPECT_EQ(proposal.heads[0].width, 16);
  EXPECT_EQ(proposal.rate, (FrameRate{1, 1000}));
}

TEST(ScanJson, HasWhatTheTextHasInFull) {
  FoundDevice device = camera(0, 1, kUsual);
  device.controls = {{"Gain", 0, 255, 1, 64}};
  device.usb->serial = "SN7";
  const auto json = nlohmann::json::parse(scan_json({device}).value());
  const auto& one = json["devices"][0];
  EXPECT_EQ(one["usb"]["serial"], "SN7");
  EXPECT_EQ(one["formats"][0]["sizes"].size(), 3U);
  EXPECT_EQ(one["formats"][0]["sizes"][0]["rates"][1], "10/1");
  EXPECT_EQ(one["controls"][0]["high"], 255);
  EXPECT_EQ(one["head"]["bytes_per_second"], 640 * 480 * 2 * 30);
  EXPECT_EQ(json["buses"][0]["capacity"], 53'248'000);
  EXPECT_TRUE(firmware::parse_rig_config(json["rig_toml"].get<std::string>(), "rig.toml"));
}

TEST(ScanText, OfAnOrdinaryUser_HasItsFilesInTheUsersFolder) {
  const RigPlaces places{"/srv/a \"b\"/.local/state/nodal/nodal.sock", "/srv/a \"b\"/.local/state/nodal"};
  std::string toml = scan_text({camera(0, 1, kUsual)}, places).value();
  const auto config = firmware::parse_rig_config(toml, "rig.toml");
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->links.unix_path, places.socket);
  EXPECT_EQ(config->store, places.folder);
  EXPECT_FALSE(config->takes);
  // What the guide does to record.
  for (const auto& [from, to] : {std::pair{"# [takes]", "[takes]"}, std::pair{"# folder = ", "folder = "}}) {
    const std::size_t at = toml.find(from);
    ASSERT_NE(at, std::string::npos) << toml;
    toml.replace(at, std::string(from).size(), to);
  }
  const auto records = firmware::parse_rig_config(toml, "rig.toml");
  ASSERT_TRUE(records) << records.error().text();
  EXPECT_EQ(records->takes->folder, places.folder + "/takes");
}

}  // namespace
}  // namespace nodal::daemon
