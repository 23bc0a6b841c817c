// Scans of devices that answer, hang and lie.
#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <map>
#include <mutex>
#include <thread>

#include <linux/videodev2.h>

#include "hal/linux/v4l2/scan.h"
#include "protocol/base/text.h"

namespace nodal::hal::v4l2 {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

struct Mode {
  std::uint32_t code, width, height;
  std::vector<v4l2_fract> periods;
};

/// A device as its driver describes it.
struct Camera {
  std::string card = "Camera", bus = {};
  std::vector<Mode> modes = {};
  std::map<std::uint32_t, v4l2_queryctrl> controls = {};
  v4l2_std_id standard = 0;
  std::optional<device::UsbPlace> usb = {};
  bool captures = true;
  int open_error = 0;
  bool hangs = false;
  bool endless = false;  ///< every list goes on for ever, with what `modes` has first
};

class Machine final : public System {
 public:
  std::map<std::string, Camera> cameras;
  std::atomic<int> questions{0};

  ~Machine() override {
    release();
    while (threads_inside_ > 0) std::this_thread::yield();
  }
  void release() {
    const std::lock_guard lock(mutex_);
    released_ = true;
    changed_.notify_all();
  }
  int opens() const { return opened_; }
  bool all_closed() const { return opened_ == closed_; }

  int open(const std::string& node) override {
    const auto found = cameras.find(node);
    if (found == cameras.end()) return -ENOENT;
    if (found->second.open_error != 0) return -found->second.open_error;
    ++opened_;
    return static_cast<int>(std::distance(cameras.begin(), found));
  }
  void close(int) override { ++closed_; }
  int ioctl(int fd, unsigned long request, void* argument) override {
    const Camera& camera = std::next(cameras.begin(), fd)->second;
    ++questions;
    if (camera.hangs && request != VIDIOC_QUERYCAP) {
      ++threads_inside_;
      {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] { return released_; });
      }
      --threads_inside_;
    }
    return answer(camera, request, argument);
  }
  std::uint8_t* map(int, std::size_t, std::size_t) override { return nullptr; }
  void unmap(std::uint8_t*, std::size_t) override {}
  std::vector<std::string> nodes() override {
    std::vector<std::string> all;
    for (const auto& [node, camera] : cameras) all.push_back(node);
    return all;
  }
  std::optional<device::UsbPlace> usb(const std::string& node) override { return cameras.at(node).usb; }

 private:
  template <std::size_t kSize>
  static void write(std::uint8_t (&field)[kSize], const std::string& text) {
    std::memcpy(field, text.data(), std::min(kSize, text.size()));  // a full field has no zero
  }
  static int answer(const Camera& camera, unsigned long request, void* argument) {
    switch (request) {
      case VIDIOC_QUERYCAP: {
        auto& capability = *static_cast<v4l2_capability*>(argument);
        write(capability.card, camera.card);
        write(capability.bus_info, camera.bus);
        write(capability.driver, "uvcvideo");
        capability.capabilities =
            V4L2_CAP_STREAMING | (camera.captures ? V4L2_CAP_VIDEO_CAPTURE : V4L2_CAP_META_CAPTURE);
        return 0;
      }
      case VIDIOC_G_INPUT: return 0;
      case VIDIOC_ENUMINPUT: write(static_cast<v4l2_input*>(argument)->name, "S-Video"); return 0;
      case VIDIOC_G_STD: *static_cast<v4l2_std_id*>(argument) = camera.standard; return camera.standard ? 0 : ENODATA;
      case VIDIOC_ENUMSTD: {
        auto& standard = *static_cast<v4l2_standard*>(argument);
        if (standard.index > 1) return EINVAL;
        standard.id = standard.index == 0 ? V4L2_STD_PAL : V4L2_STD_NTSC;
        standard.frameperiod = standard.index == 0 ? v4l2_fract{1, 25} : v4l2_fract{1001, 30000};
        return 0;
      }
      case VIDIOC_ENUM_FMT: {
        auto& format = *static_cast<v4l2_fmtdesc*>(argument);
        std::vector<std::uint32_t> codes;
        for (const Mode& mode : camera.modes) {
          if (codes.empty() || codes.back() != mode.code) codes.push_back(mode.code);
        }
        if (!camera.endless && format.index >= codes.size()) return EINVAL;
        format.pixelformat = codes[format.index % codes.size()];
        return 0;
      }
      case VIDIOC_ENUM_FRAMESIZES: {
        auto& size = *static_cast<v4l2_frmsizeenum*>(argument);
        const Mode* const mode = nth(camera, size.pixel_format, size.index);
        if (mode == nullptr) return EINVAL;
        size.type = V4L2_FRMSIZE_TYPE_DISCRETE;
        size.discrete = {mode->width + (camera.endless ? 2 * size.index : 0), mode->height};
        return 0;
      }
      case VIDIOC_ENUM_FRAMEINTERVALS: {
        auto& interval = *static_cast<v4l2_frmivalenum*>(argument);
        interval.type = V4L2_FRMIVAL_TYPE_DISCRETE;
        for (const Mode& mode : camera.modes) {
          if (camera.endless) {
            interval.discrete = mode.periods.at(0);
            return 0;
          }
          if (mode.code != interval.pixel_format || mode.width != interval.width || mode.height != interval.height)
            continue;
          if (interval.index >= mode.periods.size()) return EINVAL;
          interval.discrete = mode.periods[interval.index];
          return 0;
        }
        return EINVAL;
      }
      case VIDIOC_G_FMT:
        static_cast<v4l2_format*>(argument)->fmt.pix.width = 720;
        static_cast<v4l2_format*>(argument)->fmt.pix.height = 480;
        return 0;
      case VIDIOC_QUERYCTRL: {
        auto& query = *static_cast<v4l2_queryctrl*>(argument);
        const auto found = camera.controls.find(query.id);
        if (found == camera.controls.end()) return EINVAL;
        query = found->second;
        return 0;
      }
      default: return ENOTTY;
    }
  }
  static const Mode* nth(const Camera& camera, std::uint32_t code, std::uint32_t index) {
    if (camera.endless) return &camera.modes.front();
    for (const Mode& mode : camera.modes) {
      if (mode.code == code && mode.width > 0 && index-- == 0) return &mode;
    }
    return nullptr;
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  bool released_ = false;
  std::atomic<int> threads_inside_{0}, opened_{0}, closed_{0};
};

v4l2_queryctrl control(const char* name, int low, int high, int step, int usual) {
  v4l2_queryctrl query{};
  std::strncpy(reinterpret_cast<char*>(query.name), name, sizeof query.name);
  query.minimum = low;
  query.maximum = high;
  query.step = step;
  query.default_value = usual;
  return query;
}

TEST(Scan, OfACamera_HasItsModesControlsAndPlaceAndLeavesNothingOpen) {
  Machine machine;
  Camera& camera = machine.cameras["/dev/video0"];
  camera.bus = "usb-0000:00:14.0-2.1";
  camera.usb = device::UsbPlace{1, 480, 480, "SN7"};
  camera.modes = {{V4L2_PIX_FMT_YUYV, 640, 480, {{1, 15}, {1, 30}}},
                  {V4L2_PIX_FMT_YUYV, 1280, 720, {{1, 10}}},
                  {V4L2_PIX_FMT_MJPEG, 1920, 1080, {{1001, 30000}}},
                  {V4L2_PIX_FMT_H264, 1920, 1080, {{1001, 30000}}}};
  camera.controls[V4L2_CID_EXPOSURE_ABSOLUTE] = control("Exposure", 1, 5000, 1, 157);
  machine.cameras["/dev/video1"] = {.bus = "usb-0000:00:14.0-2.1", .captures = false};  // its metadata

  const auto found = Scanner(machine).scan(seconds(60));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].node, "/dev/video0");
  EXPECT_EQ(found[0].port, "v4l2:usb-0000:00:14.0-2.1");
  EXPECT_EQ(found[0].model, "Camera");
  EXPECT_EQ(found[0].driver, "uvcvideo");
  EXPECT_EQ(found[0].usb->serial, "SN7");
  EXPECT_FALSE(found[0].problem);
  EXPECT_TRUE(found[0].oddities.empty());
  ASSERT_EQ(found[0].formats.size(), 3U);
  const FoundFormat& yuyv = found[0].formats[0];
  EXPECT_EQ(yuyv.pixels, PixelFormat::kYuyv);
  ASSERT_EQ(yuyv.sizes.size(), 2U);
  EXPECT_EQ(yuyv.sizes[0].width, 640);
  EXPECT_EQ(yuyv.sizes[0].rates, (std::vector<FrameRate>{{30, 1}, {15, 1}}));
  EXPECT_EQ(yuyv.sizes[1].rates, (std::vector<FrameRate>{{10, 1}}));
  EXPECT_EQ(found[0].formats[1].pixels, PixelFormat::kMjpeg);
  EXPECT_FALSE(found[0].formats[2].pixels) << "H.264 is no format of a head";
  ASSERT_EQ(found[0].controls.size(), 1U);
  EXPECT_EQ(found[0].controls[0].high, 5000);
  EXPECT_EQ(found[0].controls[0].usual, 157);
  EXPECT_TRUE(machine.all_closed());
}

TEST(Scan, OfAnAnalogueInput_HasTheRateSizeAndFieldsOfItsStandard) {
  Machine machine;
  machine.cameras["/dev/video0"] = {
      .bus = "PCI:1", .modes = {{V4L2_PIX_FMT_YUYV, 0, 0, {}}}, .standard = V4L2_STD_NTSC_M};
  const auto found = Scanner(machine).scan(seconds(60));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].input, "S-Video");
  EXPECT_EQ(found[0].standard, (FrameRate{30000, 1001}));
  EXPECT_EQ(found[0].fields, Fields::kBottomFirst);
  ASSERT_EQ(found[0].formats.at(0).sizes.size(), 1U);
  EXPECT_EQ(found[0].formats[0].sizes[0].width, 720);
  EXPECT_EQ(found[0].formats[0].sizes[0].rates, (std::vector<FrameRate>{{30000, 1001}}));
}

TEST(Scan, NodesOfOneBus_AreStreamsOfOneCameraOnUsbAndDevicesOfTheirOwnElsewhere) {
  Machine machine;
  for (const char* node : {"/dev/video0", "/dev/video1"})
    machine.cameras[node] = {.bus = "usb-1", .usb = device::UsbPlace{1, 480, 480, ""}};
  for (const char* node : {"/dev/video2", "/dev/video3"}) machine.cameras[node] = {.bus = "PCI:1"};
  const auto found = Scanner(machine).scan(seconds(60));
  ASSERT_EQ(found.size(), 4U);
  EXPECT_EQ(found[0].port, "v4l2:usb-1");
  EXPECT_FALSE(found[0].second_stream);
  EXPECT_TRUE(found[1].second_stream);
  EXPECT_EQ(found[2].port, "v4l2:PCI:1");
  EXPECT_EQ(found[3].port, "v4l2:/dev/video3");
  EXPECT_FALSE(found[3].second_stream);
}

TEST(Scan, ADeviceThatHangs_IsNamedAndTheOthersAreListed) {
  Machine machine;
  machine.cameras["/dev/video0"] = {.bus = "usb-1", .hangs = true};
  machine.cameras["/dev/video1"] = {.bus = "usb-2", .modes = {{V4L2_PIX_FMT_GREY, 640, 480, {{1, 30}}}}};
  machine.cameras["/dev/video2"] = {.bus = "usb-3", .open_error = EACCES};
  const auto found = Scanner(machine).scan(milliseconds(200));
  ASSERT_EQ(found.size(), 3U);
  ASSERT_TRUE(found[0].problem);
  EXPECT_EQ(found[0].problem->code, Errc::kTimeout);
  EXPECT_NE(found[0].problem->message.find("/dev/video0: the device does not answer"), std::string::npos);
  EXPECT_EQ(found[1].formats.size(), 1U);
  ASSERT_TRUE(found[2].problem);
  EXPECT_NE(found[2].problem->message.find("add nodald's user to the group video"), std::string::npos);
  machine.release();
  while (!machine.all_closed()) std::this_thread::yield();
}

TEST(Scan, ADeviceThatHangsThroughManyScans_IsAskedOnceUntilItAnswers) {
  Machine machine;
  machine.cameras["/dev/video0"] = {.bus = "usb-1", .modes = {{V4L2_PIX_FMT_GREY, 640, 480, {{1, 30}}}}, .hangs = true};
  Scanner scanner(machine);
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(scanner.scan(milliseconds(1)).at(0).problem);
  EXPECT_EQ(machine.opens(), 1);
  machine.release();
  while (!machine.all_closed()) std::this_thread::yield();
  EXPECT_FALSE(scanner.scan(seconds(60)).at(0).problem) << "it has come back";
}

TEST(Scan, ListsThatDoNotEnd_AreCutAndSaidToBe) {
  Machine machine;
  machine.cameras["/dev/video0"] = {
      .bus = "usb-1", .modes = {{V4L2_PIX_FMT_YUYV, 640, 480, {{1, 30}}}}, .endless = true};
  const auto found = Scanner(machine).scan(seconds(60));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_LE(machine.questions, kMaxEnumerations + 20);
  EXPECT_LE(found[0].formats.size(), kMaxFormats);
  ASSERT_FALSE(found[0].formats.empty());
  EXPECT_EQ(found[0].formats[0].sizes.size(), kMaxSizes);
  EXPECT_EQ(found[0].formats[0].sizes[0].rates.size(), kMaxFrameRates);
  std::string all;
  for (const std::string& oddity : found[0].oddities) all += oddity + "\n";
  EXPECT_NE(all.find("lists more than 64 sizes of YUYV"), std::string::npos) << all;
  EXPECT_NE(all.find("lists more than 32 rates"), std::string::npos) << all;
  EXPECT_NE(all.find("answers more than 4096 questions"), std::string::npos) << all;
}

TEST(Scan, MoreNodesThanItOpens_TheFirstAreListed) {
  Machine machine;
  for (int i = 100; i < 400; ++i) machine.cameras["/dev/video" + std::to_string(i)] = {.bus = "b" + std::to_string(i)};
  EXPECT_EQ(Scanner(machine).scan(seconds(60)).size(), kMaxNodes);
}

TEST(Scan, WhatCannotBe_IsLeftOutAndSaidAndTextsAreHarmless) {
  Machine machine;
  Camera& camera = machine.cameras["/dev/video0"];
  camera.card = "Cam\x1b[31m\xff\nera of thirty-two characters xx";
  camera.bus = "usb\n[[heads]]";
  camera.modes = {{V4L2_PIX_FMT_YUYV, 4, 0, {}},
                  {V4L2_PIX_FMT_YUYV, 0xFFFFFFFF, 0xFFFFFFFF, {}},
                  {V4L2_PIX_FMT_YUYV, 640, 480, {{0, 0}, {1, 0}, {0, 1}, {0xFFFFFFFF, 1}, {1, 25}}},
                  {0x1B0A0080, 640, 480, {}}};
  camera.controls[V4L2_CID_GAIN] = control("Ga\x07in", 10, 1, 1, 5);
  camera.controls[V4L2_CID_RED_BALANCE] = control("Red", 0, 10, -3, 5);
  const auto found = Scanner(machine).scan(seconds(60));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_TRUE(is_printable(found[0].model)) << found[0].model;
  EXPECT_EQ(found[0].port, "v4l2:/dev/video0") << "a bus that cannot be written into rig.toml is no port";
  ASSERT_EQ(found[0].formats.size(), 2U);
  ASSERT_EQ(found[0].formats[0].sizes.size(), 1U);
  EXPECT_EQ(found[0].formats[0].sizes[0].rates, (std::vector<FrameRate>{{25, 1}}));
  EXPECT_TRUE(is_printable(found[0].formats[1].name));
  ASSERT_EQ(found[0].controls.size(), 1U);
  EXPECT_EQ(found[0].controls[0].step, 1);
  std::string all;
  for (const std::string& oddity : found[0].oddities) {
    EXPECT_TRUE(is_printable(oddity)) << oddity;
    all += oddity + "\n";
  }
  for (const char* part : {"YUYV of 4x0", "4294967295x4294967295", "period of 1/0 s", "'Ga?in' a range of 10 to 1"}) {
    EXPECT_NE(all.find(part), std::string::npos) << part << " is not in\n" << all;
  }
}

}  // namespace
}  // namespace nodal::hal::v4l2
