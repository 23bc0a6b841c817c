#include "uvc_camera.h"

#include <linux/usb/ch9.h>
#include <pthread.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <new>
#include <stdexcept>
#include <thread>
#include <utility>

#include "raw_gadget.h"
#include "tests/support/process.h"

namespace nodal::hil {
namespace {

using Device = UvcCamera::Device;

constexpr std::uint32_t kFrameBytes = UvcCamera::kWidth * UvcCamera::kHeight * 2;
constexpr std::uint32_t kPayloadBytes = 4096;  ///< bytes of a transfer, with its header of 2 bytes
constexpr std::uint32_t kPeriod100Ns = static_cast<std::uint32_t>(UvcCamera::kPeriod.ns() / 100);
constexpr const char* kTexts[] = {"Nodal", UvcCamera::kName, "UVC0001"};

Bytes device_descriptor() {
  return descriptor({{1, 1},
                     {0x0200, 2},
                     {0xef, 1},
                     {2, 1},
                     {1, 1},
                     {64, 1},
                     {0x1d6b, 2},
                     {0x0102, 2},
                     {0x0100, 2},
                     {1, 1},
                     {2, 1},
                     {3, 1},
                     {1, 1}});
}

/// UVC 1.0, 3.1 to 3.9: a camera terminal (1), a processing unit (2), an output terminal (3); one format, one frame
/// size.
Bytes configuration_descriptor() {
  constexpr std::uint32_t kVideo = 0x0e;
  constexpr std::uint32_t kRate = kFrameBytes * 8 * 30;
  const Bytes terminal =  // it has auto exposure mode and exposure time
      descriptor({{0x24, 1}, {2, 1}, {1, 1}, {0x0201, 2}, {0, 1}, {0, 1}, {0, 2}, {0, 2}, {0, 2}, {3, 1}, {0x0a, 3}});
  const Bytes unit = descriptor({{0x24, 1}, {5, 1}, {2, 1}, {1, 1}, {0, 2}, {2, 1}, {0x0200, 2}, {0, 1}});  // gain
  const Bytes output = descriptor({{0x24, 1}, {3, 1}, {3, 1}, {0x0101, 2}, {0, 1}, {2, 1}, {0, 1}});
  const auto control_bytes = static_cast<std::uint32_t>(13 + terminal.size() + unit.size() + output.size());
  const Bytes format = descriptor({{0x24, 1},
                                   {4, 1},
                                   {1, 1},
                                   {1, 1},
                                   {0x32595559, 4},
                                   {0x00100000, 4},
                                   {0xaa000080, 4},
                                   {0x719b3800, 4},
                                   {16, 1},
                                   {1, 1},
                                   {0, 1},
                                   {0, 1},
                                   {0, 1},
                                   {0, 1}});
  const Bytes size = descriptor({{0x24, 1},
                                 {5, 1},
                                 {1, 1},
                                 {0, 1},
                                 {UvcCamera::kWidth, 2},
                                 {UvcCamera::kHeight, 2},
                                 {kRate, 4},
                                 {kRate, 4},
                                 {kFrameBytes, 4},
                                 {kPeriod100Ns, 4},
                                 {1, 1},
                                 {kPeriod100Ns, 4}});
  const auto stream_bytes = static_cast<std::uint32_t>(14 + format.size() + size.size());
  Bytes all = descriptor({{2, 1}, {0, 2}, {2, 1}, {1, 1}, {0, 1}, {0x80, 1}, {50, 1}});
  for (const Bytes& each :
       {descriptor({{11, 1}, {0, 1}, {2, 1}, {kVideo, 1}, {3, 1}, {0, 1}, {0, 1}}),
        descriptor({{4, 1}, {0, 1}, {0, 1}, {0, 1}, {kVideo, 1}, {1, 1}, {0, 1}, {0, 1}}),
        descriptor({{0x24, 1}, {1, 1}, {0x0100, 2}, {control_bytes, 2}, {48'000'000, 4}, {1, 1}, {1, 1}}), terminal,
        unit, output, descriptor({{4, 1}, {1, 1}, {0, 1}, {1, 1}, {kVideo, 1}, {2, 1}, {0, 1}, {0, 1}}),
        descriptor({{0x24, 1},
                    {1, 1},
                    {1, 1},
                    {stream_bytes, 2},
                    {RawGadget::kStream, 1},
                    {0, 1},
                    {3, 1},
                    {0, 1},
                    {0, 1},
                    {0, 1},
                    {1, 1},
                    {0, 1}}),
        format, size, descriptor({{5, 1}, {RawGadget::kStream, 1}, {2, 1}, {512, 2}, {0, 1}})}) {
    all.insert(all.end(), each.begin(), each.end());
  }
  all[2] = static_cast<std::uint8_t>(all.size());
  all[3] = static_cast<std::uint8_t>(all.size() >> 8);
  return all;
}

/// The stream's parameters: UVC 1.0, table 4-47. There is one choice of each.
Bytes probe_reply() {
  Bytes bytes{1, 0, 1, 1};
  put(bytes, kPeriod100Ns, 4);
  for (int unused = 0; unused < 5; ++unused) put(bytes, 0, 2);
  put(bytes, kFrameBytes, 4);
  put(bytes, kPayloadBytes, 4);
  return bytes;
}

struct Control {
  std::uint8_t entity, selector, bytes;
  std::uint32_t lowest, highest, step, preset;
  std::atomic<std::uint32_t> Device::*value;
};

/// The step of the automatic modes is the set of those that the camera has.
constexpr Control kControls[] = {
    {1, 2, 1, 1, 8, UvcCamera::kManual | UvcCamera::kAutomatic, UvcCamera::kAutomatic, &Device::mode},
    {1, 4, 4, 1, UvcCamera::kLongest, 1, 100, &Device::exposure},
    {2, 4, 2, 0, UvcCamera::kMaxGain, 1, 32, &Device::gain},
};

/// The camera's own process. A failed call to raw-gadget ends it.
class Process {
 public:
  explicit Process(Device& device) : device_(device) {}

  [[noreturn]] void run() {
    struct sigaction interrupt {};
    interrupt.sa_handler = [](int) {};  // without SA_RESTART: ends the write of a frame
    ::sigaction(SIGUSR1, &interrupt, nullptr);
    std::thread sender([this] { send_frames(); });
    sender_ = sender.native_handle();
    while (true) {
      if (!answer(usb_.next_request())) usb_.stall();
    }
  }

 private:
  bool give_number(std::uint32_t number, int bytes, unsigned most) {
    Bytes all;
    put(all, number, bytes);
    return usb_.give(all, most);
  }
  std::uint32_t take_number(unsigned length) {
    std::uint32_t value = 0;
    const Bytes bytes = usb_.take(length);
    for (std::size_t i = 0; i < std::min<std::size_t>(bytes.size(), 4); ++i)
      value |= std::uint32_t{bytes[i]} << (8 * i);
    return value;
  }

  bool answer(const usb_ctrlrequest& request) {
    if ((request.bRequestType & USB_TYPE_MASK) == USB_TYPE_STANDARD) return answer_standard(request);
    if ((request.bRequestType & USB_TYPE_MASK) != USB_TYPE_CLASS) return false;
    const auto interface = static_cast<std::uint8_t>(request.wIndex);
    const auto entity = static_cast<std::uint8_t>(request.wIndex >> 8);
    const auto selector = static_cast<std::uint8_t>(request.wValue >> 8);
    if (interface == 1) return answer_stream(request, selector);
    // The reason of the last refusal: UVC 1.5, 4.2.1.2. 4: wrong state.
    if (entity == 0 && selector == 2) return give_number(refusal_, 1, request.wLength);
    for (const Control& control : kControls) {
      if (control.entity == entity && control.selector == selector) return answer_control(request, control);
    }
    refusal_ = 6;  // there is no such control
    return false;
  }

  bool answer_standard(const usb_ctrlrequest& request) {
    switch (request.bRequest) {
      case USB_REQ_GET_DESCRIPTOR:
        if (request.wValue >> 8 == USB_DT_DEVICE) return usb_.give(device_descriptor(), request.wLength);
        if (request.wValue >> 8 == USB_DT_CONFIG) return usb_.give(configuration_descriptor(), request.wLength);
        if (request.wValue >> 8 == USB_DT_STRING)
          return usb_.give(string_descriptor(request.wValue & 0xff, kTexts), request.wLength);
        return false;
      case USB_REQ_SET_CONFIGURATION: usb_.configure(); return true;
      case USB_REQ_SET_INTERFACE: usb_.take(0); return true;
      case USB_REQ_GET_INTERFACE: return give_number(0, 1, request.wLength);
      default: return false;
    }
  }

  bool answer_stream(const usb_ctrlrequest& request, std::uint8_t selector) {
    constexpr std::uint8_t kProbe = 1, kCommit = 2;
    if (selector != kProbe && selector != kCommit) return false;
    switch (request.bRequest) {
      case 0x01:
        usb_.take(request.wLength);
        if (selector == kCommit) {  // a bulk stream begins here; nothing on the bus ends it
          restart_ = true;
          device_.streams = true;
          ::pthread_kill(sender_, SIGUSR1);
        }
        return true;
      case 0x85: return give_number(26, 2, request.wLength);
      case 0x86: return give_number(3, 1, request.wLength);
      default: return usb_.give(probe_reply(), request.wLength);
    }
  }

  bool answer_control(const usb_ctrlrequest& request, const Control& control) {
    std::atomic<std::uint32_t>& value = device_.*control.value;
    const auto number = [&](std::uint32_t one) { return give_number(one, control.bytes, request.wLength); };
    switch (request.bRequest) {
      case 0x01: {  // SET_CUR
        if (device_.refuse || (control.value == &Device::exposure && device_.mode != UvcCamera::kManual)) {
          refusal_ = 4;
          return false;
        }
        if (device_.answer_after_us > 0) ::usleep(device_.answer_after_us);
        value = take_number(request.wLength);
        return true;
      }
      case 0x81: return number(value);
      case 0x82: return number(control.lowest);
      case 0x83: return number(control.highest);
      case 0x84: return number(control.step);
      case 0x85: return give_number(control.bytes, 2, request.wLength);
      case 0x86: return give_number(3, 1, request.wLength);  // it can be read and set
      case 0x87: return number(control.preset);
      default: return false;
    }
  }

  void send_frames() {
    using Clock = std::chrono::steady_clock;
    Clock::time_point due = Clock::now();
    std::uint8_t id = 0;
    Bytes frame(kFrameBytes);
    while (true) {
      due = std::max(due + std::chrono::nanoseconds(UvcCamera::kPeriod.ns()), Clock::now());
      std::this_thread::sleep_until(due);
      if (!device_.streams || device_.silent) continue;
      for (std::size_t i = 0; i < frame.size(); i += 2) {
        frame[i] = static_cast<std::uint8_t>(device_.exposure);
        frame[i + 1] = static_cast<std::uint8_t>(device_.gain);
      }
      const std::uint32_t number = device_.frames++;
      for (int i = 0; i < 4; ++i) frame[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(number >> (8 * i));
      restart_ = false;
      send(frame, device_.tear.exchange(false) ? kFrameBytes / 2 : kFrameBytes, id);
      id ^= 1;
    }
  }

  void send(const Bytes& frame, std::uint32_t until, std::uint8_t id) {
    constexpr std::uint32_t kRoom = kPayloadBytes - 2;
    for (std::uint32_t at = 0; at < until && !restart_;) {
      const std::uint32_t n = std::min(until - at, kRoom);
      const bool last = at + n == until;
      Bytes payload{2, static_cast<std::uint8_t>(0x80 | id | (last ? 2 : 0))};
      payload.insert(payload.end(), frame.begin() + at, frame.begin() + at + n);
      if (const int error = usb_.write(payload); error != 0 && error != EINTR) device_.streams = false;
      if (!device_.streams) return;
      at += n;
    }
  }

  Device& device_;
  RawGadget usb_;
  std::uint8_t refusal_ = 0;
  pthread_t sender_{};
  std::atomic<bool> restart_{false};
};

/// Whether uvcvideo has a node for the camera.
bool has_node() {
  for (const auto& node : std::filesystem::directory_iterator("/sys/class/video4linux")) {
    std::string name;
    std::getline(std::ifstream(node.path() / "name") >> std::ws, name);
    if (name == UvcCamera::kName && std::filesystem::exists("/dev" / node.path().filename())) return true;
  }
  return false;
}

}  // namespace

UvcCamera::UvcCamera() : device_(new (shared_memory(sizeof(Device))) Device) {
  process_ = start_process([this] { Process(*device_).run(); });
  if (!test::wait_until(has_node, std::chrono::seconds(20)))
    throw std::runtime_error("uvcvideo did not find the camera");
}

void UvcCamera::unplug() {
  if (process_ < 0) return;
  kill_process(std::exchange(process_, -1));
  if (!test::wait_until([] { return !has_node(); }, std::chrono::seconds(20))) std::abort();
}

}  // namespace nodal::hil
