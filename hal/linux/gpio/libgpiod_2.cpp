// The kernel's GPIO lines through libgpiod 2. libgpiod_1.cpp is the same for libgpiod 1.6; CMake compiles one of them.
#include <fmt/format.h>

#include <gpiod.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
#include <string>
#include <system_error>

#include "hal/linux/gpio/runner.h"
#include "hal/linux/gpio/system.h"

namespace nodal::hal::gpio {
namespace {

constexpr const char* kConsumer = "nodald";

template <auto close>
struct Closer {
  void operator()(auto* object) const { close(object); }
};
using Chip = std::unique_ptr<gpiod_chip, Closer<gpiod_chip_close>>;
using ChipInfo = std::unique_ptr<gpiod_chip_info, Closer<gpiod_chip_info_free>>;
using LineInfo = std::unique_ptr<gpiod_line_info, Closer<gpiod_line_info_free>>;
using Settings = std::unique_ptr<gpiod_line_settings, Closer<gpiod_line_settings_free>>;
using LineConfig = std::unique_ptr<gpiod_line_config, Closer<gpiod_line_config_free>>;
using RequestConfig = std::unique_ptr<gpiod_request_config, Closer<gpiod_request_config_free>>;
using Request = std::unique_ptr<gpiod_line_request, Closer<gpiod_line_request_release>>;
using EventBuffer = std::unique_ptr<gpiod_edge_event_buffer, Closer<gpiod_edge_event_buffer_free>>;

constexpr std::string_view kDevice = "gpiochip";

bool is_device_name(std::string_view name) {
  return name.starts_with(kDevice) && name.size() > kDevice.size() &&
         std::all_of(name.begin() + kDevice.size(), name.end(), [](char c) { return c >= '0' && c <= '9'; });
}

Chip open_device(const std::string& name) { return Chip(gpiod_chip_open(("/dev/" + name).c_str())); }

/// The names of the chips' devices, in the order of their numbers.
std::vector<std::string> device_names() {
  std::vector<std::string> names;
  std::error_code error;
  for (std::filesystem::directory_iterator entry("/dev", error), end; !error && entry != end; entry.increment(error)) {
    std::string name = entry->path().filename().string();
    if (is_device_name(name)) names.push_back(std::move(name));
  }
  std::sort(names.begin(), names.end(), [](const std::string& a, const std::string& b) {
    return a.size() != b.size() ? a.size() < b.size() : a < b;
  });
  return names;
}

/// Null with errno. A chip that may not be opened can be the one with this label, so it counts as the reason.
Chip open_label(const std::string& label) {
  int reason = ENOENT;
  for (const std::string& name : device_names()) {
    Chip chip = open_device(name);
    const ChipInfo info(chip ? gpiod_chip_get_info(chip.get()) : nullptr);
    if (info && label == gpiod_chip_info_get_label(info.get())) return chip;
    if (!info && (errno == EACCES || errno == EPERM)) reason = errno;
  }
  errno = reason;
  return nullptr;
}

/// Null with errno.
Chip open_chip(const std::string& name) { return is_device_name(name) ? open_device(name) : open_label(name); }

class KernelLine final : public Line {
 public:
  /// Without a buffer, the line has no events.
  KernelLine(Request request, unsigned offset, EventBuffer buffer)
      : request_(std::move(request)), offset_(offset), buffer_(std::move(buffer)) {}

  /// libgpiod writes nothing to the request object here and takes no memory, so two threads may set a line.
  int set(bool high) override {
    int result = 0;
    do result = gpiod_line_request_set_value(request_.get(), offset_, value_of(high));
    while (result < 0 && errno == EINTR);
    return result < 0 ? errno : 0;
  }
  int get() override {
    gpiod_line_value value = GPIOD_LINE_VALUE_ERROR;
    do value = gpiod_line_request_get_value(request_.get(), offset_);
    while (value == GPIOD_LINE_VALUE_ERROR && errno == EINTR);
    if (value == GPIOD_LINE_VALUE_ERROR) return -errno;
    return value == GPIOD_LINE_VALUE_ACTIVE ? 1 : 0;
  }
  int read_events(std::span<LineEvent> into) override {
    pollfd ready{descriptor(), POLLIN, 0};
    int count = ::poll(&ready, 1, 0);
    if (count < 0) return errno == EINTR ? 0 : -errno;
    if (count == 0) return 0;
    if ((ready.revents & POLLIN) == 0) return -ENODEV;
    count = gpiod_line_request_read_edge_events(request_.get(), buffer_.get(), std::min(into.size(), kKernelQueue));
    if (count < 0) return errno == EINTR || errno == EAGAIN ? 0 : -errno;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      gpiod_edge_event* const event = gpiod_edge_event_buffer_get_event(buffer_.get(), i);
      // The kernel numbers a line's edges from 1, those that it discards too; 32 bits.
      const auto number = static_cast<std::uint32_t>(gpiod_edge_event_get_line_seqno(event));
      into[i] = {Instant::from_ns(static_cast<std::int64_t>(gpiod_edge_event_get_timestamp_ns(event))),
                 gpiod_edge_event_get_event_type(event) == GPIOD_EDGE_EVENT_RISING_EDGE, number != newest_ + 1};
      newest_ = number;
    }
    return count;
  }
  int descriptor() const override { return buffer_ ? gpiod_line_request_get_fd(request_.get()) : -1; }

  static gpiod_line_value value_of(bool high) { return high ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE; }

 private:
  const Request request_;
  const unsigned offset_;
  const EventBuffer buffer_;
  std::uint32_t newest_ = 0;  ///< number of the newest edge that was read
};

gpiod_line_bias bias_of(Bias bias) {
  switch (bias) {
    case Bias::kAsIs: return GPIOD_LINE_BIAS_AS_IS;
    case Bias::kPullUp: return GPIOD_LINE_BIAS_PULL_UP;
    case Bias::kPullDown: return GPIOD_LINE_BIAS_PULL_DOWN;
  }
  return GPIOD_LINE_BIAS_AS_IS;
}

gpiod_line_edge edge_of(EdgeKind edges) {
  if (edges == EdgeKind::kBoth) return GPIOD_LINE_EDGE_BOTH;
  return edges == EdgeKind::kRising ? GPIOD_LINE_EDGE_RISING : GPIOD_LINE_EDGE_FALLING;
}

class Kernel final : public System {
 public:
  Claim claim_output(const LineName& line, bool high) override {
    const Settings settings(gpiod_line_settings_new());
    if (!settings || gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_OUTPUT) < 0 ||
        gpiod_line_settings_set_output_value(settings.get(), KernelLine::value_of(high)) < 0) {
      return {nullptr, errno};
    }
    return claim(line, settings.get(), nullptr);
  }
  Claim claim_input(const LineName& line, const InputOptions& options) override {
    const Settings settings(gpiod_line_settings_new());
    EventBuffer buffer(gpiod_edge_event_buffer_new(kKernelQueue));
    if (!settings || !buffer || gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_INPUT) < 0 ||
        gpiod_line_settings_set_edge_detection(settings.get(), edge_of(options.edges)) < 0 ||
        gpiod_line_settings_set_bias(settings.get(), bias_of(options.bias)) < 0 ||
        gpiod_line_settings_set_event_clock(settings.get(), GPIOD_LINE_CLOCK_MONOTONIC) < 0) {
      return {nullptr, errno};
    }
    gpiod_line_settings_set_active_low(settings.get(), options.active_low);
    return claim(line, settings.get(), std::move(buffer));
  }
  std::string holder(const LineName& name) override {
    const Chip chip = open_chip(name.chip);
    const LineInfo info(chip ? gpiod_chip_get_line_info(chip.get(), name.offset) : nullptr);
    const char* const consumer = info ? gpiod_line_info_get_consumer(info.get()) : nullptr;
    return consumer != nullptr ? consumer : "";
  }
  std::vector<std::string> chips() override {
    std::vector<std::string> all;
    for (const std::string& name : device_names()) {
      const Chip chip = open_device(name);
      const ChipInfo info(chip ? gpiod_chip_get_info(chip.get()) : nullptr);
      if (!info) continue;
      all.push_back(fmt::format("{} ({}, {} lines)", gpiod_chip_info_get_name(info.get()),
                                gpiod_chip_info_get_label(info.get()), gpiod_chip_info_get_num_lines(info.get())));
    }
    return all;
  }
  Instant now() override { return monotonic_now(); }
  Running run(const RunOptions& options, Step step) override { return run_on_thread(options, std::move(step)); }

 private:
  static Claim claim(const LineName& name, gpiod_line_settings* settings, EventBuffer buffer) {
    const Chip chip = open_chip(name.chip);
    if (!chip) return {nullptr, errno};
    const LineConfig line(gpiod_line_config_new());
    const RequestConfig config(gpiod_request_config_new());
    const unsigned offset = name.offset;
    if (!line || !config || gpiod_line_config_add_line_settings(line.get(), &offset, 1, settings) < 0) {
      return {nullptr, errno};
    }
    gpiod_request_config_set_consumer(config.get(), kConsumer);
    gpiod_request_config_set_event_buffer_size(config.get(), buffer ? kKernelQueue : 0);
    Request request(gpiod_chip_request_lines(chip.get(), config.get(), line.get()));
    if (!request) return {nullptr, errno};
    return {std::make_unique<KernelLine>(std::move(request), offset, std::move(buffer)), 0};
  }
};

}  // namespace

System& kernel() {
  static Kernel one;
  return one;
}

}  // namespace nodal::hal::gpio
