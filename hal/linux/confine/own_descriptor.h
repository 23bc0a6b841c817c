// A file descriptor that closes itself.
#pragma once

#include <unistd.h>

namespace nodal::hal::linux_os {

/// Threading: thread-bound. Ownership: closes the descriptor; -1: none.
class OwnDescriptor {
 public:
  explicit OwnDescriptor(long fd) : fd_(static_cast<int>(fd)) {}
  ~OwnDescriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  OwnDescriptor(const OwnDescriptor&) = delete;
  OwnDescriptor& operator=(const OwnDescriptor&) = delete;
  int get() const { return fd_; }
  explicit operator bool() const { return fd_ >= 0; }

 private:
  int fd_;
};

}  // namespace nodal::hal::linux_os
