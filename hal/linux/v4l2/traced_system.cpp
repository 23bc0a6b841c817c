#include "hal/linux/v4l2/traced_system.h"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "hal/linux/v4l2/ioctl_text.h"

namespace nodal::hal::v4l2 {
namespace {

constexpr Duration kSlow = Duration::milliseconds(5);
constexpr Duration kEmptyEvery = Duration::seconds(1);

/// "EINVAL (Invalid argument)".
std::string error_text(int error) {
  const char* const name = ::strerrorname_np(error);
  return fmt::format("{} ({})", name != nullptr ? name : std::to_string(error).c_str(), ::strerrordesc_np(error));
}

}  // namespace

int TracedSystem::open(const std::string& node) {
  const int fd = system_.open(node);
  if (fd < 0) {
    write_(fmt::format("{}: open -> {}", node, error_text(-fd)));
    return fd;
  }
  {
    const std::lock_guard lock(mutex_);
    open_[fd].node = node;
  }
  write_(fmt::format("{}: open", node));
  return fd;
}

void TracedSystem::close(int fd) {
  const std::string node = node_of(fd);
  {
    const std::lock_guard lock(mutex_);
    open_.erase(fd);
  }
  system_.close(fd);
  write_(fmt::format("{}: close", node));
}

int TracedSystem::ioctl(int fd, unsigned long request, void* argument) {
  const std::string asked = asked_text(request, argument);
  const Instant before = clock_.now();
  const int error = system_.ioctl(fd, request, argument);
  const Instant after = clock_.now();
  if (request == VIDIOC_DQBUF && error == EAGAIN) {
    if (const std::string line = count_empty(fd, after); !line.empty()) write_(line);
    return error;
  }
  if (request == VIDIOC_DQBUF || request == VIDIOC_STREAMON) note_frame(fd, after);
  std::string line = fmt::format("{}: {}", node_of(fd), request_name(request));
  if (!asked.empty()) line += " " + asked;
  const std::string answered = error != 0 ? error_text(error) : answered_text(request, argument);
  if (!answered.empty()) line += " -> " + answered;
  if (after - before >= kSlow) {
    line += fmt::format(" ({} ms)", (after - before).ms());
  }
  write_(line);
  return error;
}

std::uint8_t* TracedSystem::map(int fd, std::size_t length, std::size_t offset) {
  std::uint8_t* const start = system_.map(fd, length, offset);
  write_(fmt::format("{}: mmap of {} bytes{}", node_of(fd), length, start == nullptr ? " -> refused" : ""));
  return start;
}

std::string TracedSystem::node_of(int fd) {
  const std::lock_guard lock(mutex_);
  const auto found = open_.find(fd);
  return found == open_.end() ? fmt::format("descriptor {}", fd) : found->second.node;
}

void TracedSystem::note_frame(int fd, Instant now) {
  const std::lock_guard lock(mutex_);
  Open& open = open_[fd];
  open.frame = open.line = now;
  open.asked = 0;
}

std::string TracedSystem::count_empty(int fd, Instant now) {
  const std::lock_guard lock(mutex_);
  Open& open = open_[fd];
  ++open.asked;
  if (now - open.line < kEmptyEvery) return {};
  open.line = now;
  return fmt::format("{}: VIDIOC_DQBUF -> no frame for {} ms, asked {} times", open.node, (now - open.frame).ms(),
                     std::exchange(open.asked, 0));
}

}  // namespace nodal::hal::v4l2
