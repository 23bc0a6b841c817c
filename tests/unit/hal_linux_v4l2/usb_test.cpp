// Where a device is on USB, and the bandwidth of its bus.
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "hal/linux/device/usb.h"
#include "head_fixture.h"

namespace nodal::hal::v4l2 {
namespace {

namespace fs = std::filesystem;
using device::usb_capacity;
using device::usb_place_of;
using device::UsbBuses;
using device::UsbPlace;

/// A sysfs like the kernel's: a camera at port 2 of bus 1, and a device that is on no USB.
class Sysfs {
 public:
  Sysfs() {
    const fs::path hub = root_ / "devices/pci0/usb1";
    const fs::path camera = hub / "1-2";
    write(hub / "speed", "480\n");
    write(hub / "busnum", "1\n");
    write(camera / "busnum", "1\n");
    write(camera / "speed", "12\n");
    write(camera / "serial", "SN\x1b[2J7\n");
    link(camera / "1-2:1.0", root_ / "class/video4linux/video3/device");
    link(root_ / "devices/platform/vivid.0", root_ / "class/video4linux/video4/device");
    link(hub, root_ / "bus/usb/devices/usb1");
  }
  ~Sysfs() { fs::remove_all(root_); }
  const fs::path& root() const { return root_; }
  static void write(const fs::path& file, const std::string& text) {
    fs::create_directories(file.parent_path());
    std::ofstream(file) << text;
  }

 private:
  static void link(const fs::path& target, const fs::path& name) {
    fs::create_directories(target);
    fs::create_directories(name.parent_path());
    fs::create_directory_symlink(target, name);
  }
  const fs::path root_ = fs::temp_directory_path() / ("nodal-sysfs-" + std::to_string(::getpid()));
};

TEST(UsbPlace, OfACamera_HasBusSpeedsAndAPrintableSerial) {
  const Sysfs sysfs;
  const auto place = usb_place_of(sysfs.root(), "/dev/video3");
  ASSERT_TRUE(place);
  EXPECT_EQ(place->bus, 1);
  EXPECT_EQ(place->bus_mbit, 480);
  EXPECT_EQ(place->device_mbit, 12);
  EXPECT_EQ(place->serial, "SN?[2J7");
}

TEST(UsbPlace, OfADeviceElsewhereOrOfNone_IsNothing) {
  const Sysfs sysfs;
  EXPECT_FALSE(usb_place_of(sysfs.root(), "/dev/video4"));
  EXPECT_FALSE(usb_place_of(sysfs.root(), "/dev/video5"));
  EXPECT_FALSE(usb_place_of(sysfs.root() / "nowhere", "/dev/video3"));
}

TEST(UsbPlace, NumbersThatAreNone_AreZeroSoNothingIsRefused) {
  const Sysfs sysfs;
  Sysfs::write(sysfs.root() / "devices/pci0/usb1/1-2/speed", "fast\n");
  Sysfs::write(sysfs.root() / "devices/pci0/usb1/speed", "99999999999999999999\n");
  const auto place = usb_place_of(sysfs.root(), "/dev/video3");
  ASSERT_TRUE(place);
  EXPECT_EQ(place->device_mbit, 0);
  EXPECT_EQ(place->bus_mbit, 0);
  UsbBuses buses;
  EXPECT_TRUE(buses.claim(*place, INT64_MAX / 4, "cam0", "anything"));
}

TEST(UsbCapacity, IsThatOfTheSpecifications) {
  EXPECT_EQ(usb_capacity(480), 53'248'000);        // USB 2.0, table 5-10: 13 bulk packets of 512 bytes a microframe
  EXPECT_EQ(usb_capacity(12), 1'216'000);          // table 5-9: 19 of 64 bytes a frame
  EXPECT_EQ(usb_capacity(5'000), 500'000'000);     // 8b/10b: ten bits a byte
  EXPECT_EQ(usb_capacity(10'000), 1'212'121'212);  // 128b/132b
  EXPECT_EQ(usb_capacity(0), 0);
}

TEST(UsbBuses, MoreThanTheBusCarries_IsRefusedWithTheNumbersAndFitsWhenAnotherHeadLeaves) {
  UsbBuses buses;
  const UsbPlace place{2, 480, 480, ""};
  auto first = buses.claim(place, 30'000'000, "cam0", "YUYV 800x600");
  ASSERT_TRUE(first);
  const auto second = buses.claim(place, 23'248'001, "cam1", "GREY 640x480");
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Errc::kBandwidth);
  EXPECT_EQ(
      second.error().message,
      "head 'cam1': GREY 640x480, 23.2 MB/s: USB bus 2 (480 Mbit/s) carries at most 53.2 MB/s, and 30.0 MB/s are in "
      "use (cam0: YUYV 800x600, 30.0 MB/s); choose a smaller size or a lower rate, or plug it into another bus");
  EXPECT_TRUE(buses.claim(place, 23'248'000, "cam1", "GREY 640x480"));
  EXPECT_TRUE(buses.claim({3, 480, 480, ""}, 53'248'000, "cam2", "on another bus"));
  first->reset();
  EXPECT_TRUE(buses.claim(place, 53'248'000, "cam1", "GREY 640x480"));
}

TEST(UsbBuses, ADeviceSlowerThanItsBus_IsRefusedForItsOwnSpeed) {
  UsbBuses buses;
  const auto slow = buses.claim({2, 480, 12, ""}, 1'216'001, "cam0", "GREY 640x480");
  ASSERT_FALSE(slow);
  EXPECT_NE(slow.error().message.find("its connection (USB, 12 Mbit/s) carries at most 1.2 MB/s"), std::string::npos);
}

TEST(UsbBuses, SharesThatOutliveThem_AreReleasedSafely) {
  auto buses = std::make_unique<UsbBuses>();
  auto share = buses->claim({2, 480, 480, ""}, 1, "cam0", "a mode");
  ASSERT_TRUE(share);
  buses.reset();
  share->reset();
}

using UsbHead = V4l2HeadTest;

TEST_F(UsbHead, MoreThanItsBusCarries_IsNotOpenedAndTheErrorHasTheNumbers) {
  driver_.width = 1280;
  driver_.height = 720;
  driver_.padding = 0;
  driver_.place = UsbPlace{1, 480, 480, ""};
  // 1280 * 720 * 2 bytes * 30000/1001
  expect_error(status_of(open()), Errc::kBandwidth, "YUYV 1280x720 at 30000/1001 frames a second, 55.2 MB/s");
  driver_.place = UsbPlace{1, 5000, 5000, ""};
  {
    const auto head = open();
    EXPECT_TRUE(head);
  }
  driver_.width = 640;
  driver_.place = UsbPlace{1, 480, 480, ""};
  for (int again = 0; again < 3; ++again) {
    const auto head = open();
    EXPECT_TRUE(head) << "its predecessor gave its 27.6 MB/s back";
  }
  expect_nothing_left();
}

}  // namespace
}  // namespace nodal::hal::v4l2
