// The kernel's GPIO lines through libgpiod 1.6. libgpiod_2.cpp is the same for libgpiod 2; CMake compiles one of them.
#include <fmt/format.h>

#include <gpiod.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>
#include <string>
#include <utility>

#include "hal/linux/gpio/runner.h"
#include "hal/linux/gpio/system.h"

namespace nodal::hal::gpio {
namespace {

constexpr const char* kConsumer = "nodald";

struct ChipCloser {
  void operator()(gpiod_chip* chip) const { gpiod_chip_close(chip); }
};
using Chip = std::unique_ptr<gpiod_chip, ChipCloser>;

/// Null with errno. gpiod_chip_open_lookup() is not used: it would open any path, and read a name of digits as the
/// chip's number.
Chip open_chip(const std::string& name) {
  if (name.find('/') != std::string::npos) {
    errno = ENOENT;
    return nullptr;
  }
  constexpr std::string_view kDevice = "gpiochip";
  const bool device =
      name.starts_with(kDevice) && name.size() > kDevice.size() &&
      std::all_of(name.begin() + kDevice.size(), name.end(), [](char c) { return c >= '0' && c <= '9'; });
  return Chip(device ? gpiod_chip_open_by_name(name.c_str()) : gpiod_chip_open_by_label(name.c_str()));
}

class KernelLine final : public Line {
 public:
  KernelLine(Chip chip, gpiod_line* line) : chip_(std::move(chip)), line_(line) {}
  ~KernelLine() override { gpiod_line_release(line_); }

  /// libgpiod remembers the newest value without a lock. Nothing reads that copy here, so two threads may set a line.
  int set(bool high) override {
    int result = 0;
    do result = gpiod_line_set_value(line_, high ? 1 : 0);
    while (result < 0 && errno == EINTR);
    return result < 0 ? errno : 0;
  }
  int get() override {
    int value = 0;
    do value = gpiod_line_get_value(line_);
    while (value < 0 && errno == EINTR);
    return value < 0 ? -errno : value;
  }
  int read_events(std::span<LineEvent> into) override {
    std::array<gpiod_line_event, kKernelQueue> events;
    const auto room = static_cast<unsigned>(std::min(into.size(), events.size()));
    pollfd ready{gpiod_line_event_get_fd(line_), POLLIN, 0};
    int count = ::poll(&ready, 1, 0);
    if (count < 0) return errno == EINTR ? 0 : -errno;
    if (count == 0) return 0;
    if ((ready.revents & POLLIN) == 0) return -ENODEV;
    count = gpiod_line_event_read_multiple(line_, events.data(), room);
    if (count < 0) return errno == EINTR || errno == EAGAIN ? 0 : -errno;
    for (int i = 0; i < count; ++i) {
      const gpiod_line_event& event = events[static_cast<std::size_t>(i)];
      into[static_cast<std::size_t>(i)] = {
          Instant::from_ns(static_cast<std::int64_t>(event.ts.tv_sec) * 1'000'000'000 + event.ts.tv_nsec),
          event.event_type == GPIOD_LINE_EVENT_RISING_EDGE, i == 0 && std::exchange(was_full_, false)};
    }
    was_full_ = static_cast<std::size_t>(count) == kKernelQueue;
    return count;
  }
  int descriptor() const override { return gpiod_line_event_get_fd(line_); }

 private:
  Chip chip_;
  gpiod_line* const line_;
  /// The kernel's queue was full at the last read. The kernel says no more about edges that it discarded.
  bool was_full_ = false;
};

int flags_of(const InputOptions& options) {
  int flags = options.active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
  if (options.bias == Bias::kPullUp) flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP;
  if (options.bias == Bias::kPullDown) flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN;
  return flags;
}

int request_of(EdgeKind edges) {
  switch (edges) {
    case EdgeKind::kRising: return GPIOD_LINE_REQUEST_EVENT_RISING_EDGE;
    case EdgeKind::kFalling: return GPIOD_LINE_REQUEST_EVENT_FALLING_EDGE;
    case EdgeKind::kBoth: return GPIOD_LINE_REQUEST_EVENT_BOTH_EDGES;
  }
  return GPIOD_LINE_REQUEST_EVENT_BOTH_EDGES;
}

class Kernel final : public System {
 public:
  Claim claim_output(const LineName& line, bool high) override {
    return claim(line, {kConsumer, GPIOD_LINE_REQUEST_DIRECTION_OUTPUT, 0}, high);
  }
  Claim claim_input(const LineName& line, const InputOptions& options) override {
    return claim(line, {kConsumer, request_of(options.edges), flags_of(options)}, false);
  }
  std::string holder(const LineName& name) override {
    const Chip chip = open_chip(name.chip);
    gpiod_line* const line = chip ? gpiod_chip_get_line(chip.get(), name.offset) : nullptr;
    const char* const consumer = line != nullptr ? gpiod_line_consumer(line) : nullptr;
    return consumer != nullptr ? consumer : "";
  }
  std::vector<std::string> chips() override {
    std::vector<std::string> all;
    gpiod_chip_iter* const chips = gpiod_chip_iter_new();
    if (chips == nullptr) return all;
    for (gpiod_chip* chip = gpiod_chip_iter_next(chips); chip != nullptr; chip = gpiod_chip_iter_next(chips)) {
      all.push_back(
          fmt::format("{} ({}, {} lines)", gpiod_chip_name(chip), gpiod_chip_label(chip), gpiod_chip_num_lines(chip)));
    }
    gpiod_chip_iter_free(chips);
    return all;
  }
  Instant now() override { return monotonic_now(); }
  Running run(const RunOptions& options, Step step) override { return run_on_thread(options, std::move(step)); }

 private:
  static Claim claim(const LineName& name, const gpiod_line_request_config& config, bool high) {
    Chip chip = open_chip(name.chip);
    if (!chip) return {nullptr, errno};
    gpiod_line* const line = gpiod_chip_get_line(chip.get(), name.offset);
    if (line == nullptr) return {nullptr, errno};
    if (gpiod_line_request(line, &config, high ? 1 : 0) < 0) return {nullptr, errno};
    return {std::make_unique<KernelLine>(std::move(chip), line), 0};
  }
};

}  // namespace

System& kernel() {
  static Kernel one;
  return one;
}

}  // namespace nodal::hal::gpio
