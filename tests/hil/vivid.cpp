#include "vivid.h"

#include <linux/videodev2.h>

#include <chrono>
#include <stdexcept>
#include <thread>

#include "hal/linux/v4l2/device.h"

namespace nodal::hil {

std::string vivid_path(int device) {
  return std::string("v4l2:platform:vivid-") + (device < 10 ? "00" : "0") + std::to_string(device);
}

std::string ntsc_heads_toml(int heads) {
  std::string text;
  for (int i = 0; i < heads; ++i) {
    text += "[[heads]]\nname = \"cam" + std::to_string(i) + "\"\nport = \"" + vivid_path(i) +
            "\"\nformat = \"YUYV\"\nsize = \"720x480\"\ninput = \"S-Video 0\"\nstandard = \"NTSC\"\n" +
            "fields = \"bottom-first\"\nseparate_fields = " + (i % 2 == 0 ? "false" : "true") + "\n";
  }
  return text;
}

void set_vivid(int device, std::uint32_t control, int value) {
  const std::string path = vivid_path(device);
  auto opened = hal::v4l2::open_device(hal::v4l2::kernel(), path, path.substr(path.find(':') + 1));
  if (!opened) throw std::runtime_error(opened.error().text());
  v4l2_control change{control, value};
  if (const int error = (*opened)->ioctl(VIDIOC_S_CTRL, &change); error != 0) {
    throw std::runtime_error((*opened)->explained("setting vivid's control " + std::to_string(control), error).text());
  }
}

hal::v4l2::HeadRequest ntsc(PixelFormat pixels) {
  hal::v4l2::HeadRequest request;
  request.pixels = pixels;
  request.fields = Fields::kBottomFirst;
  request.width = 720;
  request.height = 480;
  request.input = "S-Video 0";
  request.standard = "NTSC";
  return request;
}

hal::v4l2::HeadRequest webcam(PixelFormat pixels) {
  hal::v4l2::HeadRequest request;
  request.pixels = pixels;
  request.rate = {30, 1};
  request.width = 320;
  request.height = 180;
  request.input = "0";
  request.gain_step_mdb = 100;
  return request;
}

Result<hal::FrameView> next_frame(hal::HeadPort& head, hal::ClockPort& clock) {
  const Instant until = clock.now() + Duration::seconds(2);
  while (clock.now() < until) {
    auto frame = head.take_frame();
    if (!frame) return fail(frame.error());
    if (*frame) return **frame;
    wait_for(Duration::milliseconds(1));
  }
  return fail(Errc::kTimeout, "no frame in two seconds");
}

void wait_for(Duration time) { std::this_thread::sleep_for(std::chrono::nanoseconds(time.ns())); }

}  // namespace nodal::hil
