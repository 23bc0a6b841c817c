#include "hal/linux/v4l2/system.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <utility>

namespace nodal::hal::v4l2 {
namespace {

class Kernel final : public System {
 public:
  int open(const std::string& node) override {
    int fd = -1;
    do fd = ::open(node.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    while (fd < 0 && errno == EINTR);
    return fd < 0 ? -errno : fd;
  }
  void close(int fd) override { ::close(fd); }
  int ioctl(int fd, unsigned long request, void* argument) override {
    int result = 0;
    do result = ::ioctl(fd, request, argument);
    while (result < 0 && errno == EINTR);
    return result < 0 ? errno : 0;
  }
  std::uint8_t* map(int fd, std::size_t length, std::size_t offset) override {
    void* const start = ::mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, static_cast<::off_t>(offset));
    return start == MAP_FAILED ? nullptr : static_cast<std::uint8_t*>(start);
  }
  void unmap(std::uint8_t* start, std::size_t length) override { ::munmap(start, length); }
  std::vector<std::string> nodes() override {
    constexpr std::string_view kPrefix = "video";
    std::vector<std::pair<int, std::string>> numbered;
    std::error_code error;
    for (std::filesystem::directory_iterator it("/dev", error), end; !error && it != end; it.increment(error)) {
      const std::string name = it->path().filename().string();
      int number = 0;
      if (!name.starts_with(kPrefix)) continue;
      const auto [after, bad] = std::from_chars(name.data() + kPrefix.size(), name.data() + name.size(), number);
      if (bad == std::errc{} && after == name.data() + name.size()) numbered.emplace_back(number, it->path().string());
    }
    std::sort(numbered.begin(), numbered.end());
    std::vector<std::string> nodes;
    nodes.reserve(numbered.size());
    for (auto& [number, node] : numbered) nodes.push_back(std::move(node));
    return nodes;
  }
  std::optional<device::UsbPlace> usb(const std::string& node) override { return device::usb_place_of("/sys", node); }
};

}  // namespace

System& kernel() {
  static Kernel one;
  return one;
}

Error explain(const std::string& who, const std::string& doing, int error) {
  const auto because = [&](Errc code, const std::string& sentence) {
    return Error{code, "head '" + who + "': " + doing + ": " + sentence};
  };
  switch (error) {
    case ENOENT: return because(Errc::kNoSuchDevice, "no such device; plug it in, or correct port in rig.toml");
    case ENODEV:
    case ENXIO: return because(Errc::kDeviceGone, "the device is not there any more; plug it in again");
    case EBUSY:
      return because(Errc::kBusy, "another program streams from the device; stop it (fuser -v /dev/video* names it)");
    case EACCES:
    case EPERM: return because(Errc::kDeviceFailed, "permission denied; add nodald's user to the group video");
    case ENOMEM:
      return because(Errc::kDeviceFailed,
                     "the kernel has no memory for its buffers; choose a smaller size, or give drivers more (cma=)");
    case ENOSPC:
      return because(
          Errc::kBandwidth,
          "the bus cannot carry this head beside the others; choose a smaller size or rate, or another port");
    case EIO:
    case EPROTO:
    case EPIPE:
    case ETIMEDOUT: return because(Errc::kDeviceFailed, "the device does not answer; unplug it and plug it in again");
    default:
      return because(Errc::kDeviceFailed, std::string("the driver says: ") + std::strerror(error) +
                                              "; the kernel's log (dmesg) may say more");
  }
}

}  // namespace nodal::hal::v4l2
