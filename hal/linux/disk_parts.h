// What disk.cpp and disk_folder.cpp share.
#pragma once

#include <unistd.h>

#include <cerrno>
#include <string>
#include <utility>

#include "hal/file_name.h"
#include "hal/linux/thread/thread.h"
#include "protocol/base/result.h"

namespace nodal::hal::linux_os {

/// A descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int fd = -1) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(Descriptor&& other) noexcept : fd_(other.release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  int get() const { return fd_; }
  int release() { return std::exchange(fd_, -1); }
  explicit operator bool() const { return fd_ >= 0; }

 private:
  int fd_;
};

inline Status check_name(const std::string& name) {
  if (is_file_name(name)) return {};
  return fail(Errc::kBadValue, "file '" + name + "': a name is parts with '/' between, never '..', '.' or empty ones");
}

template <class Call>
auto again_when_interrupted(Call call) {
  for (beat();;) {  // a piece of work may make many calls
    const auto result = call();
    if (result >= 0 || errno != EINTR) return result;
  }
}

}  // namespace nodal::hal::linux_os
