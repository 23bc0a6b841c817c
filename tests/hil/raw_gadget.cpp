#include "raw_gadget.h"

#include <fcntl.h>
#include <linux/usb/raw_gadget.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <system_error>

namespace nodal::hil {
namespace {

/// A structure of raw_gadget.h with the data that follows it, which C++ cannot declare.
template <class Head>
struct WithData {
  Head& head() { return *reinterpret_cast<Head*>(bytes.data()); }
  std::uint8_t* data() { return bytes.data() + sizeof(Head); }
  alignas(Head) std::array<std::uint8_t, sizeof(Head) + RawGadget::kMaxBytes> bytes{};
};
using Transfer = WithData<usb_raw_ep_io>;

}  // namespace

void put(Bytes& to, std::uint32_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) to.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

Bytes descriptor(std::initializer_list<std::pair<std::uint32_t, int>> fields) {
  Bytes bytes{0};
  for (const auto& [value, size] : fields) put(bytes, value, size);
  bytes[0] = static_cast<std::uint8_t>(bytes.size());
  return bytes;
}

Bytes string_descriptor(unsigned index, std::span<const char* const> texts) {
  if (index == 0) return descriptor({{3, 1}, {0x0409, 2}});
  Bytes bytes{0, 3};
  for (const char* c = texts[std::min<std::size_t>(index, texts.size()) - 1]; *c != 0; ++c) {
    put(bytes, static_cast<std::uint8_t>(*c), 2);
  }
  bytes[0] = static_cast<std::uint8_t>(bytes.size());
  return bytes;
}

RawGadget::RawGadget(int controller) : fd_(::open("/dev/raw-gadget", O_RDWR)) {
  usb_raw_init init{};
  std::strcpy(reinterpret_cast<char*>(init.driver_name), "dummy_udc");
  std::snprintf(reinterpret_cast<char*>(init.device_name), sizeof init.device_name, "dummy_udc.%d", controller);
  init.speed = USB_SPEED_HIGH;
  if (fd_ < 0 || ::ioctl(fd_, USB_RAW_IOCTL_INIT, &init) < 0 || ::ioctl(fd_, USB_RAW_IOCTL_RUN, 0) < 0) end("init");
}

void RawGadget::end(const char* where) {
  std::perror(where);
  ::_exit(1);
}

usb_ctrlrequest RawGadget::next_request() {
  for (;;) {
    WithData<usb_raw_event> got;
    got.head().length = sizeof(usb_ctrlrequest);
    if (::ioctl(fd_, USB_RAW_IOCTL_EVENT_FETCH, got.bytes.data()) < 0) end("fetch");
    if (got.head().type != USB_RAW_EVENT_CONTROL) continue;
    usb_ctrlrequest request{};
    std::memcpy(&request, got.data(), sizeof(request));
    return request;
  }
}

void RawGadget::stall() { ::ioctl(fd_, USB_RAW_IOCTL_EP0_STALL, 0); }

bool RawGadget::give(const Bytes& bytes, unsigned most) {
  Transfer transfer;
  transfer.head().length = std::min(static_cast<std::uint32_t>(bytes.size()), most);
  std::copy_n(bytes.begin(), transfer.head().length, transfer.data());
  ::ioctl(fd_, USB_RAW_IOCTL_EP0_WRITE, transfer.bytes.data());
  return true;
}

Bytes RawGadget::take(unsigned length) {
  Transfer transfer;
  transfer.head().length = std::min<std::uint32_t>(length, kMaxBytes);
  ::ioctl(fd_, USB_RAW_IOCTL_EP0_READ, transfer.bytes.data());
  return Bytes(transfer.data(), transfer.data() + std::min<std::uint32_t>(length, kMaxBytes));
}

void RawGadget::configure() {
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
}

int RawGadget::write(std::span<const std::uint8_t> bytes) {
  Transfer transfer;
  transfer.head().ep = static_cast<std::uint16_t>(endpoint_);
  transfer.head().length = static_cast<std::uint32_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), transfer.data());
  return ::ioctl(fd_, USB_RAW_IOCTL_EP_WRITE, transfer.bytes.data()) < 0 ? errno : 0;
}

void* shared_memory(std::size_t bytes) {
  void* const shared = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (shared == MAP_FAILED) throw std::system_error(errno, std::generic_category(), "mmap");
  return shared;
}

pid_t start_process(const std::function<void()>& run) {
  const pid_t process = ::fork();
  if (process != 0) return process;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  run();
  ::_exit(0);
}

void kill_process(pid_t process) {
  ::kill(process, SIGKILL);
  ::waitpid(process, nullptr, 0);
}

}  // namespace nodal::hil
