#include "uvc_camera.h"

#include <fcntl.h>
#include <linux/usb/ch9.h>
#include <linux/usb/raw_gadget.h>
#include <pthread.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <new>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <vector>

#include "tests/support/process.h"

namespace nodal::hil {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Device = UvcCamera::Device;

constexpr std::uint32_t kFrameBytes = UvcCamera::kWidth * UvcCamera::kHeight * 2;
constexpr std::uint32_t kPayloadBytes = 4096;  ///< of a transfer, with its header of 2 bytes
constexpr std::uint32_t kPeriod100Ns = static_cast<std::uint32_t>(UvcCamera::kPeriod.ns() / 100);
constexpr std::uint8_t kStream = 0x81;  ///< the endpoint

void put(Bytes& to, std::uint32_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) to.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

/// A descriptor; its first byte becomes its length.
Bytes descriptor(std::initializer_list<std::pair<std::uint32_t, int>> fields) {
  Bytes bytes{0};
  for (const auto& [value, size] : fields) put(bytes, value, size);
  bytes[0] = static_cast<std::uint8_t>(bytes.size());
  return bytes;
}

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

/// UVC 1.0, 3.1 to 3.9: a camera terminal (1), a processing unit (2), an output terminal (3); one format, one frame size.
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
                    {kStream, 1},
                    {0, 1},
                    {3, 1},
                    {0, 1},
                    {0, 1},
                    {0, 1},
                    {1, 1},
                    {0, 1}}),
        format, size, descriptor({{5, 1}, {kStream, 1}, {2, 1}, {512, 2}, {0, 1}})}) {
    all.insert(all.end(), each.begin(), each.end());
  }
  all[2] = static_cast<std::uint8_t>(all.size());
  all[3] = static_cast<std::uint8_t>(all.size() >> 8);
  return all;
}

Bytes string_descriptor(unsigned index) {
  if (index == 0) return descriptor({{3, 1}, {0x0409, 2}});
  const char* const texts[] = {"Nodal", UvcCamera::kName, "UVC0001"};
  Bytes bytes{0, 3};
  for (const char* c = texts[std::min(index, 3U) - 1]; *c != 0; ++c) put(bytes, static_cast<std::uint8_t>(*c), 2);
  bytes[0] = static_cast<std::uint8_t>(bytes.size());
  return bytes;
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
    {2, 4, 2, 0, UvcCamera::kMostGain, 1, 32, &Device::gain},
};

/// The camera's own process. A failed call to raw-gadget ends it.
class Process {
 public:
  explicit Process(Device& device) : device_(device), fd_(::open("/dev/raw-gadget", O_RDWR)) {
    usb_raw_init init{};
    std::strcpy(reinterpret_cast<char*>(init.driver_name), "dummy_udc");
    std::strcpy(reinterpret_cast<char*>(init.device_name), "dummy_udc.0");
    init.speed = USB_SPEED_HIGH;
    if (fd_ < 0 || ::ioctl(fd_, USB_RAW_IOCTL_INIT, &init) < 0 || ::ioctl(fd_, USB_RAW_IOCTL_RUN, 0) < 0) end("init");
  }

  [[noreturn]] void run() {
    struct sigaction interrupt {};
    interrupt.sa_handler = [](int) {};  // without SA_RESTART: ends the write of a frame
    ::sigaction(SIGUSR1, &interrupt, nullptr);
    std::thread sender([this] { send_frames(); });
    sender_ = sender.native_handle();
    while (true) {
      WithData<usb_raw_event> got;
      got.head().length = sizeof(usb_ctrlrequest);
      if (::ioctl(fd_, USB_RAW_IOCTL_EVENT_FETCH, got.bytes.data()) < 0) end("fetch");
      if (got.head().type != USB_RAW_EVENT_CONTROL) continue;
      usb_ctrlrequest request{};
      std::memcpy(&request, got.data(), sizeof(request));
      if (!answer(request)) ::ioctl(fd_, USB_RAW_IOCTL_EP0_STALL, 0);
    }
  }

 private:
  /// A structure of raw_gadget.h with the data that follows it, which C++ cannot declare.
  template <class Head>
  struct WithData {
    Head& head() { return *reinterpret_cast<Head*>(bytes.data()); }
    std::uint8_t* data() { return bytes.data() + sizeof(Head); }
    alignas(Head) std::array<std::uint8_t, sizeof(Head) + kPayloadBytes> bytes{};
  };
  using Transfer = WithData<usb_raw_ep_io>;

  [[noreturn]] static void end(const char* where) {
    std::perror(where);
    ::_exit(1);
  }

  bool give(const Bytes& bytes, unsigned most) {
    Transfer transfer;
    transfer.head().length = std::min(static_cast<std::uint32_t>(bytes.size()), most);
    std::copy_n(bytes.begin(), transfer.head().length, transfer.data());
    ::ioctl(fd_, USB_RAW_IOCTL_EP0_WRITE, transfer.bytes.data());
    return true;
  }
  bool give_number(std::uint32_t number, int bytes, unsigned most) {
    Bytes all;
    put(all, number, bytes);
    return give(all, most);
  }
  /// The data of a request, or its acknowledgement.
  std::uint32_t take(unsigned length) {
    Transfer transfer;
    transfer.head().length = std::min<std::uint32_t>(length, kPayloadBytes);
    ::ioctl(fd_, USB_RAW_IOCTL_EP0_READ, transfer.bytes.data());
    std::uint32_t value = 0;
    for (unsigned i = 0; i < std::min(length, 4U); ++i) value |= std::uint32_t{transfer.data()[i]} << (8 * i);
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
        if (request.wValue >> 8 == USB_DT_DEVICE) return give(device_descriptor(), request.wLength);
        if (request.wValue >> 8 == USB_DT_CONFIG) return give(configuration_descriptor(), request.wLength);
        if (request.wValue >> 8 == USB_DT_STRING)
          return give(string_descriptor(request.wValue & 0xff), request.wLength);
        return false;
      case USB_REQ_SET_CONFIGURATION: {
        usb_endpoint_descriptor endpoint{};
        endpoint.bLength = USB_DT_ENDPOINT_SIZE;
        endpoint.bDescriptorType = USB_DT_ENDPOINT;
        endpoint.bEndpointAddress = kStream;
        endpoint.bmAttributes = USB_ENDPOINT_XFER_BULK;
        endpoint.wMaxPacketSize = 512;
        if (endpoint_ < 0) endpoint_ = ::ioctl(fd_, USB_RAW_IOCTL_EP_ENABLE, &endpoint);
        if (endpoint_ < 0) end("endpoint");
        ::ioctl(fd_, USB_RAW_IOCTL_VBUS_DRAW, 50);
        ::ioctl(fd_, USB_RAW_IOCTL_CONFIGURE, 0);
        take(0);
        return true;
      }
      case USB_REQ_SET_INTERFACE: take(0); return true;
      case USB_REQ_GET_INTERFACE: return give_number(0, 1, request.wLength);
      default: return false;
    }
  }

  bool answer_stream(const usb_ctrlrequest& request, std::uint8_t selector) {
    constexpr std::uint8_t kProbe = 1, kCommit = 2;
    if (selector != kProbe && selector != kCommit) return false;
    switch (request.bRequest) {
      case 0x01:
        take(request.wLength);
        if (selector == kCommit) {  // a bulk stream begins here; nothing on the bus ends it
          restart_ = true;
          device_.streams = true;
          ::pthread_kill(sender_, SIGUSR1);
        }
        return true;
      case 0x85: return give_number(26, 2, request.wLength);
      case 0x86: return give_number(3, 1, request.wLength);
      default: return give(probe_reply(), request.wLength);
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
        value = take(request.wLength);
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
      Transfer transfer;
      transfer.head().ep = static_cast<std::uint16_t>(endpoint_);
      transfer.head().length = n + 2;
      transfer.data()[0] = 2;
      transfer.data()[1] = static_cast<std::uint8_t>(0x80 | id | (last ? 2 : 0));
      std::memcpy(transfer.data() + 2, frame.data() + at, n);
      if (::ioctl(fd_, USB_RAW_IOCTL_EP_WRITE, transfer.bytes.data()) < 0 && errno != EINTR) device_.streams = false;
      if (!device_.streams) return;
      at += n;
    }
  }

  Device& device_;
  const int fd_;
  int endpoint_ = -1;
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

UvcCamera::UvcCamera() {
  void* const shared = ::mmap(nullptr, sizeof(Device), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (shared == MAP_FAILED) throw std::system_error(errno, std::generic_category(), "mmap");
  device_ = new (shared) Device;
  process_ = ::fork();
  if (process_ == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    Process(*device_).run();
  }
  if (!test::wait_until(has_node, std::chrono::seconds(20)))
    throw std::runtime_error("uvcvideo did not find the camera");
}

void UvcCamera::unplug() {
  if (process_ < 0) return;
  ::kill(process_, SIGKILL);
  ::waitpid(process_, nullptr, 0);
  process_ = -1;
  if (!test::wait_until([] { return !has_node(); }, std::chrono::seconds(20))) std::abort();
}

}  // namespace nodal::hil
